"""Forearms and shins inside other parts."""

from numba import njit

from kpopnet.geometry.body import COLLISION_PAIRS
from kpopnet.geometry.cones import signed_distance
from kpopnet.tracker.fit.energy.equations import PART_COLUMNS, add_residual

PENETRATION_WEIGHT = 0.02
"""Weight of each sample, relative to 1 for all points together."""

PENETRATION_TOLERANCE_M = 0.03
"""A forearm's or shin's axis may lie this deep below another part's surface, in metres: clothes, flesh, error of the cones."""

COLLISION_SAMPLES = 3
"""Samples on the axis of a forearm or shin."""


@njit(cache=True)
def penetration(segments, lower_part, other, along):
    """Depth (m) beyond the tolerance of a point on the axis of `lower_part` inside part `other`, and the way out (3,)."""
    x, y, z = (
        segments[lower_part, 0] + along * segments[lower_part, 3],
        segments[lower_part, 1] + along * segments[lower_part, 4],
        segments[lower_part, 2] + along * segments[lower_part, 5],
    )
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
    """Cost of limbs inside other parts, in square metres, over rows `first` to `last` - 1 of `COLLISION_PAIRS`.

    The sum is aborted above `cost_limit`.
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
    """Adds the penetration of samples on forearms and shins into the parts of `COLLISION_PAIRS`."""
    for pair in range(len(COLLISION_PAIRS)):
        lower_part, other = COLLISION_PAIRS[pair, 0], COLLISION_PAIRS[pair, 1]
        ends = PART_COLUMNS[lower_part, 0], PART_COLUMNS[lower_part, 1]
        for q in range(COLLISION_SAMPLES):
            t = q / (COLLISION_SAMPLES - 1)
            depth, nx, ny, nz = penetration(segments, lower_part, other, t)
            if depth > 0:
                add_residual(matrix, rhs, ends, (t - 1, -t), (nx, ny, nz), depth, PENETRATION_WEIGHT)
