"""Human bodies: random people drawn from the baked shape space, and dressed.

World frame: z up; a person in the T-pose faces -y, and the person's left is +x. The frame of every bone is aligned with
the world in the T-pose. A bone's local rotation is therefore relative to the T-pose, for every body shape and every motion
source. Anny's own A-pose is only the bind pose of the skin.
"""

import itertools
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from kpopnet.errors import check_between, check_one_of
from synth.body.asset import BodyAsset, load_body, load_children
from synth.body.garments import HELD_BACK, ORDINARY, Figure, Wardrobe
from synth.body.outfit import ClothesConfig, put_on, unworn


@dataclass(frozen=True)
class BodyConfig:
    """The distribution of body shapes and clothes.

    Attributes:
        shape_jitter: standard deviation of each shape coefficient about those of a baked person, in standard deviations of
            the component over the baked people.
        children: share of the people who are 6 to 12 years old; the others are adults.
        clothes: what people wear and carry.
    """

    shape_jitter: float = 0.25
    children: float = 0.0
    clothes: ClothesConfig = field(default_factory=ClothesConfig)

    def __post_init__(self) -> None:
        check_between("body.shape_jitter", self.shape_jitter, 0, 2)
        check_between("body.children", self.children, 0, 1)


@dataclass(frozen=True, eq=False)
class Person:
    """One body at rest (Anny's A-pose)."""

    bare_m: np.ndarray  # (V, 3) skin at rest, metres: what bodies collide with
    # (N, 3) what is seen at rest, metres: the body's V vertices on skin or cloth, then those of the pieces of clothes (see
    # `synth.body.outfit.Skin`)
    vertices_m: np.ndarray
    heads_m: np.ndarray  # (B, 3) proximal end (head) of each bone at rest, metres
    joints_m: np.ndarray  # (15, 3) labelled joints at rest, metres
    t_pose: np.ndarray  # (B, 3, 3) world rotation of each bone from the rest pose to the T-pose
    leg_m: float  # length from hip through knee to ankle, metres


SPLIT_RANGES = {"train": (0.0, 0.8), "validation": (0.8, 0.9), "test": (0.9, 1.0), "benchmark": (0.9, 1.0)}
"""Range of the baked adults, and children, as fractions of all, near which the people of each split are drawn. Training and
validation share none with another split. The people of the benchmarks are near those of `test`, in garments that no other split
has."""

BMI_MEDIAN, BMI_LOG_DEVIATION = 24.5, 0.17
"""Body mass index of adults, kg/m², as a log-normal distribution: a tenth below 19.7, a tenth above 30.5 (WHO, NCD-RisC 2016,
between its regions). Anny's own sampling draws a tenth below 18.4."""

_BMI_BANDWIDTH = 0.08


def _range(split: str, asset: BodyAsset) -> tuple[int, int]:
    """The first of a split's baked people, and the first behind the last."""
    first, end = (int(fraction * len(asset.people)) for fraction in SPLIT_RANGES[split])
    return first, end


@cache
def _adults(split: str) -> tuple[int, np.ndarray]:
    """First of a split's baked adults, and their cumulative probabilities, which give them the body mass index of adults."""
    first, end = _range(split, load_body())
    log_bmi = np.log(load_body().facts[first:end, 3].astype(float))
    density = np.exp(-0.5 * ((log_bmi[:, None] - log_bmi) / _BMI_BANDWIDTH) ** 2).mean(axis=1)
    wanted = np.exp(-0.5 * ((log_bmi - np.log(BMI_MEDIAN)) / BMI_LOG_DEVIATION) ** 2)
    share = np.cumsum(np.minimum(wanted / density, 20 * np.median(wanted / density)))
    return first, share / share[-1]


def draw_person(rng: np.random.Generator, config: BodyConfig, split: str) -> Person:
    """A dressed person near one of the split's baked people; of the split `benchmark`, in HELD_BACK garments.

    Raises InputError for another split.
    """
    check_one_of("split", split, SPLIT_RANGES)
    if config.children and rng.random() < config.children:
        asset = load_children()
        first, end = _range(split, asset)
        near = int(rng.integers(first, end))
    else:
        asset, (first, thresholds) = load_body(), _adults(split)
        near = first + int(np.searchsorted(thresholds, rng.random(), side="right"))
    coefficients = asset.people[near]
    coefficients = coefficients + config.shape_jitter * rng.standard_normal(len(coefficients), np.float32)
    wardrobe = HELD_BACK if split == "benchmark" else ORDINARY
    return dress(shape_person(coefficients, asset), bool(asset.facts[near, 0] > 0.5), rng, config.clothes, wardrobe)


def shape_person(coefficients: np.ndarray, asset: BodyAsset) -> Person:
    """The body without clothes and hair for (K,) shape coefficients of `load_body`, or of `load_children`."""
    points = asset.mean.copy()
    # One component after the other: the last bits of a BLAS product differ between machines.
    for coefficient, displacement in zip(coefficients.astype(np.float32), asset.basis, strict=True):
        points += coefficient * displacement
    points = points.reshape(-1, 3)
    num_vertices, num_bones = len(asset.weights), len(asset.bone_names)
    vertices, heads, joints = np.split(points, [num_vertices, num_vertices + num_bones])
    hip, knee, ankle = (heads[asset.bone(name)] for name in ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    pieces = unworn(Figure(vertices, heads, female=False)).values()
    return Person(
        bare_m=vertices,
        vertices_m=np.concatenate([vertices, *pieces]).astype(np.float32),
        heads_m=heads,
        joints_m=joints,
        t_pose=_t_pose(heads, asset),
        leg_m=float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)),
    )


def dress(
    person: Person, female: bool, rng: np.random.Generator, config: ClothesConfig, wardrobe: Wardrobe = ORDINARY
) -> Person:
    """Puts an outfit on an unclothed person. Bones and joints do not move."""
    figure = Figure(person.bare_m, person.heads_m, female)
    return replace(person, vertices_m=np.concatenate(put_on(figure, rng, config, wardrobe)))


def _t_pose(heads: np.ndarray, asset: BodyAsset) -> np.ndarray:
    """(B, 3, 3) rotation of each bone from the A-pose to the T-pose.

    Each limb bone is rotated, after its parent, by the smallest rotation that aligns it with its axis (arms with x, legs
    with -z). Fingers rotate with the hand. All other bones keep their orientation.
    """
    rotations = np.tile(np.eye(3), (len(heads), 1, 1))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        arm = (f"{side}Arm", f"{side}ForeArm", f"{side}Hand", f"{side}FingerBase")
        leg = (f"{side}UpLeg", f"{side}Leg", f"{side}Foot")
        for chain, axis in ((arm, np.array([sign, 0, 0])), (leg, np.array([0, 0, -1.0]))):
            rotation = np.eye(3)
            for name, following in itertools.pairwise(chain):
                direction = rotation @ (heads[asset.bone(following)] - heads[asset.bone(name)]).astype(float)
                rotation = _smallest_rotation(direction / np.linalg.norm(direction), axis) @ rotation
                rotations[asset.bone(name)] = rotation
        for finger in (f"{side[0]}Thumb", f"{side}FingerBase", f"{side}HandFinger1"):
            rotations[asset.bone(finger)] = rotations[asset.bone(f"{side}Hand")]
    return rotations


def _smallest_rotation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation about a x b that maps unit vector a to unit vector b (Rodrigues); a must not be -b."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + cross + cross @ cross / (1 + a @ b)
