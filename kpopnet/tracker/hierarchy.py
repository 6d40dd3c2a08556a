"""Hierarchical human pose estimation (section 2.4): Algorithm 2, from the head down to hands and feet.

What the paper leaves open is settled so:

- Candidates are pixels of the body's surface, joints lie inside. Each candidate is moved in along its viewing ray by the
  thickness of the body at the joint that is looked for (kpopnet.tracker.body), before any distance is taken.
- r_j and epsilon_j are millimetres in Table 1; 110 and 50 are its best.
- "Insufficient" is fewer than `ENOUGH` valid candidates. Where the raw depth does not give that many either, the joint
  goes along with its parent (the torso's with the head), and it is predicted without velocity in the next frame: left
  to Eq. (3) alone, a joint once lost flies off for ever.
- The geodesic distance of Eq. (10) is the shortest way over the silhouette's cells, where a jump in depth counts
  `kpopnet.tracker.geodesic.JUMP_COST` times.
- Eqs. (6) and (8) name the distance from the head (the torso's centre) to the line through candidate and opposite
  shoulder (hip). The first of the two shoulders, and of the two hips, is judged by the prediction of the other.
- The neck, which the paper does not estimate, lies between the shoulders and the head.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.body import NECK_SHARE, PARTS, RIGHT_RIBS, Body
from kpopnet.tracker.cells import CELL_PX, Cells
from kpopnet.tracker.geodesic import shortest_ways
from kpopnet.tracker.model import LIMB_PARENTS, HumanModel

HEAD, TORSO = int(Joint.HEAD), int(Joint.TORSO)
RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)

ORDER = np.array([HEAD, RIGHT_SHOULDER, LEFT_SHOULDER, TORSO, RIGHT_HIP, LEFT_HIP, *LIMB_PARENTS])
PARENTS = np.array([LIMB_PARENTS.get(joint, -1) for joint in Joint])
CARRIERS = np.where(PARENTS >= 0, PARENTS, HEAD)
ENOUGH = 3
SOURCE_M = 0.12
"""A parent joint's own surface: the geodesic distance starts from the cells within this of it, or from the nearest."""


@dataclass(frozen=True)
class HierarchyConfig:
    """Parameters of Algorithm 2.

    Attributes:
        candidates: ridge (raw depth only where ridge data do not suffice) or depth (raw depth only, Fig. 10's comparison).
        r_m: radius of the search for a joint, r_j of Eqs. (4) and (12).
        epsilon_m: tolerance of lengths, epsilon_j of Eqs. (5) to (9).
        straightness: the least ratio of straight to geodesic distance, epsilon_L of Eq. (9).
    """

    candidates: str = "ridge"
    r_m: float = 0.11
    epsilon_m: float = 0.05
    straightness: float = 0.7

    def __post_init__(self) -> None:
        if self.candidates not in ("ridge", "depth"):
            raise InputError(f"hierarchy.candidates={self.candidates}: expected ridge or depth")
        if not (0 < self.r_m <= 2 and 0 < self.epsilon_m <= 1 and 0 <= self.straightness < 1):
            raise InputError(
                "hierarchy: expected r_m in 0..2 m, epsilon_m in 0..1 m and straightness in 0..1, found "
                f"{self.r_m}, {self.epsilon_m} and {self.straightness}"
            )


def lengths_of(model: HumanModel) -> np.ndarray:
    """(2, 15) l of the rules: in row 0 the shoulders' and hips' distances to the right shoulder and the limbs' to their
    parents, in row 1 the same to the left shoulder; the torso's in both; perpendiculars in the columns of head and neck.
    """
    lengths = np.zeros((2, NUM_JOINTS))
    lengths[:, HEAD] = model.head_to_torso_m, model.head_to_shoulder_line_m
    lengths[:, Joint.NECK] = model.shoulder_to_shoulder_m, model.torso_to_hip_line_m
    lengths[:, TORSO] = model.right_shoulder_to_torso_m, model.left_shoulder_to_torso_m
    lengths[:, RIGHT_HIP] = model.right_shoulder_to_right_hip_m, model.left_shoulder_to_right_hip_m
    lengths[:, LEFT_HIP] = model.right_shoulder_to_left_hip_m, model.left_shoulder_to_left_hip_m
    for joint, length in model.limb_m.items():
        lengths[:, joint] = length
    return lengths


@njit(cache=True)
def thickness_of(radii):
    """(15,) how deep under the surface each joint lies: the thinnest part that ends there, the ribs' for the torso."""
    thickness = np.full(NUM_JOINTS, np.inf)
    for k in range(len(PARTS)):
        for end in range(2):
            row = TORSO if PARTS[k, end] == RIGHT_RIBS else PARTS[k, end]
            if row < NUM_JOINTS:
                thickness[row] = min(thickness[row], radii[k, end])
    return thickness


@njit(cache=True)
def _distance(x, y):
    return math.sqrt((x[0] - y[0]) ** 2 + (x[1] - y[1]) ** 2 + (x[2] - y[2]) ** 2)


@njit(cache=True)
def _perpendicular(x, opposite, point):
    """From a point to the line through a candidate x and the joint opposite to it."""
    ax, ay, az = x[0] - opposite[0], x[1] - opposite[1], x[2] - opposite[2]
    bx, by, bz = point[0] - opposite[0], point[1] - opposite[1], point[2] - opposite[2]
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return math.sqrt((cx * cx + cy * cy + cz * cz) / (ax * ax + ay * ay + az * az + 1e-12))


@njit(cache=True)
def _valid_head(x, joints, lengths, epsilon):
    # Eq. (5)
    return abs(_distance(x, joints[TORSO]) - lengths[0, 0]) <= epsilon


@njit(cache=True)
def _valid_shoulder(x, opposite, joints, lengths, epsilon):
    # Eq. (6)
    across = abs(_distance(joints[opposite], x) - lengths[0, 1]) <= epsilon
    return across and abs(_perpendicular(x, joints[opposite], joints[HEAD]) - lengths[1, 0]) <= epsilon


@njit(cache=True)
def _valid_torso(x, joints, lengths, epsilon):
    # Eq. (7)
    return (
        abs(_distance(joints[HEAD], x) - lengths[0, 0]) <= epsilon
        and abs(_distance(joints[RIGHT_SHOULDER], x) - lengths[0, TORSO]) <= epsilon
        and abs(_distance(joints[LEFT_SHOULDER], x) - lengths[1, TORSO]) <= epsilon
    )


@njit(cache=True)
def _valid_hip(x, hip, opposite, joints, lengths, epsilon):
    # Eq. (8)
    return (
        abs(_distance(joints[RIGHT_SHOULDER], x) - lengths[0, hip]) <= epsilon
        and abs(_distance(joints[LEFT_SHOULDER], x) - lengths[1, hip]) <= epsilon
        and abs(_perpendicular(x, joints[opposite], joints[TORSO]) - lengths[1, 1]) <= epsilon
    )


@njit(cache=True)
def _valid_limb(x, limb, parent, geodesic_m, joints, lengths, epsilon, straightness):
    # Eq. (9)
    straight = _distance(x, joints[parent])
    # Eq. (10)
    return abs(straight - lengths[0, limb]) <= epsilon and straight > straightness * geodesic_m


@njit(cache=True)
def _farthest_m(limb, lengths, epsilon, straightness):
    """The geodesic distance beyond which no candidate of a limb can pass Eq. (9)."""
    return (lengths[0, limb] + epsilon) / max(straightness, 1e-9)


@njit(cache=True)
def _is_valid(x, geodesic_m, joint, joints, lengths, epsilon, straightness):
    """The switch of Algorithm 2."""
    if joint == HEAD:
        return _valid_head(x, joints, lengths, epsilon)
    if joint in (RIGHT_SHOULDER, LEFT_SHOULDER):
        return _valid_shoulder(x, RIGHT_SHOULDER + LEFT_SHOULDER - joint, joints, lengths, epsilon)
    if joint == TORSO:
        return _valid_torso(x, joints, lengths, epsilon)
    if joint in (RIGHT_HIP, LEFT_HIP):
        return _valid_hip(x, joint, RIGHT_HIP + LEFT_HIP - joint, joints, lengths, epsilon)
    return _valid_limb(x, joint, PARENTS[joint], geodesic_m, joints, lengths, epsilon, straightness)


@njit(cache=True)
def _from_parent(parent_m, points, neighbours, steps, farthest_m):
    """(N,) geodesic distances of all cells to a joint, up to a farthest one."""
    source = np.zeros(len(points), np.bool_)
    nearest, least = -1, 1e9
    for i in range(len(points)):
        away = _distance(points[i], parent_m)
        source[i] = away < SOURCE_M
        if away < least:
            nearest, least = i, away
    if nearest >= 0:
        source[nearest] = True
    return shortest_ways(neighbours, steps, source, farthest_m)[0]


@njit(cache=True)
def _estimate(joint, candidates_m, cell_of, predicted, joints, geodesics_m, thickness, lengths, r, epsilon, straightness):
    """Sums up the valid ones of some candidates: their sum, how many, and which."""
    total, count = np.zeros(3), 0
    valid = np.zeros(len(candidates_m), np.bool_)
    x = np.empty(3)
    px, py, pz = predicted[joint]
    farthest = r + thickness[joint]
    for i in range(len(candidates_m)):
        sx, sy, sz = candidates_m[i, 0], candidates_m[i, 1], candidates_m[i, 2]
        if (sx - px) ** 2 + (sy - py) ** 2 + (sz - pz) ** 2 > farthest * farthest:
            continue  # too far even when moved in
        deeper = 1 + thickness[joint] / math.sqrt(sx**2 + sy**2 + sz**2)
        x[0], x[1], x[2] = sx * deeper, sy * deeper, sz * deeper
        # Eq. (4), and Eq. (12) for candidates of the raw depth
        if _distance(x, predicted[joint]) > r:
            continue
        geodesic_m = geodesics_m[cell_of[i]] if cell_of[i] >= 0 else 0.0
        if _is_valid(x, geodesic_m, joint, joints, lengths, epsilon, straightness):
            valid[i] = True
            total += x
            count += 1
    return total, count, valid


@njit(cache=True)
def track_frame(
    ridge_m, ridge_cell, points, neighbours, steps, previous, velocity, thickness, lengths, r, epsilon, straightness, only_depth
):
    """Algorithm 2.

    Args:
        ridge_m: (R, 3) ridge data as points on the surface.
        ridge_cell: (R,) the number of each one's cell in `points`, -1 for none.
        points: (N, 3) raw depth, a point a cell.
        neighbours: (N, 8) of the cells,
        steps: (N, 8) and the ways there.
        previous: (15, 3) J^(t-1).
        velocity: (15, 3) Delta J^(t-1), 0 for joints that had no valid candidates.
        thickness: see `thickness_of`.
        lengths: see `lengths_of`.
        r: r_j.
        epsilon: epsilon_j.
        straightness: epsilon_L.
        only_depth: never look at ridge data.

    Returns:
        (15, 3) J^t, and (15,) how many valid candidates each joint had: 0 where it stayed where it was predicted.
    """
    # Eq. (3)
    predicted = previous + velocity
    joints, support = predicted.copy(), np.zeros(len(predicted), np.int32)
    own = np.arange(len(points))
    geodesics_m = np.zeros(len(points))
    for joint in ORDER:
        if PARENTS[joint] >= 0:
            farthest_m = _farthest_m(joint, lengths, epsilon, straightness)
            geodesics_m = _from_parent(joints[PARENTS[joint]], points, neighbours, steps, farthest_m)
        count = 0
        if not only_depth:
            total, count, _ = _estimate(
                joint, ridge_m, ridge_cell, predicted, joints, geodesics_m, thickness, lengths, r, epsilon, straightness
            )
        if count < ENOUGH:
            total, count, _ = _estimate(
                joint, points, own, predicted, joints, geodesics_m, thickness, lengths, r, epsilon, straightness
            )
        if count >= ENOUGH:
            # Eq. (11)
            joints[joint] = total / count
            support[joint] = count
        else:
            joints[joint] = previous[joint]
            if joint != HEAD:
                joints[joint] += joints[CARRIERS[joint]] - previous[CARRIERS[joint]]
    middle = (joints[RIGHT_SHOULDER] + joints[LEFT_SHOULDER]) / 2
    joints[1] = middle + NECK_SHARE * (joints[HEAD] - middle)
    support[1] = min(support[RIGHT_SHOULDER], support[LEFT_SHOULDER], support[HEAD])
    return joints, support


@njit(cache=True)
def ridge_points(ridge, depth, index, intrinsics):
    """(R, 3) the surface points of the ridge data, and (R,) the numbers of the cells they lie in."""
    fx, fy, cx, cy = intrinsics
    flat, count = ridge.ravel(), 0
    for is_ridge in flat:
        count += is_ridge
    points, cell = np.empty((count, 3)), np.empty(count, np.int32)
    count = 0
    # Most pixels are none: they are passed by in eights.
    eights = flat[: flat.size // 8 * 8].view(np.uint64)
    i = 0
    while i < flat.size:
        if not flat[i]:
            i += 8 if i % 8 == 0 and i // 8 < len(eights) and eights[i // 8] == 0 else 1
            continue
        v, u = divmod(i, ridge.shape[1])
        z = float(depth[v, u])
        points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
        cell[count] = index[v // CELL_PX, u // CELL_PX]
        count += 1
        i += 1
    return points, cell


def estimate_pose(
    ridge: np.ndarray,
    cells: Cells,
    previous_m: np.ndarray,
    velocity_m: np.ndarray,
    body: Body,
    lengths: np.ndarray,
    config: HierarchyConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """`track_frame` for (H, W) ridge data and the cells of the same picture."""
    ridge_m, ridge_cell = ridge_points(ridge, cells.depth_m, cells.index, cells.intrinsics)
    return track_frame(
        ridge_m, ridge_cell, cells.points_m, cells.neighbours, cells.steps_m, previous_m, velocity_m,
        thickness_of(body.radii_m), lengths, config.r_m, config.epsilon_m, config.straightness, config.candidates == "depth",
    )  # fmt: skip


def valid_candidates(
    ridge: np.ndarray,
    cells: Cells,
    previous_m: np.ndarray,
    velocity_m: np.ndarray,
    body: Body,
    lengths: np.ndarray,
    config: HierarchyConfig,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `estimate_pose` saw, for drawing.

    Returns:
        (N, 3) ridge data collected for any joint, (M, 3) those left for any joint after pruning, both as points of the
        surface, and (15, 3) the estimated joints.
    """
    joints, _ = estimate_pose(ridge, cells, previous_m, velocity_m, body, lengths, config)
    ridge_m, ridge_cell = ridge_points(ridge, cells.depth_m, cells.index, cells.intrinsics)
    predicted, thickness = previous_m + velocity_m, thickness_of(body.radii_m)
    collected, valid = np.zeros(len(ridge_m), bool), np.zeros(len(ridge_m), bool)
    for joint in ORDER:
        geodesics_m = np.zeros(len(cells.points_m))
        if PARENTS[joint] >= 0:
            farthest_m = _farthest_m(joint, lengths, config.epsilon_m, config.straightness)
            geodesics_m = _from_parent(joints[PARENTS[joint]], cells.points_m, cells.neighbours, cells.steps_m, farthest_m)
        seen = joint, ridge_m, ridge_cell, predicted, joints, geodesics_m, thickness, lengths, config.r_m
        collected |= _estimate(*seen, np.inf, -1.0)[2]
        valid |= _estimate(*seen, config.epsilon_m, config.straightness)[2]
    return ridge_m[collected], ridge_m[valid], joints
