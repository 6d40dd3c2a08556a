"""The ways to find people in raw depth, by name, and the depth of the one person of a recording.

A new one is a line of `EXTRACTIONS` and a file in configs/extraction/, whose `schema/NAME` stands for the settings.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.errors import check_between, check_type
from kpopnet.finder.finder import FinderConfig, PersonFinder
from kpopnet.human import Human, Looker
from kpopnet.paper_extraction import PaperExtractionConfig, PaperExtractor


class Extractor(Protocol):
    """Finds people in the images of its camera: each image once, in order."""

    camera: Camera

    def extract(self, depth_m: np.ndarray, time_s: float | None = None) -> list[Human]:
        """The people in the next (H, W) image in metres, in the order in which they were first found; `time_s` is when it was
        taken, in seconds of any clock, None for one thirtieth of a second after the image before.

        Raises InputError for anything but one depth image of the camera's size.
        """
        ...


EXTRACTIONS: dict[str, tuple[type, Callable[[Camera, Any, Looker | None], Extractor]]] = {
    "finder": (FinderConfig, PersonFinder),
    "paper": (PaperExtractionConfig, lambda camera, settings, _: PaperExtractor(camera, settings)),
}
"""Settings and builder of each. Each has a dataclass of its own, by which its builder is found."""

DEFAULT_EXTRACTION = FinderConfig()


def extraction_name(settings: Any) -> str:
    """The name in `EXTRACTIONS` of these settings; raises InputError for others."""
    check_type("extraction", settings, *(schema for schema, _ in EXTRACTIONS.values()))
    return next(name for name, (schema, _) in EXTRACTIONS.items() if type(settings) is schema)


def build_extractor(camera: Camera, settings: Any, looker: Looker | None = None) -> Extractor:
    """What finds people in the images of a camera, with these settings, of a type in `EXTRACTIONS`; the finder asks the
    `looker`, if there is one, whether they are people.
    """
    _, builder = EXTRACTIONS[extraction_name(settings)]
    return builder(camera, settings, looker)


def extract_person(depth_m: np.ndarray, camera: Camera, settings: Any = DEFAULT_EXTRACTION, fps: float = 30.0) -> np.ndarray:
    """The depth of the one person of a recording, (T, H, W) float32 metres, 0 elsewhere; `settings` as for `build_extractor`.

    If several people are found, it is the one found in most images; of equals, the one found first. The recording is (T, H, W)
    float32 metres, 0 where nothing was measured. Raises InputError for anything but depth images of the camera's size.
    """
    check_between("fps", fps, 1, 1000)
    extractor = build_extractor(camera, settings)
    images = enumerate(sequence_in_metres(depth_m, camera))
    found = [{human.identity: human for human in extractor.extract(image, number / fps)} for number, image in images]
    num_images = Counter(identity for humans in found for identity in humans)
    person_m = np.zeros(depth_m.shape, np.float32)
    if num_images:
        person = min(num_images, key=lambda identity: (-num_images[identity], identity))
        for image, humans in zip(person_m, found, strict=True):
            if person in humans:
                image[:] = humans[person].whole(camera)
    return person_m
