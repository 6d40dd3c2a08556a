"""A body fitted to the measured points by least squares, a few Gauss-Newton steps from a pose that is about right.

Beyond the paper. Unknowns are the joints' places. Every point wants to lie on the surface of all parts together,
what sticks out of the silhouette or stands in front of what was measured wants back, distances between joints are kept,
and every joint is drawn a little to where it started. In joint places all but the last is nearly linear, so few
steps do; eliminated from hands and feet inwards the equations cost less than the search for the nearest parts. A step
moves all joints at once, so that a turn of the body is one step and not a slow diffusion from joint to joint.

Started near the truth it stays there; from farther away it may not arrive, which is what `kpopnet.tracker.proposals` is
for, and `kpopnet.tracker.misfit` tells. Points and joints are in the camera frame in metres throughout.
"""

import math

import numpy as np
from numba import njit

from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.body import BARRED, LIMBS, OWNERS, PARTS, TORSO_JOINTS, Body
from kpopnet.tracker.cells import Cells
from kpopnet.tracker.cones import axes_of, extend, frame_of, intrusion, nearest_parts
from kpopnet.tracker.misfit import (
    BARRIER_WEIGHT,
    HABIT_WEIGHT,
    HABITS,
    PLACES_ON_BARRED,
    short_of_habit,
    too_deep,
)

REACH_M = 0.3
"""Points farther from every part pull at none: they may belong to a limb that is somewhere else by mistake."""

ROBUST_M = 0.12
"""A point at this distance pulls with a quarter of its weight (Geman and McClure 1987)."""

NO_DIRECTION_M = 1e-3
"""A point so near to a part's axis has no direction to pull it in."""

LENGTH_WEIGHT = 20.0
FREE_SPACE_WEIGHT = 0.05
START_WEIGHT = 0.01
"""Against 1 for all points together; shared among the distances, parts and joints."""

LONGEST_STEP_M, LAST_STEP_M = 0.15, 0.002
"""No coordinate changes by more at once; below the second the fit is done."""

PLACES_ON_PART = 3
FARTHEST_BACK_M = 0.2

_ELIMINATION = [
    *(Joint.RIGHT_HAND, Joint.RIGHT_ELBOW, Joint.LEFT_HAND, Joint.LEFT_ELBOW),
    *(Joint.RIGHT_FOOT, Joint.RIGHT_KNEE, Joint.LEFT_FOOT, Joint.LEFT_KNEE),
    *TORSO_JOINTS,
]
COLUMN = np.empty(len(OWNERS), np.int64)
"""(25,) the first of the three unknowns of every row."""
COLUMN[_ELIMINATION] = 3 * np.arange(NUM_JOINTS)
COLUMN[NUM_JOINTS:] = COLUMN[OWNERS[NUM_JOINTS:]]


ENTRY = np.array([(0, 1, 2), (1, 3, 4), (2, 4, 5)])
"""Where a symmetric 3 x 3 matrix's entries stand among its six different ones."""


@njit(cache=True)
def _add(matrix, right, i, j, share_i, share_j, nx, ny, nz, residual, weight):
    """Adds weight (residual + n . (share_i dx_i + share_j dx_j))^2 to the normal equations."""
    n = (nx, ny, nz)
    for c in range(3):
        right[i + c] -= weight * share_i * n[c] * residual
        right[j + c] -= weight * share_j * n[c] * residual
        for d in range(3):
            product = weight * n[c] * n[d]
            matrix[i + c, i + d] += share_i * share_i * product
            matrix[j + c, j + d] += share_j * share_j * product
            matrix[i + c, j + d] += share_i * share_j * product
            matrix[j + d, i + c] += share_i * share_j * product


@njit(cache=True)
def solve(matrix, right):
    """Solves a symmetric, positive definite system in place by Cholesky's method, skipping the zeros left of each row's
    first entry (skyline). Only the lower half of the matrix is read.
    """
    size = len(right)
    first = np.empty(size, np.int64)
    for i in range(size):
        start = 0
        while matrix[i, start] == 0.0 and start < i:
            start += 1
        first[i] = start
        for j in range(start, i):
            total = matrix[i, j]
            for k in range(max(start, first[j]), j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        total = matrix[i, i]
        for k in range(start, i):
            total -= matrix[i, k] * matrix[i, k]
        matrix[i, i] = math.sqrt(max(total, 1e-12))
    for i in range(size):
        for k in range(first[i], i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        right[i] /= matrix[i, i]
        for k in range(first[i], i):
            right[k] -= matrix[i, k] * right[i]


@njit(cache=True)
def _add_points(matrix, right, axes, parts, points, every):
    """As `_add` for every point, summed up part by part first: the points of a part pull at the same two joints."""
    part, offs, along = nearest_parts(axes, points, every)
    near, far = np.zeros((len(parts), 3)), np.zeros((len(parts), 3))
    near_near, near_far, far_far = np.zeros((len(parts), 6)), np.zeros((len(parts), 6)), np.zeros((len(parts), 6))
    for i in range(len(part)):
        off = float(offs[i])
        if abs(off) > REACH_M:
            continue
        k, t = part[i], float(along[i])
        scale = 1 / max(off + axes[k, 7] + t * axes[k, 8], NO_DIRECTION_M)
        nx = scale * (points[i * every, 0] - axes[k, 0] - t * axes[k, 3])
        ny = scale * (points[i * every, 1] - axes[k, 1] - t * axes[k, 4])
        nz = scale * (points[i * every, 2] - axes[k, 2] - t * axes[k, 5])
        trust = ROBUST_M**2 / (ROBUST_M**2 + off * off)
        weight = trust * trust / len(part)
        s = 1 - t
        pull = weight * off
        for c, n in enumerate((nx, ny, nz)):
            near[k, c] += s * pull * n
            far[k, c] += t * pull * n
        for e, product in enumerate((nx * nx, nx * ny, nx * nz, ny * ny, ny * nz, nz * nz)):
            near_near[k, e] += s * s * weight * product
            near_far[k, e] += s * t * weight * product
            far_far[k, e] += t * t * weight * product
    for k in range(len(parts)):
        i, j = COLUMN[parts[k, 0]], COLUMN[parts[k, 1]]
        for c in range(3):
            right[i + c] += near[k, c]
            right[j + c] += far[k, c]
            for d in range(3):
                e = ENTRY[c, d]
                matrix[i + c, i + d] += near_near[k, e]
                matrix[j + c, j + d] += far_far[k, e]
                matrix[i + c, j + d] += near_far[k, e]
                matrix[j + c, i + d] += near_far[k, e]


@njit(cache=True)
def _add_free_space(matrix, right, axes, parts, depth, nearest, intrinsics):
    weight = FREE_SPACE_WEIGHT / (PLACES_ON_PART * len(parts))
    for k in range(len(parts)):
        for q in range(PLACES_ON_PART):
            t = q / (PLACES_ON_PART - 1)
            mx, my, mz, _ = intrusion(axes, k, t, depth, nearest, intrinsics)
            way = math.sqrt(mx * mx + my * my + mz * mz)
            if way > 0:
                i, j = COLUMN[parts[k, 0]], COLUMN[parts[k, 1]]
                back = min(way, FARTHEST_BACK_M)
                _add(matrix, right, i, j, t - 1, -t, mx / way, my / way, mz / way, back, weight)


@njit(cache=True)
def _add_lengths(matrix, right, joints, pairs, stiffness, lengths, carried, rise):
    down = frame_of(joints)[1]
    raised = np.zeros(2)
    for arm in range(2):
        along, length = 0.0, 1e-9
        for c in range(3):
            way = joints[LIMBS[arm, 1], c] - joints[LIMBS[arm, 0], c]
            along -= way * down[c]
            length += way * way
        raised[arm] = along / math.sqrt(length)
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        dx, dy, dz = joints[b, 0] - joints[a, 0], joints[b, 1] - joints[a, 1], joints[b, 2] - joints[a, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-9
        wanted = lengths[k]
        if carried[k] >= 0:
            up = raised[carried[k]]
            wanted += rise[k, 0] * up + rise[k, 1] * up * up
        weight = LENGTH_WEIGHT * stiffness[k] / len(pairs)
        i, j = COLUMN[a], COLUMN[b]
        _add(matrix, right, i, j, -1.0, 1.0, dx / length, dy / length, dz / length, length - wanted, weight)


@njit(cache=True)
def _add_barriers(matrix, right, axes, parts):
    for pair in range(len(BARRED)):
        own = BARRED[pair, 0]
        i, j = COLUMN[parts[own, 0]], COLUMN[parts[own, 1]]
        for q in range(PLACES_ON_BARRED):
            t = q / (PLACES_ON_BARRED - 1)
            depth, nx, ny, nz = too_deep(axes, own, BARRED[pair, 1], t)
            if depth > 0:
                _add(matrix, right, i, j, t - 1, -t, nx, ny, nz, depth, BARRIER_WEIGHT)


@njit(cache=True)
def _add_habits(matrix, right, joints):
    front = frame_of(joints)[2]
    for habit in range(len(HABITS)):
        short = short_of_habit(joints, habit, front)
        if short > 0:
            # A knee and its foot give way against each other, the hip stays; of two joints both do.
            i, j = COLUMN[HABITS[habit, 0]], COLUMN[HABITS[habit, 2]]
            share = -0.5 if HABITS[habit, 1] != HABITS[habit, 2] else -1.0
            _add(matrix, right, i, j, -1.0, -share, front[0], front[1], front[2], short, HABIT_WEIGHT[habit])


@njit(cache=True)
def _fit(
    start, points, every, depth, nearest, intrinsics, parts, radii, pairs, stiffness, lengths, carried, rise,
    places, steps, start_weight,
):  # fmt: skip
    joints = start.copy()
    size = 3 * len(joints)
    matrix, right = np.empty((size, size)), np.empty(size)
    for _ in range(steps):
        matrix[:], right[:] = 0.0, 0.0
        axes = axes_of(extend(joints, places), parts, radii)
        _add_points(matrix, right, axes, parts, points, every)
        _add_free_space(matrix, right, axes, parts, depth, nearest, intrinsics)
        _add_lengths(matrix, right, joints, pairs, stiffness, lengths, carried, rise)
        _add_barriers(matrix, right, axes, parts)
        _add_habits(matrix, right, joints)
        for j in range(len(joints)):
            for c in range(3):
                matrix[COLUMN[j] + c, COLUMN[j] + c] += start_weight / len(joints)
                right[COLUMN[j] + c] += start_weight / len(joints) * (start[j, c] - joints[j, c])
        solve(matrix, right)
        most = np.abs(right).max()
        for j in range(len(joints)):
            for c in range(3):
                joints[j, c] += right[COLUMN[j] + c] * min(1.0, LONGEST_STEP_M / (most + 1e-12))
        if most < LAST_STEP_M:
            break
    return joints


def fit(
    joints_m: np.ndarray, cells: Cells, body: Body, steps: int, every: int = 1, start_weight: float = START_WEIGHT
) -> np.ndarray:
    """(15, 3) float64 the joints after at most so many steps of fitting to every `every`th point.

    Args:
        joints_m: (15, 3) where to start.
        cells: the picture.
        body: the person.
        steps: at most so many.
        every: only every so many points are looked at.
        start_weight: how much every joint is drawn to where it started, against 1 for all points together.
    """
    return _fit(
        np.ascontiguousarray(joints_m, np.float64), cells.points_m, every, cells.depth_m, cells.nearest,
        cells.intrinsics, PARTS, body.radii_m, body.pairs, body.stiffness, body.lengths_m,
        body.carried, body.rise_m, body.places_m, steps, start_weight,
    )  # fmt: skip
