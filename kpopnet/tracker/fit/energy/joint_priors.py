"""Impossible and unlikely positions of joints, which a depth image alone does not rule out."""

import numpy as np
from numba import njit

from kpopnet.geometry.cones import torso_frame
from kpopnet.skeleton import Joint
from kpopnet.tracker.fit.energy.equations import COLUMN, add_residual

_HEAD_PRIOR = (Joint.HEAD, Joint.NECK, Joint.NECK, 0.04, 0.005)
_ARM_PRIOR = (Joint.RIGHT_HAND, Joint.RIGHT_SHOULDER, Joint.RIGHT_SHOULDER, 0.0, 0.002)
_LEG_PRIORS = (
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_FOOT, 0.0, 0.02),
    (Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_HIP, 0.0, 0.002),
)
"""A joint, two reference joints, the minimum distance in metres by which the joint lies in front of the middle of the
reference joints (along the torso's front axis), and the weight of the squared shortfall. The left joints mirror the right."""

_ALL_PRIORS = [
    (*(joint + side for joint in prior[:3]), *prior[3:])
    for priors in ((_ARM_PRIOR,), _LEG_PRIORS)
    for side in (0, 1)
    for prior in priors
] + [_HEAD_PRIOR]
JOINT_PRIORS = np.array([prior[:3] for prior in _ALL_PRIORS])
JOINT_PRIOR_MIN_M, JOINT_PRIOR_WEIGHT = np.array([prior[3:] for prior in _ALL_PRIORS]).T.copy()
"""Priors that disambiguate front and back, which look alike in a depth image: knees never bend backwards, the head is in front
of the neck (by 6 +- 1 cm in simulated dancers), and thighs and hands are seldom behind hips and shoulders."""

LIMB_JOINT_PRIORS = np.array([(0, 1), (1, 2), (2, 4), (4, 6)])
"""(4, 2) first (inclusive) and last (exclusive) prior of each limb."""


@njit(cache=True)
def joint_prior_shortfall(joints, prior, forward):
    """Shortfall in metres of a joint's position along the torso's front axis; 0 or negative if the prior holds."""
    joint, a, b = JOINT_PRIORS[prior, 0], JOINT_PRIORS[prior, 1], JOINT_PRIORS[prior, 2]
    ahead = 0.0
    for c in range(3):
        ahead += (joints[joint, c] - (joints[a, c] + joints[b, c]) / 2) * forward[c]
    return JOINT_PRIOR_MIN_M[prior] - ahead


@njit(cache=True)
def joint_prior(joints, forward, first, last):
    """Cost of impossible or unlikely joint positions, in square metres, over priors `first` to `last` - 1.

    `forward` is the torso's front axis, the last row of `kpopnet.geometry.cones.torso_frame`.
    """
    total = 0.0
    for prior in range(first, last):
        total += JOINT_PRIOR_WEIGHT[prior] * max(joint_prior_shortfall(joints, prior, forward), 0.0) ** 2
    return total


@njit(cache=True)
def add_joint_priors(matrix, rhs, joints):
    """Adds the shortfalls of the joint priors."""
    forward = torso_frame(joints)[2]
    direction = forward[0], forward[1], forward[2]
    for prior in range(len(JOINT_PRIORS)):
        shortfall = joint_prior_shortfall(joints, prior, forward)
        if shortfall > 0:
            # With three joints (hip, knee, foot) the foot moves against the knee and the hip is fixed; with two both move.
            joint, reference, other = JOINT_PRIORS[prior, 0], JOINT_PRIORS[prior, 1], JOINT_PRIORS[prior, 2]
            coefficient = 0.5 if reference != other else 1.0
            ends = COLUMN[joint], COLUMN[other]
            add_residual(matrix, rhs, ends, (-1.0, coefficient), direction, shortfall, JOINT_PRIOR_WEIGHT[prior])
