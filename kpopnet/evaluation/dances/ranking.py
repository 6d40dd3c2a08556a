"""Agreement of scores with the experts' ranking: the concordance of the paper's Table 2, Kendall's tau, wrong pairs.

A dance is in the right order if and only if its scores decrease strictly from the best learner to the worst (section 4.3). A
tie is a failure, and so is a learner without a score. Kendall's tau counts pairs of learners instead of dances: (pairs in the
right order - pairs in the wrong order) / all pairs of the dance; tied pairs count 0.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kpopnet.dance.performance import numbers
from kpopnet.dance.scoring import DanceScore
from kpopnet.errors import InputError
from kpopnet.evaluation.intervals import Bootstrap

TRUTH = "truth"
"""Name of the true joints as a source of joints, beside the names of estimators."""


class LearnerScore(NamedTuple):
    """The score of one learner by one scorer on one source of joints."""

    name: str
    score: DanceScore
    error_m: float | None = None  # mean distance of the found joints from the true ones; None on these, or if unknown


def similarities(learners: list[LearnerScore]) -> np.ndarray:
    """(L,) similarity scores in the order of the learners."""
    return np.array([learner.score.similarity for learner in learners])


def is_ordered(scores: ArrayLike) -> bool:
    """Whether (L,) scores, the best learner by the experts first, decrease strictly; raises InputError for fewer than two."""
    return bool((np.diff(_of_learners(scores)) < 0).all())


def kendall_tau(scores: ArrayLike) -> float:
    """Kendall's tau-a of (L,) scores, the best learner by the experts first: 1 in the right order, -1 in reverse order.

    Raises InputError for fewer than two.
    """
    scores = _of_learners(scores)
    first, second = np.triu_indices(len(scores), 1)
    difference = np.nan_to_num(scores[first] - scores[second])
    return float(np.sign(difference).mean())


def _of_learners(scores: ArrayLike) -> np.ndarray:
    found = numbers("scores", scores)
    if found.ndim != 1 or len(found) < 2:
        raise InputError(f"scores of shape {found.shape}: expected those of two learners or more, the best first")
    return found


class Agreement(NamedTuple):
    """Agreement of scores with the experts, with 95 % intervals of both figures."""

    concordance: float  # percentage of dances in the right order; Wilson's interval of a proportion
    kendall_tau: float  # mean over dances; interval of a bootstrap over dances
    interval: dict[str, list[float] | None]
    wrong: tuple[str, ...]  # names of the dances that are not in the right order


def agreement(scores: dict[str, np.ndarray], seed: int) -> Agreement:
    """The agreement of (L,) scores of each dance by its name, the best learner by the experts first; at least one dance."""
    if not scores:
        raise InputError("scores: expected those of one dance or more, by its name")
    ordered = np.array([is_ordered(one) for one in scores.values()])
    tau = np.array([kendall_tau(one) for one in scores.values()])
    bootstrap = Bootstrap(np.arange(len(tau)), seed)
    low, high = wilson_interval(int(ordered.sum()), len(ordered))
    interval = {
        "concordance": [100 * low, 100 * high],
        "kendall_tau": bootstrap.interval(tau[:, None], np.ones((len(tau), 1))),
    }
    wrong = tuple(name for name, right in zip(scores, ordered, strict=True) if not right)
    return Agreement(float(100 * ordered.mean()), float(tau.mean()), interval, wrong)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion, which a bootstrap's percentiles miss near 0 and 1 (Brown, Cai, DasGupta 2001)."""
    from scipy.stats import binomtest  # slow to import

    found = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


def in_order_by_one(wrong_by_one: Iterable, wrong_by_other: Iterable) -> tuple[int, int]:
    """How many dances are in order by one scorer alone, and by the other alone; given those that each has in a wrong order."""
    one, other = set(wrong_by_one), set(wrong_by_other)
    return len(other - one), len(one - other)


def mcnemar_p_value(only_one: int, only_other: int) -> float:
    """The exact two-sided p-value of McNemar's test: do two scorers order equally many of the same dances?

    Only dances that one of both orders count; under the hypothesis each is as likely to be the one's as the other's.
    """
    from scipy.stats import binomtest

    return float(binomtest(only_one, only_one + only_other).pvalue) if only_one + only_other else 1.0
