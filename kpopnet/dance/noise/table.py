"""What estimators' errors do to perfect dancing, learnt on simulated dances by tools/measure_noise.py."""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.dance.noise.steady import PART_OF_SEGMENT, SEGMENTS
from kpopnet.dance.window import PARTS
from kpopnet.errors import InputError, check_one_of


class EstimatorNoise(NamedTuple):
    """The errors of an estimator on simulated dances of the split `train`."""

    # by the name of an angle of dance22_turn, the standard deviation of the error around the true angle, radians, constant
    # errors included; of an azimuth, weighted as the distance weights it. Angles that are not named have none.
    std_rad: dict[str, float]
    # by a word of PARTS (arm, leg, torso, turning), a and b: perfect dancing keeps the similarity 1 / (1 + a d^b) of a part of
    # `doubt` d
    loss: dict[str, tuple[float, float]]
    # half of what 95 % of scores' errors do not exceed, in units of (1 - kept) / kept, see `DanceScore.uncertainty`; None where
    # it was not measured
    spread: float | None
    # by the last word of a name of `steady.SEGMENTS` (elbow, hand, knee, foot, torso), a and b: perfect dancing has a steady
    # difference of the root mean square a d^b, radians, of a part of `doubt` d; empty where it was not measured
    steady: dict[str, tuple[float, float]]
    # whether directions along the line of sight are known as well as those across it, see kpopnet.dance.noise.sight
    sees_depth: bool = True


CERTAIN = 0.003
"""Chance of an error that no confidence excludes."""

TABLE = Path(__file__).parents[1] / "noise.json"

NOISE: dict[str, EstimatorNoise] = {"none": EstimatorNoise({}, {}, 0.0, {})} | {
    name: EstimatorNoise(**entry) for name, entry in json.loads(TABLE.read_text()).items()
}
"""By the estimator's name; `none` for true joints. Those of the network are the shipped one's."""


SEEN = "_seen_teacher"
"""Ends the name of an estimator's noise against a teacher as the estimator sees them (`synth.dances.seen`), where what it is
off of all who dance the same is no difference."""

SEEN_PEOPLE = "validation"
"""Split of the simulated people whom the estimator sees dance the teacher's dance: no network has learnt of them."""

SEEN_BY = tuple(name.removesuffix(SEEN) for name in NOISE if name.endswith(SEEN))
"""Estimators of which this noise is known."""

RECORDED = "_recorded_teacher"
"""Ends the name of an estimator's noise against a teacher who was recorded and estimated as the learner was: one person, whose
own errors come on top."""


def noise_between(teacher: str, learner: str) -> str:
    """The name of the noise of a learner's estimator against a teacher's joints, of an `estimator` as of `Performance`.

    Raises InputError where the teacher is as another estimator than the learner's sees them, or as one that NOISE lacks.
    """
    check_one_of("the estimator of the teacher's joints", teacher, tuple(NOISE))
    if teacher == learner and f"{learner}{RECORDED}" in NOISE:
        return f"{learner}{RECORDED}"
    if not teacher.endswith(SEEN):
        return learner
    if learner.removesuffix(SEEN) != teacher.removesuffix(SEEN):
        raise InputError(
            f"the teacher's joints are as {teacher.removesuffix(SEEN)} sees them, the learner's of noise {learner}"
        )
    return teacher


def known_noise(name: str) -> EstimatorNoise:
    """The noise of an estimator; none for `auto`, which only an evaluation replaces by each estimator's."""
    return NOISE["none" if name == "auto" else name]


def kept_by_noise(loss: dict[str, tuple[float, float]], doubt: np.ndarray) -> np.ndarray:
    """(..., P) similarity in 0..1 that perfect dancing keeps, of the (..., P) `doubt` of each part."""
    scale, power = np.array([loss.get(name.split()[-1], (0.0, 0.0)) for name in PARTS]).T
    return 1 / (1 + scale * doubt**power)


def doubt(confidence: np.ndarray) -> np.ndarray:
    """(P,) geometric mean, over the frames that show the part, of the chance that its least confident joint is wrong.

    Takes (n, P) confidence. An estimator that errs in one pose errs in those around it too, of which it is surer: seconds tell
    more than a frame (docs/ledger.md).
    """
    shown = confidence > 0
    logarithm = np.where(shown, np.log(1 - confidence + CERTAIN), 0.0).sum(axis=0)
    return np.exp(logarithm / np.maximum(shown.sum(axis=0), 1))


def steady_by_noise(steady: dict[str, tuple[float, float]], doubt: np.ndarray) -> np.ndarray:
    """(S,) mean squares, radians^2, of perfect dancing's steady differences, of (P,) `doubt`; infinite where not measured."""
    scale, power = np.array([steady.get(name.split("_")[-1], (math.inf, 0.0)) for name in SEGMENTS]).T
    return (scale * doubt[PART_OF_SEGMENT] ** power) ** 2
