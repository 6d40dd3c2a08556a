"""Hierarchical human pose estimation (section 2.4): Algorithm 2, from the head down to hands and feet.

Assumptions, where the paper is silent:

- Candidates are pixels of the body's surface, joints lie inside. Each candidate is moved along its viewing ray into the
  body, by the radius of the body at the joint (kpopnet.geometry.body), before any distance is measured.
- r_j and epsilon_j are millimetres in Table 1; its best values are 110 and 50.
- "Insufficient" is fewer than `MIN_CANDIDATES` valid candidates. If the raw depth does not give that many either, the joint
  moves with its parent (the torso's joints with the head), and its velocity in the next frame is zero. With only Eq. (3) a
  lost joint would move away without bound.
- The geodesic distance of Eq. (10) is the shortest path over the silhouette's grid cells. An edge across a depth jump counts
  `kpopnet.geometry.geodesic.JUMP_FACTOR` times its length.
- Eqs. (6) and (8) need the distance from the head (the torso's centre) to the line through candidate and opposite shoulder
  (hip). The first of the two shoulders, and of the two hips, is tested against the prediction of the other.
- The neck, which the paper does not estimate, lies between the shoulders and the head.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from kpopnet.errors import InputError
from kpopnet.geometry.body import NECK_FRACTION, PARTS, RIGHT_RIBS, Body
from kpopnet.geometry.depth_grid import DepthGrid
from kpopnet.geometry.geodesic import geodesic_distances
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint

HEAD, TORSO = int(Joint.HEAD), int(Joint.TORSO)
RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)

JOINT_ORDER = np.array([HEAD, RIGHT_SHOULDER, LEFT_SHOULDER, TORSO, RIGHT_HIP, LEFT_HIP, *LIMB_PARENTS])
PARENTS = np.array([LIMB_PARENTS.get(joint, -1) for joint in Joint])
FALLBACK_PARENTS = np.where(PARENTS >= 0, PARENTS, HEAD)
MIN_CANDIDATES = 3
"""Minimum number of valid candidates of a joint."""
SOURCE_RADIUS_M = 0.12
"""The geodesic distance starts from all points within this distance of the parent joint, in metres, and from the nearest
point."""


@dataclass(frozen=True)
class HierarchyConfig:
    """Parameters of Algorithm 2.

    Attributes:
        candidates: ridge (raw depth only where ridge data are insufficient) or depth (raw depth only, the comparison of
            Fig. 10).
        r_m: search radius of a joint in metres, r_j of Eqs. (4) and (12).
        epsilon_m: tolerance of lengths in metres, epsilon_j of Eqs. (5) to (9).
        straightness: minimum ratio of straight to geodesic distance, epsilon_L of Eq. (9).
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


def model_lengths(model: HumanModel) -> np.ndarray:
    """(2, 15) metres: l of the validity rules, as an array for the kernels.

    Row 0 holds the distances of torso and hips to the right shoulder, row 1 those to the left shoulder. Both rows hold the
    limbs' lengths to their parents. The column of the head holds head to torso and head to shoulder line, that of the neck
    shoulder to shoulder and torso to hip line.
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
def joint_thickness(radii):
    """(15,) depth of each joint under the surface in metres: the smallest radius of the parts that end there, the ribs' for the
    torso.
    """
    thickness = np.full(NUM_JOINTS, np.inf)
    for k in range(len(PARTS)):
        for end in range(2):
            row = TORSO if PARTS[k, end] == RIGHT_RIBS else PARTS[k, end]
            if row < NUM_JOINTS:
                thickness[row] = min(thickness[row], radii[k, end])
    return thickness


@njit(cache=True)
def _distance(x, y):
    """Euclidean distance of two (3,) points."""
    return math.sqrt((x[0] - y[0]) ** 2 + (x[1] - y[1]) ** 2 + (x[2] - y[2]) ** 2)


@njit(cache=True)
def _perpendicular(x, opposite, point):
    """Distance of a point to the line through a candidate x and the joint opposite to it."""
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
def _max_geodesic_m(limb, lengths, epsilon, straightness):
    """Geodesic distance in metres above which no candidate of a limb can pass Eq. (9)."""
    return (lengths[0, limb] + epsilon) / max(straightness, 1e-9)


@njit(cache=True)
def _is_valid(x, geodesic_m, joint, joints, lengths, epsilon, straightness):
    """Whether candidate x of a joint is valid: the switch of Algorithm 2."""
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
def _geodesics_from(parent_m, points, neighbours, edge_lengths, max_distance_m):
    """(N,) geodesic distances of all points to a parent joint in metres, up to a maximum."""
    source = np.zeros(len(points), np.bool_)
    nearest, min_distance = -1, 1e9
    for i in range(len(points)):
        distance = _distance(points[i], parent_m)
        source[i] = distance < SOURCE_RADIUS_M
        if distance < min_distance:
            nearest, min_distance = i, distance
    if nearest >= 0:
        source[nearest] = True
    return geodesic_distances(neighbours, edge_lengths, source, max_distance_m)[0]


@njit(cache=True)
def _sum_valid(joint, candidates_m, cell_of, predicted, joints, geodesics_m, thickness, lengths, r, epsilon, straightness):
    """Sums the valid candidates of a joint.

    Returns:
        (3,) their sum in metres, their number, and (N,) which candidates are valid.
    """
    total, count = np.zeros(3), 0
    valid = np.zeros(len(candidates_m), np.bool_)
    x = np.empty(3)
    px, py, pz = predicted[joint]
    max_surface_distance = r + thickness[joint]
    for i in range(len(candidates_m)):
        surface_x, surface_y, surface_z = candidates_m[i, 0], candidates_m[i, 1], candidates_m[i, 2]
        if (surface_x - px) ** 2 + (surface_y - py) ** 2 + (surface_z - pz) ** 2 > max_surface_distance * max_surface_distance:
            continue  # outside the search radius even after moving into the body
        factor = 1 + thickness[joint] / math.sqrt(surface_x**2 + surface_y**2 + surface_z**2)
        x[0], x[1], x[2] = surface_x * factor, surface_y * factor, surface_z * factor
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
    ridge_m, ridge_cell, points, neighbours, edge_lengths, previous, velocity, thickness, lengths, r, epsilon, straightness,
    only_depth,
):  # fmt: skip
    """Algorithm 2 for one frame.

    Args:
        ridge_m: (R, 3) ridge data as points on the surface, metres.
        ridge_cell: (R,) the index in `points` of each one's grid cell, -1 for none.
        points: (N, 3) raw depth, one point per grid cell, metres.
        neighbours: (N, 8) neighbours of the points.
        edge_lengths: (N, 8) lengths of the edges to the neighbours in metres.
        previous: (15, 3) J^(t-1).
        velocity: (15, 3) Delta J^(t-1), 0 for joints without valid candidates.
        thickness: (15,) from `joint_thickness`.
        lengths: (2, 15) from `model_lengths`.
        r: r_j in metres.
        epsilon: epsilon_j in metres.
        straightness: epsilon_L.
        only_depth: do not use ridge data.

    Returns:
        (15, 3) J^t, and (15,) the number of valid candidates of each joint: 0 where the joint moved with its parent.
    """
    # Eq. (3)
    predicted = previous + velocity
    joints, support = predicted.copy(), np.zeros(len(predicted), np.int32)
    own_cell = np.arange(len(points))
    geodesics_m = np.zeros(len(points))
    for joint in JOINT_ORDER:
        if PARENTS[joint] >= 0:
            max_distance_m = _max_geodesic_m(joint, lengths, epsilon, straightness)
            geodesics_m = _geodesics_from(joints[PARENTS[joint]], points, neighbours, edge_lengths, max_distance_m)
        count = 0
        if not only_depth:
            total, count, _ = _sum_valid(
                joint, ridge_m, ridge_cell, predicted, joints, geodesics_m, thickness, lengths, r, epsilon, straightness
            )
        if count < MIN_CANDIDATES:
            total, count, _ = _sum_valid(
                joint, points, own_cell, predicted, joints, geodesics_m, thickness, lengths, r, epsilon, straightness
            )
        if count >= MIN_CANDIDATES:
            # Eq. (11)
            joints[joint] = total / count
            support[joint] = count
        else:
            joints[joint] = previous[joint]
            if joint != HEAD:
                joints[joint] += joints[FALLBACK_PARENTS[joint]] - previous[FALLBACK_PARENTS[joint]]
    shoulder_centre = (joints[RIGHT_SHOULDER] + joints[LEFT_SHOULDER]) / 2
    joints[1] = shoulder_centre + NECK_FRACTION * (joints[HEAD] - shoulder_centre)
    support[1] = min(support[RIGHT_SHOULDER], support[LEFT_SHOULDER], support[HEAD])
    return joints, support


@njit(cache=True)
def ridge_points(ridge, depth, index, intrinsics):
    """(R, 3) surface points of the ridge data in metres, and (R,) the indices of their grid cells."""
    fx, fy, cx, cy, cell_px = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], int(intrinsics[4])
    pixels, count = ridge.ravel(), 0
    for is_ridge in pixels:
        count += is_ridge
    points, cell = np.empty((count, 3)), np.empty(count, np.int32)
    count = 0
    # Most pixels are not ridge data: eight at a time are skipped.
    words = pixels[: pixels.size // 8 * 8].view(np.uint64)
    i = 0
    while i < pixels.size:
        if not pixels[i]:
            i += 8 if i % 8 == 0 and i // 8 < len(words) and words[i // 8] == 0 else 1
            continue
        v, u = divmod(i, ridge.shape[1])
        z = float(depth[v, u])
        points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
        cell[count] = index[v // cell_px, u // cell_px]
        count += 1
        i += 1
    return points, cell


def estimate_pose(
    ridge: np.ndarray,
    grid: DepthGrid,
    previous_m: np.ndarray,
    velocity_m: np.ndarray,
    body: Body,
    lengths: np.ndarray,
    config: HierarchyConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """`track_frame` for (H, W) ridge data and the grid of the same frame.

    Returns:
        (15, 3) joints, and (15,) the number of valid candidates of each.
    """
    ridge_m, ridge_cell = ridge_points(ridge, grid.depth_m, grid.index, grid.intrinsics)
    return track_frame(
        ridge_m, ridge_cell, grid.points_m, grid.neighbours, grid.edge_lengths_m, previous_m, velocity_m,
        joint_thickness(body.radii_m), lengths, config.r_m, config.epsilon_m, config.straightness, config.candidates == "depth",
    )  # fmt: skip


def valid_candidates(
    ridge: np.ndarray,
    grid: DepthGrid,
    previous_m: np.ndarray,
    velocity_m: np.ndarray,
    body: Body,
    lengths: np.ndarray,
    config: HierarchyConfig,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The candidates of `estimate_pose`, for drawing.

    Returns:
        (N, 3) ridge data within the search radius of any joint, (M, 3) those valid for any joint, both as points on the
        surface, and (15, 3) the estimated joints.
    """
    joints, _ = estimate_pose(ridge, grid, previous_m, velocity_m, body, lengths, config)
    ridge_m, ridge_cell = ridge_points(ridge, grid.depth_m, grid.index, grid.intrinsics)
    predicted, thickness = previous_m + velocity_m, joint_thickness(body.radii_m)
    collected, valid = np.zeros(len(ridge_m), bool), np.zeros(len(ridge_m), bool)
    for joint in JOINT_ORDER:
        geodesics_m = np.zeros(len(grid.points_m))
        if PARENTS[joint] >= 0:
            max_distance_m = _max_geodesic_m(joint, lengths, config.epsilon_m, config.straightness)
            geodesics_m = _geodesics_from(
                joints[PARENTS[joint]], grid.points_m, grid.neighbours, grid.edge_lengths_m, max_distance_m
            )
        arguments = joint, ridge_m, ridge_cell, predicted, joints, geodesics_m, thickness, lengths, config.r_m
        collected |= _sum_valid(*arguments, np.inf, -1.0)[2]
        valid |= _sum_valid(*arguments, config.epsilon_m, config.straightness)[2]
    return ridge_m[collected], ridge_m[valid], joints
