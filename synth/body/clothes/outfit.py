"""Draws what a person wears and carries, and puts it on.

The frequencies are those of people in streets, gyms and dance halls as the authors guess them; no set of recordings was
counted for them.
"""

from dataclasses import dataclass

import numpy as np

from kpopnet.errors import InputError
from synth.body.clothes.attachments import ellipsoid, skirt, unworn
from synth.body.clothes.cloth import Figure, folds, outermost
from synth.body.clothes.garments import BOTTOMS, TOPS, Garment, hair, jacket, leggings, shoes

FOLD_DEPTH = 0.25
"""Folds take up to this fraction of the distance from skin to cloth."""


@dataclass(frozen=True)
class ClothesConfig:
    """How often each kind of clothes is worn.

    Attributes:
        dressed: probability of wearing each of a top and trousers, or a skirt.
        shod: probability of shoes.
        skirt: probability that a woman wears a skirt or a dress; a tenth of it for a man (a robe, a kilt).
        coat: probability of a coat over everything else.
        haired: probability of hair on the scalp.
        long_hair: probability that a woman's hair is long, in a tail or a bun; a fifth of it for a man's.
        hat: probability of a cap or a hat.
        backpack: probability of a backpack.
        bag: probability of a bag at the hip, or of a jumper tied around it.
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
        for name, value in vars(self).items():
            if not 0 <= value <= 1:
                raise InputError(f"body.clothes.{name}={value} is a probability: choose a value in 0..1")


def put_on(figure: Figure, rng: np.random.Generator, config: ClothesConfig) -> list[np.ndarray]:
    """Rest positions of a dressed body, metres: (V, 3) of its vertices on skin or cloth, then those of every piece.

    Every part of the outfit draws from a generator of its own, so that one choice does not shift the others.
    """
    wearing, top, bottom, feet, head, carried = rng.spawn(6)
    layers, pieces = [np.zeros_like(figure.vertices_m)], unworn(figure)
    skirted = wearing.random() < config.skirt * (1.0 if figure.female else 0.1)
    coated, topped, trousered, shod = wearing.random(4) < (config.coat, config.dressed, config.dressed, config.shod)
    if topped:
        layers.append(_drawn(TOPS, top)(figure, top))
    if coated:
        layers.append(jacket(figure, top))
    if trousered:
        layers.append((leggings if skirted else _drawn(BOTTOMS, bottom))(figure, bottom))
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
    """A garment, drawn by weight."""
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
