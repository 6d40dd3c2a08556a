"""Fits a body to the measured points by least squares: a few Gauss-Newton iterations from an approximate pose.

Beyond the paper. The unknowns are the joint positions. The terms: distances of the points to the surface of the union of
all parts; parts outside the silhouette or in front of the measured depth; distances between joints; penetration of limbs;
joint priors; distance to the start pose. In joint positions all terms but the last are nearly linear, so few iterations
suffice. Eliminated from hands and feet inwards, the equations cost less than the search for the nearest parts. An iteration
moves all joints at once: a rotation of the body takes one step instead of diffusing from joint to joint.

The fit is local. It keeps a pose near the truth and may not converge from farther away; for that there is
`kpopnet.tracker.fit.hypotheses`, and `kpopnet.tracker.fit.objective` measures the result. Points and joints are in the
camera frame in metres throughout.
"""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import COLLISION_PAIRS, LIMBS, PARTS, ROW_TO_JOINT, TORSO_JOINTS, Body
from kpopnet.geometry.cones import extend_joints, free_space_violation, nearest_parts, part_segments, torso_frame
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.fit.objective import (
    COLLISION_SAMPLES,
    JOINT_PRIOR_WEIGHT,
    JOINT_PRIORS,
    PENETRATION_WEIGHT,
    joint_prior_shortfall,
    penetration,
)

MAX_ASSOCIATION_M = 0.3
"""Points farther than this from every part, in metres, are ignored: they may belong to a misplaced limb."""

ROBUST_SCALE_M = 0.12
"""Scale of the robust weight in metres: a residual of this size has a quarter of the weight (Geman and McClure 1987)."""

MIN_AXIS_DISTANCE_M = 1e-3
"""Minimum distance to a part's axis, in metres, by which a point's direction is normalised."""

LENGTH_WEIGHT = 20.0
FREE_SPACE_STEP_WEIGHT = 0.05
START_PRIOR_WEIGHT = 0.01
"""Weights relative to 1 for all points together; each is distributed over its distances, parts or joints.

`FREE_SPACE_STEP_WEIGHT` is the weight of free space in a Gauss-Newton step. The objective that compares whole poses has
another value for the same term (`objective.FREE_SPACE_WEIGHT`); whether one value serves both has not been measured."""

MAX_UPDATE_M, CONVERGED_UPDATE_M = 0.15, 0.002
"""Largest update of a coordinate per iteration, and the update below which the fit has converged, in metres."""

SAMPLES_PER_PART = 3
MAX_FREE_SPACE_RESIDUAL_M = 0.2
"""Samples of the free-space term on each part, and its largest residual in metres."""

_ELIMINATION = [
    *(Joint.RIGHT_HAND, Joint.RIGHT_ELBOW, Joint.LEFT_HAND, Joint.LEFT_ELBOW),
    *(Joint.RIGHT_FOOT, Joint.RIGHT_KNEE, Joint.LEFT_FOOT, Joint.LEFT_KNEE),
    *TORSO_JOINTS,
]
COLUMN = np.empty(len(ROW_TO_JOINT), np.int64)
"""(25,) the first of the three unknowns of every row."""
COLUMN[_ELIMINATION] = 3 * np.arange(NUM_JOINTS)
COLUMN[NUM_JOINTS:] = COLUMN[ROW_TO_JOINT[NUM_JOINTS:]]


SYMMETRIC_INDEX = np.array([(0, 1, 2), (1, 3, 4), (2, 4, 5)])
"""Index of each entry of a symmetric 3 x 3 matrix among its six distinct entries."""


@njit(cache=True)
def _add_residual(matrix, rhs, i, j, coefficient_i, coefficient_j, nx, ny, nz, residual, weight):
    """Adds weight (residual + n . (c_i dx_i + c_j dx_j))^2 to the normal equations, with c_i and c_j the two coefficients."""
    n = (nx, ny, nz)
    for c in range(3):
        rhs[i + c] -= weight * coefficient_i * n[c] * residual
        rhs[j + c] -= weight * coefficient_j * n[c] * residual
        for d in range(3):
            product = weight * n[c] * n[d]
            matrix[i + c, i + d] += coefficient_i * coefficient_i * product
            matrix[j + c, j + d] += coefficient_j * coefficient_j * product
            matrix[i + c, j + d] += coefficient_i * coefficient_j * product
            matrix[j + d, i + c] += coefficient_i * coefficient_j * product


@njit(cache=True)
def solve(matrix, rhs):
    """Solves a symmetric positive definite system in place by Cholesky factorisation with skyline storage.

    Zeros left of each row's first entry are skipped. Only the lower half of the matrix is read. The solution replaces `rhs`.
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


@njit(cache=True)
def _add_points(matrix, rhs, segments, parts, points, stride):
    """Adds every point's residual as `_add_residual` does, summed per part first: a part's points act on the same joints."""
    part, distances, along = nearest_parts(segments, points, stride)
    rhs_near, rhs_far = np.zeros((len(parts), 3)), np.zeros((len(parts), 3))
    block_near, block_cross, block_far = np.zeros((len(parts), 6)), np.zeros((len(parts), 6)), np.zeros((len(parts), 6))
    for i in range(len(part)):
        distance = float(distances[i])
        if abs(distance) > MAX_ASSOCIATION_M:
            continue
        k, t = part[i], float(along[i])
        scale = 1 / max(distance + segments[k, 7] + t * segments[k, 8], MIN_AXIS_DISTANCE_M)
        nx = scale * (points[i * stride, 0] - segments[k, 0] - t * segments[k, 3])
        ny = scale * (points[i * stride, 1] - segments[k, 1] - t * segments[k, 4])
        nz = scale * (points[i * stride, 2] - segments[k, 2] - t * segments[k, 5])
        robust = ROBUST_SCALE_M**2 / (ROBUST_SCALE_M**2 + distance * distance)
        weight = robust * robust / len(part)
        s = 1 - t
        force = weight * distance
        for c, n in enumerate((nx, ny, nz)):
            rhs_near[k, c] += s * force * n
            rhs_far[k, c] += t * force * n
        for e, product in enumerate((nx * nx, nx * ny, nx * nz, ny * ny, ny * nz, nz * nz)):
            block_near[k, e] += s * s * weight * product
            block_cross[k, e] += s * t * weight * product
            block_far[k, e] += t * t * weight * product
    for k in range(len(parts)):
        i, j = COLUMN[parts[k, 0]], COLUMN[parts[k, 1]]
        for c in range(3):
            rhs[i + c] += rhs_near[k, c]
            rhs[j + c] += rhs_far[k, c]
            for d in range(3):
                e = SYMMETRIC_INDEX[c, d]
                matrix[i + c, i + d] += block_near[k, e]
                matrix[j + c, j + d] += block_far[k, e]
                matrix[i + c, j + d] += block_cross[k, e]
                matrix[j + c, i + d] += block_cross[k, e]


@njit(cache=True)
def _add_free_space(matrix, rhs, segments, parts, depth, nearest, intrinsics):
    """Adds the free-space violations of samples on the axes of all parts."""
    weight = FREE_SPACE_STEP_WEIGHT / (SAMPLES_PER_PART * len(parts))
    for k in range(len(parts)):
        for q in range(SAMPLES_PER_PART):
            t = q / (SAMPLES_PER_PART - 1)
            mx, my, mz, _ = free_space_violation(segments, k, t, depth, nearest, intrinsics)
            violation = math.sqrt(mx * mx + my * my + mz * mz)
            if violation > 0:
                i, j = COLUMN[parts[k, 0]], COLUMN[parts[k, 1]]
                residual = min(violation, MAX_FREE_SPACE_RESIDUAL_M)
                _add_residual(matrix, rhs, i, j, t - 1, -t, mx / violation, my / violation, mz / violation, residual, weight)


@njit(cache=True)
def _add_lengths(matrix, rhs, joints, pairs, stiffness, lengths, elevating_arm, elevation_gain):
    """Adds the deviations of the distances between joints; shoulder distances depend on the elevation of the arms."""
    down = torso_frame(joints)[1]
    elevation = np.zeros(2)
    for arm in range(2):
        along, length = 0.0, 1e-9
        for c in range(3):
            offset = joints[LIMBS[arm, 1], c] - joints[LIMBS[arm, 0], c]
            along -= offset * down[c]
            length += offset * offset
        elevation[arm] = along / math.sqrt(length)
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        dx, dy, dz = joints[b, 0] - joints[a, 0], joints[b, 1] - joints[a, 1], joints[b, 2] - joints[a, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-9
        target = lengths[k]
        if elevating_arm[k] >= 0:
            cosine = elevation[elevating_arm[k]]
            target += elevation_gain[k, 0] * cosine + elevation_gain[k, 1] * cosine * cosine
        weight = LENGTH_WEIGHT * stiffness[k] / len(pairs)
        i, j = COLUMN[a], COLUMN[b]
        _add_residual(matrix, rhs, i, j, -1.0, 1.0, dx / length, dy / length, dz / length, length - target, weight)


@njit(cache=True)
def _add_collisions(matrix, rhs, segments, parts):
    """Adds the penetration of samples on forearms and shins into the parts of `COLLISION_PAIRS`."""
    for pair in range(len(COLLISION_PAIRS)):
        lower_part = COLLISION_PAIRS[pair, 0]
        i, j = COLUMN[parts[lower_part, 0]], COLUMN[parts[lower_part, 1]]
        for q in range(COLLISION_SAMPLES):
            t = q / (COLLISION_SAMPLES - 1)
            depth, nx, ny, nz = penetration(segments, lower_part, COLLISION_PAIRS[pair, 1], t)
            if depth > 0:
                _add_residual(matrix, rhs, i, j, t - 1, -t, nx, ny, nz, depth, PENETRATION_WEIGHT)


@njit(cache=True)
def _add_joint_priors(matrix, rhs, joints):
    """Adds the shortfalls of the joint priors."""
    forward = torso_frame(joints)[2]
    for prior in range(len(JOINT_PRIORS)):
        shortfall = joint_prior_shortfall(joints, prior, forward)
        if shortfall > 0:
            # With three joints (hip, knee, foot) the foot moves against the knee and the hip is fixed; with two both move.
            i, j = COLUMN[JOINT_PRIORS[prior, 0]], COLUMN[JOINT_PRIORS[prior, 2]]
            coefficient = -0.5 if JOINT_PRIORS[prior, 1] != JOINT_PRIORS[prior, 2] else -1.0
            _add_residual(
                matrix, rhs, i, j, -1.0, -coefficient, forward[0], forward[1], forward[2], shortfall, JOINT_PRIOR_WEIGHT[prior]
            )


@njit(cache=True)
def _fit(
    start, points, stride, depth, nearest, intrinsics, parts, radii, pairs, stiffness, lengths, elevating_arm, elevation_gain,
    trunk_offsets, iterations, prior_weight,
):  # fmt: skip
    """`fit` as a kernel on arrays."""
    joints = start.copy()
    size = 3 * len(joints)
    matrix, rhs = np.empty((size, size)), np.empty(size)
    for _ in range(iterations):
        matrix[:], rhs[:] = 0.0, 0.0
        segments = part_segments(extend_joints(joints, trunk_offsets), parts, radii)
        _add_points(matrix, rhs, segments, parts, points, stride)
        _add_free_space(matrix, rhs, segments, parts, depth, nearest, intrinsics)
        _add_lengths(matrix, rhs, joints, pairs, stiffness, lengths, elevating_arm, elevation_gain)
        _add_collisions(matrix, rhs, segments, parts)
        _add_joint_priors(matrix, rhs, joints)
        for j in range(len(joints)):
            for c in range(3):
                matrix[COLUMN[j] + c, COLUMN[j] + c] += prior_weight / len(joints)
                rhs[COLUMN[j] + c] += prior_weight / len(joints) * (start[j, c] - joints[j, c])
        solve(matrix, rhs)
        max_update = np.abs(rhs).max()
        for j in range(len(joints)):
            for c in range(3):
                joints[j, c] += rhs[COLUMN[j] + c] * min(1.0, MAX_UPDATE_M / (max_update + 1e-12))
        if max_update < CONVERGED_UPDATE_M:
            break
    return joints


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
    return _fit(
        np.ascontiguousarray(joints_m, np.float64), grid.points_m, stride, grid.depth_m, grid.nearest,
        grid.intrinsics, PARTS, body.radii_m, body.pairs, body.stiffness, body.lengths_m,
        body.elevating_arm, body.elevation_gain_m, body.trunk_offsets_m, iterations, prior_weight,
    )  # fmt: skip
