"""How far the angles of estimated joints are off: a part of the difference of two dances that is not the learner's.

    python -m kpopnet.evaluation.dances.noise FOLDER --estimator network --checkpoint DIR

measures it on simulated dances with true joints (docs/dance_scoring.md). With `--write` the result becomes an entry of
`noise.json`, which is read here.
"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import FEATURES


class AngleNoise(NamedTuple):
    """The errors of an estimator's angles on simulated dances of the split `train`.

    Attributes:
        std_rad: by the name of an angle of dance22_turn, the standard deviation of the error around the true angle, radians,
            constant errors included; of an azimuth, weighted as the distance weights it. Angles that are not named have none.
        ceiling: mean score of perfect dancing seen through the sensor and this estimator by `dance22`, with its noise known.
    """

    std_rad: dict[str, float]
    ceiling: float


TABLE = Path(__file__).with_name("noise.json")

NOISE: dict[str, AngleNoise] = {"none": AngleNoise({}, 100.0)} | {
    name: AngleNoise(**entry) for name, entry in json.loads(TABLE.read_text()).items()
}
"""By the estimator's name; `none` for true joints. Those of the network are the shipped one's. A third of the tracker's
learners score less than 90: there it had lost trunk or legs, which no noise explains."""


def known_noise(name: str) -> AngleNoise:
    """The noise of an estimator; none for `auto`, which only an evaluation replaces by each estimator's."""
    return NOISE["none" if name == "auto" else name]


def angle_variance(name: str) -> np.ndarray:
    """(D,) squared standard deviations of the errors of the angles of dance22_turn, radians^2, by an estimator's name."""
    return np.array([known_noise(name).std_rad.get(angle, 0.0) ** 2 for angle in FEATURES["dance22_turn"].names])
