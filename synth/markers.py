"""Motion-capture markers: named points on the body's surface, the same vertex on every body, and when they are tracked.

A simulated motion-capture system stands around the person, as one did around the people of EVAL and SMMC-10: eight cameras
in a ring. It has nothing to do with the depth camera. A marker whose place two of its cameras see is tracked; arms folded
over the chest, a seat on the floor or a trunk bent over hide some.
"""

import numpy as np

from kpopnet.skeleton import Joint
from synth.body import load_body
from synth.scene import Scene

RING_CAMERAS, RING_RADIUS_M, RING_HEIGHT_M = 8, 3.5, 2.4
SEEING_CAMERAS = 2

MARKER_ROOM_M = 0.05
"""So far before a marker a ray to it may meet the capsules of the body, which here and there stick out of the skin, as where
an arm is raised over its shoulder."""

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


def tracked_markers(scene: Scene, markers_world_m: np.ndarray, place_m: np.ndarray) -> np.ndarray:
    """(M,) bool: which of (M, 3) markers on the scene's posed person are seen by the ring around (3,) place."""
    angles = 2 * np.pi * np.arange(RING_CAMERAS) / RING_CAMERAS
    ring_m = RING_RADIUS_M * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    cameras_m = np.array([*place_m[:2], RING_HEIGHT_M]) + ring_m
    tracked = np.zeros(len(markers_world_m), bool)
    for marker, place in enumerate(markers_world_m):
        seeing = 0
        for camera in cameras_m:
            seeing += scene.reaches_m(camera, place) > np.linalg.norm(place - camera) - MARKER_ROOM_M
            if seeing == SEEING_CAMERAS:
                tracked[marker] = True
                break
    return tracked
