"""The fit of a body to the measured points: the energy of a pose, term by term, and its Gauss-Newton minimisation.

Beyond the paper. Points and free space tie the body to the depth; lengths, penetration and joint priors hold it together. A
cost compares whole poses, a linearisation moves one: the `add_...` functions add a term to the normal equations of a step,
(45, 45) `matrix` @ displacements of the joints = (45,) `rhs`. Lengths have no cost: all poses that are compared come from
`fit`, or have the body's lengths by construction. The unknowns are joint positions, in which nearly all terms are linear: few
iterations suffice, and a rotation of the body takes one. The fit is local: farther from the truth, `kpopnet.tracker.limbs`
helps. Points and joints are in the camera frame, in metres; `segments` are those of `kpopnet.geometry.cones.part_segments`.
"""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import COLLISION_PAIRS, LIMBS, PARTS, ROW_TO_JOINT, Body
from kpopnet.geometry.cones import axis_point, body_segments, nearest_parts, signed_distance, torso_frame
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.skeleton import NUM_JOINTS, Joint

COLUMN = np.empty(len(ROW_TO_JOINT), np.int64)
"""(25,) the first of the three unknowns of every row, which are eliminated from hands and feet inwards."""
_OF_LIMBS = LIMBS[:, :0:-1].ravel()
COLUMN[[*_OF_LIMBS, *np.setdiff1d(Joint, _OF_LIMBS)]] = 3 * np.arange(NUM_JOINTS)
COLUMN[NUM_JOINTS:] = COLUMN[ROW_TO_JOINT[NUM_JOINTS:]]

PART_COLUMNS = COLUMN[PARTS]
"""(P, 2) the first unknowns of both ends of every part."""


@njit(cache=True)
def add_residual(matrix, rhs, ends, coefficients, direction, residual, weight):
    """Adds weight (residual + n . (c_i dx_i + c_j dx_j))^2 for the unknowns i, j = `ends`, and n = `direction`."""
    (i, j), (ci, cj) = ends, coefficients
    for c in range(3):
        rhs[i + c] -= weight * ci * direction[c] * residual
        rhs[j + c] -= weight * cj * direction[c] * residual
        for d in range(3):
            product = weight * direction[c] * direction[d]
            matrix[i + c, i + d] += ci * ci * product
            matrix[j + c, j + d] += cj * cj * product
            matrix[i + c, j + d] += ci * cj * product
            matrix[j + d, i + c] += ci * cj * product


# Points: the distances of the measured points to the surface of the union of all parts.

MAX_RESIDUAL_M = 0.12
"""Residuals are clipped to this value in the cost, in metres: all outliers cost the same."""

MAX_ASSOCIATION_M = 0.3
"""Points farther than this from every part, in metres, move nothing: they may belong to a misplaced limb."""

ROBUST_SCALE_M = 0.12
"""Scale of the robust weight in metres: a residual of this size has a quarter of the weight (Geman and McClure 1987)."""

MIN_AXIS_DISTANCE_M = 1e-3
"""Minimum distance to a part's axis, in metres, by which a point's direction is normalised."""

SYMMETRIC_INDEX = np.array([(0, 1, 2), (1, 3, 4), (2, 4, 5)])
"""Index of each entry of a symmetric 3 x 3 matrix among its six distinct entries."""


@njit(cache=True)
def points_cost(distances):
    """Mean square of (n,) signed distances to the surface, clipped, in square metres."""
    total = 0.0
    for distance in distances:
        total += min(distance * distance, MAX_RESIDUAL_M * MAX_RESIDUAL_M)
    return total / max(len(distances), 1)


@njit(cache=True)
def add_points(matrix, rhs, segments, points, nearest, stride):
    """Adds every point's residual as `add_residual` does, summed per part first: a part's points act on the same joints.

    `nearest` are the parts, distances and positions of every `stride`th point, of `kpopnet.geometry.cones.nearest_parts`.
    """
    part, distances, along = nearest
    forces = np.zeros((len(segments), 2, 3))
    blocks = np.zeros((len(segments), 3, 6))  # near end, both, far end
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
            forces[k, 0, c] += s * force * n
            forces[k, 1, c] += t * force * n
        for e, product in enumerate((nx * nx, nx * ny, nx * nz, ny * ny, ny * nz, nz * nz)):
            blocks[k, 0, e] += s * s * weight * product
            blocks[k, 1, e] += s * t * weight * product
            blocks[k, 2, e] += t * t * weight * product
    for k in range(len(segments)):
        i, j = PART_COLUMNS[k, 0], PART_COLUMNS[k, 1]
        for c in range(3):
            rhs[i + c] += forces[k, 0, c]
            rhs[j + c] += forces[k, 1, c]
            for d in range(3):
                e = SYMMETRIC_INDEX[c, d]
                matrix[i + c, i + d] += blocks[k, 0, e]
                matrix[j + c, j + d] += blocks[k, 2, e]
                matrix[i + c, j + d] += blocks[k, 1, e]
                matrix[j + c, i + d] += blocks[k, 1, e]


# Free space: parts where the depth image shows none, outside the silhouette or in front of the measured depth.

FREE_SPACE_WEIGHT = 0.1
"""Weight of the mean over all parts, relative to 1 for all points together."""

FREE_SPACE_SAMPLES = 5
"""Samples on the axis of each part."""

HIDDEN_COST_M2 = 0.006
"""Cost in square metres of a sample on a part that is hidden behind the measured depth: visible poses are more likely."""

FRONT_TOLERANCE_M = 0.04
"""A part may lie this far in front of the measured depth, in metres: error of its thickness and sensor noise."""

HIDDEN_DEPTH_M = 0.06
"""A part whose front surface is farther behind the measured depth, in metres, counts as hidden."""

MAX_PUSH_BACK_M, MAX_STEP_RESIDUAL_M = 0.3, 0.2
"""Largest push away from the camera, and largest residual in a step, in metres."""

MIN_Z_M = 0.2
"""Samples nearer to the camera's plane than this, in metres, are not projected."""


@njit(cache=True)
def free_space_violation(segments, k, along, depth, nearest, intrinsics):
    """How the point at position `along` (0..1) on the axis of part k contradicts the depth image: dx, dy, dz, metres, and
    whether the part is hidden there.

    Outside the silhouette: the vector to the nearest measured cell, at the point's depth. In front of the measured depth: the
    vector away from the camera. The arrays of the grid come one by one: a NamedTuple of them would double the time of a fit.
    """
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    x, y, z = axis_point(segments, k, along)
    if z < MIN_Z_M:
        return 0.0, 0.0, 0.0, False
    u, v = int(np.rint(x * fx / z + cx)), int(np.rint(y * fy / z + cy))
    if u < 0 or v < 0 or v >= depth.shape[0] or u >= depth.shape[1]:
        return 0.0, 0.0, 0.0, False
    if depth[v, u] > 0:
        gap = depth[v, u] - (z - segments[k, 7] - along * segments[k, 8])
        return 0.0, 0.0, (min(gap, MAX_PUSH_BACK_M) if gap > FRONT_TOLERANCE_M else 0.0), gap < -HIDDEN_DEPTH_M
    side = int(intrinsics[4])
    cell_row, cell_column = v // side, u // side
    row, column = nearest[cell_row, cell_column, 0], nearest[cell_row, cell_column, 1]
    if row < 0 or (row == cell_row and column == cell_column):
        return 0.0, 0.0, 0.0, False
    middle = (side - 1) / 2
    return (column * side + middle - cx) * z / fx - x, (row * side + middle - cy) * z / fy - y, 0.0, False


@njit(cache=True)
def free_space_cost(segments, k, depth, nearest, intrinsics):
    """Mean squared free-space violation of part k, clipped, in square metres."""
    total = 0.0
    for q in range(FREE_SPACE_SAMPLES):
        mx, my, mz, hidden = free_space_violation(segments, k, q / (FREE_SPACE_SAMPLES - 1), depth, nearest, intrinsics)
        total += min(mx * mx + my * my + mz * mz + (HIDDEN_COST_M2 if hidden else 0.0), MAX_RESIDUAL_M * MAX_RESIDUAL_M)
    return FREE_SPACE_WEIGHT * total / (FREE_SPACE_SAMPLES * len(segments))


@njit(cache=True)
def add_free_space(matrix, rhs, segments, depth, nearest, intrinsics):
    """Adds the free-space violations of all parts."""
    weight = FREE_SPACE_WEIGHT / (FREE_SPACE_SAMPLES * len(segments))
    for k in range(len(segments)):
        for q in range(FREE_SPACE_SAMPLES):
            t = q / (FREE_SPACE_SAMPLES - 1)
            mx, my, mz, _ = free_space_violation(segments, k, t, depth, nearest, intrinsics)
            violation = math.sqrt(mx * mx + my * my + mz * mz)
            if violation > 0:
                ends = PART_COLUMNS[k, 0], PART_COLUMNS[k, 1]
                direction = mx / violation, my / violation, mz / violation
                residual = min(violation, MAX_STEP_RESIDUAL_M)
                add_residual(matrix, rhs, ends, (t - 1, -t), direction, residual, weight)


# Lengths: the distances between joints that the body demands.

LENGTH_WEIGHT = 20.0
"""Weight of the mean over all distances, relative to 1 for all points together."""


@njit(cache=True)
def add_lengths(matrix, rhs, joints, frame, body):
    """Adds the deviations of the distances between joints, given their `torso_frame`: shoulders rise with the arms."""
    elevation, pairs, lengths_m = _elevation(joints, frame[1]), body.pairs, body.lengths_m
    elevating_arm, gain_m, stiffness = body.elevating_arm, body.elevation_gain_m, body.stiffness
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        dx, dy, dz = joints[b, 0] - joints[a, 0], joints[b, 1] - joints[a, 1], joints[b, 2] - joints[a, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-9
        target = lengths_m[k]
        if elevating_arm[k] >= 0:
            cosine = elevation[elevating_arm[k]]
            target += gain_m[k, 0] * cosine + gain_m[k, 1] * cosine * cosine
        weight = LENGTH_WEIGHT * stiffness[k] / len(pairs)
        direction = dx / length, dy / length, dz / length
        add_residual(matrix, rhs, (COLUMN[a], COLUMN[b]), (-1.0, 1.0), direction, length - target, weight)


@njit(cache=True)
def _elevation(joints, down):
    """(2,) cosine between the upper arm and the torso's up direction, right and left."""
    elevation = np.zeros(2)
    for arm in range(2):
        along, length = 0.0, 1e-9
        for c in range(3):
            offset = joints[LIMBS[arm, 1], c] - joints[LIMBS[arm, 0], c]
            along -= offset * down[c]
            length += offset * offset
        elevation[arm] = along / math.sqrt(length)
    return elevation


# Penetration: forearms and shins inside other parts.

PENETRATION_WEIGHT = 0.02
"""Weight of each sample, relative to 1 for all points together."""

PENETRATION_TOLERANCE_M = 0.03
"""A forearm's or shin's axis may lie this deep below another part's surface, in metres: clothes, flesh, error of the cones."""

COLLISION_SAMPLES = 3
"""Samples on the axis of a forearm or shin."""


@njit(cache=True)
def penetration(segments, lower_part, other, along):
    """Depth (m) beyond the tolerance of a point on the axis of `lower_part` inside part `other`, and the way out (3,)."""
    x, y, z = axis_point(segments, lower_part, along)
    distance, t, axis_distance = signed_distance(segments, other, x, y, z)
    depth = -PENETRATION_TOLERANCE_M - distance
    if depth <= 0:
        return 0.0, 0.0, 0.0, 0.0
    scale = 1 / (axis_distance + 1e-9)
    return (
        depth,
        scale * (x - segments[other, 0] - t * segments[other, 3]),
        scale * (y - segments[other, 1] - t * segments[other, 4]),
        scale * (z - segments[other, 2] - t * segments[other, 5]),
    )


@njit(cache=True)
def penetration_cost(segments, first, last, cost_limit):
    """Cost of limbs inside other parts, square metres, over rows `first` to `last` - 1 of `COLLISION_PAIRS`, aborted above
    `cost_limit`.
    """
    total = 0.0
    for pair in range(first, last):
        if PENETRATION_WEIGHT * total >= cost_limit:
            break
        for q in range(COLLISION_SAMPLES):
            along = q / (COLLISION_SAMPLES - 1)
            total += penetration(segments, COLLISION_PAIRS[pair, 0], COLLISION_PAIRS[pair, 1], along)[0] ** 2
    return PENETRATION_WEIGHT * total


@njit(cache=True)
def add_penetration(matrix, rhs, segments):
    """Adds the penetration of samples on forearms and shins into other parts."""
    for pair in range(len(COLLISION_PAIRS)):
        lower_part, other = COLLISION_PAIRS[pair, 0], COLLISION_PAIRS[pair, 1]
        ends = PART_COLUMNS[lower_part, 0], PART_COLUMNS[lower_part, 1]
        for q in range(COLLISION_SAMPLES):
            t = q / (COLLISION_SAMPLES - 1)
            depth, nx, ny, nz = penetration(segments, lower_part, other, t)
            if depth > 0:
                add_residual(matrix, rhs, ends, (t - 1, -t), (nx, ny, nz), depth, PENETRATION_WEIGHT)


# Joint priors: impossible and unlikely positions of joints, which a depth image alone does not rule out.

_PRIORS = (
    (Joint.RIGHT_HAND, Joint.RIGHT_SHOULDER, Joint.RIGHT_SHOULDER, 0.0, 0.002),
    (Joint.LEFT_HAND, Joint.LEFT_SHOULDER, Joint.LEFT_SHOULDER, 0.0, 0.002),
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_FOOT, 0.0, 0.02),
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_HIP, 0.0, 0.002),
    (Joint.LEFT_KNEE, Joint.LEFT_HIP, Joint.LEFT_FOOT, 0.0, 0.02),
    (Joint.LEFT_KNEE, Joint.LEFT_HIP, Joint.LEFT_HIP, 0.0, 0.002),
    (Joint.HEAD, Joint.NECK, Joint.NECK, 0.04, 0.005),
)
"""A joint, two reference joints, the minimum distance in metres by which the joint lies in front of the middle of the
reference joints (along the torso's front axis), and the weight of the squared shortfall; set by hand."""

JOINT_PRIORS = np.array([prior[:3] for prior in _PRIORS])
JOINT_PRIOR_MIN_M, JOINT_PRIOR_WEIGHT = np.array([prior[3:] for prior in _PRIORS]).T.copy()
"""Priors that disambiguate front and back, which look alike in a depth image: knees never bend backwards, the head is in front
of the neck (by 6 +- 1 cm in simulated dancers), and thighs and hands are seldom behind hips and shoulders."""

LIMB_JOINT_PRIORS = np.array([(0, 1), (1, 2), (2, 4), (4, 6)])
"""(4, 2) first (inclusive) and last (exclusive) prior of each limb."""


@njit(cache=True)
def joint_prior_shortfall(joints, prior, forward):
    """Shortfall in metres of a joint's position along the torso's front axis; 0 or negative if the prior holds."""
    joint, a, b = JOINT_PRIORS[prior, 0], JOINT_PRIORS[prior, 1], JOINT_PRIORS[prior, 2]
    ahead = 0.0
    for c in range(3):
        ahead += (joints[joint, c] - (joints[a, c] + joints[b, c]) / 2) * forward[c]
    return JOINT_PRIOR_MIN_M[prior] - ahead


@njit(cache=True)
def joint_prior(joints, forward, first, last):
    """Cost of impossible or unlikely joint positions, square metres, over priors `first` to `last` - 1.

    `forward` is the torso's front axis, the last row of `torso_frame`.
    """
    total = 0.0
    for prior in range(first, last):
        total += JOINT_PRIOR_WEIGHT[prior] * max(joint_prior_shortfall(joints, prior, forward), 0.0) ** 2
    return total


@njit(cache=True)
def add_joint_priors(matrix, rhs, joints, forward):
    """Adds the shortfalls of the joint priors; `forward` as in `joint_prior`."""
    direction = forward[0], forward[1], forward[2]
    for prior in range(len(JOINT_PRIORS)):
        shortfall = joint_prior_shortfall(joints, prior, forward)
        if shortfall > 0:
            # With three joints (hip, knee, foot) the foot moves against the knee and the hip is fixed; with two both move.
            joint, reference, other = JOINT_PRIORS[prior, 0], JOINT_PRIORS[prior, 1], JOINT_PRIORS[prior, 2]
            coefficient = 0.5 if reference != other else 1.0
            ends = COLUMN[joint], COLUMN[other]
            add_residual(matrix, rhs, ends, (-1.0, coefficient), direction, shortfall, JOINT_PRIOR_WEIGHT[prior])


# The whole energy.

START_PRIOR_WEIGHT = 0.01
"""Weight of the mean squared distance to the start pose, relative to 1 for all points together."""

MAX_UPDATE_M, CONVERGED_UPDATE_M = 0.15, 0.002
"""Largest update of a coordinate per iteration, and the update below which the fit has converged, in metres."""


@njit(cache=True)
def _surface(joints, points, body, stride):
    """The segments of the body in a pose, the `nearest_parts` of every `stride`th point, and the torso's frame."""
    segments = body_segments(joints, body)
    return segments, nearest_parts(segments, points, stride), torso_frame(joints)


@njit(cache=True)
def pose_cost(joints_m, grid, body, stride):
    """Cost of (15, 3) joints given the depth image, square metres: all terms but the lengths, with every `stride`th point."""
    segments, nearest, frame = _surface(joints_m, grid.points_m, body, stride)
    cost = points_cost(nearest[1])
    for k in range(len(segments)):
        cost += free_space_cost(segments, k, grid.depth_m, grid.nearest, grid.intrinsics)
    # A plain 0 would be a type of its own, and both kernels compiled anew.
    cost += joint_prior(joints_m, frame[2], np.int64(0), len(JOINT_PRIORS))
    return cost + penetration_cost(segments, np.int64(0), len(COLLISION_PAIRS), np.inf)


def fit(
    joints_m: np.ndarray,
    grid: DepthGrid,
    body: Body,
    iterations: int,
    stride: int = 1,
    prior_weight: float = START_PRIOR_WEIGHT,
) -> np.ndarray:
    """Fits the body to the depth image, from (15, 3) joints in metres: at most this number of Gauss-Newton iterations.

    Only every `stride`th point is used; `prior_weight` is that of the mean squared distance to the start pose, relative to 1
    for all points together. (15, 3) float64 joints in the camera frame in metres.
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
        segments, nearest, frame = _surface(joints, grid.points_m, body, stride)
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
        max_update = 0.0
        for k in range(size):  # numba compiles a maximum of an array for a second
            max_update = max(max_update, abs(rhs[k]))
        factor = min(1.0, MAX_UPDATE_M / (max_update + 1e-12))
        for j in range(len(joints)):
            for c in range(3):
                joints[j, c] += rhs[COLUMN[j] + c] * factor
        if max_update < CONVERGED_UPDATE_M:
            break
    return joints


# The linear system of a step.


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
