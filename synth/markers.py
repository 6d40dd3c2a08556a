"""Motion-capture markers: named points on the body's surface, the same vertex on every body."""

import numpy as np

from kpopnet.skeleton import Joint
from synth.body import load_body

_PLACES = {
    # Names of the usual marker sets; a marker sits where the skin lies farthest from the joint in a direction of the
    # person at rest: (left, back, up).
    "LFHD": (Joint.HEAD, (0.7, -0.7, 0.3)),
    "RFHD": (Joint.HEAD, (-0.7, -0.7, 0.3)),
    "LBHD": (Joint.HEAD, (0.7, 0.7, 0.3)),
    "RBHD": (Joint.HEAD, (-0.7, 0.7, 0.3)),
    "C7": (Joint.NECK, (0, 1, 0)),
    "CLAV": (Joint.NECK, (0, -1, -0.4)),
    "STRN": (Joint.TORSO, (0, -1, 0.6)),
    "T10": (Joint.TORSO, (0, 1, 0.6)),
    "LSHO": (Joint.LEFT_SHOULDER, (0.2, 0, 1)),
    "RSHO": (Joint.RIGHT_SHOULDER, (-0.2, 0, 1)),
    "LELB": (Joint.LEFT_ELBOW, (0.8, 0.5, 0.3)),
    "RELB": (Joint.RIGHT_ELBOW, (-0.8, 0.5, 0.3)),
    "LWRI": (Joint.LEFT_HAND, (0.7, 0, 0.7)),
    "RWRI": (Joint.RIGHT_HAND, (-0.7, 0, 0.7)),
    "LASI": (Joint.LEFT_HIP, (0.3, -1, 0.3)),
    "RASI": (Joint.RIGHT_HIP, (-0.3, -1, 0.3)),
    "LPSI": (Joint.LEFT_HIP, (-0.3, 1, 0.3)),
    "RPSI": (Joint.RIGHT_HIP, (0.3, 1, 0.3)),
    "LKNE": (Joint.LEFT_KNEE, (1, -0.3, 0)),
    "RKNE": (Joint.RIGHT_KNEE, (-1, -0.3, 0)),
    "LANK": (Joint.LEFT_FOOT, (1, 0, 0)),
    "RANK": (Joint.RIGHT_FOOT, (-1, 0, 0)),
    "LTOE": (Joint.LEFT_FOOT, (0, -1, -0.3)),
    "RTOE": (Joint.RIGHT_FOOT, (0, -1, -0.3)),
}


def _on_mean_body() -> dict[str, int]:
    asset = load_body()
    points = asset.mean.reshape(-1, 3)
    vertices, joints = points[: len(asset.weights)], points[-len(Joint) :]
    found = {}
    for name, (joint, direction) in _PLACES.items():
        ray = np.array(direction) / np.linalg.norm(direction)
        away = vertices - joints[joint]
        along = away @ ray
        aside = np.linalg.norm(away - along[:, None] * ray, axis=1)
        # The nearest to the ray, of those in front of the joint and not on another limb.
        near = (along > 0.02) & (along < 0.25)
        found[name] = int(np.flatnonzero(near)[aside[near].argmin()])
    return found


MARKERS: dict[str, int] = _on_mean_body()
"""Name of each marker to its vertex."""
