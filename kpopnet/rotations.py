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


def continuous(quats: np.ndarray) -> np.ndarray:
    """(T, B, 4) float64 rotations whose signs do not change from frame to frame, so that they can be averaged."""
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


def of_matrix(matrix: np.ndarray) -> np.ndarray:
    """The quaternion of a (3, 3) matrix of a rotation, its largest part positive."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    products = np.array([  # of each two of x, y, z and w, four times
        [1 + xx - yy - zz, xy + yx, xz + zx, zy - yz],
        [xy + yx, 1 - xx + yy - zz, yz + zy, xz - zx],
        [xz + zx, yz + zy, 1 - xx - yy + zz, yx - xy],
        [zy - yz, xz - zx, yx - xy, 1 + xx + yy + zz],
    ])  # fmt: skip
    return normalised(np.roll(products[np.diag(products).argmax()], 1))
