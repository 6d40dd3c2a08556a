"""Rotations as unit quaternions (..., 4), w first."""

import numpy as np


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions (..., 4): rotation b followed by rotation a."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    product[..., 0] = aw * bw - ax * bx - ay * by - az * bz
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def conjugate(quats: np.ndarray) -> np.ndarray:
    """Inverse rotations of unit quaternions (..., 4)."""
    return quats * np.array([1, -1, -1, -1], quats.dtype)


def rotate(quats: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Rotates vectors (..., 3) by unit quaternions (..., 4)."""
    w, x, y, z = quats[..., 0], quats[..., 1], quats[..., 2], quats[..., 3]
    vx, vy, vz = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return np.stack([vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx], axis=-1)


def about(axis: int, angles: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) of rotations by `angles` (radians) about axis 0 (X), 1 (Y) or 2 (Z)."""
    quats = np.zeros((*np.shape(angles), 4))
    quats[..., 0] = np.cos(angles / 2)
    quats[..., 1 + axis] = np.sin(angles / 2)
    return quats
