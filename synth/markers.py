"""Motion-capture markers: named points on the body's surface, the same vertex on every body, and when they are tracked.

A simulated motion-capture system stands around the person, as one did around the people of EVAL and SMMC-10: eight cameras
in a ring. It has nothing to do with the depth camera. A marker whose place two of its cameras see is tracked; arms folded
over the chest, a seat on the floor or a trunk bent over hide some.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.skeleton import Joint
from synth.body import load_body

RING_CAMERAS, RING_RADIUS_M, RING_HEIGHT_M = 8, 3.5, 2.4
SEEING_CAMERAS = 2

MARKER_RADIUS_M = 0.01
"""A marker is a small ball on the skin: so high its middle lies."""

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


NEAR_RAY_M = 0.02


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
        # The outermost near the ray, where there are several layers, of those in front of the joint and not on another limb.
        reachable = (along > 0.02) & (along < 0.25)
        near = reachable & (aside < max(NEAR_RAY_M, aside[reachable].min() + 1e-6))
        found[name] = int(np.flatnonzero(near)[along[near].argmax()])
    return found


MARKERS: dict[str, int] = _on_mean_body()
"""Name of each marker to its vertex."""


def tracked_markers(vertices_world_m: np.ndarray, place_m: np.ndarray) -> np.ndarray:
    """(M,) bool: which of MARKERS on a posed body are seen by the ring around (3,) place.

    Args:
        vertices_world_m: (V, 3) the skin.
        place_m: (3,) on the floor.
    """
    angles = 2 * np.pi * np.arange(RING_CAMERAS) / RING_CAMERAS
    ring_m = np.stack([RING_RADIUS_M * np.cos(angles), RING_RADIUS_M * np.sin(angles), 0 * angles], axis=1)
    cameras_m = np.array([place_m[0], place_m[1], RING_HEIGHT_M]) + ring_m
    vertices, skin = vertices_world_m.astype(np.float64), _skin()
    of_part = vertices[skin.part_corners]
    count = np.diff(skin.corner_starts, append=len(of_part))
    middles = np.add.reduceat(of_part, skin.corner_starts) / count[:, None]
    away2 = ((of_part - np.repeat(middles, count, axis=0)) ** 2).sum(axis=1)
    radii2 = np.maximum.reduceat(away2, skin.corner_starts)
    a, b, c = vertices[skin.marker_faces.T]
    normals = np.add.reduceat(np.cross(b - a, c - a), skin.marker_starts)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places_m = vertices[list(MARKERS.values())] + MARKER_RADIUS_M * normals
    return _tracked(vertices, skin.faces, skin.face_starts, middles, radii2, places_m, cameras_m)


class _Skin(NamedTuple):
    """The body's triangles by the bone that moves them most, a part each, and those around the markers.

    The starts say where in the array before them each part, or each marker, begins.
    """

    faces: np.ndarray  # (F, 3)
    face_starts: np.ndarray
    part_corners: np.ndarray  # (C,) vertices of each part's triangles
    corner_starts: np.ndarray
    marker_faces: np.ndarray  # (N, 3)
    marker_starts: np.ndarray


@cache
def _skin() -> _Skin:
    asset = load_body()
    bone = asset.weight_bones[asset.faces[:, 0], 0]
    parts = [asset.faces[bone == one] for one in np.unique(bone)]
    corners = [np.unique(part) for part in parts]
    around = [asset.faces[(asset.faces == vertex).any(axis=1)] for vertex in MARKERS.values()]
    joined = [(np.concatenate(pieces), _starts(pieces)) for pieces in (parts, corners, around)]
    return _Skin(*(array for pair in joined for array in pair))


def _starts(pieces: list[np.ndarray]) -> np.ndarray:
    return np.cumsum([0, *(len(piece) for piece in pieces[:-1])])


@njit(cache=True)
def _tracked(vertices, faces, face_starts, middles, radii2, places, cameras):
    tracked = np.zeros(len(places), np.bool_)
    for k in range(len(places)):
        start, seeing = places[k], 0
        for camera in cameras:
            way = camera - start
            length2, blocked = (way**2).sum(), False
            for part in range(len(middles)):
                to_middle = middles[part] - start
                share = min(max((to_middle * way).sum() / length2, 0.0), 1.0)
                if ((to_middle - share * way) ** 2).sum() <= radii2[part]:
                    stop = face_starts[part + 1] if part + 1 < len(middles) else len(faces)
                    blocked = _meets(vertices, faces[face_starts[part] : stop], start, way)
                if blocked:
                    break
            seeing += not blocked
            if seeing == SEEING_CAMERAS:
                tracked[k] = True
                break
    return tracked


@njit(cache=True)
def _meets(vertices, faces, start, way):
    """Whether one meets any triangle on the way from start (Moller & Trumbore 1997)."""
    wx, wy, wz = way[0], way[1], way[2]
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
        ux, uy, uz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        vx, vy, vz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        px, py, pz = wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx
        volume = ux * px + uy * py + uz * pz
        if volume == 0:
            continue
        sx, sy, sz = start[0] - ax, start[1] - ay, start[2] - az
        along_u = (sx * px + sy * py + sz * pz) / volume
        if along_u < 0 or along_u > 1:
            continue
        qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
        along_v = (wx * qx + wy * qy + wz * qz) / volume
        if along_v < 0 or along_u + along_v > 1:
            continue
        if 0 < (vx * qx + vy * qy + vz * qz) / volume < 1:
            return True
    return False
