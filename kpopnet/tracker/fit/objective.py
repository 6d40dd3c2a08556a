"""The cost of a pose given a depth image.

Points and joints are in the camera frame in metres throughout. The cost has four terms: distances of the points to the
surface, free-space violations, penetration of limbs, and priors on joint positions.
"""

import numpy as np
from numba import njit

from kpopnet.geometry.body import COLLISION_PAIRS, PARTS, Body
from kpopnet.geometry.cones import (
    extend_joints,
    free_space_violation,
    nearest_parts,
    part_segments,
    signed_distance,
    torso_frame,
)
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.skeleton import Joint

MAX_RESIDUAL_M = 0.12
"""Residuals are clipped to this value, in metres: all outliers cost the same."""

FREE_SPACE_WEIGHT = 0.1
HIDDEN_COST_M2 = 0.006
"""Cost in square metres of a sample on a part that is hidden behind the measured depth: visible poses are more likely."""

FREE_SPACE_SAMPLES = 5

_HEAD_PRIOR = (Joint.HEAD, Joint.NECK, Joint.NECK, 0.04, 0.005)
_ARM_PRIOR = (Joint.RIGHT_HAND, Joint.RIGHT_SHOULDER, Joint.RIGHT_SHOULDER, 0.0, 0.002)
_LEG_PRIORS = (
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_FOOT, 0.0, 0.02),
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_HIP, 0.0, 0.002),
)
"""A joint, two reference joints, the minimum distance in metres by which the joint lies in front of the middle of the
reference joints (along the torso's front axis), and the weight of the squared shortfall. The left joints mirror the right."""

_ALL_PRIORS = [
    (*(joint + side for joint in prior[:3]), *prior[3:])
    for priors in ((_ARM_PRIOR,), _LEG_PRIORS)
    for side in (0, 1)
    for prior in priors
] + [_HEAD_PRIOR]
JOINT_PRIORS = np.array([prior[:3] for prior in _ALL_PRIORS])
JOINT_PRIOR_MIN_M, JOINT_PRIOR_WEIGHT = np.array([prior[3:] for prior in _ALL_PRIORS]).T.copy()
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


PENETRATION_WEIGHT = 0.02
PENETRATION_TOLERANCE_M = 0.03
"""A forearm's or shin's axis may lie this deep below another part's surface, in metres: clothes, flesh, error of the cones."""

COLLISION_SAMPLES = 3


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
            total += (
                penetration(segments, COLLISION_PAIRS[pair, 0], COLLISION_PAIRS[pair, 1], q / (COLLISION_SAMPLES - 1))[0] ** 2
            )
    return PENETRATION_WEIGHT * total


@njit(cache=True)
def joint_prior(joints, forward, first, last):
    """Cost of impossible or unlikely joint positions, in square metres, over priors `first` to `last` - 1.

    `forward` is the torso's front axis, the last row of `kpopnet.geometry.cones.torso_frame`.
    """
    total = 0.0
    for prior in range(first, last):
        total += JOINT_PRIOR_WEIGHT[prior] * max(joint_prior_shortfall(joints, prior, forward), 0.0) ** 2
    return total


@njit(cache=True)
def free_space_cost(segments, k, depth, nearest, intrinsics):
    """Mean squared free-space violation of part k, clipped, in square metres."""
    total = 0.0
    for q in range(FREE_SPACE_SAMPLES):
        mx, my, mz, hidden = free_space_violation(segments, k, q / (FREE_SPACE_SAMPLES - 1), depth, nearest, intrinsics)
        total += min(mx * mx + my * my + mz * mz + (HIDDEN_COST_M2 if hidden else 0.0), MAX_RESIDUAL_M * MAX_RESIDUAL_M)
    return total / FREE_SPACE_SAMPLES


@njit(cache=True)
def _pose_cost(joints, points, stride, depth, nearest, intrinsics, parts, radii, trunk_offsets):
    segments = part_segments(extend_joints(joints, trunk_offsets), parts, radii)
    _, distances, _ = nearest_parts(segments, points, stride)
    residual = 0.0
    for distance in distances:
        residual += min(distance * distance, MAX_RESIDUAL_M * MAX_RESIDUAL_M)
    free_space = 0.0
    for k in range(len(parts)):
        free_space += free_space_cost(segments, k, depth, nearest, intrinsics)
    data_cost = residual / max(len(distances), 1) + FREE_SPACE_WEIGHT * free_space / len(parts)
    return (
        data_cost
        + joint_prior(joints, torso_frame(joints)[2], 0, len(JOINT_PRIORS))
        + penetration_cost(segments, 0, len(COLLISION_PAIRS), np.inf)
    )


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
    return _pose_cost(
        joints_m, grid.points_m, stride, grid.depth_m, grid.nearest, grid.intrinsics, PARTS, body.radii_m, body.trunk_offsets_m
    )
