"""The cost of a pose given a depth image: the energy's terms added up."""

import numpy as np
from numba import njit

from kpopnet.geometry.body import COLLISION_PAIRS, PARTS, Body
from kpopnet.geometry.cones import extend_joints, part_segments, torso_frame
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.tracker.fit.energy.free_space import free_space_cost
from kpopnet.tracker.fit.energy.joint_priors import JOINT_PRIORS, joint_prior
from kpopnet.tracker.fit.energy.penetration import penetration_cost
from kpopnet.tracker.fit.energy.points import points_cost


@njit(cache=True)
def _pose_cost(joints, grid, body, stride):
    """`pose_cost` as a kernel."""
    segments = part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m)
    cost = points_cost(segments, grid.points_m, stride)
    depth, nearest, intrinsics = grid.depth_m, grid.nearest, grid.intrinsics
    for k in range(len(segments)):
        cost += free_space_cost(segments, k, depth, nearest, intrinsics)
    cost += joint_prior(joints, torso_frame(joints)[2], 0, len(JOINT_PRIORS))
    return cost + penetration_cost(segments, 0, len(COLLISION_PAIRS), np.inf)


def pose_cost(joints_m: np.ndarray, grid: DepthGrid, body: Body, stride: int = 1) -> float:
    """Cost of a pose given the depth image, in square metres.

    The sum of: squared distances of the points to the surface; parts in free space or hidden; limbs inside other parts;
    impossible or unlikely joint positions.

    Args:
        joints_m: (15, 3) the pose.
        grid: the depth image.
        body: the person's body.
        stride: only every `stride`th point is used.
    """
    return _pose_cost(joints_m, grid, body, stride)
