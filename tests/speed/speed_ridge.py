"""What the ridge image costs, in distance transforms of the same frame."""

from timeit import repeat

import cv2
import numpy as np
from capsule_people import draw_joints
from factories import draw_person

from kpopnet.camera import CAMERAS
from kpopnet.ridge import RidgeConfig, ridge_probability
from tests.speed.common import Figures, one_core


def measure() -> Figures:
    """The whole of Eq. (2), edges to probability, of a person in a 320x240 frame."""
    depth = draw_person(draw_joints(np.random.default_rng(0)), CAMERAS["kinect_v1"])
    mask, config = (depth > 0).astype(np.uint8), RidgeConfig()
    ridge_probability(depth, config)
    # Taken in turns, so that a busy machine slows both.
    ours, theirs = [], []
    with one_core():
        for _ in range(20):
            ours += repeat(lambda: ridge_probability(depth, config), number=5, repeat=1)
            theirs += repeat(lambda: cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_5), number=5, repeat=1)
    against = "cv2.distanceTransform(DIST_L2, 5) of the same 320x240 frame"
    return {"ridge.vs_distance_transform": (min(ours) / min(theirs), "times", against)}
