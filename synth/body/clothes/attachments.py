"""Pieces with a mesh of their own: a skirt, the lower part of a coat, long hair, a bun, a hat, a bag, a backpack.

MuJoCo compiles one skin: its vertices, faces and weights are fixed, only the rest positions of the vertices change from
person to person. So every piece is one of a few closed shapes (`PIECES`) that are part of every person's skin: a tube
around the legs, and ellipsoids held by the head, the neck, the back and the hips. A piece that is not worn is shrunk to a
point inside the body.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from synth.body.asset import BodyAsset
from synth.body.clothes.cloth import Figure

RINGS, SECTORS = 9, 20
ANGLES_RAD = 2 * np.pi * np.arange(SECTORS) / SECTORS
SKIRT_EASE_M = 0.015
"""Distance of a skirt from what it lies around."""


class Piece(NamedTuple):
    """The mesh of a piece: N vertices, F faces. Vertices run ring by ring.

    Attributes:
        faces: (F, 3) counter-clockwise seen from outside.
        bones: the bones that hold the piece.
        weights: (N, len(bones)) skinning weights; rows sum to 1.
    """

    faces: np.ndarray
    bones: tuple[str, ...]
    weights: np.ndarray


def _ring_faces() -> np.ndarray:
    """Faces between consecutive rings of vertices that run anticlockwise seen from above, the highest ring first."""
    ring, sector = np.meshgrid(np.arange(RINGS - 1), np.arange(SECTORS), indexing="ij")
    a, b = ring * SECTORS + sector, ring * SECTORS + (sector + 1) % SECTORS
    c, d = a + SECTORS, b + SECTORS
    return np.stack([np.stack([a, c, d], axis=-1), np.stack([a, d, b], axis=-1)], axis=2).reshape(-1, 3)


def _skirt() -> Piece:
    """Hangs from the hips; downwards the thighs take over, each its own side."""
    down = np.repeat(np.linspace(0, 1, RINGS), SECTORS)
    left = np.tile(0.5 + 0.5 * np.clip(1.4 * np.cos(ANGLES_RAD), -1, 1), RINGS)
    legs = np.clip(1.5 * down - 0.1, 0, 0.9)
    weights = np.stack([1 - legs, legs * left, legs * (1 - left)], axis=1)
    return Piece(_ring_faces(), ("Hips", "LeftUpLeg", "RightUpLeg"), weights)


def _ellipsoid(*bones: str) -> Piece:
    """Held by the first bone at the top and, if there are more, by the last at the bottom."""
    down = np.repeat(np.linspace(0, 1, RINGS), SECTORS) * (len(bones) - 1)
    weights = np.maximum(1 - np.abs(down[:, None] - np.arange(len(bones))), 0)
    return Piece(_ring_faces(), bones, weights)


PIECES: dict[str, Piece] = {
    "skirt": _skirt(),
    "head": _ellipsoid("Head"),
    "brim": _ellipsoid("Head"),
    "hair": _ellipsoid("Head", "Neck", "Spine1"),
    "back": _ellipsoid("Spine1"),
    "hip": _ellipsoid("Hips"),
}


class Skin(NamedTuple):
    """The mesh of every dressed person: the body's V vertices, then those of the pieces.

    Attributes:
        faces: (F, 3) int32.
        weight_bones: (N, 4) int bones of the skinning weights.
        weights: (N, 4) float32 skinning weights; rows sum to 1.
        starts: index of the first vertex of each piece, by name.
    """

    faces: np.ndarray
    weight_bones: np.ndarray
    weights: np.ndarray
    starts: dict[str, int]


@cache
def build_skin(asset: BodyAsset) -> Skin:
    """The mesh of body and pieces together."""
    faces, bones, weights, starts = [asset.faces], [asset.weight_bones], [asset.weights], {}
    count = len(asset.weights)
    for name, piece in PIECES.items():
        starts[name] = count
        faces.append(piece.faces + count)
        padded = np.zeros((len(piece.weights), asset.weights.shape[1]), np.float32)
        held = np.zeros(padded.shape, int)
        padded[:, : len(piece.bones)] = piece.weights
        held[:, : len(piece.bones)] = [asset.bone(bone) for bone in piece.bones]
        weights.append(padded)
        bones.append(held)
        count += len(padded)
    return Skin(np.concatenate(faces).astype(np.int32), np.concatenate(bones), np.concatenate(weights), starts)


def unworn(figure: Figure) -> dict[str, np.ndarray]:
    """All pieces (N, 3), shrunk to points inside the body."""
    return {name: np.tile(figure.bone_m(piece.bones[0]), (len(piece.weights), 1)) for name, piece in PIECES.items()}


def skirt(figure: Figure, dressed_m: np.ndarray, length: float, flare: float) -> np.ndarray:
    """(N, 3) a skirt, or the lower part of a coat.

    At each height it lies around the convex outline of hips and thighs, and falls from the widest place above.

    Args:
        figure: the body.
        dressed_m: (V, 3) the vertices with the clothes below the skirt, metres.
        length: 1 reaches the knees, 1.25 the calves.
        flare: widening per length, as a fraction: 0 is a pencil skirt, 0.5 a wide one.
    """
    covered = figure.cover("Hips", "LowerBack", "LeftUpLeg", "RightUpLeg", "LeftLeg", "RightLeg") > 0.5
    points = dressed_m[covered]
    middle = figure.bone_m("Hips")
    waist_z = figure.bone_m("LowerBack")[2]
    hem_z = waist_z + length * (figure.bone_m("LeftLeg")[2] - waist_z)
    heights = np.linspace(waist_z, hem_z, RINGS)
    directions = np.stack([np.cos(ANGLES_RAD), np.sin(ANGLES_RAD)], axis=1)
    reach = (points[:, :2] - middle[:2]) @ directions.T
    half_m = (waist_z - hem_z) / (RINGS - 1)
    near = np.abs(points[:, 2, None] - heights) <= half_m
    support = np.stack([reach[near[:, ring]].max(axis=0, initial=0.0) for ring in range(RINGS)])
    # Below the crotch the legs of the rest pose are apart; the cloth would lie around closed legs.
    support = np.minimum(support, np.maximum(support[: RINGS // 2].max(axis=0), 0.05) * 1.15)
    radius = np.maximum.accumulate(support, axis=0) * np.linspace(1, 1 + flare * length, RINGS)[:, None] + SKIRT_EASE_M
    flat = middle[:2] + radius[..., None] * directions
    return np.concatenate([flat, np.broadcast_to(heights[:, None, None], (RINGS, SECTORS, 1))], axis=2).reshape(-1, 3)


def ellipsoid(centre_m: np.ndarray, half_m: tuple[float, float, float], boxy: float = 1.0) -> np.ndarray:
    """(N, 3) an ellipsoid with half axes along x, y, z; boxy below 1 makes a rounded box of it."""

    def power(value: np.ndarray) -> np.ndarray:
        return np.sign(value) * np.abs(value) ** boxy

    polar = np.linspace(0, np.pi, RINGS)[:, None]
    across = power(np.sin(polar))
    x, y = across * power(np.cos(ANGLES_RAD)), across * power(np.sin(ANGLES_RAD))
    z = np.broadcast_to(power(np.cos(polar)), x.shape)
    return centre_m + np.stack([x, y, z], axis=-1).reshape(-1, 3) * half_m
