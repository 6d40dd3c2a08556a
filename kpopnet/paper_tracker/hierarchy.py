"""Hierarchical human pose estimation (section 2.4): Algorithm 2, from the head down to hands and feet.

Assumptions, where the paper is silent:

- Candidates are pixels of the body's surface, joints lie inside. Each candidate is moved along its viewing ray into the
  body, by the depth of the joint under the surface (`structure.Structure`), before any distance is measured.
- r_j and epsilon_j are millimetres in Table 1; its best values are 110 and 50.
- "Insufficient" is fewer than `MIN_CANDIDATES` valid candidates. If the raw depth does not give that many either, the joint
  moves with its parent (the torso's joints with the head), and its velocity in the next frame is zero. With only Eq. (3) a
  lost joint would move away without bound.
- The geodesic distance of Eq. (10) is the shortest path over the silhouette's cells. An edge across a depth jump counts
  `kpopnet.geometry.geodesic.JUMP_FACTOR` times its length.
- Eqs. (6) and (8) need the distance from the head (the torso's centre) to the line through candidate and opposite shoulder
  (hip). The first of the two shoulders, and of the two hips, is tested against the prediction of the other.
- The neck, which the paper does not estimate, lies between the shoulders and the head.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.body import NECK_FRACTION
from kpopnet.geometry.human_model import LIMB_PARENTS
from kpopnet.paper_tracker.frame import Frame
from kpopnet.paper_tracker.rules import PARENTS, Settings, distance, geodesics_to, is_valid
from kpopnet.paper_tracker.structure import HEAD, LEFT_SHOULDER, RIGHT_SHOULDER, TRUNK, Structure, with_arms_as_in
from kpopnet.skeleton import NUM_JOINTS, Joint

JOINT_ORDER = np.array([*TRUNK, *LIMB_PARENTS])
CARRIERS = np.where(PARENTS >= 0, PARENTS, HEAD)
"""(15,) the joint that a lost joint moves with."""

NEAR_TRUNK = np.isin(np.arange(NUM_JOINTS), [*TRUNK, Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW])
"""(15,) the joints that the repair `depth_near_trunk` takes from raw depth."""

MIN_CANDIDATES = 3
"""Minimum number of valid candidates of a joint."""

LOST_FRAMES, WIDER = 5, 2.0
"""The repair `wider_when_lost` looks `WIDER` times as far for joints lost for more than `LOST_FRAMES` frames."""


class State(NamedTuple):
    """What one frame leaves to the next.

    Attributes:
        joints: (15, 3) J^(t-1), metres.
        velocity: (15, 3) Delta J^(t-1), metres a frame, 0 for joints without valid candidates.
        lost: (15,) for how many frames each joint has had no valid candidates.
    """

    joints: np.ndarray
    velocity: np.ndarray
    lost: np.ndarray


class Collected(NamedTuple):
    """The candidates of one joint.

    Attributes:
        total: (3,) sum of the valid ones in metres.
        count: their number.
        near: (N,) whether each point lies within the search radius.
        valid: (N,) whether it is valid too.
    """

    total: np.ndarray
    count: int
    near: np.ndarray
    valid: np.ndarray


@njit(cache=True)
def collect(joint, points, geodesics_m, centre, radius_m, joints, structure, settings):
    """Steps 2 and 3: the points within the search radius, moved into the body, and those that keep the joint's rule.

    Args:
        joint: the joint.
        points: (N, 3) ridge data or raw depth, on the surface, metres.
        geodesics_m: (N,) way to each of them from the joint's parent, metres.
        centre: (3,) predicted joint.
        radius_m: r_j.
        joints: (15, 3) estimated or predicted joints.
        structure: `Structure`.
        settings: `Settings`.
    """
    total, count, x = np.zeros(3), 0, np.empty(3)
    near, valid = np.zeros(len(points), np.bool_), np.zeros(len(points), np.bool_)
    depth_m = structure.depth_m[joint]
    reach = (radius_m + depth_m) ** 2
    for i in range(len(points)):
        surface_x, surface_y, surface_z = points[i, 0], points[i, 1], points[i, 2]
        if (surface_x - centre[0]) ** 2 + (surface_y - centre[1]) ** 2 + (surface_z - centre[2]) ** 2 > reach:
            continue  # outside the search radius even after moving into the body
        factor = 1 + depth_m / math.sqrt(surface_x**2 + surface_y**2 + surface_z**2)
        x[0], x[1], x[2] = surface_x * factor, surface_y * factor, surface_z * factor
        # Eq. (4), and Eq. (12) for candidates of the raw depth
        near[i] = distance(x, centre) <= radius_m
        if near[i] and is_valid(x, geodesics_m[i], joint, joints, structure, settings):
            valid[i] = True
            total += x
            count += 1
    return Collected(total, count, near, valid)


@njit(cache=True)
def ridge_geodesics(frame, geodesics_m):
    """(R,) of the ridge data from (N,) of the cells; 0 where ridge data lie in no measured cell."""
    found = np.zeros(len(frame.ridge_m))
    for i in range(len(found)):
        if frame.ridge_cell[i] >= 0:
            found[i] = geodesics_m[frame.ridge_cell[i]]
    return found


@njit(cache=True)
def search_radius_m(joint, state, settings):
    """r_j of a joint, wider where it is lost and the repair is on."""
    wider = settings.wider_when_lost and state.lost[joint] > LOST_FRAMES
    return settings.r_m * (WIDER if wider else 1.0)


@njit(cache=True)
def _candidates(joint, frame, centre, joints, state, structure, settings):
    """Steps 2 and 3 of one joint: from ridge data, from raw depth where they are insufficient."""
    geodesics_m = np.zeros(len(frame.raw_m))
    if PARENTS[joint] >= 0:
        geodesics_m = geodesics_to(joint, frame, joints, structure, settings)
    radius_m = search_radius_m(joint, state, settings)
    if not (settings.only_depth or (settings.depth_near_trunk and NEAR_TRUNK[joint])):
        on_ridge = ridge_geodesics(frame, geodesics_m)
        found = collect(joint, frame.ridge_m, on_ridge, centre, radius_m, joints, structure, settings)
        if found.count >= MIN_CANDIDATES:
            return found
    return collect(joint, frame.raw_m, geodesics_m, centre, radius_m, joints, structure, settings)


@njit(cache=True)
def predicted_joints(state, settings):
    """(15, 3) where step 1 expects the joints, metres."""
    if settings.still:
        return state.joints.copy()
    # Eq. (3)
    return state.joints + state.velocity


@njit(cache=True)
def track_frame(frame, state, structure, settings):
    """Algorithm 2 for one frame.

    Args:
        frame: `Frame`.
        state: `State` after the last frame.
        structure: `Structure` of the person.
        settings: `Settings`.

    Returns:
        `State` after this frame, and (15,) the number of valid candidates of each joint: 0 where it moved with its parent.
    """
    predicted = predicted_joints(state, settings)
    joints, support = predicted.copy(), np.zeros(NUM_JOINTS, np.int64)
    if settings.rising_shoulders:
        structure = with_arms_as_in(structure, state.joints)
    for joint in JOINT_ORDER:
        found = _candidates(joint, frame, predicted[joint], joints, state, structure, settings)
        if found.count >= MIN_CANDIDATES:
            # Eq. (11)
            joints[joint] = found.total / found.count
            support[joint] = found.count
        else:
            joints[joint] = state.joints[joint]
            if joint != HEAD:
                joints[joint] += joints[CARRIERS[joint]] - state.joints[CARRIERS[joint]]
    shoulder_centre = (joints[RIGHT_SHOULDER] + joints[LEFT_SHOULDER]) / 2
    joints[1] = shoulder_centre + NECK_FRACTION * (joints[HEAD] - shoulder_centre)
    support[1] = min(support[RIGHT_SHOULDER], support[LEFT_SHOULDER], support[HEAD])
    velocity = (joints - state.joints) * (support > 0).reshape(-1, 1)
    return State(joints, velocity, np.where(support > 0, 0, state.lost + 1)), support


def ridge_candidates(frame: Frame, state: State, structure: Structure, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """What `track_frame` chooses from, for drawing.

    Returns:
        (N, 3) ridge data within the search radius of any joint, and (M, 3) those valid for any joint, as points on the surface.
    """
    after, _ = track_frame(frame, state, structure, settings)
    predicted = predicted_joints(state, settings)
    if settings.rising_shoulders:
        structure = with_arms_as_in(structure, state.joints)
    near, valid = np.zeros(len(frame.ridge_m), bool), np.zeros(len(frame.ridge_m), bool)
    for joint in JOINT_ORDER:
        ways_m = np.zeros(len(frame.ridge_m))
        if PARENTS[joint] >= 0:
            ways_m = ridge_geodesics(frame, geodesics_to(joint, frame, after.joints, structure, settings))
        radius_m = search_radius_m(joint, state, settings)
        found = collect(joint, frame.ridge_m, ways_m, predicted[joint], radius_m, after.joints, structure, settings)
        near |= found.near
        valid |= found.valid
    return frame.ridge_m[near], frame.ridge_m[valid]
