"""The distances of the measured points to the surface of the union of all parts."""

import numpy as np
from numba import njit

from kpopnet.geometry.cones import nearest_parts
from kpopnet.tracker.fit.energy.equations import PART_COLUMNS

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
def points_cost(segments, points, stride):
    """Mean squared distance of every `stride`th point to the surface, clipped, in square metres."""
    _, distances, _ = nearest_parts(segments, points, stride)
    total = 0.0
    for distance in distances:
        total += min(distance * distance, MAX_RESIDUAL_M * MAX_RESIDUAL_M)
    return total / max(len(distances), 1)


@njit(cache=True)
def add_points(matrix, rhs, segments, points, stride):
    """Adds every point's residual as `add_residual` does, summed per part first: a part's points act on the same joints."""
    part, distances, along = nearest_parts(segments, points, stride)
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
    _add_parts(matrix, rhs, forces, blocks)


@njit(cache=True)
def _add_parts(matrix, rhs, forces, blocks):
    """Adds the sums of `add_points` over the points of every part."""
    for k in range(len(forces)):
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
