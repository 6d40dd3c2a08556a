"""Human extraction as the paper describes it (section 2.1, Algorithm 1), one image at a time.

Its limits: the camera does not move; a person is found when they move, and only before a measured background, since a pixel
that measured nothing before has no difference; people and furniture that touch are one object; a body that the image shows in
parts is several.

Choices where the paper is silent or wrong; `floor` has those of the floor:

- The box ends with the labels of the objects: what it calls human identification is the second pass of the labelling. Human
  detection and identification are in the text alone.
- The text sums depth differences in the bounding box of an object. A wall, in whose box people move, would be human, and
  approach and retreat cancel. Here only an object's own pixels count, where they are nearer than in the image before.
- A sum of differences grows with the distance of the wall behind. Here every such pixel counts with its area on the object.
- The text finds humans in each image anew, so one who stops is lost. Here the object that has most of the pixels of a human of
  the image before is human, too.
"""

import math
from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, check_camera, image_in_metres
from kpopnet.errors import InputError, check_number
from kpopnet.human import Human
from kpopnet.paper_extraction.floor import find_floor, remove_floor
from kpopnet.paper_extraction.objects import label_components, measure_objects

MAX_STEP_M = 0.1
"""The surface of a human moves less than this along the optical axis from one image to the next."""

NOT_MOVED_M2 = 1e-6
"""Added to the area that moved, so that pixels count where nothing moved, square metres: less than a pixel's."""


@dataclass(frozen=True)
class PaperExtractionConfig:
    """Thresholds of Algorithm 1; the paper gives no numbers.

    Attributes:
        delta_f_m: points less than this above the floor are floor, in metres.
        epsilon_z_m: neighbouring pixels belong to one object if their depths differ by less than this, in metres; the limit
            grows with the squared depth.
        epsilon_m_m2: an object is human if more than this area of it has moved, in square metres; smaller objects are noise.
    """

    delta_f_m: float = 0.03
    epsilon_z_m: float = 0.03
    epsilon_m_m2: float = 0.02

    def __post_init__(self) -> None:
        for name in ("delta_f_m", "epsilon_z_m", "epsilon_m_m2"):
            check_number(f"extraction.{name}", value := getattr(self, name))
            if not 0 <= value < math.inf:
                raise InputError(f"extraction.{name} must be a finite number of at least 0, not {value}")


class PaperExtractor:
    """Finds people in the depth images of a camera that does not move: each image once, in order."""

    def __init__(self, camera: Camera, config: PaperExtractionConfig = PaperExtractionConfig()) -> None:
        check_camera(camera)
        self.camera, self.config = camera, config
        self._intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        self._before_m = np.zeros((camera.height, camera.width), np.float32)
        self._floor: np.ndarray | None = None
        self._humans: list[Human] = []
        self._num_identities = 0

    def extract(self, depth_m: np.ndarray, time_s: float | None = None) -> list[Human]:
        """Algorithm 1: the people in the next image, in the order in which they were first found; none in the first image.

        It is (H, W) float metres or uint16 millimetres, 0 where nothing was measured, and neither changed nor kept. Its time is
        not used: the paper counts images. Raises InputError unless it is one depth image of the camera's size.
        """
        depth_m = image_in_metres(depth_m, self.camera, unit_known=True)  # see `PersonFinder.extract`
        if not depth_m.any():
            return []
        config = self.config
        # Floor removal
        self._floor = find_floor(depth_m, self.camera, config.delta_f_m, self._floor)
        objects_m = depth_m if self._floor is None else remove_floor(depth_m, self.camera, self._floor, config.delta_f_m)
        # 3D connected components labelling
        labels, count = label_components(objects_m, config.epsilon_z_m)
        # Human detection
        objects = measure_objects(labels, count, depth_m, self._before_m, self._intrinsics, config.epsilon_z_m)
        is_human = objects["moved_m2"] > config.epsilon_m_m2
        is_human[[self._object_of(human, labels, depth_m, objects["moved_m2"]) for human in self._humans]] = True
        is_human &= objects["area_m2"] > config.epsilon_m_m2
        # Human identification
        identities = self._identify({label: objects["centre_m"][label] for label in np.flatnonzero(is_human).tolist()})
        self._before_m = depth_m
        self._humans = [
            Human.cut_out(identity, depth_m, labels, label, objects["box"][label], objects["centre_m"][label])
            for identity, label in sorted(identities.items())
        ]
        return self._humans.copy()

    def _object_of(self, human: Human, labels: np.ndarray, depth_m: np.ndarray, moved_m2: np.ndarray) -> int:
        """The label with most of the pixels of a human of the image before, 0 if they are nothing's.

        Pixels count by how much of their object moved, `moved_m2` by label: of a person and furniture that touched, the person.
        """
        x0, y0, x1, y1 = human.box
        before_m, now_m = human.depth_m, depth_m[y0:y1, x0:x1]
        stayed = (before_m > 0) & (np.abs(now_m - before_m) < MAX_STEP_M)
        pixels = np.bincount(labels[y0:y1, x0:x1][stayed], minlength=len(moved_m2))
        return int((pixels * (moved_m2 + NOT_MOVED_M2)).argmax())

    def _identify(self, centres_m: dict[int, np.ndarray]) -> dict[int, int]:
        """The label of each human by identity, from centres by label: that of the nearest human before, or a new one."""
        distances = [
            (float(np.linalg.norm(centre_m - human.centre_m)), human.identity, label)
            for label, centre_m in centres_m.items()
            for human in self._humans
        ]
        identities: dict[int, int] = {}
        for _, identity, label in sorted(distances):
            if identity not in identities and label not in identities.values():
                identities[identity] = label
        for label in sorted(centres_m.keys() - identities.values()):
            identities[self._num_identities] = label
            self._num_identities += 1
        return identities
