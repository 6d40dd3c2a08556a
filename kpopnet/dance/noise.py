"""How far the angles of estimated joints are off: the part of a difference between two dances that is nobody's fault.

    python -m kpopnet.evaluation.dances.noise FOLDER                      # the tracker, on training dances
    python -m kpopnet.evaluation.dances.noise FOLDER --estimator network --checkpoint DIR

measures them. FOLDER holds simulated dances with true joints (docs/dance_scoring.md). With `--write` the result becomes an
entry of `noise.json`, which is read here.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import feature_names
from kpopnet.errors import InputError


class AngleNoise(NamedTuple):
    """The errors of an estimator's angles on simulated dances of the split `train`.

    Attributes:
        std_rad: by feature, the standard deviation of the error around the true angle by the angle's name, radians, constant
            errors included; of an azimuth, weighted as the distance weights it. Angles that are not named have none.
        ceiling: mean score of perfect dancing seen through the sensor and this estimator by `dance22`, with its noise known.
    """

    std_rad: dict[str, dict[str, float]]
    ceiling: float


TABLE = Path(__file__).with_name("noise.json")

NOISE: dict[str, AngleNoise] = {"none": AngleNoise({}, 100.0)} | {
    name: AngleNoise(**entry) for name, entry in json.loads(TABLE.read_text()).items()
}
"""By the estimator's name; `none` for true joints. Those of the network are the shipped one's; another is measured by whoever
trains it. Of the tracker's learners a third score less than 90: there it had lost trunk or legs, which no noise explains."""


def angle_variance(noise: str, feature: str, heading: bool) -> np.ndarray:
    """(D,) squared standard deviations of the errors of a feature's angles, radians^2.

    Raises:
        InputError: the noise of this estimator is not known.
    """
    if noise not in NOISE:
        raise InputError(f"noise={noise} is not one of {', '.join(NOISE)}")
    std_rad = NOISE[noise].std_rad.get(feature, {})
    return np.array([std_rad.get(name, 0.0) ** 2 for name in feature_names(feature, heading)])
