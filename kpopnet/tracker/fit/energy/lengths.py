"""The distances between joints that the body's lengths demand."""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMBS
from kpopnet.geometry.cones import torso_frame
from kpopnet.tracker.fit.energy.equations import COLUMN, add_residual

LENGTH_WEIGHT = 20.0
"""Weight of the mean over all distances, relative to 1 for all points together."""


@njit(cache=True)
def add_lengths(matrix, rhs, joints, body):
    """Adds the deviations of the distances between joints; shoulder distances depend on the elevation of the arms."""
    elevation, pairs, lengths_m = _elevation(joints), body.pairs, body.lengths_m
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
def _elevation(joints):
    """(2,) cosine between the upper arm and the torso's up direction, right and left."""
    down = torso_frame(joints)[1]
    elevation = np.zeros(2)
    for arm in range(2):
        along, length = 0.0, 1e-9
        for c in range(3):
            offset = joints[LIMBS[arm, 1], c] - joints[LIMBS[arm, 0], c]
            along -= offset * down[c]
            length += offset * offset
        elevation[arm] = along / math.sqrt(length)
    return elevation
