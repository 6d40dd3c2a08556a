"""Cloth on the skin: how a garment moves the vertices of the unclothed body outwards.

A garment is a displacement (V, 3) of the vertices at rest, metres. Three ways to make one cover most clothes: a coat of even
thickness (`padded`), a tube around a limb (`tube`), and cloth that hangs from the widest place above it (`hanging`). Where
garments lie over each other the outermost shows (`outermost`).
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from synth.body.asset import BodyAsset, vertex_normals

THIN_M = 0.003
"""Thickness of one layer of cloth."""

AZIMUTHS, LEVEL_M = 24, 0.03
"""Around the trunk, hanging cloth is resolved into this many directions, and along it into levels of this height."""


@dataclass(frozen=True)
class Figure:
    """An unclothed body at rest, with what garments need to know of it. z is up, the body faces -y, its left is +x.

    Attributes:
        asset: the body model.
        vertices_m: (V, 3) skin at rest, metres.
        heads_m: (B, 3) proximal ends of the bones at rest, metres.
        female: whether the person is more female than male.
    """

    asset: BodyAsset
    vertices_m: np.ndarray
    heads_m: np.ndarray
    female: bool

    @cached_property
    def normals(self) -> np.ndarray:
        """(V, 3) unit normals of the vertices."""
        return vertex_normals(self.vertices_m, self.asset.faces)

    def bone_m(self, name: str) -> np.ndarray:
        """(3,) proximal end of a bone, metres."""
        return self.heads_m[self.asset.bone(name)]

    def cover(self, *bones: str) -> np.ndarray:
        """(V,) share 0..1 of each vertex that belongs to these bones, not to be written to."""
        return _cover(self.asset, bones)


@cache
def _cover(asset: BodyAsset, bones: tuple[str, ...]) -> np.ndarray:
    share = np.minimum(asset.weight_of(*bones), 1)
    share.flags.writeable = False
    return share


def outermost(first: np.ndarray, *others: np.ndarray) -> np.ndarray:
    """(V, 3) the greatest displacement of each vertex among displacements (V, 3)."""
    outer = first.copy()
    outer_squared = np.einsum("vi,vi->v", outer, outer)
    for other in others:
        squared = np.einsum("vi,vi->v", other, other)
        larger = squared > outer_squared
        outer[larger], outer_squared[larger] = other[larger], squared[larger]
    return outer


def padded(figure: Figure, cover: np.ndarray, thickness_m: float) -> np.ndarray:
    """(V, 3) an even layer along the normals, by cover (V,) in 0..1."""
    return (cover * thickness_m)[:, None] * figure.normals


def tube(figure: Figure, bones: tuple[str, str], cover: np.ndarray, radii_m: tuple[float, float]) -> np.ndarray:
    """(V, 3) a tube of cloth around a limb: nowhere narrower than its radius, nor than the limb.

    Args:
        figure: the body.
        bones: bones whose proximal ends are the ends of the tube's axis.
        cover: (V,) share of each vertex that the tube covers.
        radii_m: radius at both ends; in between it changes linearly.
    """
    worn = np.flatnonzero(cover)
    start, end = (figure.bone_m(bone) for bone in bones)
    axis, points = end - start, figure.vertices_m[worn] - start
    along = np.clip(points @ axis / (axis @ axis), 0, 1)
    away = points - along[:, None] * axis
    distance = np.maximum(np.sqrt(np.einsum("vi,vi->v", away, away)), 1e-6)
    radius = radii_m[0] + along * (radii_m[1] - radii_m[0])
    thickness_m = cover[worn] * np.maximum(radius - distance, THIN_M)
    return _outwards(figure, worn, thickness_m, away / distance[:, None])


def hanging(figure: Figure, cover: np.ndarray, drape: float) -> np.ndarray:
    """(V, 3) cloth that hangs from shoulders, chest, belly or hips: below its widest place it falls straight.

    Args:
        figure: the body.
        cover: (V,) share of each vertex that the cloth covers.
        drape: fraction of the widest radius above that the cloth keeps; 1 falls straight, less follows the body.
    """
    worn = np.flatnonzero(cover > 0.5)
    if not len(worn):
        return np.zeros_like(figure.vertices_m)
    points = figure.vertices_m[worn]
    flat = points[:, :2] - figure.bone_m("LowerBack")[:2]
    radius = np.maximum(np.sqrt(np.einsum("vi,vi->v", flat, flat)), 1e-6)
    sector = ((np.arctan2(flat[:, 1], flat[:, 0]) / (2 * np.pi) + 0.5) * AZIMUTHS).astype(int) % AZIMUTHS
    level = ((points[:, 2].max() - points[:, 2]) / LEVEL_M).astype(int)
    widest = np.zeros((level.max() + 1, AZIMUTHS))
    np.maximum.at(widest, (level, sector), radius)
    widest = np.maximum.accumulate(widest, axis=0)
    # Between neighbouring directions cloth is stretched, not folded in.
    widest = np.maximum(widest, (np.roll(widest, 1, axis=1) + np.roll(widest, -1, axis=1)) / 2)
    thickness_m = cover[worn] * np.maximum(drape * widest[level, sector] - radius, THIN_M)
    return _outwards(figure, worn, thickness_m, np.column_stack([flat / radius[:, None], np.zeros(len(flat))]))


def _outwards(figure: Figure, worn: np.ndarray, distance_m: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(V, 3) displacement of the vertices `worn` (W,) by (W,) along unit directions (W, 3), where the skin faces them.

    Elsewhere, as between the legs, the cloth would be pushed through the body.
    """
    facing = np.clip(3 * np.einsum("vi,vi->v", figure.normals[worn], directions), 0, 1)
    moved = np.zeros_like(figure.vertices_m)
    moved[worn] = (distance_m * facing)[:, None] * directions
    return moved


def above(figure: Figure, height_m: float, soft_m: float = 0.02) -> np.ndarray:
    """(V,) 1 above a height at rest, 0 below it, with a soft edge."""
    return np.clip((figure.vertices_m[:, 2] - height_m) / soft_m + 0.5, 0, 1)


def folds(vertices_m: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(V,) smooth random field in -1..1 over the rest body: a mean of sine waves with wavelengths of 15 to 60 cm."""
    waves = rng.standard_normal((3, 3), np.float32)
    lengths_m = 0.15 + 0.45 * rng.random((3, 1), np.float32)
    waves *= 2 * np.pi / lengths_m / np.linalg.norm(waves, axis=1, keepdims=True)
    phases = 2 * np.pi * rng.random(3, np.float32)
    return np.sin(vertices_m @ waves.T + phases).mean(1)
