"""Other poses worth trying, read off the silhouette: limbs laid along it to its tips, and turned bodies.

Beyond the paper, which follows one pose and cannot come back once a limb is lost. The tips of hands and feet are where
the way to the torso, inside the silhouette, is longest (Plagemann et al. 2010); the way back from a tip is the limb.
"""

import math

import numpy as np
from numba import njit

from kpopnet.skeleton import Joint
from kpopnet.tracker.body import BARRED_OF, LIMB_PARTS, LIMBS, PARTS, Body
from kpopnet.tracker.cells import Cells
from kpopnet.tracker.cones import axes_of, extend, extend_limb, frame_of, nearest_parts, off_cone, off_surface, set_axis
from kpopnet.tracker.geodesic import NOWHERE_M, shortest_ways
from kpopnet.tracker.misfit import CLIP_M, FREE_SPACE_WEIGHT, HABITS_OF, outside, overlap, unusual

ON_TORSO_M = 0.05
TIP_APART_M = 0.15
TIP_LEAST_M = 0.12
MOST_TIPS = 12
TIP_BEYOND_END_M = 0.08
"""The silhouette goes on so far beyond the hand's and the foot's joint: fingers and toes."""

END_RADIUS_M, MIDDLE_RADIUS_M = 0.05, 0.06
SLACK_M = 0.12
"""A tip may be so much farther from the limb's root than the limb is long, since the root may be off."""

CONTINUITY = 0.0005
FARTHEST_M = 0.5
"""The end of a limb pays for the square of its way since the last frame, up to this distance."""

LEAST_GAIN = 1e-4
"""Square metres of misfit that a limb must gain to be laid anew."""

EXPLAINED_M = 0.02
"""A point this near to another part's surface gains little from a limb."""


def _limb_poses() -> tuple[np.ndarray, np.ndarray]:
    """Directions of upper and lower limb in the torso's frame (right, down, front) of a right limb.

    Returns:
        (K, 2, 3) unit vectors, and (4, 2) for each limb its first and its last but one.
    """
    around = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    arms = [
        (upper, lower)
        for upper in around
        for lower in around
        if upper @ lower > np.cos(np.radians(130)) and not (upper[0] < -0.4 and upper[2] < 0.3) and lower[2] > -0.6
    ]
    legs = []
    for upper in around:
        if upper[2] < -0.6 or upper[0] < -0.6 or upper[1] < -0.1:
            continue
        # The knee bends backwards only: about the axis to the right.
        back = np.cross(upper, (1.0, 0, 0))
        back = back / np.linalg.norm(back) if np.linalg.norm(back) > 0.1 else np.array((0.0, 1.0, 0.0))
        legs += [(upper, np.cos(bend) * upper + np.sin(bend) * back) for bend in np.radians((0, 50, 100, 140))]
    poses = np.array(arms + legs)
    a, all_ = len(arms), len(poses)
    return poses, np.array([(0, a), (0, a), (a, all_), (a, all_)])


LIMB_POSES, LIMB_KINDS = _limb_poses()


@njit(cache=True)
def _torso_cells(joints, points, body):
    """(N,) whether a point lies on the torso or the head and nearer to it than to any limb."""
    is_limb = np.zeros(len(PARTS), np.bool_)
    for limb in range(len(LIMB_PARTS)):
        for k in LIMB_PARTS[limb]:
            is_limb[k] = True
    part, off, _ = nearest_parts(axes_of(extend(joints, body.places_m), PARTS, body.radii_m), points, 1)
    on = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        on[i] = not is_limb[part[i]] and abs(off[i]) < ON_TORSO_M
    return on


@njit(cache=True)
def _tips(points, neighbours, steps, length):
    """Numbers of the points that are farther than all others around them."""
    tips = np.empty(MOST_TIPS, np.int32)
    count = 0
    for i in range(len(points)):
        if not TIP_LEAST_M <= length[i] < 1e8 or count == MOST_TIPS:
            continue
        farthest = True
        for k in range(8):  # most points have a farther one beside them
            beside = neighbours[i, k]
            if beside >= 0 and length[i] < length[beside] < 1e8 and steps[i, k] < TIP_APART_M:
                farthest = False
        for j in range(len(points) if farthest else 0):
            if length[j] < 1e8 and (length[j] > length[i] or (length[j] == length[i] and j < i)):
                dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
                if dx * dx + dy * dy + dz * dz < TIP_APART_M**2:
                    farthest = False
                    break
        if farthest:
            tips[count] = i
            count += 1
    return tips[:count]


@njit(cache=True)
def _inside(points, k, radius, inside):
    """Writes the kth point of the surface, moved along its viewing ray to the limb's middle."""
    x, y, z = points[k, 0], points[k, 1], points[k, 2]
    deeper = 1 + radius / math.sqrt(x**2 + y**2 + z**2)
    inside[0], inside[1], inside[2] = x * deeper, y * deeper, z * deeper


@njit(cache=True)
def _apart(a, b):
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def _laid_along(points, onward, tip, lower_m, end, middle):
    """Writes end and middle of a limb whose tip is here: a little way inwards, and a lower limb's length from there."""
    here, gone = tip, 0.0
    while onward[here] >= 0 and gone < TIP_BEYOND_END_M:
        gone += _apart(points[here], points[onward[here]])
        here = onward[here]
    _inside(points, here, END_RADIUS_M, end)
    _inside(points, here, MIDDLE_RADIUS_M, middle)
    while onward[here] >= 0 and _apart(end, middle) < lower_m:
        here = onward[here]
        _inside(points, here, MIDDLE_RADIUS_M, middle)


@njit(cache=True)
def _with_lengths(root, middle, end, upper_m, lower_m):
    """Moves middle and end until both lengths are right; the root stays."""
    for _ in range(12):
        wrong = (_apart(middle, end) - lower_m) / (_apart(middle, end) + 1e-9)
        for c in range(3):
            way = end[c] - middle[c]
            middle[c] += 0.5 * wrong * way
            end[c] -= 0.15 * wrong * way
        share = upper_m / (_apart(root, middle) + 1e-9)
        for c in range(3):
            middle[c] = root[c] + (middle[c] - root[c]) * share
    share = lower_m / (_apart(middle, end) + 1e-9)
    for c in range(3):
        end[c] = middle[c] + (end[c] - middle[c]) * share


@njit(cache=True)
def _limb_misfit(axes, limb, limb_parts, joints, front, points, rest, count, of_all, depth, nearest, intrinsics, enough):
    """The part of the misfit that a limb can change.

    The first `count` of `points` are those that no other part explains, `rest` their distances to these; `of_all` is
    the number of all points. What comes to `enough` is not added up to its end: most poses fail by a few points.
    """
    besides = unusual(joints, front, HABITS_OF[limb, 0], HABITS_OF[limb, 1])
    if besides < enough:
        besides += overlap(axes, BARRED_OF[limb, 0], BARRED_OF[limb, 1], enough - besides)
    for k in limb_parts:
        if besides >= enough:
            return besides
        besides += FREE_SPACE_WEIGHT / len(PARTS) * outside(axes, k, depth, nearest, intrinsics)
    total, most = 0.0, (enough - besides) * of_all
    for i in range(count):
        if total > most:
            break
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        off = rest[i]
        for k in limb_parts:
            off = min(off, off_surface(axes, k, x, y, z)[0])
        off = max(off, -CLIP_M)
        total += off * off
    return total / max(of_all, 1) + besides


@njit(cache=True)
def _way(joints, before, end):
    """What the end of a limb pays for having moved."""
    dx, dy, dz = joints[end, 0] - before[end, 0], joints[end, 1] - before[end, 1], joints[end, 2] - before[end, 2]
    return CONTINUITY * min(math.sqrt(dx * dx + dy * dy + dz * dz), FARTHEST_M) ** 2


@njit(cache=True)
def _pose_limb(joints, root, middle, end, frame, side, poses, k, upper_m, lower_m):
    """Puts a limb into the kth of `LIMB_POSES`; side is 1 for the right one, -1 for the left."""
    for c in range(3):
        upper = side * poses[k, 0, 0] * frame[0, c] + poses[k, 0, 1] * frame[1, c] + poses[k, 0, 2] * frame[2, c]
        lower = side * poses[k, 1, 0] * frame[0, c] + poses[k, 1, 1] * frame[1, c] + poses[k, 1, 2] * frame[2, c]
        joints[middle, c] = joints[root, c] + upper_m * upper
        joints[end, c] = joints[middle, c] + lower_m * lower


@njit(cache=True)
def _open_points(points, away, limb_parts, rest, found):
    """Copies the points that no part but the limb's own explains to `found`, their distances to `rest`; how many."""
    others = np.full(len(points), CLIP_M)
    for k in range(len(away)):
        if k != limb_parts[0] and k != limb_parts[1] and k != limb_parts[2]:
            distance = away[k]
            for i in range(len(points)):
                others[i] = min(others[i], distance[i])
    count = 0
    for i in range(len(points)):
        if others[i] > EXPLAINED_M:
            rest[count] = others[i]
            for c in range(3):
                found[count, c] = points[i, c]
            count += 1
    return count


@njit(cache=True)
def _distances(joints, points, parts, radii, which, away):
    """Writes the points' signed distances to the surfaces of some parts into the rows of `away`."""
    axes = axes_of(joints, parts, radii)
    x, y, z = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    for k in which:
        x0, y0, z0, dx, dy, dz, scale, radius, growth = axes[k]
        row = away[k]
        for i in range(len(points)):
            row[i] = off_cone(x0, y0, z0, dx, dy, dz, scale, radius, growth, x[i], y[i], z[i])[0]


@njit(cache=True)
def _best_laid(limb, least, joints, frame, before, cells, body, some, away, ends, middles, used, rest, unexplained):
    """One limb as it is laid best: along the silhouette from a tip, in two ways, or in one of `LIMB_POSES`.

    Args:
        limb: 0 to 3.
        least: square metres of misfit that there must be to gain.
        joints: (25, 3) the pose with all other rows; written to, and left as it was.
        frame: the torso's, of `kpopnet.tracker.cones.frame_of`.
        before: (15, 3) the pose of the last frame.
        cells: the picture.
        body: the person.
        some: (n, 3) the points that are looked at.
        away: (P, n) their signed distances to all parts.
        ends: (tips, 3) where the limb's end comes to lie at each tip.
        middles: (tips, 3) and its middle.
        used: (tips,) those that belong to another limb.
        rest: (n,) to work in.
        unexplained: (n, 3) to work in.

    Returns:
        What it gains, `least` if it stays best as it is; the tip it ends at, or -1; its middle and its end.
    """
    root, middle, end = LIMBS[limb, 0], LIMBS[limb, 1], LIMBS[limb, 2]
    upper_m, lower_m = body.limbs_m[limb, 0], body.limbs_m[limb, 1]
    axes = axes_of(joints, PARTS, body.radii_m)
    count = _open_points(some, away, LIMB_PARTS[limb], rest, unexplained)
    kept_middle, kept_end = joints[middle].copy(), joints[end].copy()
    best, best_tip, best_middle, best_end = least, -1, kept_middle, kept_end
    now = 0.0
    # First as it is, then from each tip, then in every known pose.
    for candidate in range(-1, 2 * len(ends) + LIMB_KINDS[limb, 1] - LIMB_KINDS[limb, 0]):
        tip = candidate // 2 if 0 <= candidate < 2 * len(ends) else -1
        if tip >= 0:
            if used[tip] or _apart(ends[tip], joints[root]) > upper_m + lower_m + SLACK_M:
                continue
            for c in range(3):
                joints[end, c], joints[middle, c] = ends[tip, c], middles[tip, c]
                # The way on the surface cuts the elbow's corner: also try it where the elbow was.
                if candidate % 2 == 1:
                    joints[middle, c] = (joints[middle, c] + kept_middle[c]) / 2
            _with_lengths(joints[root], joints[middle], joints[end], upper_m, lower_m)
        elif candidate >= 0:
            pose, side = LIMB_KINDS[limb, 0] + candidate - 2 * len(ends), 1.0 - 2.0 * (limb % 2)
            _pose_limb(joints, root, middle, end, frame, side, LIMB_POSES, pose, upper_m, lower_m)
        way = _way(joints, before, end)
        enough = 1e9 if candidate < 0 else now - best
        if way >= enough:
            continue
        extend_limb(joints, limb, frame[2])
        for k in LIMB_PARTS[limb]:
            set_axis(axes, k, joints, PARTS, body.radii_m)
        then = way + _limb_misfit(
            axes, limb, LIMB_PARTS[limb], joints, frame[2], unexplained, rest, count, len(some),
            cells.depth_m, cells.nearest, cells.intrinsics, enough - way,
        )  # fmt: skip
        if candidate < 0:
            now = then
            if now <= best:
                break  # it has nothing to gain
        elif now - then > best:
            best, best_tip, best_middle, best_end = now - then, tip, joints[middle].copy(), joints[end].copy()
    joints[middle], joints[end] = kept_middle, kept_end
    extend_limb(joints, limb, frame[2])
    return best, best_tip, best_middle, best_end


@njit(cache=True)
def _relay(joints, before, cells, body, every):
    points = cells.points_m
    source = _torso_cells(joints, points, body)
    length, onward = shortest_ways(cells.neighbours, cells.steps_m, source, NOWHERE_M)
    tips = _tips(points, cells.neighbours, cells.steps_m, length)
    joints, frame, some = extend(joints, body.places_m), frame_of(joints), points[::every]
    away = np.empty((len(PARTS), len(some)))
    _distances(joints, some, PARTS, body.radii_m, np.arange(len(PARTS)), away)
    ends, middles = np.empty((len(LIMBS), len(tips), 3)), np.empty((len(LIMBS), len(tips), 3))
    for limb in range(len(LIMBS)):
        for k in range(len(tips)):
            _laid_along(points, onward, tips[k], body.limbs_m[limb, 1], ends[limb, k], middles[limb, k])
    used, laid = np.zeros(len(tips), np.bool_), np.zeros(len(LIMBS), np.bool_)
    rest, unexplained = np.empty(len(some)), np.empty((len(some), 3))
    for changes in range(len(LIMBS)):
        best, best_limb, best_tip = LEAST_GAIN, -1, -1
        best_middle, best_end = np.zeros(3), np.zeros(3)
        for limb in range(len(LIMBS)):
            if laid[limb]:
                continue
            gain, tip, middle, end = _best_laid(
                limb, best, joints, frame, before, cells, body, some, away, ends[limb], middles[limb], used, rest, unexplained
            )
            if gain > best:
                best, best_limb, best_tip, best_middle, best_end = gain, limb, tip, middle, end
        if best_limb < 0:
            return joints[: len(before)], changes
        joints[LIMBS[best_limb, 1]], joints[LIMBS[best_limb, 2]] = best_middle, best_end
        extend_limb(joints, best_limb, frame[2])
        laid[best_limb] = True
        if best_tip >= 0:
            used[best_tip] = True
        _distances(joints, some, PARTS, body.radii_m, LIMB_PARTS[best_limb], away)
    return joints[: len(before)], len(LIMBS)


def relay_limbs(
    joints_m: np.ndarray, before_m: np.ndarray, cells: Cells, body: Body, every: int = 1
) -> tuple[np.ndarray, int]:
    """Lays limbs along the silhouette to its tips wherever that explains the picture better, the greatest gain first.

    Args:
        joints_m: (15, 3) whose torso is about right.
        before_m: (15, 3) the pose of the last frame: ends of limbs pay for their way from there.
        cells: the picture.
        body: the person.
        every: only every so many points are looked at.

    Returns:
        (15, 3) the pose, and how many limbs were laid anew.
    """
    return _relay(joints_m, before_m, cells, body, every)


def uncrossed(joints_m: np.ndarray) -> list[np.ndarray]:
    """Of (15, 3) joints in the camera frame in metres whose arms or legs cross: the poses in which these have exchanged their
    ends, and all but their roots; none if nothing crosses.

    A limb that was lost may find the silhouette of the other one, and that one then finds the place left over.
    """
    right = frame_of(joints_m)[0]
    found = []
    for (_, *one), (_, *other) in LIMBS.reshape(2, 2, 3):
        if (joints_m[one[1]] - joints_m[other[1]]) @ right < 0:
            for exchanged in (1, 0):
                pose = joints_m.copy()
                pose[one[exchanged:]], pose[other[exchanged:]] = joints_m[other[exchanged:]], joints_m[one[exchanged:]]
                found.append(pose)
    return found


def turned(joints_m: np.ndarray, angle_rad: float) -> np.ndarray:
    """The pose turned about the torso's long axis, positive to the person's left."""
    hips = (joints_m[Joint.RIGHT_HIP] + joints_m[Joint.LEFT_HIP]) / 2
    return _rotated(joints_m, joints_m[Joint.NECK] - hips, angle_rad)


def bent(joints_m: np.ndarray, angle_rad: float) -> np.ndarray:
    """The pose turned about the line through the shoulders, positive forwards."""
    return _rotated(joints_m, joints_m[Joint.LEFT_SHOULDER] - joints_m[Joint.RIGHT_SHOULDER], angle_rad)


def _rotated(joints_m: np.ndarray, axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Rodrigues' rotation about an axis through the torso's middle."""
    middle = joints_m[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(0)
    axis = axis / (np.linalg.norm(axis) + 1e-9)
    arm = joints_m - middle
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return middle + arm * cos + np.cross(axis, arm) * sin + np.outer(arm @ axis, axis) * (1 - cos)
