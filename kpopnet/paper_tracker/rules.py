"""Invalid-data pruning (section 2.4.3): the rule by which a candidate of each joint is valid, Eqs. (5) to (10)."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.geodesic import geodesic_distances
from kpopnet.geometry.human_model import LIMB_PARENTS
from kpopnet.paper_tracker.structure import HEAD, LEFT_HIP, LEFT_SHOULDER, RIGHT_HIP, RIGHT_SHOULDER, TORSO
from kpopnet.skeleton import Joint

PARENTS = np.array([LIMB_PARENTS.get(joint, -1) for joint in Joint])
"""(15,) J_p of the limb joints, -1 for the others."""


class Settings(NamedTuple):
    """Parameters and repairs as the kernels take them; `kpopnet.paper_tracker.config` explains them.

    Attributes:
        r_m: r_j of Eqs. (4) and (12).
        epsilon_m: epsilon_j of Eqs. (5) to (9).
        straightness: epsilon_L of Eq. (9).
        only_depth: no ridge data.
        still: repair, no velocity in Eq. (3).
        head_to_shoulder: repair, one more condition in Eq. (6).
        rising_shoulders: repair, lengths that follow the arms.
        depth_near_trunk: repair, raw depth for the joints of the trunk and the elbows.
        wider_when_lost: repair, r_j doubled for lost joints.
    """

    r_m: float
    epsilon_m: float
    straightness: float
    only_depth: bool
    still: bool
    head_to_shoulder: bool
    rising_shoulders: bool
    depth_near_trunk: bool
    wider_when_lost: bool


@njit(cache=True)
def distance(x, y):
    """Euclidean distance D_E of two (3,) points."""
    return math.sqrt((x[0] - y[0]) ** 2 + (x[1] - y[1]) ** 2 + (x[2] - y[2]) ** 2)


@njit(cache=True)
def perpendicular(x, opposite, point):
    """Distance of a point to the line through a candidate x and the joint opposite to it."""
    ax, ay, az = x[0] - opposite[0], x[1] - opposite[1], x[2] - opposite[2]
    bx, by, bz = point[0] - opposite[0], point[1] - opposite[1], point[2] - opposite[2]
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return math.sqrt((cx * cx + cy * cy + cz * cz) / (ax * ax + ay * ay + az * az + 1e-12))


@njit(cache=True)
def _as_far(x, joint, other, joints, structure, settings):
    """Whether candidate x of a joint is as far from another joint as the model says."""
    return abs(distance(x, joints[other]) - structure.distance_m[joint, other]) <= settings.epsilon_m


@njit(cache=True)
def valid_shoulder(x, shoulder, joints, structure, settings):
    opposite = RIGHT_SHOULDER + LEFT_SHOULDER - shoulder
    if settings.head_to_shoulder and not _as_far(x, shoulder, HEAD, joints, structure, settings):
        return False
    # Eq. (6)
    line_m = perpendicular(x, joints[opposite], joints[HEAD])
    return (
        _as_far(x, shoulder, opposite, joints, structure, settings)
        and abs(line_m - structure.head_to_shoulder_line_m) <= settings.epsilon_m
    )


@njit(cache=True)
def valid_torso(x, joints, structure, settings):
    # Eq. (7)
    return (
        _as_far(x, TORSO, HEAD, joints, structure, settings)
        and _as_far(x, TORSO, RIGHT_SHOULDER, joints, structure, settings)
        and _as_far(x, TORSO, LEFT_SHOULDER, joints, structure, settings)
    )


@njit(cache=True)
def valid_hip(x, hip, joints, structure, settings):
    # Eq. (8)
    line_m = perpendicular(x, joints[RIGHT_HIP + LEFT_HIP - hip], joints[TORSO])
    return (
        _as_far(x, hip, RIGHT_SHOULDER, joints, structure, settings)
        and _as_far(x, hip, LEFT_SHOULDER, joints, structure, settings)
        and abs(line_m - structure.torso_to_hip_line_m) <= settings.epsilon_m
    )


@njit(cache=True)
def valid_limb(x, limb, geodesic_m, joints, structure, settings):
    parent = PARENTS[limb]
    # Eq. (10)
    straight = distance(x, joints[parent]) > settings.straightness * geodesic_m
    # Eq. (9)
    return straight and _as_far(x, limb, parent, joints, structure, settings)


@njit(cache=True)
def is_valid(x, geodesic_m, joint, joints, structure, settings):
    """Whether candidate x of a joint is valid: the switch of Algorithm 2.

    Args:
        x: (3,) the candidate, metres.
        geodesic_m: D_G of Eq. (10) from the joint's parent to it, metres; any number for joints without a parent.
        joint: its joint.
        joints: (15, 3) estimated joints, predicted ones where none is estimated yet.
        structure: `Structure`.
        settings: `Settings`.
    """
    if joint == HEAD:
        # Eq. (5)
        return _as_far(x, HEAD, TORSO, joints, structure, settings)
    if joint in (RIGHT_SHOULDER, LEFT_SHOULDER):
        return valid_shoulder(x, joint, joints, structure, settings)
    if joint == TORSO:
        return valid_torso(x, joints, structure, settings)
    if joint in (RIGHT_HIP, LEFT_HIP):
        return valid_hip(x, joint, joints, structure, settings)
    return valid_limb(x, joint, geodesic_m, joints, structure, settings)


@njit(cache=True)
def geodesics_to(limb, frame, joints, structure, settings):
    """(N,) geodesic distances of all cells to a limb's parent in metres, as far as Eq. (9) can be kept.

    They start at the cell nearest to the parent, which lies inside the body.
    """
    parent = joints[PARENTS[limb]]
    source = np.zeros(len(frame.raw_m), np.bool_)
    nearest, least = -1, np.inf
    for i in range(len(frame.raw_m)):
        here = distance(frame.raw_m[i], parent)
        if here < least:
            nearest, least = i, here
    if nearest >= 0:
        source[nearest] = True
    farthest_m = farthest_geodesic_m(limb, structure, settings)
    return geodesic_distances(frame.neighbours, frame.edges_m, source, farthest_m)[0]


@njit(cache=True)
def farthest_geodesic_m(limb, structure, settings):
    """Geodesic distance in metres above which no candidate of a limb can pass Eq. (9)."""
    return (structure.distance_m[limb, PARENTS[limb]] + settings.epsilon_m) / max(settings.straightness, 1e-9)
