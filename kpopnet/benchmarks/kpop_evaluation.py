"""The evaluation of dance scores: learners' joints by every estimator, their scores by every scorer, the experts' order.

    python evaluate.py benchmark=kpop_sim 'estimator=[tracker,network]' 'scorer=[dance22,raptis]' checkpoint=...

True joints, where a set has them, are always scored beside the estimated ones: what is confused there no pose estimator
can mend.
"""

import logging
from dataclasses import asdict, dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from kpopnet.benchmarks.kpop import Dance, KpopSet
from kpopnet.benchmarks.kpop_poses import PoseCache
from kpopnet.benchmarks.kpop_scores import TRUTH, Agreement, LearnerScore, agreement, similarities
from kpopnet.benchmarks.metrics import joint_errors_m
from kpopnet.benchmarks.spread import spread
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, ScorerConfig, score_dance
from kpopnet.errors import InputError

log = logging.getLogger(__name__)

Scores = dict[str, dict[str, dict[str, list[LearnerScore]]]]
"""Source of joints, scorer and dance to the learners, the experts' best first."""


@dataclass(frozen=True)
class DanceRun:
    """What came out of one evaluation.

    Attributes:
        dances: the set.
        scores: `truth`, where it is known, and every estimator, in the order of the report.
        agreements: of each source and scorer.
        fps: of every estimator, frames a second of estimation alone.
        failed: what was wrong with each dance that was left out, by its name.
        assumed: what a reader must know of the settings, and of true joints that are not there.
        evaluated: names of the dances that were asked for.
    """

    dances: KpopSet
    scores: Scores
    agreements: dict[str, dict[str, Agreement]]
    fps: dict[str, float]
    failed: dict[str, str]
    assumed: list[str]
    evaluated: list[str]


def run_dances(
    dances: KpopSet,
    estimators: dict[str, Any],
    scorers: dict[str, ScorerConfig],
    poses: Path,
    count: int | None,
    seed: int,
    processes: int,
) -> DanceRun:
    """Estimates what is not in `poses` yet, and scores every learner of the first `count` dances.

    A dance that cannot be read, estimated or scored is named in the result and left out, with all of its learners. True joints
    are scored where every learner of the others has them.

    Args:
        dances: the set.
        estimators: settings by name, the main one first.
        scorers: settings by name; all of SCORERS if there are none.
        poses: folder of the estimators' poses.
        count: of dances, None for all.
        seed: of the bootstrap.
        processes: how many work at once.

    Raises:
        InputError: no dance could be scored.
    """
    estimators, assumed = _from_standing(estimators)
    caches = {name: PoseCache(poses, name, settings) for name, settings in estimators.items()}
    names, failed = dances.names[:count], {}
    _estimate(dances, names, caches, failed, processes)
    work = ScoringOfDance(dances, caches, scorers or SCORERS)
    chosen = [name for name in names if name not in failed]
    found: dict[str, ScoredDance] = {}
    for index, scored in tqdm(spread(work, chosen, processes), "scores", len(chosen), unit="dance"):
        if isinstance(scored, str):
            failed[chosen[index]] = scored
        else:
            found[chosen[index]] = scored
    if not found:
        first, reason = next(iter(failed.items()))
        raise InputError(f"{dances.folder}: none of {len(names)} dances can be scored; {first}: {reason}")
    known = [name for name in names if name in found]
    sources = [source for source in (TRUTH, *caches) if all(source in found[name].scores for name in known)]
    without = [name for name in known if TRUTH not in found[name].scores]
    if without:
        lacking = f"a learner of {without[0]} has no true joints ({len(without)} of {len(known)} dances are without)"
        if not sources:
            raise InputError(f"{dances.folder}: {lacking}; give an estimator")
        assumed.append(f"Scores on true joints are left out: {lacking}.")
    scores = {
        source: {scorer: {name: found[name].scores[source][scorer] for name in known} for scorer in work.scorers}
        for source in sources
    }
    agreements = {
        source: {
            scorer: agreement({name: similarities(learners) for name, learners in by_dance.items()}, seed)
            for scorer, by_dance in by_scorer.items()
        }
        for source, by_scorer in scores.items()
    }
    fps = {name: sum(found[d].frames for d in known) / max(sum(found[d].seconds[name] for d in known), 1e-9) for name in caches}
    return DanceRun(dances, scores, agreements, fps, failed, assumed, names)


def _from_standing(estimators: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Trackers that would wait for the Y pose begin with whoever stands there: learners show no Y pose."""
    changed, assumed = {}, []
    for name, settings in estimators.items():
        if is_dataclass(settings) and "start" in asdict(settings) and settings.start != "standing":
            settings = replace(settings, start="standing")
            assumed.append(f"Learners show no start pose: {name} begins with whoever stands there (start=standing).")
        changed[name] = settings
    return changed, assumed


def _estimate(dances: KpopSet, names: list[str], caches: dict[str, PoseCache], failed: dict[str, str], processes: int) -> None:
    work = EstimationOfLearner(dances, caches)
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
            failed[name] = _reason(error, name)
    for index, reason in tqdm(spread(work, jobs, processes), "poses", len(jobs), unit="learner", disable=not jobs):
        if reason is not None:
            failed[jobs[index][1]] = reason


def _reason(error: Exception, dance: str) -> str:
    """What to say of an error that takes one dance; what is no user's mistake is logged with its traceback."""
    if isinstance(error, InputError):
        return str(error)
    log.error("%s failed", dance, exc_info=error)
    return f"{type(error).__name__}: {error}"


@dataclass(frozen=True)
class EstimationOfLearner:
    """Called with an estimator, a dance and a learner's rank: makes the poses; returns what was wrong, or None."""

    dances: KpopSet
    caches: dict[str, PoseCache]

    def __call__(self, job: tuple[str, str, int]) -> str | None:
        estimator, name, rank = job
        try:
            dance = self.dances.dance(name)
            self.caches[estimator].make(dance, dance.learners[rank])
        except Exception as error:
            return f"{estimator}: {_reason(error, name)}"
        return None


@dataclass(frozen=True)
class ScoredDance:
    """Scores by source and scorer; frames of all learners, and what each estimator took for them."""

    scores: dict[str, dict[str, list[LearnerScore]]]
    frames: int
    seconds: dict[str, float]


@dataclass(frozen=True)
class ScoringOfDance:
    """Called with a dance's name: scores its learners by every scorer on every source of joints; or says what is wrong."""

    dances: KpopSet
    caches: dict[str, PoseCache]
    scorers: dict[str, ScorerConfig]

    def __call__(self, name: str) -> ScoredDance | str:
        try:
            return self._scored(self.dances.dance(name))
        except Exception as error:
            return _reason(error, name)

    def _scored(self, dance: Dance) -> ScoredDance:
        teacher = dance.teacher()
        sources: dict[str, dict[str, list[LearnerScore]]] = {}
        seconds, frames = dict.fromkeys(self.caches, 0.0), 0
        for learner in dance.learners:
            truth = learner.joints()
            danced: dict[str, tuple[Performance, float | None]] = {}
            if truth is not None:
                danced[TRUTH] = truth, None
            for name, cache in self.caches.items():
                poses = cache.read(dance, learner)
                danced[name] = poses.performance(), _mean_error_m(poses.joints_m, truth)
                seconds[name] += poses.seconds
            frames += len(next(iter(danced.values()))[0].times_s) if danced else 0
            for source, (performance, error_m) in danced.items():
                for scorer, config in self.scorers.items():
                    score = score_dance(teacher, performance, config)
                    by_scorer = sources.setdefault(source, {name: [] for name in self.scorers})
                    by_scorer[scorer].append(LearnerScore(learner.name, score, error_m))
        whole = {s: by for s, by in sources.items() if all(len(one) == len(dance.learners) for one in by.values())}
        return ScoredDance(whole, frames, seconds)


def _mean_error_m(joints_m: np.ndarray, truth: Performance | None) -> float | None:
    """Over the joints that were found."""
    if truth is None or len(truth.joints_m) != len(joints_m):
        return None
    errors_m = joint_errors_m(truth.joints_m, joints_m)
    found = np.isfinite(errors_m)
    return float(errors_m[found].mean()) if found.any() else None
