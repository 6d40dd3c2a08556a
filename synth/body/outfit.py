"""Draws what a person wears and carries, and puts it on.

The frequencies are those of people in streets, gyms and dance halls as the authors guess them; no set of recordings was
counted for them.

Skirts, long hair, hats and bags have a mesh of their own. MuJoCo compiles one skin: its vertices, faces and weights are fixed,
only the rest positions of the vertices change from person to person. So every such piece is one of a few closed shapes
(`PIECES`) that are part of every person's skin: a tube around the legs, and ellipsoids held by the head, the neck, the back
and the hips. A piece that is not worn is shrunk to a point inside the body.
"""

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from kpopnet.errors import check_between
from synth.body.asset import load_body
from synth.body.garments import ORDINARY, Figure, Garment, Wardrobe, folds, hair, jacket, leggings, outermost, shoes

FOLD_DEPTH = 0.25  # folds take up to this fraction of the distance from skin to cloth


@dataclass(frozen=True)
class ClothesConfig:
    """How often each kind of clothes is worn. All are probabilities.

    Attributes:
        dressed: of wearing each of a top and trousers, or a skirt.
        shod: of shoes.
        skirt: that a woman wears a skirt or a dress; a tenth of it for a man (a robe, a kilt).
        coat: of a coat over everything else.
        haired: of hair on the scalp.
        long_hair: that a woman's hair is long, in a tail or a bun; a fifth of it for a man's.
        hat: of a cap or a hat.
        backpack: of a backpack.
        bag: of a bag at the hip, or of a jumper tied around it.
    """

    dressed: float = 0.95
    shod: float = 0.85
    skirt: float = 0.2
    coat: float = 0.06
    haired: float = 0.9
    long_hair: float = 0.65
    hat: float = 0.08
    backpack: float = 0.04
    bag: float = 0.04

    def __post_init__(self) -> None:
        for name, probability in vars(self).items():
            check_between(f"body.clothes.{name}", probability, 0, 1)


RINGS, SECTORS = 9, 20
ANGLES_RAD = 2 * np.pi * np.arange(SECTORS) / SECTORS
SKIRT_EASE_M = 0.015  # distance of a skirt from what it lies around


class Piece(NamedTuple):
    """A piece of N vertices, in RINGS rings that run anticlockwise seen from above, the highest first."""

    bones: tuple[str, ...]  # the bones that hold the piece
    weights: np.ndarray  # (N, len(bones)) skinning weights; rows sum to 1


_ring, _sector = np.meshgrid(np.arange(RINGS - 1), np.arange(SECTORS), indexing="ij")
_upper = np.stack([_ring * SECTORS + _sector, _ring * SECTORS + (_sector + 1) % SECTORS], axis=-1)
_corners = np.concatenate([_upper, _upper + SECTORS], axis=-1)
RING_FACES = _corners[..., [[0, 2, 3], [0, 3, 1]]].reshape(-1, 3)
"""(F, 3) faces between consecutive rings of a piece, counter-clockwise seen from outside."""


def _skirt() -> Piece:
    """Hangs from the hips; downwards the thighs take over, each its own side."""
    down = np.repeat(np.linspace(0, 1, RINGS), SECTORS)
    left = np.tile(0.5 + 0.5 * np.clip(1.4 * np.cos(ANGLES_RAD), -1, 1), RINGS)
    legs = np.clip(1.5 * down - 0.1, 0, 0.9)
    weights = np.stack([1 - legs, legs * left, legs * (1 - left)], axis=1)
    return Piece(("Hips", "LeftUpLeg", "RightUpLeg"), weights)


def _ellipsoid(*bones: str) -> Piece:
    """Held by the first bone at the top and, if there are more, by the last at the bottom."""
    down = np.repeat(np.linspace(0, 1, RINGS), SECTORS) * (len(bones) - 1)
    weights = np.maximum(1 - np.abs(down[:, None] - np.arange(len(bones))), 0)
    return Piece(bones, weights)


PIECES: dict[str, Piece] = {
    "skirt": _skirt(),
    "head": _ellipsoid("Head"),
    "brim": _ellipsoid("Head"),
    "hair": _ellipsoid("Head", "Neck", "Spine1"),
    "back": _ellipsoid("Spine1"),
    "hip": _ellipsoid("Hips"),
}


class Skin(NamedTuple):
    """The mesh of every dressed person: the body's V vertices, then those of the pieces."""

    faces: np.ndarray  # (F, 3) int32
    weight_bones: np.ndarray  # (N, 4) int bones of the skinning weights
    weights: np.ndarray  # (N, 4) float32 skinning weights; rows sum to 1


@cache
def load_skin() -> Skin:
    asset = load_body()
    faces, bones, weights = [asset.faces], [asset.weight_bones], [asset.weights]
    for number, piece in enumerate(PIECES.values()):
        faces.append(RING_FACES + len(asset.weights) + number * RINGS * SECTORS)
        unused = (0, 0), (0, asset.weights.shape[1] - len(piece.bones))
        held = np.tile([asset.bone(bone) for bone in piece.bones], (RINGS * SECTORS, 1))
        bones.append(np.pad(held, unused))
        weights.append(np.pad(piece.weights, unused).astype(np.float32))
    return Skin(np.concatenate(faces).astype(np.int32), np.concatenate(bones), np.concatenate(weights))


def unworn(figure: Figure) -> dict[str, np.ndarray]:
    """All pieces (N, 3), shrunk to points inside the body."""
    return {name: np.tile(figure.bone_m(piece.bones[0]), (RINGS * SECTORS, 1)) for name, piece in PIECES.items()}


def skirt(figure: Figure, dressed_m: np.ndarray, length: float, flare: float) -> np.ndarray:
    """(N, 3) a skirt, or the lower part of a coat, over the vertices (V, 3) in the clothes below it, metres.

    At each height it lies around the convex outline of hips and thighs, and falls from the widest place above. A length of 1
    reaches the knees, 1.25 the calves. The flare is the widening per length: 0 for a pencil skirt, 0.5 for a wide one.
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


def put_on(figure: Figure, rng: np.random.Generator, config: ClothesConfig, wardrobe: Wardrobe = ORDINARY) -> list[np.ndarray]:
    """Rest positions of a dressed body, metres: (V, 3) of its vertices on skin or cloth, then those of every piece.

    Every part of the outfit draws from a generator of its own, so that one choice does not shift the others.
    """
    wearing, top, bottom, feet, head, carried = rng.spawn(6)
    layers, pieces = [np.zeros_like(figure.vertices_m)], unworn(figure)
    skirted = wearing.random() < config.skirt * (1.0 if figure.female else 0.1)
    coated, topped, trousered, shod = wearing.random(4) < (config.coat, config.dressed, config.dressed, config.shod)
    if topped:
        layers.append(_drawn(wardrobe.tops, top)(figure, top))
    if coated:
        layers.append(jacket(figure, top))
    if trousered:
        layers.append((leggings if skirted else _drawn(wardrobe.bottoms, bottom))(figure, bottom))
    if shod:
        layers.append(shoes(figure, feet))
    moved = outermost(*layers) * (1 - FOLD_DEPTH * (0.5 + 0.5 * folds(figure.vertices_m, rng)))[:, None]
    long_haired = head.random() < config.long_hair * (1.0 if figure.female else 0.2)
    haired, hatted = head.random(2) < (config.haired, config.hat)
    if haired:
        moved = outermost(moved, hair(figure, head))
    dressed_m = figure.vertices_m + moved
    if skirted or coated:
        length, flare = bottom.uniform((0.45, 0.0), (1.25, 0.3))
        pieces["skirt"] = skirt(figure, dressed_m, length, flare if skirted else 0.1)
    if haired and long_haired:
        _long_hair(figure, head, pieces)
    if hatted:
        _hat(figure, head, pieces)
    _carry(figure, carried, config, pieces)
    return [points.astype(np.float32) for points in (dressed_m, *pieces.values())]


def _drawn(garments: dict[str, tuple[float, Garment]], rng: np.random.Generator) -> Garment:
    thresholds = np.cumsum([weight for weight, _ in garments.values()])
    chosen = int(np.searchsorted(thresholds, rng.random() * thresholds[-1], side="right"))
    return list(garments.values())[min(chosen, len(garments) - 1)][1]


def _skull(figure: Figure) -> tuple[np.ndarray, np.ndarray]:
    """Centre and half size of the head's bounding box, metres."""
    head = figure.vertices_m[figure.cover("Head") > 0.5]
    low, high = head.min(axis=0), head.max(axis=0)
    return (low + high) / 2, (high - low) / 2


def _long_hair(figure: Figure, rng: np.random.Generator, pieces: dict[str, np.ndarray]) -> None:
    """A bun, a tail, or hair that falls over the neck to the shoulder blades."""
    centre, half = _skull(figure)
    kind, size, height = rng.random(3)
    if kind < 0.3:
        bun_m = 0.03 + 0.03 * size
        place = centre + np.array([0, half[1], half[2] * (0.1 + 0.9 * height)])
        pieces["head"] = ellipsoid(place, (bun_m, bun_m, bun_m))
    elif kind < 0.55:
        tail_m = 0.08 + 0.12 * size
        place = centre + np.array([0, half[1] + 0.02, half[2] * (0.2 + 0.5 * height) - tail_m])
        pieces["hair"] = ellipsoid(place, (0.035, 0.035, tail_m))
    else:
        fall_m = 0.1 + 0.12 * size
        place = centre + np.array([0, 0.55 * half[1], half[2] - 0.05 - fall_m])
        pieces["hair"] = ellipsoid(place, (half[0] + 0.015 + 0.02 * height, 0.6 * half[1] + 0.02, fall_m), boxy=0.6)


def _hat(figure: Figure, rng: np.random.Generator, pieces: dict[str, np.ndarray]) -> None:
    """A cap with a peak, a woollen hat, or a hat with a brim."""
    centre, half = _skull(figure)
    kind, size = rng.random(2)
    crown = centre + np.array([0, 0.1 * half[1], 0.45 * half[2]])
    pieces["head"] = ellipsoid(crown, (half[0] + 0.015, half[1] + 0.01, 0.6 * half[2] + 0.03 * size), boxy=0.8)
    if kind < 0.5:
        pieces["brim"] = ellipsoid(crown - np.array([0, half[1] + 0.02, 0]), (0.08, 0.05 + 0.03 * size, 0.008))
    elif kind < 0.75:
        wide_m = half[1] + 0.04 + 0.05 * size
        pieces["brim"] = ellipsoid(crown, (wide_m, wide_m, 0.01))


def _carry(figure: Figure, rng: np.random.Generator, config: ClothesConfig, pieces: dict[str, np.ndarray]) -> None:
    """A backpack; a bag at a hip, or a jumper tied around it."""
    has_backpack, has_bag, on_left = rng.random(3) < (config.backpack, config.bag, 0.5)
    size = rng.random(3)
    if has_backpack:
        back = figure.vertices_m[figure.cover("Spine1", "Spine") > 0.5]
        half_m = np.array([0.12, 0.06, 0.16]) + np.array([0.05, 0.07, 0.1]) * size
        place = np.array([0, back[:, 1].max() + 0.7 * half_m[1], back[:, 2].mean()])
        pieces["back"] = ellipsoid(place, tuple(half_m), boxy=0.4)
    if has_bag:
        half_m = np.array([0.05, 0.1, 0.08]) + np.array([0.05, 0.08, 0.1]) * size
        side = 1 if on_left else -1
        place = figure.bone_m("Hips") + np.array([side * (0.17 + half_m[0]), 0, -0.05])
        pieces["hip"] = ellipsoid(place, tuple(half_m), boxy=0.5)
