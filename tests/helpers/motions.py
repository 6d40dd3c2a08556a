"""Measures of motions for tests of learners."""

import numpy as np

from synth.motion.skeleton import Motion, forward_kinematics


def points_m(motion: Motion) -> np.ndarray:
    """(T, 28, 3) relative to the hips, metres."""
    points, _ = forward_kinematics(motion.quats, motion.root_m)
    return points - points[:, :1]


def distance_m(teacher: Motion, learner: Motion) -> float:
    """The mean distance of corresponding points, metres."""
    return float(np.linalg.norm(points_m(teacher) - points_m(learner), axis=-1).mean())
