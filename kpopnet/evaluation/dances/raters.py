"""Agreement of people who compared learners of a dance pair by pair: with each other, with themselves, of scorers with them.

A rater's ranks within a dance follow from the number of pairs that each learner won, equal ones counted as half. Where every
pair was compared equally often, that is the order of the maximum likelihood of Bradley and Terry's model (Ford 1957, "Solution
of a ranking problem from binary comparisons", The American Mathematical Monthly 64(8)); so a dance counts for a rater only if
all of its pairs are answered.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from kpopnet.datasets.dances.ratings import CHOICES, Answer
from kpopnet.errors import check_one_of
from kpopnet.evaluation.dances.ranking import wilson_interval
from kpopnet.evaluation.intervals import FEWEST_UNITS, Bootstrap, interval_of


class Estimate(NamedTuple):
    """A figure, its 95 % interval and the number of dances that it rests on."""

    value: float | None  # None where nothing defines it
    interval: list[float] | None  # None with fewer dances than FEWEST_UNITS and where no resample differs
    dances: int


@dataclass(frozen=True)
class Votes:
    """A dance with the m raters who compared all pairs of its L learners."""

    learners: tuple[str, ...]
    raters: tuple[str, ...]
    signs: np.ndarray  # (m, L, L) 1 where a rater prefers the row's learner to the column's, -1 the reverse, 0 for equal

    @property
    def pooled(self) -> np.ndarray:
        """(L,) pairs won minus pairs lost, over all raters."""
        return self.signs.sum(axis=(0, 2))

    def split(self, rater: str) -> tuple[np.ndarray, "Votes"]:
        """The (L, L) signs of one rater, and the others."""
        one = self.raters.index(rater)
        return self.signs[one], Votes(self.learners, self.raters, np.delete(self.signs, one, axis=0))


def votes_of(dances: dict[str, list[str]], ratings: dict[str, list[Answer]]) -> dict[str, Votes]:
    """The dances, by name, that at least one rater compared completely; from learners by dance and answers by rater.

    Raises InputError for an answer that is none yet, or is about others than the learners.
    """
    found = {}
    for dance, learners in dances.items():
        signs = {}
        for rater, answers in ratings.items():
            one = np.zeros((len(learners),) * 2)
            first = [answer for answer in answers if answer.dance == dance and not answer.repeat]
            for answer in first:
                check_one_of(f"{rater} on {dance}: choice", answer.choice, CHOICES)
                for learner in (answer.left, answer.right):
                    check_one_of(f"{rater} on {dance}: learner", learner, learners)
                left, right = learners.index(answer.left), learners.index(answer.right)
                one[left, right] = CHOICES[answer.choice]
                one[right, left] = -CHOICES[answer.choice]
            if len(first) == len(learners) * (len(learners) - 1) // 2:
                signs[rater] = one
        if signs:
            found[dance] = Votes(tuple(learners), tuple(signs), np.array(list(signs.values())))
    return found


def ranks(signs: np.ndarray) -> np.ndarray:
    """(m, L) ranks of each rater from (m, L, L) signs, 1 for the best; equal ones share their mean rank."""
    from scipy.stats import rankdata  # slow to import, and the raters' server needs it in the end alone

    return rankdata(-signs.sum(axis=2), axis=1)


def kendall_w(ranked: np.ndarray) -> float:
    """Kendall's coefficient of concordance of (m, n) mean ranks, corrected for ties (Kendall, Gibbons 1990, chapter 6).

    1 if all m raters rank the n learners alike; 1 / m is expected of raters at random. NaN if all are equal to all raters.
    """
    m, n = ranked.shape
    squares = ((ranked.sum(axis=0) - m * (n + 1) / 2) ** 2).sum()
    counts = (np.unique(one, return_counts=True)[1] for one in ranked)
    most = m**2 * (n**3 - n) - m * sum((count**3 - count).sum() for count in counts)
    return float(12 * squares / most) if most > 0 else np.nan


def coincidences(values: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """(V, V) Krippendorff's coincidence matrix of (units, coders) values, NaN where missing, among V sorted levels."""
    counts = (values[:, :, None] == levels).sum(axis=1)
    counts = counts[counts.sum(axis=1) > 1]
    pairs = counts[:, :, None] * counts[:, None] - counts[:, :, None] * np.eye(len(levels))
    return (pairs / (counts.sum(axis=1) - 1)[:, None, None]).sum(axis=0)


def ordinal_alpha(matrix: np.ndarray) -> np.ndarray:
    """(...) Krippendorff's alpha for ordinal values, of (..., V, V) coincidences; NaN where all values are equal.

    Krippendorff, "Computing Krippendorff's alpha-reliability", 2011. 1 if all agree, 0 as by chance.
    """
    often = matrix.sum(axis=-1)
    middle = often.cumsum(axis=-1) - often / 2
    squared = (middle[..., :, None] - middle[..., None, :]) ** 2
    observed, expected = ((one * squared).sum(axis=(-2, -1)) for one in (matrix, often[..., :, None] * often[..., None, :]))
    defined = expected > 0
    return np.where(defined, 1 - (often.sum(axis=-1) - 1) * observed / np.where(defined, expected, 1), np.nan)


def estimate(value: float, draws: np.ndarray, dances: int) -> Estimate:
    """A figure with the interval of its values in all resamples."""
    return Estimate(None if np.isnan(value) else float(value), interval_of(draws, dances), dances)


def ratio(above: list[float], below: list[float], seed: int) -> Estimate:
    """The ratio of two sums over dances; dances that add nothing to the lower one are left out."""
    kept = np.array(below) > 0
    upper, lower = (np.array(values, float)[kept, None] for values in (above, below))
    bootstrap = Bootstrap(np.arange(len(lower)), seed)
    value = upper.sum() / lower.sum() if len(lower) else np.nan
    return estimate(value, bootstrap.ratios(upper, lower), bootstrap.units)


def mean_w(votes: dict[str, Votes], seed: int) -> Estimate:
    """Kendall's W, the mean over the dances that two or more raters compared."""
    values = np.array([kendall_w(ranks(one.signs)) for one in votes.values() if len(one.raters) > 1])
    return ratio(np.nan_to_num(values).tolist(), np.isfinite(values).tolist(), seed)


def alpha(votes: dict[str, Votes], seed: int) -> Estimate:
    """Krippendorff's ordinal alpha of the ranks within dances: units are learners, coders raters."""
    ranked = [ranks(one.signs).T for one in votes.values() if len(one.raters) > 1]
    if not ranked:
        return Estimate(None, None, 0)
    levels = np.unique(np.concatenate([one.ravel() for one in ranked]))
    table = np.array([coincidences(one, levels) for one in ranked])
    bootstrap = Bootstrap(np.arange(len(ranked)), seed)
    draws = bootstrap.sums(table.reshape(len(ranked), -1)).reshape(-1, *table.shape[1:])
    return estimate(float(ordinal_alpha(table.sum(axis=0))), ordinal_alpha(draws), bootstrap.units)


def consistency(answers: list[Answer]) -> Estimate:
    """How often a rater answered the same when a pair was shown again; at most one pair a dance, so Wilson's interval."""
    first = {one.pair: one for one in answers}
    same = []
    for again in answers:
        before = first.get((again.dance, again.pair[1], False)) if again.repeat else None
        if before is not None:
            same.append(CHOICES[again.choice] == CHOICES[before.choice] * (1 if again.left == before.left else -1))
    interval = list(wilson_interval(sum(same), len(same))) if len(same) >= FEWEST_UNITS else None
    return Estimate(sum(same) / len(same) if same else None, interval, len(same))


def against(signs: dict[str, np.ndarray], votes: dict[str, Votes], seed: int) -> dict[str, Estimate]:
    """How an order of learners by someone else, (L, L) signs by dance, agrees with raters.

    `pairs`: the fraction of the raters' preferences that it shares; equal to it counts as half. `tau`: Kendall's tau-a with the
    raters' pooled order, mean over dances; a pair that is equal in one of both counts 0.
    """
    shared, given, tau = [], [], []
    for dance, one in votes.items():
        upper = np.triu_indices(len(one.learners), 1)
        own, others = signs[dance][upper], one.signs[:, *upper]
        shared.append(((own * others > 0) + 0.5 * ((own == 0) & (others != 0))).sum())
        given.append((others != 0).sum())
        tau.append((own * np.sign(np.subtract.outer(one.pooled, one.pooled))[upper]).mean())
    return {"pairs": ratio(shared, given, seed), "tau": ratio(tau, [1] * len(tau), seed)}


def one_against_others(rater: str, votes: dict[str, Votes], seed: int) -> dict[str, Estimate]:
    """`against` of a rater with the other raters."""
    split = {dance: one.split(rater) for dance, one in votes.items() if rater in one.raters and len(one.raters) > 1}
    return against({dance: own for dance, (own, _) in split.items()}, {dance: rest for dance, (_, rest) in split.items()}, seed)


def agreed_order(votes: Votes) -> tuple[list[str], str]:
    """The learners from the best to the worst by the pairs won, and "" or why the raters do not agree on it.

    They agree if at least two compared the dance and if of every two learners the better one won more pairs in all and was
    preferred by more raters than preferred the other.
    """
    order = np.argsort(-votes.pooled, kind="stable").tolist()
    names, majority = [votes.learners[k] for k in order], votes.signs.sum(axis=0)
    if len(votes.signs) < 2:
        return names, "one rater; expected two or more"
    for one, other in combinations(order, 2):
        if not (votes.pooled[one] > votes.pooled[other] and majority[one, other] > 0):
            return names, f"the raters are divided on {votes.learners[one]} and {votes.learners[other]}"
    return names, ""
