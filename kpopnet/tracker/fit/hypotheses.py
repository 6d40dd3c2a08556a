"""Alternative poses: limbs refitted along the silhouette to its tips, exchanged limbs, rotated bodies.

Beyond the paper, which tracks one pose and cannot recover a lost limb. The tips of hands and feet are maxima of the geodesic
distance from the torso (Plagemann et al. 2010). The shortest path from a tip to the torso follows the limb.
"""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMB_COLLISIONS, LIMB_PARTS, LIMBS, PARTS, Body
from kpopnet.geometry.cones import (
    cone_signed_distance,
    extend_joints,
    extend_limb,
    nearest_parts,
    part_segments,
    set_segment,
    signed_distance,
    torso_frame,
)
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.geometry.geodesic import UNREACHABLE_M, geodesic_distances
from kpopnet.skeleton import Joint
from kpopnet.tracker.fit.objective import (
    FREE_SPACE_WEIGHT,
    LIMB_JOINT_PRIORS,
    MAX_RESIDUAL_M,
    free_space_cost,
    joint_prior,
    penetration_cost,
)

TORSO_TOLERANCE_M = 0.05
"""Points within this distance of the surface of torso or head, in metres, are sources of the geodesic distance."""
MIN_TIP_SEPARATION_M = 0.15
MIN_TIP_DISTANCE_M = 0.12
MAX_TIPS = 12
"""A tip is the maximum of the geodesic distance within `MIN_TIP_SEPARATION_M` metres, at least `MIN_TIP_DISTANCE_M` metres from
the torso; at most `MAX_TIPS` are used."""
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


@njit(cache=True)
def _torso_points(joints, points, body):
    """(N,) whether a point lies on the torso or the head, and closer to it than to any limb."""
    is_limb = np.zeros(len(PARTS), np.bool_)
    for limb in range(len(LIMB_PARTS)):
        for k in LIMB_PARTS[limb]:
            is_limb[k] = True
    part, distance, _ = nearest_parts(
        part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m), points, 1
    )
    on_torso = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        on_torso[i] = not is_limb[part[i]] and abs(distance[i]) < TORSO_TOLERANCE_M
    return on_torso


@njit(cache=True)
def _limb_tips(points, neighbours, edge_lengths, geodesic):
    """Indices of the points that are local maxima of the geodesic distance."""
    tips = np.empty(MAX_TIPS, np.int32)
    count = 0
    for i in range(len(points)):
        if not MIN_TIP_DISTANCE_M <= geodesic[i] < 1e8 or count == MAX_TIPS:
            continue
        is_maximum = True
        for k in range(8):  # early rejection: most points have a neighbour with a larger distance
            neighbour = neighbours[i, k]
            if neighbour >= 0 and geodesic[i] < geodesic[neighbour] < 1e8 and edge_lengths[i, k] < MIN_TIP_SEPARATION_M:
                is_maximum = False
        for j in range(len(points) if is_maximum else 0):
            if geodesic[j] < 1e8 and (geodesic[j] > geodesic[i] or (geodesic[j] == geodesic[i] and j < i)):
                dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
                if dx * dx + dy * dy + dz * dz < MIN_TIP_SEPARATION_M**2:
                    is_maximum = False
                    break
        if is_maximum:
            tips[count] = i
            count += 1
    return tips[:count]


@njit(cache=True)
def _move_inside(points, index, radius, position):
    """Writes the given surface point, moved along its viewing ray by the radius to the limb's axis, into `position`."""
    x, y, z = points[index, 0], points[index, 1], points[index, 2]
    factor = 1 + radius / math.sqrt(x**2 + y**2 + z**2)
    position[0], position[1], position[2] = x * factor, y * factor, z * factor


@njit(cache=True)
def _distance(a, b):
    """Euclidean distance of two (3,) points."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def _trace_limb(points, predecessor, tip, lower_m, end, middle):
    """Writes end and middle of a limb with this tip: the end `END_TO_TIP_M` along the path, the middle a lower limb on."""
    point, travelled = tip, 0.0
    while predecessor[point] >= 0 and travelled < END_TO_TIP_M:
        travelled += _distance(points[point], points[predecessor[point]])
        point = predecessor[point]
    _move_inside(points, point, END_RADIUS_M, end)
    _move_inside(points, point, MIDDLE_RADIUS_M, middle)
    while predecessor[point] >= 0 and _distance(end, middle) < lower_m:
        point = predecessor[point]
        _move_inside(points, point, MIDDLE_RADIUS_M, middle)


@njit(cache=True)
def _enforce_lengths(root, middle, end, upper_m, lower_m):
    """Moves middle and end until the upper and lower lengths hold; the root stays fixed."""
    for _ in range(12):
        error = (_distance(middle, end) - lower_m) / (_distance(middle, end) + 1e-9)
        for c in range(3):
            offset = end[c] - middle[c]
            middle[c] += 0.5 * error * offset
            end[c] -= 0.15 * error * offset
        factor = upper_m / (_distance(root, middle) + 1e-9)
        for c in range(3):
            middle[c] = root[c] + (middle[c] - root[c]) * factor
    factor = lower_m / (_distance(middle, end) + 1e-9)
    for c in range(3):
        end[c] = middle[c] + (end[c] - middle[c]) * factor


@njit(cache=True)
def _limb_cost(
    segments, limb, limb_parts, joints, forward, points, other_distances, count, num_points, depth, nearest, intrinsics,
    cost_limit,
):  # fmt: skip
    """The terms of the pose cost that a limb can change, in square metres.

    `points` holds `count` points that no other part explains, `other_distances` their distances to the other parts.
    `num_points` is the number of all points. The sum is aborted above `cost_limit`: a few points reject most poses.
    """
    prior_cost = joint_prior(joints, forward, LIMB_JOINT_PRIORS[limb, 0], LIMB_JOINT_PRIORS[limb, 1])
    if prior_cost < cost_limit:
        prior_cost += penetration_cost(segments, LIMB_COLLISIONS[limb, 0], LIMB_COLLISIONS[limb, 1], cost_limit - prior_cost)
    for k in limb_parts:
        if prior_cost >= cost_limit:
            return prior_cost
        prior_cost += FREE_SPACE_WEIGHT / len(PARTS) * free_space_cost(segments, k, depth, nearest, intrinsics)
    total, residual_limit = 0.0, (cost_limit - prior_cost) * num_points
    for i in range(count):
        if total > residual_limit:
            break
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        distance = other_distances[i]
        for k in limb_parts:
            distance = min(distance, signed_distance(segments, k, x, y, z)[0])
        distance = max(distance, -MAX_RESIDUAL_M)
        total += distance * distance
    return total / max(num_points, 1) + prior_cost


@njit(cache=True)
def _continuity_cost(joints, previous, end):
    """Continuity cost of the end of a limb, in square metres."""
    dx, dy, dz = joints[end, 0] - previous[end, 0], joints[end, 1] - previous[end, 1], joints[end, 2] - previous[end, 2]
    return CONTINUITY_WEIGHT * min(math.sqrt(dx * dx + dy * dy + dz * dz), MAX_END_STEP_M) ** 2


@njit(cache=True)
def _apply_limb_pose(joints, root, middle, end, frame, sign, poses, index, upper_m, lower_m):
    """Writes middle and end of a limb in pose `index` of `LIMB_POSES`; sign is 1 for a right limb, -1 for a left one."""
    for c in range(3):
        upper = sign * poses[index, 0, 0] * frame[0, c] + poses[index, 0, 1] * frame[1, c] + poses[index, 0, 2] * frame[2, c]
        lower = sign * poses[index, 1, 0] * frame[0, c] + poses[index, 1, 1] * frame[1, c] + poses[index, 1, 2] * frame[2, c]
        joints[middle, c] = joints[root, c] + upper_m * upper
        joints[end, c] = joints[middle, c] + lower_m * lower


@njit(cache=True)
def _unexplained_points(points, part_distances, limb_parts, other_distances, unexplained):
    """Copies the points that only this limb's parts can explain.

    Writes the points to `unexplained` and their distances to the nearest other part to `other_distances`. Returns their number.
    """
    nearest_other = np.full(len(points), MAX_RESIDUAL_M)
    for k in range(len(part_distances)):
        if k != limb_parts[0] and k != limb_parts[1] and k != limb_parts[2]:
            row = part_distances[k]
            for i in range(len(points)):
                nearest_other[i] = min(nearest_other[i], row[i])
    count = 0
    for i in range(len(points)):
        if nearest_other[i] > EXPLAINED_M:
            other_distances[count] = nearest_other[i]
            for c in range(3):
                unexplained[count, c] = points[i, c]
            count += 1
    return count


@njit(cache=True)
def _part_distances(joints, points, parts, radii, part_indices, distances):
    """Writes the signed distances of the points to the surfaces of the given parts into the rows of `distances`."""
    segments = part_segments(joints, parts, radii)
    x, y, z = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    for k in part_indices:
        x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change = segments[k]
        row = distances[k]
        for i in range(len(points)):
            row[i] = cone_signed_distance(
                x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change, x[i], y[i], z[i]
            )[0]


@njit(cache=True)
def _best_limb_pose(
    limb, min_gain, joints, frame, previous, grid, body, sampled, part_distances, ends, middles, used, other_distances,
    unexplained,
):  # fmt: skip
    """Finds the best pose of one limb: traced from a tip along the silhouette in two variants, or one of `LIMB_POSES`.

    Args:
        limb: 0 to 3.
        min_gain: smallest decrease of the cost to accept, in square metres.
        joints: (25, 3) the pose with all rows; modified and restored.
        frame: (3, 3) from `kpopnet.geometry.cones.torso_frame`.
        previous: (15, 3) the pose of the last frame.
        grid: the depth image.
        body: the person's body.
        sampled: (n, 3) the points that are used.
        part_distances: (P, n) their signed distances to all parts.
        ends: (tips, 3) the limb's end for each tip.
        middles: (tips, 3) the limb's middle for each tip.
        used: (tips,) whether a tip is assigned to another limb.
        other_distances: (n,) work array.
        unexplained: (n, 3) work array.

    Returns:
        The decrease of the cost, `min_gain` if the limb is kept; the tip, or -1; the middle; the end.
    """
    root, middle, end = LIMBS[limb, 0], LIMBS[limb, 1], LIMBS[limb, 2]
    upper_m, lower_m = body.limbs_m[limb, 0], body.limbs_m[limb, 1]
    segments = part_segments(joints, PARTS, body.radii_m)
    count = _unexplained_points(sampled, part_distances, LIMB_PARTS[limb], other_distances, unexplained)
    old_middle, old_end = joints[middle].copy(), joints[end].copy()
    best_gain, best_tip, best_middle, best_end = min_gain, -1, old_middle, old_end
    current_cost = 0.0
    # Candidate -1 is the current pose, then come two per tip, then the sampled limb poses.
    for candidate in range(-1, 2 * len(ends) + LIMB_POSE_RANGES[limb, 1] - LIMB_POSE_RANGES[limb, 0]):
        tip = candidate // 2 if 0 <= candidate < 2 * len(ends) else -1
        if tip >= 0:
            if used[tip] or _distance(ends[tip], joints[root]) > upper_m + lower_m + REACH_SLACK_M:
                continue
            for c in range(3):
                joints[end, c], joints[middle, c] = ends[tip, c], middles[tip, c]
                # The path along the surface cuts the corner at the elbow: also try halfway to the old elbow.
                if candidate % 2 == 1:
                    joints[middle, c] = (joints[middle, c] + old_middle[c]) / 2
            _enforce_lengths(joints[root], joints[middle], joints[end], upper_m, lower_m)
        elif candidate >= 0:
            pose_index, sign = LIMB_POSE_RANGES[limb, 0] + candidate - 2 * len(ends), 1.0 - 2.0 * (limb % 2)
            _apply_limb_pose(joints, root, middle, end, frame, sign, LIMB_POSES, pose_index, upper_m, lower_m)
        motion_cost = _continuity_cost(joints, previous, end)
        cost_limit = 1e9 if candidate < 0 else current_cost - best_gain
        if motion_cost >= cost_limit:
            continue
        extend_limb(joints, limb, frame[2])
        for k in LIMB_PARTS[limb]:
            set_segment(segments, k, joints, PARTS, body.radii_m)
        cost = motion_cost + _limb_cost(
            segments, limb, LIMB_PARTS[limb], joints, frame[2], unexplained, other_distances, count, len(sampled),
            grid.depth_m, grid.nearest, grid.intrinsics, cost_limit - motion_cost,
        )  # fmt: skip
        if candidate < 0:
            current_cost = cost
            if current_cost <= best_gain:
                break  # the cost cannot decrease by more than its own value
        elif current_cost - cost > best_gain:
            best_gain, best_tip, best_middle, best_end = current_cost - cost, tip, joints[middle].copy(), joints[end].copy()
    joints[middle], joints[end] = old_middle, old_end
    extend_limb(joints, limb, frame[2])
    return best_gain, best_tip, best_middle, best_end


@njit(cache=True)
def _refit_limbs(joints, previous, grid, body, stride):
    """`refit_limbs` as a kernel: repeatedly refits the limb with the largest decrease of the cost, each limb at most once."""
    points = grid.points_m
    source = _torso_points(joints, points, body)
    geodesic, predecessor = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = _limb_tips(points, grid.neighbours, grid.edge_lengths_m, geodesic)
    joints, frame, sampled = extend_joints(joints, body.trunk_offsets_m), torso_frame(joints), points[::stride]
    part_distances = np.empty((len(PARTS), len(sampled)))
    _part_distances(joints, sampled, PARTS, body.radii_m, np.arange(len(PARTS)), part_distances)
    ends, middles = np.empty((len(LIMBS), len(tips), 3)), np.empty((len(LIMBS), len(tips), 3))
    for limb in range(len(LIMBS)):
        for k in range(len(tips)):
            _trace_limb(points, predecessor, tips[k], body.limbs_m[limb, 1], ends[limb, k], middles[limb, k])
    used, refitted = np.zeros(len(tips), np.bool_), np.zeros(len(LIMBS), np.bool_)
    other_distances, unexplained = np.empty(len(sampled)), np.empty((len(sampled), 3))
    for num_refitted in range(len(LIMBS)):
        best_gain, best_limb, best_tip = MIN_GAIN_M2, -1, -1
        best_middle, best_end = np.zeros(3), np.zeros(3)
        for limb in range(len(LIMBS)):
            if refitted[limb]:
                continue
            gain, tip, middle, end = _best_limb_pose(
                limb,
                best_gain,
                joints,
                frame,
                previous,
                grid,
                body,
                sampled,
                part_distances,
                ends[limb],
                middles[limb],
                used,
                other_distances,
                unexplained,
            )
            if gain > best_gain:
                best_gain, best_limb, best_tip, best_middle, best_end = gain, limb, tip, middle, end
        if best_limb < 0:
            return joints[: len(previous)], num_refitted
        joints[LIMBS[best_limb, 1]], joints[LIMBS[best_limb, 2]] = best_middle, best_end
        extend_limb(joints, best_limb, frame[2])
        refitted[best_limb] = True
        if best_tip >= 0:
            used[best_tip] = True
        _part_distances(joints, sampled, PARTS, body.radii_m, LIMB_PARTS[best_limb], part_distances)
    return joints[: len(previous)], len(LIMBS)


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


def rotate_about_spine(joints_m: np.ndarray, angle_rad: float) -> np.ndarray:
    """The pose rotated about the torso's long axis, positive to the person's left."""
    hips = (joints_m[Joint.RIGHT_HIP] + joints_m[Joint.LEFT_HIP]) / 2
    return _rotate(joints_m, joints_m[Joint.NECK] - hips, angle_rad)


def rotate_about_shoulders(joints_m: np.ndarray, angle_rad: float) -> np.ndarray:
    """The pose rotated about the line through the shoulders, positive forwards."""
    return _rotate(joints_m, joints_m[Joint.LEFT_SHOULDER] - joints_m[Joint.RIGHT_SHOULDER], angle_rad)


def _rotate(joints_m: np.ndarray, axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Rodrigues rotation about an axis through the torso's centre."""
    middle = joints_m[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(0)
    axis = axis / (np.linalg.norm(axis) + 1e-9)
    offset = joints_m - middle
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return middle + offset * cos + np.cross(axis, offset) * sin + np.outer(offset @ axis, axis) * (1 - cos)
