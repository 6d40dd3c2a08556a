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
    # Six dances of kpop_sim's split train (seed 2018), 24 learners.
    "realtime": AngleNoise(
        {
            "twist": 0.067, "lean": 0.069, "bend": 0.078, "twist_change": 0.01, "lean_change": 0.006, "bend_change": 0.006,
            "right_elbow_inclination": 0.081, "right_elbow_azimuth": 0.127, "left_elbow_inclination": 0.094,
            "left_elbow_azimuth": 0.129, "right_knee_inclination": 0.113, "right_knee_azimuth": 0.227,
            "left_knee_inclination": 0.115, "left_knee_azimuth": 0.24, "right_hand_inclination": 0.166,
            "right_hand_azimuth": 0.24, "left_hand_inclination": 0.183, "left_hand_azimuth": 0.252,
            "right_foot_inclination": 0.111, "right_foot_azimuth": 0.115, "left_foot_inclination": 0.125,
            "left_foot_azimuth": 0.11, "turn": 0.074,
        },
        93.2,
    ),
    "network": AngleNoise(
        {
            "twist": 0.077, "lean": 0.068, "bend": 0.078, "twist_change": 0.011, "lean_change": 0.008, "bend_change": 0.007,
            "right_elbow_inclination": 0.088, "right_elbow_azimuth": 0.147, "left_elbow_inclination": 0.098,
            "left_elbow_azimuth": 0.145, "right_knee_inclination": 0.093, "right_knee_azimuth": 0.181,
            "left_knee_inclination": 0.109, "left_knee_azimuth": 0.18, "right_hand_inclination": 0.188,
            "right_hand_azimuth": 0.25, "left_hand_inclination": 0.193, "left_hand_azimuth": 0.259,
            "right_foot_inclination": 0.107, "right_foot_azimuth": 0.117, "left_foot_inclination": 0.13,
            "left_foot_azimuth": 0.124, "turn": 0.081,
        },
        93.9,
    ),
    "fitted_network": AngleNoise(
        {
            "twist": 0.073, "lean": 0.078, "bend": 0.096, "twist_change": 0.011, "lean_change": 0.006, "bend_change": 0.008,
            "right_elbow_inclination": 0.086, "right_elbow_azimuth": 0.128, "left_elbow_inclination": 0.103,
            "left_elbow_azimuth": 0.137, "right_knee_inclination": 0.136, "right_knee_azimuth": 0.404,
            "left_knee_inclination": 0.135, "left_knee_azimuth": 0.379, "right_hand_inclination": 0.159,
            "right_hand_azimuth": 0.246, "left_hand_inclination": 0.19, "left_hand_azimuth": 0.26, "right_foot_inclination":
            0.133, "right_foot_azimuth": 0.148, "left_foot_inclination": 0.136, "left_foot_azimuth": 0.125, "turn": 0.083,
        },
        89.5,
    ),
    "best": AngleNoise(
        {
            "twist": 0.064, "lean": 0.066, "bend": 0.077, "twist_change": 0.009, "lean_change": 0.006, "bend_change": 0.005,
            "right_elbow_inclination": 0.082, "right_elbow_azimuth": 0.124, "left_elbow_inclination": 0.089,
            "left_elbow_azimuth": 0.123, "right_knee_inclination": 0.112, "right_knee_azimuth": 0.212,
            "left_knee_inclination": 0.116, "left_knee_azimuth": 0.229, "right_hand_inclination": 0.162,
            "right_hand_azimuth": 0.237, "left_hand_inclination": 0.176, "left_hand_azimuth": 0.232,
            "right_foot_inclination": 0.107, "right_foot_azimuth": 0.108, "left_foot_inclination": 0.122,
            "left_foot_azimuth": 0.103, "turn": 0.069,
        },
        93.4,
    ),
    # A third of the learners score less than 90: there the tracker had lost trunk or legs, which no noise explains.
    "tracker": AngleNoise(
        {
            "twist": 0.133, "lean": 0.083, "bend": 0.123, "twist_change": 0.026, "lean_change": 0.007, "bend_change": 0.012,
            "right_elbow_inclination": 0.138, "right_elbow_azimuth": 0.226, "left_elbow_inclination": 0.143,
            "left_elbow_azimuth": 0.22, "right_knee_inclination": 0.142, "right_knee_azimuth": 0.595,
            "left_knee_inclination": 0.154, "left_knee_azimuth": 0.568, "right_hand_inclination": 0.252,
            "right_hand_azimuth": 0.392, "left_hand_inclination": 0.292, "left_hand_azimuth": 0.412,
            "right_foot_inclination": 0.204, "right_foot_azimuth": 0.295, "left_foot_inclination": 0.194,
            "left_foot_azimuth": 0.297, "turn": 0.308,
        },
        82.7,
    ),
}  # fmt: skip
"""By the estimator's name; `none` for true joints. Those of the network are the shipped one's; another is measured by whoever
trains it."""


def angle_variance(noise: str, names: tuple[str, ...]) -> np.ndarray:
    """(D,) squared standard deviations of the errors of the named angles, radians^2.

    Raises:
        InputError: the noise of this estimator is not known.
    """
    if noise not in NOISE:
        raise InputError(f"noise={noise} is not one of {', '.join(NOISE)}")
    std_rad = NOISE[noise].std_rad
    return np.array([std_rad.get(name, 0.0) ** 2 for name in names])
