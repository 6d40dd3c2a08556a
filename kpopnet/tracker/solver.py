"""Fits a body to the measured points by least squares: a few Gauss-Newton iterations from an approximate pose.

Beyond the paper. The unknowns are the joint positions, the terms those of `kpopnet.tracker.energy` and the distance to the
start pose. In joint positions nearly all of them are linear, so few iterations suffice. An iteration moves all joints at once:
a rotation of the body takes one step instead of diffusing from joint to joint. The fit is local: it keeps a pose near the truth
and may not converge from farther away, where `kpopnet.tracker.limbs` helps.
"""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import COLLISION_PAIRS, PARTS, Body
from kpopnet.geometry.cones import extend_joints, nearest_parts, part_segments, torso_frame
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.tracker.energy import (
    COLUMN,
    JOINT_PRIORS,
    add_free_space,
    add_joint_priors,
    add_lengths,
    add_penetration,
    add_points,
    free_space_cost,
    joint_prior,
    penetration_cost,
    points_cost,
)

START_PRIOR_WEIGHT = 0.01
"""Weight of the mean squared distance to the start pose, relative to 1 for all points together."""

MAX_UPDATE_M, CONVERGED_UPDATE_M = 0.15, 0.002
"""Largest update of a coordinate per iteration, and the update below which the fit has converged, in metres."""


def pose_cost(joints_m: np.ndarray, grid: DepthGrid, body: Body, stride: int = 1) -> float:
    """Cost of a pose given the depth image, in square metres: all terms of the energy but the lengths.

    Args:
        joints_m: (15, 3) the pose.
        grid: the depth image.
        body: the person's body.
        stride: only every `stride`th point is used.
    """
    return _pose_cost(joints_m, grid, body, stride)


@njit(cache=True)
def _pose_cost(joints, grid, body, stride):
    """`pose_cost` as a kernel."""
    segments = part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m)
    cost = points_cost(nearest_parts(segments, grid.points_m, stride)[1])
    depth, nearest, intrinsics = grid.depth_m, grid.nearest, grid.intrinsics
    for k in range(len(segments)):
        cost += free_space_cost(segments, k, depth, nearest, intrinsics)
    cost += joint_prior(joints, torso_frame(joints)[2], 0, len(JOINT_PRIORS))
    return cost + penetration_cost(segments, 0, len(COLLISION_PAIRS), np.inf)


def fit(
    joints_m: np.ndarray,
    grid: DepthGrid,
    body: Body,
    iterations: int,
    stride: int = 1,
    prior_weight: float = START_PRIOR_WEIGHT,
) -> np.ndarray:
    """Fits the body's joints to the depth image.

    Args:
        joints_m: (15, 3) the start pose.
        grid: the depth image.
        body: the person's body.
        iterations: maximum number of Gauss-Newton iterations.
        stride: only every `stride`th point is used.
        prior_weight: weight of the distance to the start pose, relative to 1 for all points together.

    Returns:
        (15, 3) float64 joints in the camera frame in metres.
    """
    return _fit(np.ascontiguousarray(joints_m, np.float64), grid, body, iterations, stride, prior_weight)


@njit(cache=True)
def _fit(start, grid, body, iterations, stride, start_weight):
    """`fit` as a kernel."""
    joints = start.copy()
    size = 3 * len(joints)
    matrix, rhs = np.empty((size, size)), np.empty(size)
    for _ in range(iterations):
        matrix[:], rhs[:] = 0.0, 0.0
        segments = part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m)
        nearest, frame = nearest_parts(segments, grid.points_m, stride), torso_frame(joints)
        add_points(matrix, rhs, segments, grid.points_m, nearest, stride)
        add_free_space(matrix, rhs, segments, grid.depth_m, grid.nearest, grid.intrinsics)
        add_lengths(matrix, rhs, joints, frame, body)
        add_penetration(matrix, rhs, segments)
        add_joint_priors(matrix, rhs, joints, frame[2])
        for j in range(len(joints)):  # the distance to the start pose
            for c in range(3):
                matrix[COLUMN[j] + c, COLUMN[j] + c] += start_weight / len(joints)
                rhs[COLUMN[j] + c] += start_weight / len(joints) * (start[j, c] - joints[j, c])
        solve(matrix, rhs)
        max_update = np.abs(rhs).max()
        factor = min(1.0, MAX_UPDATE_M / (max_update + 1e-12))
        for j in range(len(joints)):
            for c in range(3):
                joints[j, c] += rhs[COLUMN[j] + c] * factor
        if max_update < CONVERGED_UPDATE_M:
            break
    return joints


@njit(cache=True)
def solve(matrix, rhs):
    """Solves a symmetric positive definite system in place by Cholesky factorisation with skyline storage.

    Zeros left of each row's first entry are skipped: eliminated from hands and feet inwards, the equations cost less than the
    search for the nearest parts. Only the lower half of the matrix is read. The solution replaces `rhs`.
    """
    size = len(rhs)
    first_nonzero = np.empty(size, np.int64)
    for i in range(size):
        start = 0
        while matrix[i, start] == 0.0 and start < i:
            start += 1
        first_nonzero[i] = start
        for j in range(start, i):
            total = matrix[i, j]
            for k in range(max(start, first_nonzero[j]), j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        total = matrix[i, i]
        for k in range(start, i):
            total -= matrix[i, k] * matrix[i, k]
        matrix[i, i] = math.sqrt(max(total, 1e-12))
    for i in range(size):
        for k in range(first_nonzero[i], i):
            rhs[i] -= matrix[i, k] * rhs[k]
        rhs[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        rhs[i] /= matrix[i, i]
        for k in range(first_nonzero[i], i):
            rhs[k] -= matrix[i, k] * rhs[i]
