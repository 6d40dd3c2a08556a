"""Hierarchical human pose estimation (section 2.4): Algorithm 2, from the head down to hands and feet.

As printed, candidates are pixels of the body's surface, and so are the joints, their means. Choices where the paper is silent
(docs/paper.md has what each is worth):

- r_j and epsilon_j have no unit in Table 1; they are taken for millimetres. Its best values are 110 and 50.
- "Insufficient" is fewer than `Plan.sufficient` valid candidates. The paper then repeats the step with raw depth, and does not
  say what happens to a joint for which that is insufficient too: `Plan.lost`.
- The geodesic distance of Eq. (10) is the shortest path over the silhouette's cells. An edge across a depth jump counts
  `kpopnet.geometry.depth_grid.JUMP_FACTOR` times its length. A candidate that lies in no cell counts as straight.
- Eqs. (6) and (8) need the distance from the head (the torso's centre) to the line through candidate and opposite shoulder
  (hip). The first of the two shoulders, and of the two hips, is tested against the prediction of the other.
- The neck, which the paper does not estimate, lies between the shoulders and the head.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.geometry.body import NECK_FRACTION
from kpopnet.geometry.cones import distance
from kpopnet.geometry.depth_grid import cell_points, geodesic_distances, neighbour_graph
from kpopnet.geometry.human_model import LIMB_PARENTS
from kpopnet.skeleton import NUM_JOINTS, Joint

# Of each plain number numba would make a type of its own, and compile what takes it anew.
HEAD, TORSO = np.int64(Joint.HEAD), np.int64(Joint.TORSO)
RIGHT_SHOULDER, LEFT_SHOULDER = np.int64(Joint.RIGHT_SHOULDER), np.int64(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = np.int64(Joint.RIGHT_HIP), np.int64(Joint.LEFT_HIP)

TRUNK = (HEAD, RIGHT_SHOULDER, LEFT_SHOULDER, TORSO, RIGHT_HIP, LEFT_HIP)
"""The joints of the head-shoulder-torso structure, and the hips."""

JOINT_ORDER = np.array([*TRUNK, *LIMB_PARENTS])
PARENTS = np.array([LIMB_PARENTS.get(joint, -1) for joint in Joint])
"""(15,) J_p of the limb joints, -1 for the others."""

CARRIERS = np.where(PARENTS >= 0, PARENTS, HEAD)
"""(15,) the joint that a carried joint moves with."""

PREDICTED, STAYS, CARRIED = LOST = range(3)
"""Where a joint without sufficient candidates is: at its prediction, where it was, or moved with its parent (`CARRIERS`)."""

CELL_M = 0.02
"""Ways over the silhouette lead from cell to cell, of about this side at the person's depth, in metres: every second pixel of a
Kinect v1."""

MOST_CELLS, MOST_PX = 20_000, 16
"""Greatest number of cells and greatest side in pixels. Cells grow where more would be measured: of noise and whole rooms."""


class Frame(NamedTuple):
    """One depth image of a person: the points that Algorithm 2 chooses from, on the surface, in the camera frame, in metres."""

    ridge_m: np.ndarray  # (R, 3) the ridge data, pixel by pixel
    ridge_cell: np.ndarray  # (R,) the number of each one's cell, -1 where its cell has no point
    raw_m: np.ndarray  # (P, 3) the raw depth
    raw_cell: np.ndarray  # (P,) likewise
    cells_m: np.ndarray  # (N, 3) the point in the middle of each measured cell
    neighbours: np.ndarray  # (N, 8) neighbours of each cell, see `kpopnet.geometry.depth_grid.neighbour_graph`
    edges_m: np.ndarray  # (N, 8) lengths of the ways to them


class State(NamedTuple):
    """What one frame leaves to the next."""

    joints: np.ndarray  # (15, 3) J^(t-1), metres
    velocity: np.ndarray  # (15, 3) Delta J^(t-1), metres a frame
    lost: np.ndarray  # (15,) for how many frames each joint has had no sufficient candidates


class Plan(NamedTuple):
    """What Algorithm 2 goes by in one frame; `kpopnet.paper_tracker.repairs` changes it."""

    predicted: np.ndarray  # (15, 3) where the joints are expected, metres
    radius_m: np.ndarray  # (15,) r_j of Eqs. (4) and (12)
    on_ridge: np.ndarray  # (15,) whether a joint's candidates are ridge data, and raw depth only where these are insufficient
    distance_m: np.ndarray  # (15, 15) the initial human model's distance between two joints (section 2.3), 0 where it has none
    head_to_shoulder_line_m: float  # l_H⊥S
    torso_to_hip_line_m: float  # l_T⊥P
    depth_m: np.ndarray  # (15,) how deep each joint lies under the surface along the viewing ray, metres
    epsilon_m: float  # epsilon_j of Eqs. (5) to (9)
    straightness: float  # epsilon_L of Eq. (9)
    sufficient: int  # least number of valid candidates
    lost: int  # where joints without them are, one of `LOST`


class Collected(NamedTuple):
    """The candidates of one joint."""

    total: np.ndarray  # (3,) sum of the valid ones in metres
    count: int  # their number
    near: np.ndarray  # (N,) whether each point lies within the search radius
    valid: np.ndarray  # (N,) whether it is valid too


def frame_of(depth_m: np.ndarray, ridge: np.ndarray, camera: Camera, sampled: bool = False) -> Frame:
    """The points of an (H, W) float32 depth image of a person, metres, with its (H, W) bool ridge data.

    Raw depth is every pixel, or `sampled` once per cell.
    """
    person_m = depth_m[depth_m > 0]
    side_px = 1
    if len(person_m):
        side_px = max(CELL_M * camera.fx / float(np.median(person_m)), (len(person_m) / MOST_CELLS) ** 0.5)
        side_px = max(1, round(min(side_px, MOST_PX)))
    cells_m, index = cell_points(depth_m, np.array([camera.fx, camera.fy, camera.cx, camera.cy, side_px]))

    def pixels(chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v, u = chosen.nonzero()
        points_m = camera.back_project(np.stack([u, v, depth_m[chosen]], axis=-1, dtype=np.float64))
        return points_m, index[v // side_px, u // side_px].astype(np.int64)

    raw = (cells_m, np.arange(len(cells_m))) if sampled else pixels(depth_m > 0)
    return Frame(*pixels(ridge), *raw, cells_m, *neighbour_graph(cells_m, index))


@njit(cache=True)
def collect(joint, points, cell, geodesics_m, joints, plan):
    """Steps 2 and 3: the points within the search radius, `Plan.depth_m` inside, and those that keep the joint's rule.

    Of (P, 3) ridge data or raw depth on the surface in cells (P,), with (N,) ways to these from the joint's parent, metres, and
    (15, 3) estimated or predicted joints.
    """
    total, count, x = np.zeros(3), 0, np.empty(3)
    centre, radius_m = plan.predicted[joint], plan.radius_m[joint]
    near, valid = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    depth_m = plan.depth_m[joint]
    reach = (radius_m + depth_m) ** 2
    for i in range(len(points)):
        surface_x, surface_y, surface_z = points[i, 0], points[i, 1], points[i, 2]
        if (surface_x - centre[0]) ** 2 + (surface_y - centre[1]) ** 2 + (surface_z - centre[2]) ** 2 > reach:
            continue  # outside the search radius, inside the body too
        factor = 1 + depth_m / math.sqrt(surface_x**2 + surface_y**2 + surface_z**2)
        x[0], x[1], x[2] = surface_x * factor, surface_y * factor, surface_z * factor
        # Eq. (4)
        near[i] = distance(x, centre) <= radius_m
        way_m = geodesics_m[cell[i]] if cell[i] >= 0 else 0.0
        if near[i] and is_valid(x, way_m, joint, joints, plan):
            valid[i] = True
            total += x
            count += 1
    return Collected(total, count, near, valid)


@njit(cache=True)
def candidates_of(joint, frame, joints, plan):
    """Steps 2 and 3 of one joint: `Collected` from ridge data, from raw depth where they are insufficient."""
    geodesics_m = geodesics_to(joint, frame, joints, plan)
    if plan.on_ridge[joint]:
        found = collect(joint, frame.ridge_m, frame.ridge_cell, geodesics_m, joints, plan)
        if found.count >= plan.sufficient:
            return found
    # Eq. (12)
    return collect(joint, frame.raw_m, frame.raw_cell, geodesics_m, joints, plan)


def track_frame(frame: Frame, state: State, plan: Plan) -> tuple[State, np.ndarray]:
    """Algorithm 2 for one `Frame`: the `State` after it, and (15,) the number of valid candidates of each joint, 0 where they
    are insufficient.
    """
    joints, support = plan.predicted.copy(), np.zeros(NUM_JOINTS, np.int64)
    for joint in JOINT_ORDER:
        found = candidates_of(joint, frame, joints, plan)
        if found.count >= plan.sufficient:
            # Eq. (11)
            joints[joint] = found.total / found.count
            support[joint] = found.count
        elif plan.lost != PREDICTED:
            joints[joint] = state.joints[joint]
            if plan.lost == CARRIED and joint != HEAD:
                joints[joint] += joints[CARRIERS[joint]] - state.joints[CARRIERS[joint]]
    shoulder_centre = (joints[RIGHT_SHOULDER] + joints[LEFT_SHOULDER]) / 2
    joints[1] = shoulder_centre + NECK_FRACTION * (joints[HEAD] - shoulder_centre)
    support[1] = min(support[RIGHT_SHOULDER], support[LEFT_SHOULDER], support[HEAD])
    return State(joints, joints - state.joints, np.where(support > 0, 0, state.lost + 1)), support


def ridge_candidates(frame: Frame, state: State, plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """What `track_frame` chooses from, for drawing: (N, 3) ridge data within the search radius of any joint, and (M, 3) those
    valid for any joint, as points on the surface.
    """
    after, _ = track_frame(frame, state, plan)
    near, valid = np.zeros(len(frame.ridge_m), bool), np.zeros(len(frame.ridge_m), bool)
    for joint in JOINT_ORDER:
        ways_m = geodesics_to(joint, frame, after.joints, plan)
        found = collect(joint, frame.ridge_m, frame.ridge_cell, ways_m, after.joints, plan)
        near |= found.near
        valid |= found.valid
    return frame.ridge_m[near], frame.ridge_m[valid]


# Invalid-data pruning (section 2.4.3): the rule by which a candidate of each joint is valid, Eqs. (5) to (10).


@njit(cache=True)
def perpendicular(x, opposite, point):
    """Distance of a point to the line through a candidate x and the joint opposite to it."""
    ax, ay, az = x[0] - opposite[0], x[1] - opposite[1], x[2] - opposite[2]
    bx, by, bz = point[0] - opposite[0], point[1] - opposite[1], point[2] - opposite[2]
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return math.sqrt((cx * cx + cy * cy + cz * cz) / (ax * ax + ay * ay + az * az + 1e-12))


@njit(cache=True)
def _as_far(x, joint, other, joints, plan):
    """Whether candidate x of a joint is as far from another joint as the model says."""
    return abs(distance(x, joints[other]) - plan.distance_m[joint, other]) <= plan.epsilon_m


@njit(cache=True)
def is_valid(x, geodesic_m, joint, joints, plan):
    """Whether candidate x of a joint is valid: the switch of Algorithm 2.

    `geodesic_m` is D_G of Eq. (10) from the joint's parent to it, metres, any number for joints without a parent; `joints` are
    (15, 3) estimated joints, predicted ones where none is estimated yet.
    """
    if joint == HEAD:
        # Eq. (5)
        return _as_far(x, HEAD, TORSO, joints, plan)
    if joint in (RIGHT_SHOULDER, LEFT_SHOULDER):
        if plan.distance_m[joint, HEAD] > 0 and not _as_far(x, joint, HEAD, joints, plan):
            return False  # a repair: as printed the model has no such distance
        # Eq. (6)
        opposite = RIGHT_SHOULDER + LEFT_SHOULDER - joint
        line_m = perpendicular(x, joints[opposite], joints[HEAD])
        return _as_far(x, joint, opposite, joints, plan) and abs(line_m - plan.head_to_shoulder_line_m) <= plan.epsilon_m
    parent = PARENTS[joint]
    if parent >= 0:
        # Eq. (10)
        straight = distance(x, joints[parent]) > plan.straightness * geodesic_m
        # Eq. (9)
        return straight and _as_far(x, joint, parent, joints, plan)
    if not (_as_far(x, joint, RIGHT_SHOULDER, joints, plan) and _as_far(x, joint, LEFT_SHOULDER, joints, plan)):
        return False  # of Eqs. (7) and (8)
    if joint == TORSO:
        # Eq. (7)
        return _as_far(x, TORSO, HEAD, joints, plan)
    # Eq. (8)
    line_m = perpendicular(x, joints[RIGHT_HIP + LEFT_HIP - joint], joints[TORSO])
    return abs(line_m - plan.torso_to_hip_line_m) <= plan.epsilon_m


@njit(cache=True)
def geodesics_to(limb, frame, joints, plan):
    """(N,) geodesic distances of all cells to a limb's parent in metres, as far as Eq. (9) can be kept; 0 without a parent.

    They start at the cell nearest to the parent, which may lie inside the body.
    """
    if PARENTS[limb] < 0:
        return np.zeros(len(frame.cells_m))
    parent = joints[PARENTS[limb]]
    source = np.zeros(len(frame.cells_m), np.bool_)
    nearest, least = -1, np.inf
    for i in range(len(frame.cells_m)):
        here = distance(frame.cells_m[i], parent)
        if here < least:
            nearest, least = i, here
    if nearest >= 0:
        source[nearest] = True
    farthest_m = (plan.distance_m[limb, PARENTS[limb]] + plan.epsilon_m) / max(plan.straightness, 1e-9)
    return geodesic_distances(frame.neighbours, frame.edges_m, source, farthest_m)[0]
