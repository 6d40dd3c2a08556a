"""Evaluation of dance scores: estimated joints of the learners, their scores by every scorer, and the experts' ranking.

True joints, where a set has them, are always scored too: a pair of learners in the wrong order on true joints is not an
error of the pose estimator.
"""

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.dance.parts import NOISE, PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, Scorer, score_dance
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.errors import InputError
from kpopnet.evaluation import engine
from kpopnet.evaluation.dances.pose_cache import PoseCache
from kpopnet.evaluation.dances.ranking import TRUTH, Agreement, LearnerScore, agreement, similarities
from kpopnet.evaluation.engine import stage
from kpopnet.evaluation.poses.metrics import joint_errors_m
from kpopnet.paper_tracker.tracker import PaperTrackerConfig
from kpopnet.tracker.estimator import TrackerEstimatorConfig

log = logging.getLogger(__name__)

MAIN_SCORER = "dance22"


@dataclass(frozen=True)
class DanceRun:
    """The results of one evaluation.

    Attributes:
        dances: the set.
        scores: source of joints -> scorer -> dance -> scores of the learners, the best by the experts' ranking first. Sources
            are the true joints (`truth`), where they are known, and every estimator, in the order of the report.
        agreements: agreement with the experts by source of joints and scorer.
        fps: frames per second of the estimation, by the estimator's name.
        failed: the error message of each dance that was left out, by its name.
        assumptions: sentences for the report about changed settings and missing true joints.
        chosen: number of dances that were to be scored, including the failed ones.
    """

    dances: KpopSet
    scores: dict[str, dict[str, dict[str, list[LearnerScore]]]]
    agreements: dict[str, dict[str, Agreement]]
    fps: dict[str, float]
    failed: dict[str, str]
    assumptions: list[str]
    chosen: int

    @property
    def main_source(self) -> str:
        """The first estimator, or the true joints if there is no estimator."""
        return next((source for source in self.scores if source != TRUTH), TRUTH)

    @property
    def main_scorer(self) -> str:
        """MAIN_SCORER if it was used, otherwise the first scorer."""
        scorers = self.scores[self.main_source]
        return MAIN_SCORER if MAIN_SCORER in scorers else next(iter(scorers))

    @property
    def names(self) -> list[str]:
        """The scored dances."""
        return list(self.scores[self.main_source][self.main_scorer])


@dataclass(frozen=True)
class ScoredDance:
    """The scores of all learners of one dance.

    Attributes:
        scores: source of joints -> scorer -> scores of the learners, the best by the experts' ranking first; only sources of
            joints of all learners.
        frames: number of frames of all learners.
        seconds: estimation time of all learners by the estimator's name.
    """

    scores: dict[str, dict[str, list[LearnerScore]]]
    frames: int
    seconds: dict[str, float]


@dataclass(frozen=True)
class DanceScoring:
    """Reads a dance by its name, and scores its learners by every scorer on every source of joints."""

    dances: KpopSet
    caches: dict[str, PoseCache]
    scorers: dict[str, Scorer]

    def __call__(self, name: str) -> ScoredDance:
        dance = self.dances.dance(name)
        teacher = dance.teacher()
        scores: dict[str, dict[str, list[LearnerScore]]] = {}
        seconds, frames = dict.fromkeys(self.caches, 0.0), 0
        for learner in dance.learners:
            truth = learner.joints()
            performances: dict[str, tuple[Performance, float | None]] = {} if truth is None else {TRUTH: (truth, None)}
            for estimator, cache in self.caches.items():
                with stage(estimator):
                    found, time_s = cache.poses(dance, learner)
                performances[estimator] = found, _mean_error_m(found.joints_m, truth)
                seconds[estimator] += time_s
            frames += len(next(iter(performances.values()))[0].times_s) if performances else 0
            for source, (performance, error_m) in performances.items():
                if not performance.is_observed:
                    log.warning("%s, %s: %s found no joint in any frame; not scored", dance.name, learner.name, source)
                by_scorer = scores.setdefault(source, {scorer: [] for scorer in self.scorers})
                for scorer, settings in self.scorers.items():
                    score = score_dance(teacher, performance, _with_noise_of(source, settings), unobserved_is_nan=True)
                    by_scorer[scorer].append(LearnerScore(learner.name, score, error_m))
        complete = {s: by for s, by in scores.items() if all(len(one) == len(dance.learners) for one in by.values())}
        return ScoredDance(complete, frames, seconds)


def _with_noise_of(source: str, scorer: Scorer) -> Scorer:
    """The scorer with `noise=auto` replaced by the noise of a source of joints, where that is known."""
    known = isinstance(scorer, PartScorer) and scorer.noise == "auto" and source in NOISE
    return replace(scorer, noise=source) if known else scorer


def _mean_error_m(joints_m: np.ndarray, truth: Performance | None) -> float | None:
    """Mean distance over the joints that were found; None without true joints of the same frames."""
    if truth is None or len(truth.joints_m) != len(joints_m):
        return None
    errors_m = joint_errors_m(truth.joints_m, joints_m)
    found = np.isfinite(errors_m)
    return float(errors_m[found].mean()) if found.any() else None


def run_dances(
    dances: KpopSet,
    estimators: dict[str, Any],
    scorers: dict[str, Scorer],
    poses: Path,
    count: int | None,
    seed: int,
    processes: int,
) -> DanceRun:
    """Scores all learners of the first `count` dances, or of all; estimates the poses that are not cached in `poses`.

    Estimators are settings by name, the main one first; without scorers all of SCORERS are taken. A dance that cannot be read,
    estimated or scored is left out with all its learners. True joints are scored only if all learners of the others have them.

    Raises:
        InputError: no dance could be scored, a true pose is missing and there is no estimator, or an estimator would wait for
            the Y pose in vain.
    """
    estimators, assumptions = _start_anywhere(estimators)
    caches = {name: PoseCache(poses, name, settings) for name, settings in estimators.items()}
    work = DanceScoring(dances, caches, scorers or SCORERS)
    names = dances.names[:count]
    rows = engine.run(work, names, processes, str(dances.folder))
    scored = rows.found
    sources = [source for source in (TRUTH, *caches) if all(source in one.scores for one in scored.values())]
    without = [name for name, one in scored.items() if TRUTH not in one.scores]
    if without:
        lacking = f"a learner of {without[0]} has no true joints ({len(without)} of {len(scored)} dances are incomplete)"
        if not sources:
            raise InputError(f"{dances.folder}: {lacking}; give an estimator")
        assumptions.append(f"Scores on true joints are left out: {lacking}.")
    scores = {
        source: {scorer: {name: one.scores[source][scorer] for name, one in scored.items()} for scorer in work.scorers}
        for source in sources
    }
    agreements = {
        source: {
            scorer: agreement({name: similarities(learners) for name, learners in by_dance.items()}, seed)
            for scorer, by_dance in by_scorer.items()
        }
        for source, by_scorer in scores.items()
    }
    frames = sum(one.frames for one in scored.values())
    fps = {name: frames / max(sum(one.seconds[name] for one in scored.values()), 1e-9) for name in caches}
    return DanceRun(dances, scores, agreements, fps, rows.failed, assumptions, len(names))


def _start_anywhere(estimators: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Sets start=auto in trackers that would wait for the Y pose or a label, which learners do not show; settings and notes.

    Raises:
        InputError: an estimator knows no other start.
    """
    changed, assumptions = {}, []
    for name, settings in estimators.items():
        if isinstance(settings, PaperTrackerConfig):
            raise InputError(
                f"{name}: Algorithm 2 starts from the Y pose, which learners do not show; take estimator=[tracker] or [network]"
            )
        if isinstance(settings, TrackerEstimatorConfig) and settings.start in ("y_pose", "label"):
            settings = replace(settings, start="auto")
            assumptions.append(
                f"Learners do not show the Y pose: {name} starts from the first person who stands or sits upright (start=auto)."
            )
        changed[name] = settings
    return changed, assumptions
