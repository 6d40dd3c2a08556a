"""Closed triangle meshes of simple solids, of which furniture and props are made."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

SIDES = 12  # corners of a circle in the meshes of balls and rods
BOX_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_BOX_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
BOX_FACES = np.array([face for a, b, c, d in _BOX_SIDES for face in ((a, b, c), (a, c, d))], np.int32)
"""(12, 3) triangles of the box with corners BOX_CORNERS, counter-clockwise seen from outside."""

Triple = tuple[float, float, float]
Box = tuple[Triple, Triple]  # centre and half sizes in metres, along the axes of its own frame


class Mesh(NamedTuple):
    vertices_m: np.ndarray  # (V, 3) float64, metres
    faces: np.ndarray  # (F, 3) int32, counter-clockwise seen from outside

    def moved(self, rotation: np.ndarray, position_m: np.ndarray) -> "Mesh":
        """The mesh in another frame: rotated by (3, 3) about its origin, then moved by (3,) metres."""
        return Mesh(self.vertices_m @ rotation.T + position_m, self.faces)


def about_z(angle_rad: float) -> np.ndarray:
    """(3, 3) rotation to the left about the vertical."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])


def joined(meshes: Iterable[Mesh]) -> Mesh:
    meshes = list(meshes)
    starts = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes[:-1]])
    faces = [mesh.faces + np.int32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.concatenate([mesh.vertices_m for mesh in meshes]), np.concatenate(faces))


def boxes(parts: Iterable[Box]) -> Mesh:
    return joined(Mesh(BOX_CORNERS * half + centre, BOX_FACES) for centre, half in parts)


def rod(radius_m: float, half_length_m: float) -> Mesh:
    """A rod along y about the origin."""
    return _turned([(0, -half_length_m), (radius_m, -half_length_m), (radius_m, half_length_m), (0, half_length_m)])


def ball(radius_m: float) -> Mesh:
    """A ball about the origin."""
    latitudes = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    return _turned([(radius_m * np.cos(angle), radius_m * np.sin(angle)) for angle in latitudes])


def _turned(profile: list[tuple[float, float]]) -> Mesh:
    """The solid that a profile of (radius, y), from the lowest y to the highest, encloses when it turns about y."""
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.stack([np.sin(angles), np.zeros(SIDES), np.cos(angles)], axis=1)
    vertices = np.concatenate([radius * ring + (0, y, 0) for radius, y in profile])
    this = np.arange(SIDES, dtype=np.int32)
    following = (this + 1) % SIDES
    faces = []
    for k in range(len(profile) - 1):
        low, high = k * SIDES, (k + 1) * SIDES
        faces += [np.stack([low + this, low + following, high + following], axis=1)]
        faces += [np.stack([low + this, high + following, high + this], axis=1)]
    return Mesh(vertices, np.concatenate(faces).astype(np.int32))
