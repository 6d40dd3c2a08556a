"""Limbs refitted: along the silhouette to its tips, or in one of many poses, where that lowers the cost.

Beyond the paper, which tracks one pose and cannot recover a lost limb. The tips of hands and feet are maxima of the geodesic
distance from the torso (Plagemann et al. 2010); the shortest path from a tip to the torso follows the limb.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMB_COLLISIONS, LIMB_PARTS, LIMBS, PARTS, Body
from kpopnet.geometry.cones import (
    cone_signed_distance,
    distance,
    extend_joints,
    extend_limb,
    nearest_parts,
    part_segments,
    set_segment,
    signed_distance,
    torso_frame,
)
from kpopnet.geometry.depth_grid import UNREACHABLE_M, DepthGrid, farthest_points, geodesic_distances
from kpopnet.tracker.fit import LIMB_JOINT_PRIORS, MAX_RESIDUAL_M, free_space_cost, joint_prior, penetration_cost

TORSO_TOLERANCE_M = 0.05
"""Points within this distance of the surface of torso or head, in metres, are sources of the geodesic distance."""

END_TO_TIP_M = 0.08
"""Distance in metres by which the silhouette extends beyond the hand's and the foot's joint: fingers and toes."""

END_RADIUS_M, MIDDLE_RADIUS_M = 0.05, 0.06
"""Distance in metres of the joint behind the surface of hand or foot, and at elbow or knee."""

REACH_SLACK_M = 0.12
"""A tip may be farther from the limb's root than the limb is long, by this many metres: the root may be displaced."""

CONTINUITY_WEIGHT = 0.0005
MAX_END_STEP_M = 0.5
"""Continuity cost of a limb: weight x squared displacement of its end since the last frame, the displacement clipped to
`MAX_END_STEP_M` metres."""

MIN_GAIN_M2 = 1e-4
"""A limb is refitted if the cost decreases by at least this many square metres."""

EXPLAINED_M = 0.02
"""Points closer than this to another part's surface, in metres, are left out of a limb's cost, which gains little by them."""


def _limb_poses() -> tuple[np.ndarray, np.ndarray]:
    """(K, 2, 3) directions of upper and lower limb in the torso's frame (right, down, front), for a right limb, and (4, 2)
    first (inclusive) and last (exclusive) index for each limb.
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

OF_LIMB = np.isin(np.arange(len(PARTS)), LIMB_PARTS)
"""(P,) whether a part is one of a limb."""


class Tips(NamedTuple):
    """Where each limb would end and bend if it had each tip of the silhouette."""

    ends_m: np.ndarray  # (4, T, 3) metres
    middles_m: np.ndarray  # (4, T, 3) metres
    used: np.ndarray  # (T,) whether a limb has this tip already


class Context(NamedTuple):
    """What the cost of a limb is computed from; `rows`, `segments` and `part_distances` follow each refitted limb."""

    grid: DepthGrid  # the depth image
    body: Body  # the person's body
    previous: np.ndarray  # (15, 3) the pose of the last frame
    frame: np.ndarray  # (3, 3) from `torso_frame`
    rows: np.ndarray  # (25, 3) from `extend_joints`
    segments: np.ndarray  # (P, 9) from `part_segments`
    points: np.ndarray  # (n, 3) the points that are used
    part_distances: np.ndarray  # (P, n) their signed distances to all parts
    tips: Tips  # of the silhouette


@njit(cache=True)
def find_tips(source, grid, body):
    """The `Tips` of a silhouette, with limbs of the body's lengths, from its (N,) `torso_points`."""
    points = grid.points_m
    geodesic, predecessor = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = farthest_points(points, grid.neighbours, grid.edge_lengths_m, geodesic)
    ends, middles = np.empty((len(LIMBS), len(tips), 3)), np.empty((len(LIMBS), len(tips), 3))
    for limb in range(len(LIMBS)):
        for k in range(len(tips)):
            trace_limb(points, predecessor, tips[k], body.limbs_m[limb, 1], ends[limb, k], middles[limb, k])
    return Tips(ends, middles, np.zeros(len(tips), np.bool_))


def torso_points(segments: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N,) whether a point lies on the torso or the head, and closer to it than to any limb."""
    part, distances, _ = nearest_parts(segments, points, 1)
    return ~OF_LIMB[part] & (np.abs(distances) < TORSO_TOLERANCE_M)


@njit(cache=True)
def move_inside(points, index, radius, position):
    """Writes the given surface point, moved along its viewing ray by the radius to the limb's axis, into `position`."""
    x, y, z = points[index, 0], points[index, 1], points[index, 2]
    factor = 1 + radius / math.sqrt(x**2 + y**2 + z**2)
    position[0], position[1], position[2] = x * factor, y * factor, z * factor


@njit(cache=True)
def trace_limb(points, predecessor, tip, lower_m, end, middle):
    """Writes end and middle of a limb with this tip: the end `END_TO_TIP_M` along the path, the middle a lower limb on."""
    point, travelled = tip, 0.0
    while predecessor[point] >= 0 and travelled < END_TO_TIP_M:
        travelled += distance(points[point], points[predecessor[point]])
        point = predecessor[point]
    move_inside(points, point, END_RADIUS_M, end)
    move_inside(points, point, MIDDLE_RADIUS_M, middle)
    while predecessor[point] >= 0 and distance(end, middle) < lower_m:
        point = predecessor[point]
        move_inside(points, point, MIDDLE_RADIUS_M, middle)


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
def _measure_parts(context, part_indices):
    """Updates the signed distances of the points to the surfaces of the given parts."""
    x, y, z = context.points[:, 0].copy(), context.points[:, 1].copy(), context.points[:, 2].copy()
    for k in part_indices:
        x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change = context.segments[k]
        row = context.part_distances[k]
        for i in range(len(x)):
            row[i] = cone_signed_distance(
                x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change, x[i], y[i], z[i]
            )[0]


@njit(cache=True)
def _place(limb, ends, context):
    """Moves middle and end of a limb, its fingertips or toes and its parts to (2, 3) middle and end."""
    for k in range(2):
        for c in range(3):
            context.rows[LIMBS[limb, 1 + k], c] = ends[k, c]
    extend_limb(context.rows, limb, context.frame[2])
    for k in LIMB_PARTS[limb]:
        set_segment(context.segments, k, context.rows, context.body.radii_m)


@njit(cache=True)
def _cost(limb, ends, context, points, distances, cost_limit):
    """Cost in square metres of a limb, placed at (2, 3) middle and end, aborted above the limit: its motion since the last
    frame, joint priors, penetration of other parts, free space, and the `_unexplained` points.
    """
    previous = context.previous[LIMBS[limb, 2]]
    cost = CONTINUITY_WEIGHT * min(distance(ends[1], previous), MAX_END_STEP_M) ** 2
    if cost < cost_limit:
        _place(limb, ends, context)
        cost += joint_prior(context.rows, context.frame[2], LIMB_JOINT_PRIORS[limb, 0], LIMB_JOINT_PRIORS[limb, 1])
    if cost < cost_limit:
        first, last = LIMB_COLLISIONS[limb]
        cost += penetration_cost(context.segments, first, last, cost_limit - cost)
    grid, in_free_space = context.grid, 0.0
    for k in LIMB_PARTS[limb]:
        if cost + in_free_space < cost_limit:
            in_free_space += free_space_cost(context.segments, k, grid.depth_m, grid.nearest, grid.intrinsics)
    cost += in_free_space
    if cost < cost_limit:
        cost += _points_cost(limb, context, points, distances, cost_limit - cost)
    return cost


@njit(cache=True)
def _points_cost(limb, context, points, distances, cost_limit):
    """Mean squared distance of all points to the surface, square metres, aborted above the limit: a few points reject most
    poses. Points that other parts explain count 0.
    """
    count = len(context.points)
    total, limit = 0.0, cost_limit * count
    for i in range(len(points)):
        if total > limit:
            break
        nearest = distances[i]
        for k in LIMB_PARTS[limb]:
            nearest = min(nearest, signed_distance(context.segments, k, points[i, 0], points[i, 1], points[i, 2])[0])
        nearest = max(nearest, -MAX_RESIDUAL_M)
        total += nearest * nearest
    return total / max(count, 1)


@njit(cache=True)
def _candidates(limb, context):
    """(N, 2, 3) middle and end of a limb, and (N,) the tip that each is traced from, or -1.

    The first is the limb as it is; two for each free tip within reach follow; then the sampled poses, mirrored for left limbs.
    """
    # Rows one by one: numba compiles an index of several for a second.
    tips, root = context.tips, context.rows[LIMBS[limb, 0]]
    middle, end = context.rows[LIMBS[limb, 1]], context.rows[LIMBS[limb, 2]]
    upper_m, lower_m = context.body.limbs_m[limb]
    first, last = LIMB_POSE_RANGES[limb]
    ends, tip_of = np.empty((1 + 2 * len(tips.used) + last - first, 2, 3)), np.full(1 + 2 * len(tips.used) + last - first, -1)
    for c in range(3):
        ends[0, 0, c], ends[0, 1, c] = middle[c], end[c]
    count = 1
    for tip in range(len(tips.used)):
        tip_end, tip_middle = tips.ends_m[limb, tip], tips.middles_m[limb, tip]
        if tips.used[tip] or distance(tip_end, root) > upper_m + lower_m + REACH_SLACK_M:
            continue
        for bend in (0.0, 0.5):  # the path along the surface cuts the corner at the elbow: half the way back to the old one
            for c in range(3):
                ends[count, 0, c] = tip_middle[c] + bend * (middle[c] - tip_middle[c])
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
def _best_candidate(limb, least_gain, context):
    """The candidate of a limb that lowers the cost most, by more than `least_gain` square metres; the limb is put back.

    The gain, `least_gain` if the limb is better left as it is; (2, 3) middle and end; the tip they are traced from, or -1.
    """
    points, distances = _unexplained(context, limb)
    candidates, tip_of = _candidates(limb, context)
    best, gain = 0, least_gain
    own_cost = _cost(limb, candidates[0], context, points, distances, np.inf)
    if own_cost > least_gain:  # the cost cannot decrease by more than its own value
        for n in range(1, len(candidates)):
            cost = _cost(limb, candidates[n], context, points, distances, own_cost - gain)
            if own_cost - cost > gain:
                best, gain = n, own_cost - cost
    _place(limb, candidates[0], context)
    return gain, candidates[best], tip_of[best]


def refit_limbs(
    joints_m: np.ndarray, previous_m: np.ndarray, grid: DepthGrid, body: Body, stride: int
) -> tuple[np.ndarray, int]:
    """Refits limbs along the silhouette to its tips, or in a sampled pose, where that lowers the cost: each limb at most once,
    the largest decrease first. (15, 3) the pose, and the number of refitted limbs.

    The torso of the (15, 3) joints is approximately correct; `previous_m` (15, 3) is the pose of the last frame, for the
    continuity cost. Only every `stride`th point is used.
    """
    rows, frame, points = extend_joints(joints_m, body.trunk_offsets_m), torso_frame(joints_m), grid.points_m[::stride].copy()
    segments, part_distances = part_segments(rows, body.radii_m), np.empty((len(PARTS), len(points)))
    tips = find_tips(torso_points(segments, grid.points_m), grid, body)
    context = Context(grid, body, previous_m, frame, rows, segments, points, part_distances, tips)
    _measure_parts(context, np.arange(len(PARTS)))
    refitted = np.zeros(len(LIMBS), np.bool_)
    while not refitted.all():
        best_limb, best_gain, best_ends, best_tip = -1, MIN_GAIN_M2, rows[:2], -1
        for limb in range(len(LIMBS)):
            if not refitted[limb]:
                gain, ends, tip = _best_candidate(limb, best_gain, context)
                if gain > best_gain:
                    best_limb, best_gain, best_ends, best_tip = limb, gain, ends, tip
        if best_limb < 0:
            break
        _place(best_limb, best_ends, context)
        refitted[best_limb] = True
        if best_tip >= 0:
            tips.used[best_tip] = True
        _measure_parts(context, LIMB_PARTS[best_limb])
    return rows[: len(joints_m)], refitted.sum()


def swap_crossed_limbs(joints_m: np.ndarray) -> list[np.ndarray]:
    """(15, 3) poses in which crossed arms or legs exchange their ends, or middles and ends; empty if no limbs cross.

    After a limb is lost it may attach to the silhouette of the other one, which then attaches to the remaining silhouette.
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
