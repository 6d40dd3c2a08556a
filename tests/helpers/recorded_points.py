"""Recorded points of one simple person in the joint sets of COCO and ImperialDance."""

import numpy as np

from kpopnet.dance.joint_files.points import COCO_NAMES, IMPERIAL_NAMES

FRAMES = 50


def person(heading_rad: float = 0.0, unit_m: float = 1.0, z_up: bool = False) -> dict[str, np.ndarray]:
    """(T, 3) positions of a person whose right hand rises, by the joints' names, in a unit of a number of metres.

    At heading 0 the person faces +z, before `z_up` makes z point up instead of y.
    """
    at = {
        "HEAD": (0, 1.6, 0), "NECK": (0, 1.45, 0), "SHOULDER": (0.18, 1.4, 0), "ELBOW": (0.25, 1.15, 0),
        "HAND": (0.3, 0.9, 0.05), "HIP": (0.1, 0.95, 0), "KNEE": (0.12, 0.5, 0.05), "FOOT": (0.12, 0.1, 0),
    }  # fmt: skip
    positions = {}
    for name, (x, y, z) in at.items():
        for side, sign in (("RIGHT_", -1), ("LEFT_", 1)) if name not in ("HEAD", "NECK") else (("", 1),):
            positions[side + name] = np.tile([sign * x, y, z], (FRAMES, 1)).astype(float)
    positions["RIGHT_HAND"][:, 1] += np.linspace(0, 0.8, FRAMES)
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    for name, points in positions.items():
        x, y, z = points.T
        points = np.stack([cos * x + sin * z + 3, y, cos * z - sin * x - 1], axis=1)
        positions[name] = (points[:, [0, 2, 1]] * [1, -1, 1] if z_up else points) / unit_m
    return positions


def coco(**options) -> np.ndarray:
    """(T, 17, 3) keypoints of `person` in COCO's order."""
    positions = person(**options)
    points = np.zeros((FRAMES, 17, 3))
    points[:, :5] = positions["HEAD"][:, None]
    for number, name in enumerate(COCO_NAMES[5:], 5):
        points[:, number] = positions[name.upper().replace("WRIST", "HAND").replace("ANKLE", "FOOT")]
    return points


def imperial(**options) -> np.ndarray:
    """(T, 21, 3) points of `person` in ImperialDance's order."""
    positions = person(**options)
    points = np.zeros((FRAMES, len(IMPERIAL_NAMES), 3))
    for name, at in positions.items():
        points[:, IMPERIAL_NAMES.index(name.lower())] = at
    return points
