"""Fits a body to the measured points by least squares: a few Gauss-Newton iterations from an approximate pose.

Beyond the paper. The unknowns are the joint positions, the terms those of `kpopnet.tracker.fit.energy` and the distance to the
start pose. In joint positions nearly all of them are linear, so few iterations suffice. Eliminated from hands and feet inwards,
the equations cost less than the search for the nearest parts. An iteration moves all joints at once: a rotation of the body
takes one step instead of diffusing from joint to joint.

The fit is local. It keeps a pose near the truth and may not converge from farther away; for that there is
`kpopnet.tracker.fit.limbs`, and `kpopnet.tracker.fit.objective` measures the result.
"""

import numpy as np
from numba import njit

from kpopnet.geometry.body import PARTS, Body
from kpopnet.geometry.cones import extend_joints, part_segments
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.tracker.fit.energy.equations import COLUMN, solve
from kpopnet.tracker.fit.energy.free_space import add_free_space
from kpopnet.tracker.fit.energy.joint_priors import add_joint_priors
from kpopnet.tracker.fit.energy.lengths import add_lengths
from kpopnet.tracker.fit.energy.penetration import add_penetration
from kpopnet.tracker.fit.energy.points import add_points

START_PRIOR_WEIGHT = 0.01
"""Weight of the mean squared distance to the start pose, relative to 1 for all points together."""

MAX_UPDATE_M, CONVERGED_UPDATE_M = 0.15, 0.002
"""Largest update of a coordinate per iteration, and the update below which the fit has converged, in metres."""


@njit(cache=True)
def _add_start(matrix, rhs, joints, start, weight):
    """Adds the distance to the start pose."""
    for j in range(len(joints)):
        for c in range(3):
            matrix[COLUMN[j] + c, COLUMN[j] + c] += weight / len(joints)
            rhs[COLUMN[j] + c] += weight / len(joints) * (start[j, c] - joints[j, c])


@njit(cache=True)
def _fit(start, grid, body, iterations, stride, start_weight):
    """`fit` as a kernel."""
    joints = start.copy()
    size = 3 * len(joints)
    matrix, rhs = np.empty((size, size)), np.empty(size)
    for _ in range(iterations):
        matrix[:], rhs[:] = 0.0, 0.0
        segments = part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m)
        add_points(matrix, rhs, segments, grid.points_m, stride)
        add_free_space(matrix, rhs, segments, grid.depth_m, grid.nearest, grid.intrinsics)
        add_lengths(matrix, rhs, joints, body)
        add_penetration(matrix, rhs, segments)
        add_joint_priors(matrix, rhs, joints)
        _add_start(matrix, rhs, joints, start, start_weight)
        solve(matrix, rhs)
        max_update = np.abs(rhs).max()
        factor = min(1.0, MAX_UPDATE_M / (max_update + 1e-12))
        for j in range(len(joints)):
            for c in range(3):
                joints[j, c] += rhs[COLUMN[j] + c] * factor
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
    return _fit(np.ascontiguousarray(joints_m, np.float64), grid, body, iterations, stride, prior_weight)
