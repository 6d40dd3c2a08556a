"""A minimal scene for tests of data set readers: a slope with a hole, and joints on a line in front of it."""

import numpy as np


def slope_m(frame: int, height: int = 240, width: int = 320) -> np.ndarray:
    """(H, W) depth in metres; the hole moves by 5 pixels per frame."""
    depth = np.tile(np.linspace(1.5, 4.0, height, dtype=np.float32)[:, None], (1, width))
    depth[20:40, 5 * frame : 5 * frame + 30] = 0
    return depth


def joints_m(frame: int) -> np.ndarray:
    """(15, 3) joints in the camera frame, metres; they move to the right by 1 cm per frame."""
    joints = np.stack([np.linspace(-0.4, 0.4, 15), np.linspace(0.9, -0.8, 15), np.full(15, 2.5)], axis=1)
    return joints + np.array([0.01 * frame, 0, 0])
