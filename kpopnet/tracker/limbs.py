"""Limbs refitted: along the silhouette to its tips, or in one of many poses, where that lowers the cost.

Beyond the paper, which tracks one pose and cannot recover a lost limb.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMB_COLLISIONS, LIMB_PARTS, LIMBS, PARTS, Body
from kpopnet.geometry.cones import (
    cone_signed_distance,
    extend_joints,
    extend_limb,
    part_segments,
    set_segment,
    signed_distance,
    torso_frame,
)
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.tracker.energy import (
    LIMB_JOINT_PRIORS,
    MAX_RESIDUAL_M,
    free_space_cost,
    joint_prior,
    penetration_cost,
)
from kpopnet.tracker.tips import distance, find_tips

REACH_SLACK_M = 0.12
"""A tip may be farther from the limb's root than the limb is long, by this many metres: the root may be displaced."""

CONTINUITY_WEIGHT = 0.0005
MAX_END_STEP_M = 0.5
"""Continuity cost of a limb: weight x squared displacement of its end since the last frame, the displacement clipped to
`MAX_END_STEP_M` metres."""

MIN_GAIN_M2 = 1e-4
"""A limb is refitted if the cost decreases by at least this many square metres."""

EXPLAINED_M = 0.02
"""Points closer than this to another part's surface, in metres, are left out of a limb's cost: the limb gains little from
them."""


def _limb_poses() -> tuple[np.ndarray, np.ndarray]:
    """Samples directions of upper and lower limb in the torso's frame (right, down, front), for a right limb.

    Returns:
        (K, 2, 3) unit vectors, and (4, 2) first (inclusive) and last (exclusive) index for each limb.
    """
    directions = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    arms = [
        (upper, lower)
        for upper in directions
        for lower in directions
        if upper @ lower > np.cos(np.radians(130)) and not (upper[0] < -0.4 and upper[2] < 0.3) and lower[2] > -0.6
    ]
    legs = []
    for upper in directions:
        if upper[2] < -0.6 or upper[0] < -0.6 or upper[1] < -0.1:
            continue
        # The knee bends only backwards, about the torso's right axis.
        backward = np.cross(upper, (1.0, 0, 0))
        backward = backward / np.linalg.norm(backward) if np.linalg.norm(backward) > 0.1 else np.array((0.0, 1.0, 0.0))
        legs += [(upper, np.cos(bend) * upper + np.sin(bend) * backward) for bend in np.radians((0, 50, 100, 140))]
    poses = np.array(arms + legs)
    num_arms, total = len(arms), len(poses)
    return poses, np.array([(0, num_arms), (0, num_arms), (num_arms, total), (num_arms, total)])


LIMB_POSES, LIMB_POSE_RANGES = _limb_poses()
"""Directions of upper and lower limb, and each limb's index range, from `_limb_poses`."""


class Context(NamedTuple):
    """What the cost of a limb is computed from.

    Attributes:
        grid: the depth image.
        body: the person's body.
        previous: (15, 3) the pose of the last frame.
        frame: (3, 3) from `kpopnet.geometry.cones.torso_frame`.
        points: (n, 3) the points that are used.
        part_distances: (P, n) their signed distances to all parts.
    """

    grid: DepthGrid
    body: Body
    previous: np.ndarray
    frame: np.ndarray
    points: np.ndarray
    part_distances: np.ndarray


@njit(cache=True)
def _enforce_lengths(root, middle, end, upper_m, lower_m):
    """Moves middle and end until the upper and lower lengths hold; the root stays fixed."""
    for _ in range(12):
        error = (distance(middle, end) - lower_m) / (distance(middle, end) + 1e-9)
        for c in range(3):
            offset = end[c] - middle[c]
            middle[c] += 0.5 * error * offset
            end[c] -= 0.15 * error * offset
        factor = upper_m / (distance(root, middle) + 1e-9)
        for c in range(3):
            middle[c] = root[c] + (middle[c] - root[c]) * factor
    factor = lower_m / (distance(middle, end) + 1e-9)
    for c in range(3):
        end[c] = middle[c] + (end[c] - middle[c]) * factor


@njit(cache=True)
def _continuity_cost(joints, previous, end):
    """Continuity cost of the end of a limb, in square metres."""
    dx, dy, dz = joints[end, 0] - previous[end, 0], joints[end, 1] - previous[end, 1], joints[end, 2] - previous[end, 2]
    return CONTINUITY_WEIGHT * min(math.sqrt(dx * dx + dy * dy + dz * dz), MAX_END_STEP_M) ** 2


@njit(cache=True)
def _pose_cost(rows, segments, limb, previous, forward, radii, cost_limit):
    """Cost of a limb's motion, its joint priors and its penetration of other parts, in square metres, aborted above the limit.

    Writes the limb's fingertips or toes into `rows` and its parts into `segments`.
    """
    cost = _continuity_cost(rows, previous, LIMBS[limb, 2])
    if cost >= cost_limit:
        return cost
    extend_limb(rows, limb, forward)
    for k in LIMB_PARTS[limb]:
        set_segment(segments, k, rows, PARTS, radii)
    cost += joint_prior(rows, forward, LIMB_JOINT_PRIORS[limb, 0], LIMB_JOINT_PRIORS[limb, 1])
    if cost < cost_limit:
        cost += penetration_cost(segments, LIMB_COLLISIONS[limb, 0], LIMB_COLLISIONS[limb, 1], cost_limit - cost)
    return cost


@njit(cache=True)
def _free_space_cost(segments, limb, depth, nearest, intrinsics, cost_limit):
    """Cost of a limb's parts in free space, in square metres, aborted above the limit."""
    cost = 0.0
    for k in LIMB_PARTS[limb]:
        if cost < cost_limit:
            cost += free_space_cost(segments, k, depth, nearest, intrinsics)
    return cost


@njit(cache=True)
def _points_cost(segments, limb, rest_points, rest_distances, num_points, cost_limit):
    """Mean squared distance of all points to the surface, in square metres, aborted above the limit: a few points reject most
    poses. Points outside the rest count 0.
    """
    total, limit = 0.0, cost_limit * num_points
    for i in range(len(rest_points)):
        if total > limit:
            break
        x, y, z = rest_points[i, 0], rest_points[i, 1], rest_points[i, 2]
        nearest = rest_distances[i]
        for k in LIMB_PARTS[limb]:
            nearest = min(nearest, signed_distance(segments, k, x, y, z)[0])
        nearest = max(nearest, -MAX_RESIDUAL_M)
        total += nearest * nearest
    return total / max(num_points, 1)


@njit(cache=True)
def _unexplained(context, limb):
    """(m, 3) the points farther than `EXPLAINED_M` from all parts but the limb's, and (m,) their distances to the nearest of
    those, clipped to `MAX_RESIDUAL_M`.
    """
    count = len(context.points)
    nearest = np.full(count, MAX_RESIDUAL_M)
    for k in range(len(PARTS)):
        if k != LIMB_PARTS[limb, 0] and k != LIMB_PARTS[limb, 1] and k != LIMB_PARTS[limb, 2]:
            row = context.part_distances[k]
            for i in range(count):
                nearest[i] = min(nearest[i], row[i])
    left = np.flatnonzero(nearest > EXPLAINED_M)
    return context.points[left], nearest[left]


@njit(cache=True)
def _measure_parts(rows, context, part_indices):
    """Writes the signed distances of the points to the surfaces of the given parts into `context`."""
    segments = part_segments(rows, PARTS, context.body.radii_m)
    x, y, z = context.points[:, 0].copy(), context.points[:, 1].copy(), context.points[:, 2].copy()
    for k in part_indices:
        x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change = segments[k]
        row = context.part_distances[k]
        for i in range(len(x)):
            row[i] = cone_signed_distance(
                x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change, x[i], y[i], z[i]
            )[0]


@njit(cache=True)
def _candidates(limb, rows, context, tips):
    """(N, 2, 3) middle and end of a limb, and (N,) the tip that each is traced from, or -1.

    The first is the limb as it is; two for each free tip within reach follow; then the sampled poses, mirrored for left limbs.
    """
    root, old = rows[LIMBS[limb, 0]], rows[LIMBS[limb, 1:]]
    upper_m, lower_m = context.body.limbs_m[limb]
    first, last = LIMB_POSE_RANGES[limb]
    ends, tip_of = np.empty((1 + 2 * len(tips.used) + last - first, 2, 3)), np.full(1 + 2 * len(tips.used) + last - first, -1)
    ends[0], count = old, 1
    for tip in range(len(tips.used)):
        tip_end, tip_middle = tips.ends_m[limb, tip], tips.middles_m[limb, tip]
        if tips.used[tip] or distance(tip_end, root) > upper_m + lower_m + REACH_SLACK_M:
            continue
        for bend in (0.0, 0.5):  # the path along the surface cuts the corner at the elbow: half the way back to the old one
            for c in range(3):
                ends[count, 0, c] = tip_middle[c] + bend * (old[0, c] - tip_middle[c])
                ends[count, 1, c] = tip_end[c]
            _enforce_lengths(root, ends[count, 0], ends[count, 1], upper_m, lower_m)
            tip_of[count] = tip
            count += 1
    sign, frame = 1.0 - 2.0 * (limb % 2), context.frame
    for pose in range(first, last):
        (ux, uy, uz), (lx, ly, lz) = LIMB_POSES[pose]
        for c in range(3):
            upper = sign * ux * frame[0, c] + uy * frame[1, c] + uz * frame[2, c]
            lower = sign * lx * frame[0, c] + ly * frame[1, c] + lz * frame[2, c]
            ends[count, 0, c] = root[c] + upper_m * upper
            ends[count, 1, c] = ends[count, 0, c] + lower_m * lower
        count += 1
    return ends[:count], tip_of[:count]


@njit(cache=True)
def _best_candidate(limb, least_gain, rows, context, tips):
    """The candidate of a limb that lowers the cost most, by more than `least_gain` square metres.

    `rows` are the (25, 3) joints and what follows them; they are restored.

    Returns:
        The gain, `least_gain` if the limb is better left as it is; (2, 3) middle and end; the tip they are traced from, or -1.
    """
    middle, end = LIMBS[limb, 1], LIMBS[limb, 2]
    radii, depth, nearest, intrinsics = (
        context.body.radii_m,
        context.grid.depth_m,
        context.grid.nearest,
        context.grid.intrinsics,
    )
    segments, (points, distances) = part_segments(rows, PARTS, radii), _unexplained(context, limb)
    candidates, tip_of = _candidates(limb, rows, context, tips)
    best, gain, own_cost = 0, least_gain, np.inf
    for n in range(len(candidates)):
        rows[middle], rows[end] = candidates[n, 0], candidates[n, 1]
        limit = own_cost - gain
        cost = _pose_cost(rows, segments, limb, context.previous, context.frame[2], radii, limit)
        if cost < limit:
            cost += _free_space_cost(segments, limb, depth, nearest, intrinsics, limit - cost)
        if cost < limit:
            cost += _points_cost(segments, limb, points, distances, len(context.points), limit - cost)
        if n == 0:
            own_cost = cost
            if own_cost <= least_gain:
                break  # the cost cannot decrease by more than its own value
        elif own_cost - cost > gain:
            best, gain = n, own_cost - cost
    rows[middle], rows[end] = candidates[0, 0], candidates[0, 1]
    extend_limb(rows, limb, context.frame[2])
    return gain, candidates[best], tip_of[best]


@njit(cache=True)
def _refit_limbs(joints, previous, grid, body, stride):
    """`refit_limbs` as a kernel: repeatedly refits the limb with the largest decrease of the cost, each limb at most once."""
    tips = find_tips(joints, grid, body)
    rows, points = extend_joints(joints, body.trunk_offsets_m), grid.points_m[::stride].copy()
    context = Context(grid, body, previous, torso_frame(joints), points, np.empty((len(PARTS), len(points))))
    _measure_parts(rows, context, np.arange(len(PARTS)))
    refitted = np.zeros(len(LIMBS), np.bool_)
    while not refitted.all():
        best_limb, best_gain, best_ends, best_tip = -1, MIN_GAIN_M2, rows[:2], -1
        for limb in range(len(LIMBS)):
            if not refitted[limb]:
                gain, ends, tip = _best_candidate(limb, best_gain, rows, context, tips)
                if gain > best_gain:
                    best_limb, best_gain, best_ends, best_tip = limb, gain, ends, tip
        if best_limb < 0:
            break
        rows[LIMBS[best_limb, 1]], rows[LIMBS[best_limb, 2]] = best_ends[0], best_ends[1]
        extend_limb(rows, best_limb, context.frame[2])
        refitted[best_limb] = True
        if best_tip >= 0:
            tips.used[best_tip] = True
        _measure_parts(rows, context, LIMB_PARTS[best_limb])
    return rows[: len(joints)], refitted.sum()


def refit_limbs(
    joints_m: np.ndarray, previous_m: np.ndarray, grid: DepthGrid, body: Body, stride: int = 1
) -> tuple[np.ndarray, int]:
    """Refits limbs along the silhouette to its tips where that lowers the cost, the largest decrease first.

    Args:
        joints_m: (15, 3) a pose with an approximately correct torso.
        previous_m: (15, 3) the pose of the last frame, for the continuity cost.
        grid: the depth image.
        body: the person's body.
        stride: only every `stride`th point is used.

    Returns:
        (15, 3) the pose, and the number of refitted limbs.
    """
    return _refit_limbs(joints_m, previous_m, grid, body, stride)


def swap_crossed_limbs(joints_m: np.ndarray) -> list[np.ndarray]:
    """Poses in which crossed arms or legs exchange their ends, or middles and ends; empty if no limbs cross.

    After a limb is lost it may attach to the silhouette of the other one, which then attaches to the remaining silhouette.

    Args:
        joints_m: (15, 3) joints in the camera frame in metres.
    """
    rightward = torso_frame(joints_m)[0]
    poses = []
    for (_, *right_limb), (_, *left_limb) in LIMBS.reshape(2, 2, 3):
        if (joints_m[right_limb[1]] - joints_m[left_limb[1]]) @ rightward < 0:
            for first in (1, 0):
                pose = joints_m.copy()
                pose[right_limb[first:]], pose[left_limb[first:]] = joints_m[left_limb[first:]], joints_m[right_limb[first:]]
                poses.append(pose)
    return poses
