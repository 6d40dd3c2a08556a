"""Parts where the depth image shows none: outside the silhouette, or in front of the measured depth."""

import math

import numpy as np
from numba import njit

from kpopnet.tracker.fit.energy.equations import PART_COLUMNS, add_residual
from kpopnet.tracker.fit.energy.points import MAX_RESIDUAL_M

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
    """How the point at position `along` (0..1) on the axis of part k contradicts the depth image.

    Outside the silhouette: the vector to the nearest measured cell, at the point's depth. In front of the measured depth: the
    vector away from the camera.

    The arrays of the grid come one by one: a NamedTuple of them would double the time of a fit.

    Returns:
        The correction dx, dy, dz in metres, 0 without a contradiction, and whether the part is hidden there.
    """
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    x, y, z = (
        segments[k, 0] + along * segments[k, 3],
        segments[k, 1] + along * segments[k, 4],
        segments[k, 2] + along * segments[k, 5],
    )
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
