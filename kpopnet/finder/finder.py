"""The finder: everybody in one depth image of any scene before any camera, and who is who in films."""

from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera, check_camera, depth_in_metres
from kpopnet.data.canvas import reduced
from kpopnet.errors import InputError, check_between
from kpopnet.finder.backend import cells_of, open_finder
from kpopnet.finder.following import FRAME_S, UNKNOWN, Followed
from kpopnet.finder.people import certainty, gather_people, pixel_owners
from kpopnet.human import Human
from kpopnet.weights import shipped_finder

LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS = 0.4, 0.03, 8
"""Of the cells of a person; the least surface that shows of a person, and the least number of their cells."""

FOLLOWED_CERTAINTY = 0.2
"""A person who is being followed is reported with at least this certainty, where they are expected: what is found with little
certainty counts for tracks and not for new ones, as in ByteTrack (Zhang et al. 2022)."""


@dataclass(frozen=True)
class FinderConfig:
    """Which finder finds people, and how sure it has to be.

    Attributes:
        weights: a file of `train.py --config-name finder`; None: the finder that comes with the package.
        least_certainty: somebody new is reported who is a person with at least this probability.
    """

    weights: str | None = None
    least_certainty: float = 0.6

    def __post_init__(self) -> None:
        check_between("extraction.least_certainty", self.least_certainty, 0, 1)


class PersonFinder:
    """Finds the people in the images of one camera, which may move, and follows them from image to image."""

    def __init__(self, camera: Camera, config: FinderConfig = FinderConfig()) -> None:
        """Raises InputError if the weights are missing, damaged or of another version."""
        check_camera(camera)
        self.camera, self.config, self._followed, self._time_s = camera, config, Followed(), 0.0
        self._network = open_finder(config.weights or str(shipped_finder()))

    def extract(self, depth_m: np.ndarray, time_s: float | None = None) -> list[Human]:
        """The people in the next image, in the order in which they were first found.

        Args:
            depth_m: (H, W) float32 metres, 0 where nothing was measured.
            time_s: when it was taken, in seconds of any clock; None: FRAME_S after the image before.

        Raises:
            InputError: not one depth image of the camera's size.
        """
        depth_m = depth_in_metres(depth_m, self.camera)
        if depth_m.ndim != 2:
            raise InputError(f"depth image: expected shape (H, W), got {depth_m.shape}; pass one image per call")
        canvas = reduced(depth_m, self.camera)
        cells = cells_of(self._network, canvas)
        people = gather_people(cells, LEAST_PROBABILITY, LEAST_M2, LEAST_CELLS)
        probability = certainty(people)
        sure = probability >= min(FOLLOWED_CERTAINTY, self.config.least_certainty)
        numbers = np.append(0, np.where(sure, np.cumsum(sure), 0)).astype(np.uint8)
        centres_m, owner = people.centres_m[sure], numbers[people.owner]
        self._time_s = self._time_s + FRAME_S if time_s is None else time_s
        identities = self._followed.identify(centres_m, probability[sure] >= self.config.least_certainty, self._time_s)
        owners, boxes = pixel_owners(depth_m, cells.depth_m, cells.probability, owner, canvas.reduction, len(centres_m))
        found = enumerate(zip(identities, boxes, centres_m, strict=True), 1)
        humans = [
            Human.cut_out(identity, depth_m, owners, number, box, centre_m)
            for number, (identity, box, centre_m) in found
            if identity != UNKNOWN and box[2] > box[0]
        ]
        return sorted(humans, key=lambda human: human.identity)
