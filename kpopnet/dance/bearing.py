"""A learner's bearing: what their angles differ from the teacher's by all along, which is not how they dance.

Another build carries its limbs otherwise, and whoever finds joints in depth finds some of them a little beside on this body
and not on that one: a network's angles are off by 0.03 to 0.1 rad throughout a dance, as much as two good learners differ in.
So each angle's steady difference is learnt while the dance goes on and taken out of it, up to a limit beyond which it is the
dancer's doing. Beyond the paper.

It is learnt from frames that are as far apart as the learner is late.
"""

import math

import numpy as np
from numba import njit

from kpopnet.dance.features import Features

STEP_RAD = 0.25
"""A frame's difference to what is known of an angle counts up to this: mistakes teach nothing."""


class Bearing:
    """One learner's steady differences, frame by frame.

    Attributes:
        steady_rad: (D,) what is known of each angle.
    """

    def __init__(self, angles: int, settling_frames: float, most_rad: float) -> None:
        """Knows nothing yet.

        Args:
            angles: D, how many.
            settling_frames: so many frames without any difference are taken to have come before; inf: nothing is learnt.
            most_rad: the limit.
        """
        self._settling, self._most_rad = settling_frames, most_rad
        self.steady_rad, self._seen = np.zeros(angles), np.zeros(angles)

    def taken_out(self, learner: Features, teacher: Features, first: int) -> Features:
        """Learns from the next frames and takes out of each what is known by then.

        Args:
            learner: (T, D) of frames that have not been given yet.
            teacher: (M, D) of the whole dance.
            first: the teacher's frame to compare row 0 with; frames that the teacher does not have teach nothing.
        """
        if math.isinf(self._settling):
            return learner
        angles = _taken_out(learner, teacher, first, self.steady_rad, self._seen, self._settling, self._most_rad)
        return learner._replace(angles_rad=angles)


@njit(cache=True)
def _taken_out(learner, teacher, first, steady, seen, settling, most):
    without = np.empty_like(learner.angles_rad)
    for i in range(len(without)):
        j = first + i
        for c in range(without.shape[1]):
            if 0 <= j < len(teacher.angles_rad):
                difference = _wrapped(learner.angles_rad[i, c] - teacher.angles_rad[j, c] - steady[c])
                if difference == difference:  # not NaN
                    weight = learner.weights[i, c] * learner.sure[i, c] * teacher.weights[j, c] * teacher.sure[j, c]
                    seen[c] += weight
                    step = weight / (seen[c] + settling) * min(max(difference, -STEP_RAD), STEP_RAD)
                    steady[c] = min(max(steady[c] + step, -most), most)
            without[i, c] = _wrapped(learner.angles_rad[i, c] - steady[c])
    return without


@njit(cache=True)
def _wrapped(angle):
    """In -pi..pi, NaN for NaN."""
    return angle - 2 * math.pi * math.floor(angle / (2 * math.pi) + 0.5)
