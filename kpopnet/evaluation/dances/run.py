"""Evaluation of dance scores: estimated joints of the learners, their scores by every scorer, and the experts' ranking.

True joints, where a set has them, are always scored too: a pair of learners in the wrong order on true joints is not an
error of the pose estimator.
"""

import logging
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kpopnet.dance.noise.table import NOISE, SEEN_BY
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.scoring import SCORERS, Scorer, score_dance
from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.errors import InputError
from kpopnet.evaluation import engine
from kpopnet.evaluation.dances.pose_cache import PoseCache, SeeTeacher
from kpopnet.evaluation.dances.ranking import TRUTH, Agreement, LearnerScore, agreement, similarities
from kpopnet.evaluation.engine import stage
from kpopnet.evaluation.poses.metrics import joint_errors_m, mean_error_m
from kpopnet.evaluation.registry import BestConfig
from kpopnet.evaluation.report import future_remark
from kpopnet.evaluation.values import plain
from kpopnet.paper_tracker.tracker import PaperTrackerConfig
from kpopnet.skeleton import Joint
from kpopnet.tracker.estimator import TrackerEstimatorConfig

log = logging.getLogger(__name__)

NO_JOINTS_M = np.zeros((0, len(Joint), 3))

MAIN_SCORER = "dance22"


class Method(NamedTuple):
    """A scorer on a source of joints: the true ones (TRUTH) or those of an estimator, by its name."""

    source: str
    scorer: str


@dataclass(frozen=True)
class DanceRun:
    """The results of one evaluation."""

    dances: KpopSet
    # By method and dance, the learners from the best by the experts' ranking on. True joints come first, where they are known,
    # then every estimator in the order of the report.
    scores: dict[Method, dict[str, list[LearnerScore]]]
    agreements: dict[Method, Agreement]  # with the experts
    fps: dict[str, float]  # of the estimation, by the estimator's name
    failed: dict[str, str]  # the error message of each dance that was left out, by its name
    # sentences for the report about changed settings, borrowed noise, a look at the future and missing true joints
    assumptions: list[str]
    chosen: int  # number of dances that were to be scored, including the failed ones

    @property
    def sources(self) -> list[str]:
        return list(dict.fromkeys(method.source for method in self.scores))

    @property
    def scorers(self) -> list[str]:
        return list(dict.fromkeys(method.scorer for method in self.scores))

    @property
    def main(self) -> Method:
        """MAIN_SCORER, or else the first one, on the first estimator's joints, or on the true ones without an estimator."""
        source = next((source for source in self.sources if source != TRUTH), TRUTH)
        return Method(source, MAIN_SCORER if MAIN_SCORER in self.scorers else self.scorers[0])

    @property
    def names(self) -> list[str]:
        """The scored dances."""
        return list(self.scores[self.main])

    @property
    def in_set(self) -> int:
        """The number of dances of the complete set: those that the manifest says, or more where some were added."""
        return max(self.dances.manifest.dances or 0, len(self.dances))


class ScoredDance(NamedTuple):
    """Scores of one dance by method, from sources of joints of all learners; frames and seconds of all, by estimator."""

    scores: dict[Method, list[LearnerScore]]
    frames: int
    seconds: dict[str, float]


def score_learners(
    dances: KpopSet, caches: dict[str, PoseCache], scorers: dict[str, Scorer], see_teacher: SeeTeacher | None, name: str
) -> ScoredDance:
    """Reads a dance by its name, and scores its learners by every scorer on every source of joints."""
    dance = dances.dance(name)
    teachers = dict.fromkeys((TRUTH, *caches), dance.teacher())
    if see_teacher is not None:
        teachers |= {one: cache.seen_teacher(dance, see_teacher) for one, cache in caches.items() if one in SEEN_BY}
    scores: dict[Method, list[LearnerScore]] = {}
    seconds, frames = dict.fromkeys(caches, 0.0), 0
    for learner in dance.learners:
        truth = learner.joints()
        found = {} if truth is None else {TRUTH: truth}
        for estimator, cache in caches.items():
            with stage(estimator):
                found[estimator], time_s = cache.poses(dance, learner)
            seconds[estimator] += time_s
        frames += max((len(performance.times_s) for performance in found.values()), default=0)
        for source, performance in found.items():
            if not performance.is_observed:
                log.warning("%s, %s: %s found no joint in any frame; not scored", dance.name, learner.name, source)
            error_m = None  # unknown without true joints of the same frames
            if source != TRUTH and truth is not None and len(truth.joints_m) == len(performance.joints_m):
                error_m = plain(mean_error_m(joint_errors_m(truth.joints_m, performance.joints_m)))
            for scorer, settings in scorers.items():
                if isinstance(settings, PartScorer) and settings.noise == "auto" and source in NOISE:
                    settings = replace(settings, noise=source)
                score = score_dance(teachers[source], performance, settings, unobserved_is_nan=True)
                score = score._replace(teacher_m=NO_JOINTS_M, learner_m=NO_JOINTS_M)  # thousands of scores are kept
                scores.setdefault(Method(source, scorer), []).append(LearnerScore(learner.name, score, error_m))
    complete = {method: learners for method, learners in scores.items() if len(learners) == len(dance.learners)}
    return ScoredDance(complete, frames, seconds)


def run_dances(
    dances: KpopSet,
    estimators: dict[str, Any],
    scorers: dict[str, Scorer],
    poses: Path,
    count: int | None,
    seed: int,
    processes: int,
    see_teacher: SeeTeacher | None = None,
) -> DanceRun:
    """Scores all learners of the first `count` dances, or of all; estimates the poses that are not cached in `poses`.

    Estimators are settings by name, the main one first; without scorers all of SCORERS are taken. With `see_teacher` learners
    are compared with teachers as their estimator sees them. A dance that cannot be read, estimated or scored is left out with
    all its learners. True joints are scored only if all learners of the others have them. Raises InputError if no dance could
    be scored, or a true pose is missing and there is no estimator.
    """
    estimators, assumptions = _start_anywhere(estimators)
    caches = {name: PoseCache(poses, name, settings) for name, settings in estimators.items()}
    names, scorers = dances.names[:count], scorers or SCORERS
    scored, failed = engine.run(
        partial(score_learners, dances, caches, scorers, see_teacher), names, processes, str(dances.folder)
    )
    methods = [Method(source, scorer) for source in (TRUTH, *caches) for scorer in scorers]
    methods = [method for method in methods if all(method in one.scores for one in scored.values())]
    without = [name for name, one in scored.items() if all(method.source != TRUTH for method in one.scores)]
    if without:
        lacking = f"a learner of {without[0]} has no true joints ({len(without)} of {len(scored)} dances are incomplete)"
        if not methods:
            raise InputError(f"{dances.folder}: {lacking}; give an estimator")
        assumptions.append(f"Scores on true joints are left out: {lacking}.")
    if see_teacher is not None:
        seeing, blind = [name for name in caches if name in SEEN_BY], [name for name in caches if name not in SEEN_BY]
        told = (
            f"Compared with teachers as the estimator sees them in the mean of SIMULATED people: {', '.join(seeing) or 'none'}"
        )
        assumptions.append(f"{told}; with the teachers' own joints: {', '.join((TRUTH, *blind))}.")
    if any(isinstance(one, PartScorer) and one.noise == "auto" for one in scorers.values()):
        others = [name for name in NOISE.keys() & caches if getattr(estimators[name], "checkpoint", None) is not None]
        told = "runs a given checkpoint, but what is taken out of its scores are the errors of the package's network."
        assumptions += [f"{name} {told}" for name in sorted(others)]
    assumptions += future_remark([name for name, one in estimators.items() if isinstance(one, BestConfig)])
    scores = {method: {name: one.scores[method] for name, one in scored.items()} for method in methods}
    agreements = {
        method: agreement({name: similarities(learners) for name, learners in by_dance.items()}, seed)
        for method, by_dance in scores.items()
    }
    if not dances.manifest.independent:
        agreements = {method: one._replace(interval=dict.fromkeys(one.interval)) for method, one in agreements.items()}
    frames = sum(one.frames for one in scored.values())
    fps = {name: frames / max(sum(one.seconds[name] for one in scored.values()), 1e-9) for name in caches}
    return DanceRun(dances, scores, agreements, fps, failed, assumptions, len(names))


def _start_anywhere(estimators: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Another start for trackers that would wait for the Y pose or a label, which learners do not show; settings and notes."""
    starts = {
        PaperTrackerConfig: (("y_pose",), "label", "first true joints"),
        TrackerEstimatorConfig: (("y_pose", "label"), "auto", "first person who stands or sits upright"),
    }
    changed, assumptions = dict(estimators), []
    for name, settings in estimators.items():
        waits, start, first = starts.get(type(settings), ((), "", ""))
        if waits and settings.start in waits:
            changed[name] = replace(settings, start=start)
            assumptions.append(f"Learners do not show the Y pose: {name} starts from the {first} (start={start}).")
    return changed, assumptions
