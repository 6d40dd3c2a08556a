"""How far the angles of estimated joints are off: the part of a difference between two dances that is nobody's fault.

    python -m kpopnet.evaluation.dances.noise FOLDER                      # the tracker, on training dances
    python -m kpopnet.evaluation.dances.noise FOLDER --estimator network --checkpoint DIR

prints the table again. FOLDER holds simulated dances with true joints (docs/dance_scoring.md).
"""

from typing import NamedTuple

import numpy as np

from kpopnet.errors import InputError


class AngleNoise(NamedTuple):
    """The errors of an estimator's angles on simulated dances of the split `train`.

    Attributes:
        std_rad: standard deviation of the error around the true angle by the angle's name, radians, constant errors
            included; of an azimuth, weighted as the distance weights it. Angles that are not named have none.
        ceiling: mean score of perfect dancing seen through the sensor and this estimator, with its noise known.
    """

    std_rad: dict[str, float]
    ceiling: float


NOISE: dict[str, AngleNoise] = {
    "none": AngleNoise({}, 100.0),
    # Three dances of kpop_sim's split train (seed 21), twelve learners. Nine of them score 93 to 100 for perfect dancing, three
    # 9 to 56: there the tracker had lost trunk or legs, which no noise explains.
    "tracker": AngleNoise(
        {
            "twist": 0.091, "lean": 0.096, "bend": 0.097, "twist_change": 0.02, "lean_change": 0.008, "bend_change": 0.012,
            "right_elbow_inclination": 0.134, "right_elbow_azimuth": 0.199, "left_elbow_inclination": 0.134,
            "left_elbow_azimuth": 0.185, "right_knee_inclination": 0.126, "right_knee_azimuth": 0.59,
            "left_knee_inclination": 0.143, "left_knee_azimuth": 0.514, "right_hand_inclination": 0.192,
            "right_hand_azimuth": 0.516, "left_hand_inclination": 0.232, "left_hand_azimuth": 0.492,
            "right_foot_inclination": 0.197, "right_foot_azimuth": 0.227, "left_foot_inclination": 0.177,
            "left_foot_azimuth": 0.218, "turn": 0.325,
        },
        82.0,
    ),
}  # fmt: skip
"""By the estimator's name; `none` for true joints. Networks are measured by whoever trains them."""


def angle_variance(noise: str, names: tuple[str, ...]) -> np.ndarray:
    """(D,) squared standard deviations of the errors of the named angles, radians^2.

    Raises:
        InputError: the noise of this estimator is not known.
    """
    if noise not in NOISE:
        raise InputError(f"noise={noise} is not one of {', '.join(NOISE)}")
    std_rad = NOISE[noise].std_rad
    return np.array([std_rad.get(name, 0.0) ** 2 for name in names])
