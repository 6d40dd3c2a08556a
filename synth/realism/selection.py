"""Which frames are compared, decided by their joints alone, so that real and generated frames obey the same rule.

The vertical is that of the image: UTD-MHAD does not tell where its floor is, and its camera looks nearly level. Frames of a
camera that looks steeply down are therefore left out too.
"""

import numpy as np

from kpopnet.skeleton import Joint

UPRIGHT_DEG = 20.0
"""Largest angle between the trunk, from the middle of the hips to the neck, and the image's vertical."""

STRAIGHT_DEG = 30.0
"""Largest flexion of a knee of a straight leg: labels of real sets have errors of several centimetres."""

LEG_DEG = 45.0
"""Largest angle between a leg, from hip to foot, and the image's vertical: people who sit with straight legs do not stand."""

LEVEL_FEET_M = 0.15
"""Largest difference in height of two feet on the floor."""

FACING_DEG = 35.0
"""Largest turn of the line through the shoulders out of the image plane. UTD-MHAD shows frontal views only."""


def is_standing(joints_camera_m: np.ndarray) -> np.ndarray:
    """(N,) bool: trunk upright, both legs straight and down, both feet at the same height.

    Args:
        joints_camera_m: (N, 15, 3) metres, camera frame; a missing joint (NaN) makes it false.
    """
    joints = np.asarray(joints_camera_m, np.float64)
    hips_m = joints[:, [Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=1)
    down = np.broadcast_to((0.0, 1.0, 0.0), hips_m.shape)
    chosen = _angle_deg(hips_m - joints[:, Joint.NECK], down) <= UPRIGHT_DEG
    for hip, knee, foot in (
        (Joint.RIGHT_HIP, Joint.RIGHT_KNEE, Joint.RIGHT_FOOT),
        (Joint.LEFT_HIP, Joint.LEFT_KNEE, Joint.LEFT_FOOT),
    ):
        thigh, shin = joints[:, knee] - joints[:, hip], joints[:, foot] - joints[:, knee]
        chosen &= (_angle_deg(thigh, shin) <= STRAIGHT_DEG) & (_angle_deg(thigh + shin, down) <= LEG_DEG)
    return chosen & (np.abs(joints[:, Joint.RIGHT_FOOT, 1] - joints[:, Joint.LEFT_FOOT, 1]) <= LEVEL_FEET_M)


def is_upright(joints_camera_m: np.ndarray) -> np.ndarray:
    """(N,) bool: standing, the shoulders parallel to the image, and both hands below the head: the silhouette's height is
    the person's.

    Args:
        joints_camera_m: (N, 15, 3) metres, camera frame.
    """
    joints = np.asarray(joints_camera_m, np.float64)
    across = joints[:, Joint.LEFT_SHOULDER] - joints[:, Joint.RIGHT_SHOULDER]
    turn_deg = np.degrees(np.arctan2(np.abs(across[:, 2]), np.abs(across[:, 0])))
    hands_m = joints[:, [Joint.RIGHT_HAND, Joint.LEFT_HAND], 1]
    below = (hands_m > joints[:, Joint.HEAD, 1, None]).all(axis=1)
    return is_standing(joints) & (turn_deg <= FACING_DEG) & below


def _angle_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(N,) angles between (N, 3) vectors in degrees; NaN where one is missing or has no length."""
    with np.errstate(invalid="ignore"):
        cosine = (a * b).sum(axis=1) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))
