"""Steps that both families of learners' faults share: rotations that can be averaged, small rotations, the floor."""

import numpy as np

from synth.motion.skeleton import Motion, height_above_floor


def continuous(quats: np.ndarray) -> np.ndarray:
    """(T, 23, 4) float64 rotations whose signs do not change from frame to frame, so that they can be averaged."""
    quats = quats.astype(np.float64)
    signs = np.where((quats[1:] * quats[:-1]).sum(axis=-1, keepdims=True) < 0, -1, 1)
    quats[1:] *= np.cumprod(signs, axis=0)
    return quats


def towards(quats: np.ndarray, others: np.ndarray, weight: np.ndarray | float) -> np.ndarray:
    """Linear interpolation from (..., 4) rotations (weight 0) to others (weight 1), the shorter way; not normalised."""
    others = np.where((quats * others).sum(axis=-1, keepdims=True) < 0, -others, others)
    return quats + weight * (others - quats)


def normalised(quats: np.ndarray) -> np.ndarray:
    return quats / np.linalg.norm(quats, axis=-1, keepdims=True)


def turns(rotation_rad: np.ndarray) -> np.ndarray:
    """(..., 4) quaternions of (..., 3) rotation vectors, radians."""
    angle = np.linalg.norm(rotation_rad, axis=-1, keepdims=True)
    axis = rotation_rad / np.maximum(angle, 1e-12)
    return np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * axis], axis=-1)


def as_high_as(like: Motion, quats: np.ndarray, root_m: np.ndarray) -> np.ndarray:
    """(T, 3) path, metres, on which the (T, 23, 4) pose is as high above the floor as another motion in each frame."""
    path_m = root_m.astype(np.float64)
    path_m[:, 1] = np.maximum(height_above_floor(like.quats, like.root_m), 0) - height_above_floor(quats, path_m * [1, 0, 1])
    return path_m
