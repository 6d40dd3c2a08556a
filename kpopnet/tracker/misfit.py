"""How badly a pose explains the picture: what tells a good pose from a bad one.

Points and joints are in the camera frame in metres throughout.
"""

import numpy as np
from numba import njit

from kpopnet.skeleton import Joint
from kpopnet.tracker.body import BARRED, PARTS, Body
from kpopnet.tracker.cells import Cells
from kpopnet.tracker.cones import axes_of, extend, frame_of, intrusion, nearest_parts, off_surface

CLIP_M = 0.12
"""Residuals count up to this: the far ones are all equally wrong."""

FREE_SPACE_WEIGHT = 0.1
HIDDEN_COST = 0.006
"""Square metres for a place on a part that is so far behind what was measured: what can be seen is likelier."""

SAMPLES_ON_PART = 5

_HEAD_HABIT = (Joint.HEAD, Joint.NECK, Joint.NECK, 0.04, 0.005)
_ARM_HABIT = (Joint.RIGHT_HAND, Joint.RIGHT_SHOULDER, Joint.RIGHT_SHOULDER, 0.0, 0.002)
_LEG_HABITS = (
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_FOOT, 0.0, 0.02),
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_HIP, 0.0, 0.002),
)
"""A joint, two others, how far the first lies at least in front of the others' middle as the torso faces, and the weight
of the square of what is missing; left ones as right ones."""

_ALL_HABITS = [
    (*(joint + side for joint in habit[:3]), *habit[3:])
    for habits in ((_ARM_HABIT,), _LEG_HABITS)
    for side in (0, 1)
    for habit in habits
] + [_HEAD_HABIT]
HABITS = np.array([habit[:3] for habit in _ALL_HABITS])
HABIT_LEAST_M, HABIT_WEIGHT = np.array([habit[3:] for habit in _ALL_HABITS]).T.copy()
"""What tells front from back, in a depth image where a back looks much like a chest: knees never bend backwards, the head
is carried before the neck (by 6 +- 1 cm in simulated dancers), and thighs and hands are seldom behind hips and shoulders."""

HABITS_OF = np.array([(0, 1), (1, 2), (2, 4), (4, 6)])
"""(4, 2) each limb's first habit, and its last but one."""


@njit(cache=True)
def short_of_habit(joints, habit, front):
    """How far the joint of a habit lies less in front than it should, in metres; negative or 0 if it does not."""
    joint, a, b = HABITS[habit, 0], HABITS[habit, 1], HABITS[habit, 2]
    ahead = 0.0
    for c in range(3):
        ahead += (joints[joint, c] - (joints[a, c] + joints[b, c]) / 2) * front[c]
    return HABIT_LEAST_M[habit] - ahead


BARRIER_WEIGHT = 0.02
OVERLAP_M = 0.03
"""The middle of a forearm or a shin may lie so deep under another part's surface: clothes, flesh, and the cones' faults."""

PLACES_ON_BARRED = 3


@njit(cache=True)
def too_deep(axes, own, other, along):
    """How much too deep a place on part `own` lies in part `other`, and (3) the way out."""
    x, y, z = (
        axes[own, 0] + along * axes[own, 3],
        axes[own, 1] + along * axes[own, 4],
        axes[own, 2] + along * axes[own, 5],
    )
    off, t, distance = off_surface(axes, other, x, y, z)
    depth = -OVERLAP_M - off
    if depth <= 0:
        return 0.0, 0.0, 0.0, 0.0
    scale = 1 / (distance + 1e-9)
    return (
        depth,
        scale * (x - axes[other, 0] - t * axes[other, 3]),
        scale * (y - axes[other, 1] - t * axes[other, 4]),
        scale * (z - axes[other, 2] - t * axes[other, 5]),
    )


@njit(cache=True)
def overlap(axes, first, last, enough):
    """What a pose pays, in square metres, for limbs in other parts: the pairs `first` to `last` - 1 of `BARRED`.

    What comes to `enough` is not added up to its end.
    """
    total = 0.0
    for pair in range(first, last):
        if BARRIER_WEIGHT * total >= enough:
            break
        for q in range(PLACES_ON_BARRED):
            total += too_deep(axes, BARRED[pair, 0], BARRED[pair, 1], q / (PLACES_ON_BARRED - 1))[0] ** 2
    return BARRIER_WEIGHT * total


@njit(cache=True)
def unusual(joints, front, first, last):
    """What a pose pays, in square metres, for what bodies never or seldom do: the habits `first` to `last` - 1.

    `front` is where the torso faces, the last row of `kpopnet.tracker.cones.frame_of`.
    """
    total = 0.0
    for habit in range(first, last):
        total += HABIT_WEIGHT[habit] * max(short_of_habit(joints, habit, front), 0.0) ** 2
    return total


@njit(cache=True)
def outside(axes, k, depth, nearest, intrinsics):
    """Mean squared intrusion of part k, clipped."""
    total = 0.0
    for q in range(SAMPLES_ON_PART):
        mx, my, mz, hidden = intrusion(axes, k, q / (SAMPLES_ON_PART - 1), depth, nearest, intrinsics)
        total += min(mx * mx + my * my + mz * mz + (HIDDEN_COST if hidden else 0.0), CLIP_M * CLIP_M)
    return total / SAMPLES_ON_PART


@njit(cache=True)
def _misfit(joints, points, every, depth, nearest, intrinsics, parts, radii, places):
    axes = axes_of(extend(joints, places), parts, radii)
    _, offs, _ = nearest_parts(axes, points, every)
    residual = 0.0
    for off in offs:
        residual += min(off * off, CLIP_M * CLIP_M)
    beside = 0.0
    for k in range(len(parts)):
        beside += outside(axes, k, depth, nearest, intrinsics)
    explained = residual / max(len(offs), 1) + FREE_SPACE_WEIGHT * beside / len(parts)
    return explained + unusual(joints, frame_of(joints)[2], 0, len(HABITS)) + overlap(axes, 0, len(BARRED), np.inf)


def misfit(joints_m: np.ndarray, cells: Cells, body: Body, every: int = 1) -> float:
    """How badly a pose explains the picture, in square metres.

    Points off every surface, parts where nothing is or that are hidden, limbs inside other parts, and what bodies never
    or seldom do.
    """
    return _misfit(
        joints_m, cells.points_m, every, cells.depth_m, cells.nearest, cells.intrinsics, PARTS, body.radii_m, body.places_m
    )
