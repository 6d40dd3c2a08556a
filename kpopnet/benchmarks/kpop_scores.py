"""Scores against the experts' order: the paper's Table 2, its concordance, and who was taken for whom.

A dance is ordered rightly if and only if the scores fall strictly from the best learner to the worst (section 4.3); a tie
is a failure, and so is a learner of whom nothing could be scored. Kendall's tau counts pairs instead of dances: of all
pairs of a dance's learners those in the right order less those in the wrong one, tied pairs neither, as a share.
"""

from dataclasses import dataclass

import numpy as np

from kpopnet.dance.scoring import DanceScore

BOOTSTRAPS = 2000
TRUTH = "truth"
"""The name under which true joints stand beside estimators."""


@dataclass(frozen=True)
class LearnerScore:
    """One learner by one scorer on one source of joints.

    Attributes:
        name: of the learner.
        score: what the scorer says.
        error_m: the mean distance of the joints found from the true ones, None on true joints or where nobody knows.
    """

    name: str
    score: DanceScore
    error_m: float | None = None


def similarities(learners: list[LearnerScore]) -> np.ndarray:
    """(L,) scores in the given order."""
    return np.array([learner.score.similarity for learner in learners])


def is_ordered(scores: np.ndarray) -> bool:
    """Whether (L,) scores, the experts' best first, fall strictly."""
    return bool((np.diff(scores) < 0).all())


def kendall_tau(scores: np.ndarray) -> float:
    """Kendall's tau-a of (L,) scores, the experts' best first: 1 in the right order, -1 in the reverse."""
    first, second = np.triu_indices(len(scores), 1)
    difference = np.nan_to_num(scores[first] - scores[second])
    return float(np.sign(difference).mean())


@dataclass(frozen=True)
class Agreement:
    """How far scores agree with experts.

    Attributes:
        concordance: dances ordered rightly, of 100.
        kendall_tau: the mean over dances.
        interval: 95 % bootstrap intervals over dances of both.
        wrong: names of those that are not ordered rightly.
    """

    concordance: float
    kendall_tau: float
    interval: dict[str, tuple[float, float]]
    wrong: tuple[str, ...]


def agreement(scores: dict[str, np.ndarray], seed: int) -> Agreement:
    """Of the scores (L,) of every dance, the experts' best first, by the dance's name; at least one."""
    ordered = np.array([is_ordered(one) for one in scores.values()])
    tau = np.array([kendall_tau(one) for one in scores.values()])
    drawn = np.random.default_rng(seed).integers(len(scores), size=(BOOTSTRAPS, len(scores)))
    interval = {
        name: tuple(np.quantile(values[drawn].mean(axis=1), (0.025, 0.975)).tolist())
        for name, values in (("concordance", 100.0 * ordered), ("kendall_tau", tau))
    }
    wrong = tuple(name for name, right in zip(scores, ordered, strict=True) if not right)
    return Agreement(float(100 * ordered.mean()), float(tau.mean()), interval, wrong)


@dataclass(frozen=True)
class Confusion:
    """Two learners of a dance whose scores are not in the experts' order.

    Attributes:
        dance: its name.
        ranks: of the better and of the worse learner, 1 for the best.
        better, worse: the learners.
        why: the likely causes, in words.
    """

    dance: str
    ranks: tuple[int, int]
    better: LearnerScore
    worse: LearnerScore
    why: str


def confusions(by_dance: dict[str, list[LearnerScore]], true_scores: dict[str, list[LearnerScore]] | None) -> list[Confusion]:
    """Every pair in the wrong order or tied, the widest apart first.

    Args:
        by_dance: learners, the experts' best first.
        true_scores: the same on true joints: a pair that is in order there is confused by the pose estimation alone.
    """
    found = []
    for dance, learners in by_dance.items():
        truth = true_scores.get(dance) if true_scores else None
        for i in range(len(learners)):
            for j in range(i + 1, len(learners)):
                if learners[i].score.similarity > learners[j].score.similarity:
                    continue
                known = (truth[i], truth[j]) if truth else None
                found.append(Confusion(dance, (i + 1, j + 1), learners[i], learners[j], _why(learners[i], learners[j], known)))
    return sorted(found, key=lambda pair: -np.nan_to_num(pair.worse.score.similarity - pair.better.score.similarity))


def _why(better: LearnerScore, worse: LearnerScore, truth: tuple[LearnerScore, LearnerScore] | None) -> str:
    if np.isnan([better.score.similarity, worse.score.similarity]).any():
        return "not scored: too little of the person was found"
    parts = []
    if truth is not None:
        in_order = truth[0].score.similarity > truth[1].score.similarity
        parts.append("pose error: in order on true joints" if in_order else "out of order on true joints too")
    wrong = [name for name in ("timing", "posture") if getattr(better.score, name) <= getattr(worse.score, name)]
    parts.append(f"the worse one's {' and '.join(wrong)} score higher" if wrong else "their windows combine so")
    return "; ".join(parts)
