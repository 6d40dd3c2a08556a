"""Clothes on the skin: cloth, and tops, trousers, shoes and hair made of it.

A garment is a function of a body and a random generator; add one by writing it and entering it in a wardrobe. It returns the
displacement (V, 3) of the unclothed vertices at rest, metres. Three ways to make one cover most clothes: a coat of even
thickness (`padded`), a tube around a limb (`tube`), and cloth that hangs from the widest place above it (`hanging`). Where
garments lie over each other the outermost shows (`outermost`). Radii and widths are those of ordinary clothes laid flat: a
trouser leg is 17 to 26 cm wide at the hem, a sleeve 9 to 22 cm.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from synth.body.asset import load_body, vertex_normals

SIDES = ("Left", "Right")
TRUNK = ("LowerBack", "Spine", "Spine1", "LeftShoulder", "RightShoulder")
THIN_M = 0.003  # thickness of one layer of cloth

AZIMUTHS, LEVEL_M = 24, 0.03
"""Around the trunk, hanging cloth is resolved into this many directions, and along it into levels of this height."""


@dataclass(frozen=True)
class Figure:
    """An unclothed body at rest, with what garments need to know of it. z is up, the body faces -y, its left is +x."""

    vertices_m: np.ndarray  # (V, 3) skin at rest, metres
    heads_m: np.ndarray  # (B, 3) proximal ends of the bones at rest, metres
    female: bool  # whether the person is more female than male

    @cached_property
    def normals(self) -> np.ndarray:
        """(V, 3) unit normals of the vertices."""
        return vertex_normals(self.vertices_m, load_body().faces)

    def bone_m(self, name: str) -> np.ndarray:
        """(3,) proximal end of a bone, metres."""
        return self.heads_m[load_body().bone(name)]

    @staticmethod
    @cache
    def cover(*bones: str) -> np.ndarray:
        """(V,) share 0..1 of each vertex that belongs to these bones, not to be written to."""
        asset = load_body()
        held = np.isin(asset.weight_bones, [asset.bone(name) for name in bones])
        share = np.minimum((asset.weights * held).sum(1), 1)
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
    """(V, 3) a tube of cloth around a limb, by cover (V,) in 0..1: nowhere narrower than its radius, nor than the limb.

    Its axis joins the proximal ends of two bones; between them its radius changes linearly.
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
    """(V, 3) cloth that hangs from shoulders, chest, belly or hips, by cover (V,) in 0..1.

    It keeps the fraction `drape` of the widest radius above: 1 falls straight, less follows the body.
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


def above(figure: Figure, height_m: float) -> np.ndarray:
    """(V,) 1 above a height at rest, 0 below it, with a soft edge."""
    return np.clip((figure.vertices_m[:, 2] - height_m) / 0.02 + 0.5, 0, 1)


def folds(vertices_m: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(V,) smooth random field in -1..1 over the rest body: a mean of sine waves with wavelengths of 15 to 60 cm."""
    waves = rng.standard_normal((3, 3), np.float32)
    lengths_m = 0.15 + 0.45 * rng.random((3, 1), np.float32)
    waves *= 2 * np.pi / lengths_m / np.linalg.norm(waves, axis=1, keepdims=True)
    phases = 2 * np.pi * rng.random(3, np.float32)
    return np.sin(vertices_m @ waves.T + phases).mean(1)


Garment = Callable[[Figure, np.random.Generator], np.ndarray]


def _sleeves(figure: Figure, upper_m: float, wrist_m: float, length: float) -> np.ndarray:
    """Sleeves with radii at the shoulder and at the wrist; a length of 1 ends at the wrist, 0.5 at the elbow."""
    pieces, elbow_m = [], upper_m + (wrist_m - upper_m) / 2
    for side in SIDES:
        arm, forearm, hand = f"{side}Arm", f"{side}ForeArm", f"{side}Hand"
        shoulder, elbow, wrist = (figure.bone_m(bone) for bone in (arm, forearm, hand))
        reached = shoulder + (elbow - shoulder) * min(2 * length, 1) + (wrist - elbow) * max(2 * length - 1, 0)
        along = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        within = np.clip((reached - figure.vertices_m) @ along / 0.02 + 0.5, 0, 1)
        pieces.append(tube(figure, (arm, forearm), figure.cover(arm) * within, (upper_m, elbow_m)))
        pieces.append(tube(figure, (forearm, hand), figure.cover(forearm) * within, (elbow_m, wrist_m)))
    return outermost(*pieces)


def _body_of_top(figure: Figure, drape: float, hem_m: float) -> np.ndarray:
    """The trunk of a top, down to a hem that lies hem_m below the hip joints."""
    hem_height_m = figure.bone_m("LeftUpLeg")[2] - hem_m
    cover = figure.cover(*TRUNK, "Hips", "LeftUpLeg", "RightUpLeg") * above(figure, hem_height_m)
    return hanging(figure, cover, drape)


def t_shirt(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Sleeves to the middle of the upper arm or the elbow, tight to boxy."""
    drape, hem_m, wide_m, length = rng.uniform((0.8, 0.0, 0.06, 0.25), (1.08, 0.12, 0.1, 0.5))
    return outermost(_body_of_top(figure, drape, hem_m), _sleeves(figure, wide_m, wide_m, length))


def sweater(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Long sleeves; thin or knitted, with or without a hood in the neck."""
    drape, hem_m, wide_m, wrist_m, thick_m, hood_m = rng.uniform(
        (0.85, 0.0, 0.06, 0.045, 0.004, -0.05), (1.1, 0.12, 0.1, 0.075, 0.025, 0.05)
    )
    trunk = figure.cover(*TRUNK)
    hood = figure.cover("Neck", "Spine1") * np.clip(figure.normals[:, 1], 0, 1) * above(figure, figure.bone_m("LeftArm")[2])
    return outermost(
        _body_of_top(figure, drape, hem_m),
        _sleeves(figure, wide_m, wrist_m, 1.0),
        padded(figure, trunk, thick_m),
        padded(figure, hood, max(hood_m, 0.0)),
    )


def jacket(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """An open jacket, a suit or a quilted jacket: thick, stiff, wide sleeves."""
    drape, hem_m, thick_m, wrist_m = rng.uniform((0.98, 0.05, 0.012, 0.06), (1.15, 0.2, 0.045, 0.09))
    return outermost(
        _body_of_top(figure, drape, hem_m),
        _sleeves(figure, 0.065 + thick_m, wrist_m, 1.0),
        padded(figure, figure.cover(*TRUNK, "Hips"), thick_m),
    )


def tank_top(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Without sleeves, close to the body."""
    return _body_of_top(figure, rng.uniform(0.6, 0.95), 0.0)


def _legs(figure: Figure, thigh_m: float, knee_m: float, hem_m: float, length: float) -> np.ndarray:
    """Trouser legs with radii at the hip, the knee and the ankle; a length of 1 ends at the ankle, 0.5 at the knee."""
    pieces = [padded(figure, figure.cover("Hips", "LeftUpLeg", "RightUpLeg"), 2 * THIN_M)]
    for side in SIDES:
        thigh, shin, foot = f"{side}UpLeg", f"{side}Leg", f"{side}Foot"
        hip_z, ankle_z = figure.bone_m(thigh)[2], figure.bone_m(foot)[2]
        within = above(figure, hip_z + length * 1.04 * (ankle_z - hip_z))
        pieces.append(tube(figure, (thigh, shin), figure.cover(thigh) * within, (thigh_m, knee_m)))
        pieces.append(tube(figure, (shin, foot), figure.cover(shin, foot) * within, (knee_m, hem_m)))
    return outermost(*pieces) * within[:, None]


def _trousers(least_m: tuple[float, float, float], greatest_m: tuple[float, float, float]) -> Garment:
    """Trousers to the ankle, with ranges of the radii at the hip, the knee and the ankle."""
    return lambda figure, rng: _legs(figure, *rng.uniform(least_m, greatest_m), 1.0)


trousers = _trousers((0.085, 0.07, 0.065), (0.105, 0.095, 0.1))
wide_trousers = _trousers((0.1, 0.085, 0.08), (0.125, 0.12, 0.14))  # baggy, flared or sweat trousers


def leggings(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Close to the skin, to the ankle or to the calf."""
    return _legs(figure, 0.0, 0.0, 0.0, rng.uniform(0.8, 1.0))


def shorts(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """From the middle of the thigh to below the knee."""
    thigh_m, knee_m, length = rng.uniform((0.08, 0.085, 0.25), (0.105, 0.12, 0.58))
    return _legs(figure, thigh_m, knee_m, knee_m, length)


def shoes(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Low shoes, trainers or boots: thicker all around, longer at toe and heel, with a sole."""
    wall_m, sole_m, toe_m, boot = rng.uniform((0.006, 0.008, 0.008, 0), (0.016, 0.035, 0.028, 1))
    cover = figure.cover(*(f"{side}{bone}" for side in SIDES for bone in ("Foot", "ToeBase")))
    shaft_m = figure.bone_m("LeftFoot")[2] + (0.04 if boot < 0.8 else 0.18)
    if boot >= 0.8:
        cover = np.minimum(cover + figure.cover("LeftLeg", "RightLeg"), 1)
    cover = cover * (1 - above(figure, shaft_m))
    moved = padded(figure, cover, wall_m)
    down = np.clip(-figure.normals[:, 2], 0, 1) ** 2
    ahead = figure.normals[:, 1] * (figure.normals[:, 2] < 0.7)
    moved[:, 2] -= cover * down * sole_m
    moved[:, 1] += cover * np.where(ahead < 0, ahead, 0.4 * ahead) * toe_m
    return moved


def hair(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Hair on the scalp, cropped to voluminous."""
    thick_m = 0.06 * (0.1 + 0.9 * rng.random() ** 2)
    scalp = figure.cover("Head")
    head = figure.vertices_m[scalp > 0.5]
    front, crown = head[:, 1].min(), head[:, 2].max()  # y grows towards the back
    behind_face = np.clip((figure.vertices_m[:, 1] - front - 0.07) / 0.04, 0, 1)
    above_ears = np.clip((figure.vertices_m[:, 2] - crown + 0.16) / 0.04, 0, 1)
    top = np.clip((figure.vertices_m[:, 2] - crown + 0.04) / 0.03, 0, 1)
    return padded(figure, scalp * np.maximum(behind_face * above_ears, top), thick_m)


# Held back from training: the people of simulated benchmarks wear only these tops and bottoms.
def hooded_top(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """A loose hooded top with the hood over the head: cloth around skull and neck, cuffs at the wrists."""
    drape, hem_m, wide_m, wrist_m, hood_m = rng.uniform((0.95, 0.05, 0.07, 0.038, 0.015), (1.12, 0.18, 0.11, 0.05, 0.04))
    skull = figure.vertices_m[figure.cover("Head") > 0.5]
    behind_face = np.clip((figure.vertices_m[:, 1] - skull[:, 1].min() - 0.06) / 0.03, 0, 1)
    hood = figure.cover("Head", "Neck") * behind_face
    return outermost(_body_of_top(figure, drape, hem_m), _sleeves(figure, wide_m, wrist_m, 1.0), padded(figure, hood, hood_m))


def wide_sleeves(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """A kimono, a poncho or a flamenco blouse: sleeves that widen to the elbow or the wrist."""
    drape, hem_m, wide_m, wrist_m, length = rng.uniform((0.85, -0.05, 0.07, 0.11, 0.55), (1.05, 0.15, 0.1, 0.17, 0.95))
    return outermost(_body_of_top(figure, drape, hem_m), _sleeves(figure, wide_m, wrist_m, length))


def quilted_vest(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """A thick vest without sleeves over a close shirt with long ones."""
    drape, hem_m, thick_m, cuff_m = rng.uniform((0.9, 0.0, 0.02, 0.035), (1.05, 0.1, 0.05, 0.045))
    return outermost(
        _body_of_top(figure, drape, hem_m),
        padded(figure, figure.cover(*TRUNK), thick_m),
        _sleeves(figure, 0.055, cuff_m, 1.0),
    )


def joggers(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Harem or jogging trousers: wide at thigh and knee, gathered at the ankle."""
    thigh_m, knee_m, hem_m, length = rng.uniform((0.105, 0.1, 0.04, 0.85), (0.14, 0.135, 0.055, 1.0))
    return _legs(figure, thigh_m, knee_m, hem_m, length)


flared_trousers = _trousers((0.07, 0.055, 0.12), (0.09, 0.07, 0.17))
"""Close at the thigh and the knee, wide at the hem."""


def leg_warmers(figure: Figure, rng: np.random.Generator) -> np.ndarray:
    """Tights with thick knitted tubes around the shins."""
    thick_m, top = rng.uniform((0.01, 0.7), (0.03, 1.0))
    knee_z, ankle_z = (figure.bone_m(bone)[2] for bone in ("LeftLeg", "LeftFoot"))
    knitted = figure.cover("LeftLeg", "RightLeg") * (1 - above(figure, ankle_z + top * (knee_z - ankle_z)))
    return outermost(_legs(figure, 0.0, 0.0, 0.0, 1.0), padded(figure, knitted, thick_m))


class Wardrobe(NamedTuple):
    """Kinds of garments to draw from: name to relative weight and garment."""

    tops: dict[str, tuple[float, Garment]]
    bottoms: dict[str, tuple[float, Garment]]


ORDINARY = Wardrobe(
    {"t_shirt": (4.0, t_shirt), "sweater": (3.0, sweater), "jacket": (2.0, jacket), "tank_top": (1.0, tank_top)},
    {
        "trousers": (5.0, trousers),
        "wide_trousers": (2.5, wide_trousers),
        "shorts": (1.5, shorts),
        "leggings": (1.0, leggings),
    },
)
HELD_BACK = Wardrobe(
    {"hooded_top": (1.0, hooded_top), "wide_sleeves": (1.0, wide_sleeves), "quilted_vest": (1.0, quilted_vest)},
    {"joggers": (1.0, joggers), "flared_trousers": (1.0, flared_trousers), "leg_warmers": (1.0, leg_warmers)},
)
"""Of the people of simulated benchmarks. No training set has these kinds."""
