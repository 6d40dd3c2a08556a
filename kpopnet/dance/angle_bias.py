"""Estimates the constant difference of each angle between a learner and a teacher, and subtracts it from the learner's angles.

A constant difference is no measure of how well a person dances. It comes from the learner's build, and from the estimator of
the joints, whose errors have a constant part that differs from body to body. A network's angles have a constant error of 0.03
to 0.1 rad throughout a dance, which is as much as the difference between two good learners. So the constant difference (the
bias) of each angle is estimated frame by frame during the dance and subtracted. The bias is limited: a larger constant
difference is attributed to the dancer. Beyond the paper.

The estimate compares frames at the delay at which the learner follows the teacher.
"""

import math

import numpy as np
from numba import njit

from kpopnet.dance.features import Features, check_same_angles

MAX_RESIDUAL_RAD = 0.25
"""The difference between a frame's angle and its estimate is clipped to this value, so that mistakes hardly change the bias."""


class AngleBias:
    """The angle biases of one learner, estimated frame by frame.

    Attributes:
        bias_rad: (D,) current estimate for each angle.
    """

    def __init__(self, num_angles: int, prior_frames: float, max_bias_rad: float) -> None:
        """Starts with a bias of 0 for every angle.

        Args:
            num_angles: D.
            prior_frames: weight of the zero-bias prior, in frames of pseudo-observations; inf switches the estimation off.
            max_bias_rad: limit of the absolute bias, radians.
        """
        self._prior_frames, self._max_bias_rad = prior_frames, max_bias_rad
        self.bias_rad, self._observed_weight = np.zeros(num_angles), np.zeros(num_angles)

    def subtracted(self, learner: Features, teacher: Features, first: int) -> Features:
        """Updates the bias with each of the next frames, and subtracts the updated bias from that frame.

        Args:
            learner: (T, D) features of frames that were not given before.
            teacher: (M, D) features of the whole dance.
            first: the teacher's frame that is compared with row 0. Rows whose teacher frame does not exist do not change the
                bias.

        Returns:
            The learner's features with (T, D) corrected angles in -pi..pi.

        Raises:
            InputError: the features have different numbers of angles.
        """
        check_same_angles(learner, teacher)
        if math.isinf(self._prior_frames):
            return learner
        angles = _subtracted(
            learner, teacher, first, self.bias_rad, self._observed_weight, self._prior_frames, self._max_bias_rad
        )
        return learner._replace(angles_rad=angles)


@njit(cache=True)
def _subtracted(learner, teacher, first, bias, observed, prior, max_bias):
    corrected = np.empty_like(learner.angles_rad)
    for i in range(len(corrected)):
        j = first + i
        for c in range(corrected.shape[1]):
            if 0 <= j < len(teacher.angles_rad):
                residual = _wrapped(learner.angles_rad[i, c] - teacher.angles_rad[j, c] - bias[c])
                if residual == residual:  # not NaN
                    weight = learner.weights[i, c] * learner.confidence[i, c] * teacher.weights[j, c] * teacher.confidence[j, c]
                    observed[c] += weight
                    step = weight / (observed[c] + prior) * min(max(residual, -MAX_RESIDUAL_RAD), MAX_RESIDUAL_RAD)
                    bias[c] = min(max(bias[c] + step, -max_bias), max_bias)
            corrected[i, c] = _wrapped(learner.angles_rad[i, c] - bias[c])
    return corrected


@njit(cache=True)
def _wrapped(angle):
    """The angle in -pi..pi; NaN for NaN."""
    return angle - 2 * math.pi * math.floor(angle / (2 * math.pi) + 0.5)
