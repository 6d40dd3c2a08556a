"""Extraction of the one person of a recording."""

from collections import Counter

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres
from kpopnet.extraction.extractor import HumanExtractionConfig, HumanExtractor


def extract_person(depth_m: np.ndarray, camera: Camera, config: HumanExtractionConfig | None = None) -> np.ndarray:
    """The depth of the one person of a recording, who is expected to be in view from the first image on.

    Args:
        depth_m: (T, H, W) float32 metres of a static camera, 0 where nothing was measured.
        camera: its camera.
        config: thresholds, None for the defaults.

    Returns:
        (T, H, W) float32 metres: the depth of that person only, 0 elsewhere. If several people are found, it is the one
        found in most images; of equals, the one found first.

    Raises:
        InputError: not a sequence of depth images of the camera's size.
    """
    extractor = HumanExtractor(camera, config or HumanExtractionConfig(), expect_person=True)
    found = [{human.identity: human for human in extractor.extract(image)} for image in sequence_in_metres(depth_m, camera)]
    num_images = Counter(identity for humans in found for identity in humans)
    person_m = np.zeros(depth_m.shape, np.float32)
    if num_images:
        person = min(num_images, key=lambda identity: (-num_images[identity], identity))
        for image, humans in zip(person_m, found, strict=True):
            if person in humans:
                image[:] = humans[person].whole(camera)
    return person_m
