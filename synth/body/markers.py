"""Simulated motion-capture markers: named vertices of the body's surface, and whether each one is tracked.

The motion-capture system is a ring of eight cameras around the person, like those that recorded EVAL and SMMC-10. Folded arms,
sitting on the floor or bending over occlude some markers.
"""

import numpy as np
from numba import njit

from kpopnet.skeleton import Joint
from synth.body.asset import load_body

RING_CAMERAS, RING_RADIUS_M, RING_HEIGHT_M = 8, 3.5, 2.4
MIN_CAMERAS = 2  # a marker is tracked if this many cameras see it
MARKER_RADIUS_M = 0.01  # a marker is a small ball on the skin; its centre lies this high above the skin


def _both(name: str, part: str, direction: tuple[float, float, float]) -> dict[str, tuple[Joint, tuple[float, float, float]]]:
    """The left and the right marker of a part of the body, from the direction of the left one."""
    left, right = (Joint[part], Joint[part]) if part == "HEAD" else (Joint[f"LEFT_{part}"], Joint[f"RIGHT_{part}"])
    return {f"L{name}": (left, direction), f"R{name}": (right, (-direction[0], *direction[1:]))}


_MARKER_DIRECTIONS = {
    # Names of the usual marker sets. A marker is placed where the skin is farthest from the joint, or from the proximal end
    # of the bone, in this direction of the person at rest: (left, back, up).
    **_both("FHD", "HEAD", (0.7, -0.7, 0.3)),
    **_both("BHD", "HEAD", (0.7, 0.7, 0.3)),
    "C7": (Joint.NECK, (0, 1, 0)),
    "CLAV": (Joint.NECK, (0, -1, -0.4)),
    "STRN": (Joint.TORSO, (0, -1, 0.6)),
    "T10": (Joint.TORSO, (0, 1, 0.6)),
    **_both("SHO", "SHOULDER", (0.2, 0, 1)),
    **_both("ELB", "ELBOW", (0.8, 0.5, 0.3)),
    "LWRI": ("LeftHand", (0.7, 0, 0.7)),
    "RWRI": ("RightHand", (-0.7, 0, 0.7)),
    **_both("ASI", "HIP", (0.3, -1, 0.3)),
    **_both("PSI", "HIP", (-0.3, 1, 0.3)),
    **_both("KNE", "KNEE", (1, -0.3, 0)),
    **_both("ANK", "FOOT", (1, 0, 0)),
    **_both("TOE", "FOOT", (0, -1, -0.3)),
}

RAY_DISTANCE_M = 0.02  # vertices within this distance of the ray from the joint are candidates for a marker


_ASSET = load_body()


def _marker_vertices() -> dict[str, int]:
    """The vertex of each marker, found on the mean body."""
    points = _ASSET.mean.reshape(-1, 3)
    vertices, heads, joints = np.split(points, [len(_ASSET.weights), len(points) - len(Joint)])
    found = {}
    for name, (origin, direction) in _MARKER_DIRECTIONS.items():
        start = heads[_ASSET.bone(origin)] if isinstance(origin, str) else joints[origin]
        ray = np.array(direction) / np.linalg.norm(direction)
        offset = vertices - start
        along = offset @ ray
        aside = np.linalg.norm(offset - along[:, None] * ray, axis=1)
        # Candidates lie 2 to 25 cm along the ray, so in front of the joint and not on another limb. The outermost is taken.
        reachable = (along > 0.02) & (along < 0.25)
        near = reachable & (aside < max(RAY_DISTANCE_M, aside[reachable].min() + 1e-6))
        found[name] = int(np.flatnonzero(near)[along[near].argmax()])
    return found


MARKERS: dict[str, int] = _marker_vertices()
"""Index of the vertex of each marker, by the marker's name. It is the same vertex on every body."""


def _grouped(pieces: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """All pieces as one array, and the index of the first row of each."""
    return np.concatenate(pieces), np.cumsum([0, *map(len, pieces[:-1])])


_PARTS = [_ASSET.faces[_ASSET.weight_bones[_ASSET.faces[:, 0], 0] == bone] for bone in range(len(_ASSET.bone_names))]
_PARTS = [part for part in _PARTS if len(part)]
"""(F, 3) triangles of the body's parts: of a part the bone with the largest skinning weight is the same."""

_FACES, _FACE_STARTS = _grouped(_PARTS)
_CORNERS, _CORNER_STARTS = _grouped([np.unique(part) for part in _PARTS])  # vertices of each part
_AROUND, _AROUND_STARTS = _grouped([_ASSET.faces[(_ASSET.faces == vertex).any(axis=1)] for vertex in MARKERS.values()])


def tracked_markers(vertices_world_m: np.ndarray, place_m: np.ndarray) -> np.ndarray:
    """(M,) bool: the MARKERS on a posed body with skin vertices (V, 3) that MIN_CAMERAS cameras of a ring about (3,) see."""
    angles = 2 * np.pi * np.arange(RING_CAMERAS) / RING_CAMERAS
    ring_m = np.stack([RING_RADIUS_M * np.cos(angles), RING_RADIUS_M * np.sin(angles), 0 * angles], axis=1)
    cameras_m = np.array([place_m[0], place_m[1], RING_HEIGHT_M]) + ring_m
    vertices = vertices_world_m.astype(np.float64)
    corners, count = vertices[_CORNERS], np.diff(_CORNER_STARTS, append=len(_CORNERS))
    middles = np.add.reduceat(corners, _CORNER_STARTS) / count[:, None]
    distance2 = ((corners - np.repeat(middles, count, axis=0)) ** 2).sum(axis=1)
    radii2 = np.maximum.reduceat(distance2, _CORNER_STARTS)
    a, b, c = vertices[_AROUND.T]
    normals = np.add.reduceat(np.cross(b - a, c - a), _AROUND_STARTS)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    markers_m = vertices[list(MARKERS.values())] + MARKER_RADIUS_M * normals
    return _tracked(vertices, _FACES, _FACE_STARTS, middles, radii2, markers_m, cameras_m)


@njit(cache=True)
def _tracked(vertices, faces, face_starts, middles, radii2, markers, cameras):
    """(M,) bool: whether MIN_CAMERAS cameras see each marker. Bounding spheres (middles, radii2) of the parts prune."""
    tracked = np.zeros(len(markers), np.bool_)
    for k in range(len(markers)):
        start, seeing = markers[k], 0
        for camera in cameras:
            ray = camera - start
            length2, occluded = (ray**2).sum(), False
            for part in range(len(middles)):
                to_middle = middles[part] - start
                fraction = min(max((to_middle * ray).sum() / length2, 0.0), 1.0)
                if ((to_middle - fraction * ray) ** 2).sum() <= radii2[part]:
                    stop = face_starts[part + 1] if part + 1 < len(middles) else len(faces)
                    occluded = _segment_hits_mesh(vertices, faces[face_starts[part] : stop], start, ray)
                if occluded:
                    break
            seeing += not occluded
            if seeing == MIN_CAMERAS:
                tracked[k] = True
                break
    return tracked


@njit(cache=True)
def _segment_hits_mesh(vertices, faces, start, ray):
    """Whether the segment from start to start + ray intersects a triangle (Moller & Trumbore 1997)."""
    wx, wy, wz = ray[0], ray[1], ray[2]
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
