"""Evaluation of dance scores: estimated joints of the learners, their scores by every scorer, and the experts' ranking.

    python evaluate.py benchmark=kpop_sim 'estimator=[tracker,network]' 'scorer=[dance22,raptis]' checkpoint=...

True joints, where a set has them, are always scored too: a pair of learners in the wrong order on true joints is not an
error of the pose estimator.
"""

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from kpopnet.dance.parts import NOISE, PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, Scorer, score_dance
from kpopnet.datasets.dances.dance_set import Dance, KpopSet
from kpopnet.errors import InputError
from kpopnet.evaluation.dances.oracle import ORACLES, oracle_similarity
from kpopnet.evaluation.dances.pose_cache import PoseCache
from kpopnet.evaluation.dances.ranking import TRUTH, Agreement, LearnerScore, agreement, is_ordered, similarities
from kpopnet.evaluation.poses.metrics import joint_errors_m
from kpopnet.paper_tracker.estimator import PaperTrackerEstimatorConfig
from kpopnet.runtime.parallel import in_processes
from kpopnet.tracker.estimator import TrackerEstimatorConfig

log = logging.getLogger(__name__)

MAIN_SCORER = "dance22"

Scores = dict[str, dict[str, dict[str, list[LearnerScore]]]]
"""Source of joints -> scorer -> dance -> scores of the learners, the best by the experts' ranking first."""


@dataclass(frozen=True)
class DanceRun:
    """The results of one evaluation.

    Attributes:
        dances: the set.
        scores: of the true joints (`truth`), where they are known, and of every estimator, in the order of the report.
        agreements: agreement with the experts by source of joints and scorer.
        fps: frames per second of the estimation, by the estimator's name.
        failed: the error message of each dance that was left out, by its name.
        assumptions: sentences for the report about changed settings and missing true joints.
        evaluated: names of the chosen dances, including the failed ones.
        oracle: by estimator, name of `ORACLES` to the names of the dances that MAIN_SCORER orders if that part's angles are
            the true ones; without estimators whose learners' true joints are unknown.
    """

    dances: KpopSet
    scores: Scores
    agreements: dict[str, dict[str, Agreement]]
    fps: dict[str, float]
    failed: dict[str, str]
    assumptions: list[str]
    evaluated: list[str]
    oracle: dict[str, dict[str, list[str]]]


def run_dances(
    dances: KpopSet,
    estimators: dict[str, Any],
    scorers: dict[str, Scorer],
    poses: Path,
    count: int | None,
    seed: int,
    processes: int,
) -> DanceRun:
    """Estimates the poses that are not cached in `poses`, and scores all learners of the first `count` dances.

    A dance that cannot be read, estimated or scored is reported in `DanceRun.failed` and left out with all its learners.
    True joints are scored only if all learners of the remaining dances have them.

    Args:
        dances: the set.
        estimators: settings by name, the main estimator first.
        scorers: settings by name; if empty, all of SCORERS.
        poses: folder of the cached poses of all estimators.
        count: number of dances, None for all.
        seed: of the bootstrap.
        processes: number of processes.

    Raises:
        InputError: no dance could be scored, or an estimator would wait for the Y pose in vain.
    """
    estimators, assumptions = _start_anywhere(estimators)
    caches = {name: PoseCache(poses, name, settings) for name, settings in estimators.items()}
    names, failed = dances.names[:count], {}
    _estimate_poses(dances, names, caches, failed, processes)
    scoring = DanceScoring(dances, caches, scorers or SCORERS)
    scored = _score_dances(scoring, names, failed, processes)
    sources = _complete_sources(scoring, scored, assumptions)
    scores = {
        source: {scorer: {name: one.scores[source][scorer] for name, one in scored.items()} for scorer in scoring.scorers}
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
    oracle = {
        source: {part: [name for name, one in scored.items() if is_ordered(one.oracle[source][part])] for part in ORACLES}
        for source in sources
        if all(source in one.oracle for one in scored.values())
    }
    return DanceRun(dances, scores, agreements, fps, failed, assumptions, names, oracle)


def _start_anywhere(estimators: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Sets start=auto in trackers that would wait for the Y pose or a label, which learners do not show; settings and notes.

    Raises:
        InputError: an estimator knows no other start.
    """
    changed, assumptions = {}, []
    for name, settings in estimators.items():
        if isinstance(settings, PaperTrackerEstimatorConfig):
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


def _estimate_poses(
    dances: KpopSet, names: list[str], caches: dict[str, PoseCache], failed: dict[str, str], processes: int
) -> None:
    """Fills the caches; adds the error message of each failed dance to `failed`."""
    work = LearnerEstimation(dances, caches)
    jobs = []
    for name in names:
        try:
            dance = dances.dance(name)
            missing = [
                (estimator, name, rank)
                for rank, learner in enumerate(dance.learners)
                for estimator, cache in caches.items()
                if not cache.has(dance, learner)
            ]
            jobs += missing
        except Exception as error:
            failed[name] = _message(error, name)
    for index, reason in tqdm(in_processes(work, jobs, processes), "poses", len(jobs), unit="learner", disable=not jobs):
        if reason is not None:
            failed[jobs[index][1]] = reason


def _message(error: Exception, dance: str) -> str:
    """The message of an error that excludes a dance. Errors other than InputError are logged with their traceback."""
    if isinstance(error, InputError):
        return str(error)
    log.error("%s failed", dance, exc_info=error)
    return f"{type(error).__name__}: {error}"


@dataclass(frozen=True)
class LearnerEstimation:
    """A callable that estimates and caches the poses of one learner.

    It is called with an estimator's name, a dance's name and the index of a learner, and returns an error message or None.
    """

    dances: KpopSet
    caches: dict[str, PoseCache]

    def __call__(self, job: tuple[str, str, int]) -> str | None:
        estimator, name, rank = job
        try:
            dance = self.dances.dance(name)
            self.caches[estimator].estimate(dance, dance.learners[rank])
        except Exception as error:
            return f"{estimator}: {_message(error, name)}"
        return None


def _score_dances(
    scoring: "DanceScoring", names: list[str], failed: dict[str, str], processes: int
) -> dict[str, "ScoredDance"]:
    """Scores the dances that have not failed, by name; adds the error message of each failed dance to `failed`.

    Raises:
        InputError: no dance could be scored.
    """
    chosen = [name for name in names if name not in failed]
    scored: dict[str, ScoredDance] = {}
    for index, outcome in tqdm(in_processes(scoring, chosen, processes), "scores", len(chosen), unit="dance"):
        if isinstance(outcome, str):
            failed[chosen[index]] = outcome
        else:
            scored[chosen[index]] = outcome
    if not scored:
        first, reason = next(iter(failed.items()))
        raise InputError(f"{scoring.dances.folder}: none of {len(names)} dances can be scored; {first}: {reason}")
    return {name: scored[name] for name in names if name in scored}


def _complete_sources(scoring: "DanceScoring", scored: dict[str, "ScoredDance"], assumptions: list[str]) -> list[str]:
    """The sources of joints that every dance has. A note is added to `assumptions` where true joints are incomplete.

    Raises:
        InputError: there are neither complete true joints nor estimators.
    """
    sources = [source for source in (TRUTH, *scoring.caches) if all(source in one.scores for one in scored.values())]
    without = [name for name, one in scored.items() if TRUTH not in one.scores]
    if without:
        lacking = f"a learner of {without[0]} has no true joints ({len(without)} of {len(scored)} dances are incomplete)"
        if not sources:
            raise InputError(f"{scoring.dances.folder}: {lacking}; give an estimator")
        assumptions.append(f"Scores on true joints are left out: {lacking}.")
    return sources


@dataclass(frozen=True)
class ScoredDance:
    """The scores of all learners of one dance.

    Attributes:
        scores: source of joints -> scorer -> scores of the learners, the best by the experts' ranking first.
        frames: number of frames of all learners.
        seconds: estimation time of all learners by the estimator's name.
        oracle: estimator -> name of `ORACLES` -> (L,) scores of the learners by MAIN_SCORER with that part's true angles.
    """

    scores: dict[str, dict[str, list[LearnerScore]]]
    frames: int
    seconds: dict[str, float]
    oracle: dict[str, dict[str, np.ndarray]]


@dataclass(frozen=True)
class DanceScoring:
    """A callable that scores the learners of one dance by every scorer on every source of joints.

    It is called with the name of a dance and returns its scores, or an error message.
    """

    dances: KpopSet
    caches: dict[str, PoseCache]
    scorers: dict[str, Scorer]

    def __call__(self, name: str) -> ScoredDance | str:
        try:
            return self._score(self.dances.dance(name))
        except Exception as error:
            return _message(error, name)

    def _score(self, dance: Dance) -> ScoredDance:
        teacher = dance.teacher()
        scores: dict[str, dict[str, list[LearnerScore]]] = {}
        oracle: dict[str, list[dict[str, float]]] = {}
        seconds, frames = dict.fromkeys(self.caches, 0.0), 0
        for learner in dance.learners:
            truth = learner.joints()
            performances: dict[str, tuple[Performance, float | None]] = {}
            if truth is not None:
                performances[TRUTH] = truth, None
            for name, cache in self.caches.items():
                poses = cache.read(dance, learner)
                performances[name] = poses.performance(), _mean_error_m(poses.joints_m, truth)
                seconds[name] += poses.seconds
            frames += len(next(iter(performances.values()))[0].times_s) if performances else 0
            for source, (performance, error_m) in performances.items():
                if not performance.is_observed:
                    log.warning("%s, %s: %s found no joint in any frame; not scored", dance.name, learner.name, source)
                for scorer, config in self.scorers.items():
                    score = score_dance(teacher, performance, _with_noise_of(source, config), unobserved_is_nan=True)
                    by_scorer = scores.setdefault(source, {name: [] for name in self.scorers})
                    by_scorer[scorer].append(LearnerScore(learner.name, score, error_m))
                if source != TRUTH and truth is not None and MAIN_SCORER in self.scorers:
                    config = _with_noise_of(source, self.scorers[MAIN_SCORER])
                    oracle.setdefault(source, []).append(oracle_similarity(teacher, performance, truth, config))
        complete = {s: by for s, by in scores.items() if all(len(one) == len(dance.learners) for one in by.values())}
        by_part = {
            source: {part: np.array([one[part] for one in learners]) for part in ORACLES}
            for source, learners in oracle.items()
            if len(learners) == len(dance.learners)
        }
        return ScoredDance(complete, frames, seconds, by_part)


def _with_noise_of(source: str, config: Scorer) -> Scorer:
    """The settings with `noise=auto` replaced by the noise of a source of joints, where that is known."""
    known = isinstance(config, PartScorer) and config.noise == "auto" and source in NOISE
    return replace(config, noise=source) if known else config


def _mean_error_m(joints_m: np.ndarray, truth: Performance | None) -> float | None:
    """Mean distance over the joints that were found; None without true joints of the same frames."""
    if truth is None or len(truth.joints_m) != len(joints_m):
        return None
    errors_m = joint_errors_m(truth.joints_m, joints_m)
    found = np.isfinite(errors_m)
    return float(errors_m[found].mean()) if found.any() else None
