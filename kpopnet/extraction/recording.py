"""The one person of a recording."""

from collections import Counter

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.extraction.humans import HumanExtractionConfig, HumanExtractor


def extract_person(depth_m: np.ndarray, camera: Camera, config: HumanExtractionConfig | None = None) -> np.ndarray:
    """The one person of a recording, who is expected in it from the first picture on.

    Args:
        depth_m: (T, H, W) float32 metres of a camera that stands still, 0 where nothing was measured.
        camera: its camera.
        config: thresholds, None for the defaults.

    Returns:
        (T, H, W) float32: that person alone, nothing where they were not found. Of several people it is the one who is
        found in most pictures, and of several of those the one who was found first.

    Raises:
        InputError: not a sequence of depth images of the camera's size.
    """
    extractor = HumanExtractor(camera, config or HumanExtractionConfig(), expect_person=True)
    found = [{human.identity: human for human in extractor.extract(image)} for image in sequence_in_metres(depth_m, camera)]
    pictures = Counter(identity for humans in found for identity in humans)
    person_m = np.zeros(depth_m.shape, np.float32)
    if pictures:
        identity = min(pictures, key=lambda who: (-pictures[who], who))
        for image, humans in zip(person_m, found, strict=True):
            if identity in humans:
                image[:] = humans[identity].whole(camera)
    return person_m
