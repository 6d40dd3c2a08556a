"""Finds and follows everybody in films of several people, and judges joints and identities.

    python evaluate.py benchmark=two_people 'estimator=[people_tracker,realtime]'

Everybody is found in the raw scene; no estimator is told how many there are.
"""

import logging
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from tqdm import tqdm

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import evenly_spaced
from kpopnet.datasets.simulated import PeopleSet
from kpopnet.errors import InputError
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.people.matching import NOBODY, MatchedSequence, match
from kpopnet.evaluation.registry import BestConfig, RealtimeConfig
from kpopnet.pose.estimator import MAX_PEOPLE, PersonPoses, PoseEstimator
from kpopnet.runtime.parallel import in_processes
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.estimator import TrackerEstimatorConfig
from kpopnet.tracker.people import TrackedPerson, track_people

log = logging.getLogger(__name__)

ALL = "all"
"""The row of all kinds of scenes."""

WITHIN_M = 0.10

Follow = Callable[[np.ndarray, Camera, float], list[TrackedPerson] | list[PersonPoses]]
"""(T, H, W) depth of a whole scene, its camera and the frames per second to everybody found."""


def follower(label: str, settings: Any) -> Follow:
    """What finds and follows people with the settings of an estimator.

    Raises:
        InputError: these settings are of an estimator of one person, or cannot be used for several.
    """
    if isinstance(settings, TrackerEstimatorConfig):
        if settings.start == "label" or settings.model is not None or settings.network is not None:
            raise InputError(f"estimator {label}: start=label, model and network are for one person; leave them out")
        return lambda depth, camera, _: track_people(depth, camera, settings)
    if isinstance(settings, RealtimeConfig | BestConfig):
        mode = "realtime" if isinstance(settings, RealtimeConfig) else "best"
        estimator = PoseEstimator.load(settings.checkpoint, mode, MAX_PEOPLE, settings.device)
        return estimator.estimate
    raise InputError(
        f"estimator {label}: estimates one person; for several take 'estimator=[people_tracker]', realtime or best"
    )


@dataclass
class PeopleEstimation:
    """A callable that reads a sequence by its name and matches everybody that each estimator finds in it.

    Attributes:
        benchmark: the set.
        settings: of each estimator, by its name.
    """

    benchmark: PeopleSet
    settings: dict[str, Any]
    _followers: dict[str, Follow] = field(default_factory=dict)

    def __call__(self, name: str) -> dict[str, MatchedSequence] | str:
        """The matched sequence of each estimator, or the error in one line."""
        stage = ""
        try:
            sequence, matched = self.benchmark.read(name), {}
            for label, settings in self.settings.items():
                stage = f"{label}: "
                if label not in self._followers:
                    self._followers[label] = follower(label, settings)
                start = time.process_time()
                people = self._followers[label](sequence.depth_mm, sequence.camera, sequence.fps)
                seconds = time.process_time() - start
                joints_m = [one.joints_camera_m for one in people]
                estimates_m = np.array(joints_m).reshape(len(people), len(sequence.depth_mm), NUM_JOINTS, 3)
                matched[label] = match(sequence, estimates_m, np.array([one.identity for one in people], int), seconds)
        except InputError as error:
            return f"{stage}{error}"
        except Exception as error:
            log.exception("%s: %sfailed", name, stage)
            return f"{stage}{type(error).__name__}: {error}"
        return matched


@dataclass(frozen=True)
class PeopleRun:
    """The results of one evaluation.

    Attributes:
        benchmark: the set.
        matched: by the estimator's name, all sequences.
        figures: by the estimator's name and kind of scene, ALL last: see `figures`.
        failed: the error message of each sequence that was left out, by its name.
    """

    benchmark: PeopleSet
    matched: dict[str, list[MatchedSequence]]
    figures: dict[str, dict[str, dict]]
    failed: dict[str, str]


def run_people(benchmark: PeopleSet, settings: dict[str, Any], sequences: int | None, seed: int, processes: int) -> PeopleRun:
    """Evaluates every estimator on every sequence.

    Args:
        benchmark: the set.
        settings: of each estimator, by its name.
        sequences: number of sequences, evenly spaced; None for all.
        seed: of the bootstrap.
        processes: number of sequences at a time.

    Raises:
        InputError: no estimator, one that finds one person only, or no sequence gave figures.
    """
    if not settings:
        raise InputError("estimator: expected at least one, for instance 'estimator=[people_tracker]'")
    for label, one in settings.items():
        follower(label, one)
    chosen = evenly_spaced(benchmark.names, sequences)
    outcomes: dict[str, dict[str, MatchedSequence] | str] = {}
    with tqdm(total=len(chosen), desc="two_people", unit="sequence") as bar:
        for index, outcome in in_processes(PeopleEstimation(benchmark, settings), chosen, processes):
            outcomes[chosen[index]] = outcome
            if isinstance(outcome, str):
                bar.write(f"left out {chosen[index]}: {outcome}", file=sys.stderr)
            bar.update()
    failed = {name: outcome for name in chosen if isinstance(outcome := outcomes[name], str)}
    good = [outcome for name in chosen if isinstance(outcome := outcomes[name], dict)]
    if not good:
        raise InputError(f"{benchmark.folder}: none of {len(chosen)} sequences gave figures; {failed[chosen[0]]}")
    matched = {label: [outcome[label] for outcome in good] for label in settings}
    return PeopleRun(benchmark, matched, {label: by_kind(parts, seed) for label, parts in matched.items()}, failed)


def by_kind(parts: list[MatchedSequence], seed: int) -> dict[str, dict]:
    """`figures` of each kind of scene, and of ALL."""
    kinds = dict.fromkeys(part.kind for part in parts)
    groups = {kind: [part for part in parts if part.kind == kind] for kind in kinds} | {ALL: parts}
    return {kind: figures(group, seed) for kind, group in groups.items()}


def figures(parts: list[MatchedSequence], seed: int) -> dict:
    """The figures of some sequences, pooled over frames and people; None where undefined.

    Returns:
        `seen`, `hidden`: people in frames that are judged, and that others hide; `within_10cm`, `mean_error_cm`: of the seen,
        where a missed person counts as fifteen joints beyond 10 cm and is left out of the mean; the same with `hidden_`;
        `missed`: share of the seen who were not found; `false`: estimates of nobody; `switches`: of identities; `mota`:
        1 - (missed + false + switches) / seen (CLEAR MOT); `idf1` (Ristani et al. 2016, over the same
        matches); `interval`: 95 % intervals over sequences; `fps`: images a second of one core, all stages.
    """
    seen = np.concatenate([part.seen.ravel() for part in parts])
    hidden = np.concatenate([part.hidden.ravel() for part in parts])
    errors_m = np.concatenate([part.errors_m.reshape(-1, NUM_JOINTS) for part in parts])
    lost = seen & (np.concatenate([part.identity.ravel() for part in parts]) == NOBODY)
    bootstrap = Bootstrap(np.repeat(np.arange(len(parts)), [part.seen.size for part in parts]), seed)
    judged = np.tile(seen[:, None], NUM_JOINTS)
    found = judged & np.isfinite(errors_m)
    sums = {
        "within_10cm": (judged & (errors_m < WITHIN_M), judged),
        "mean_error_cm": (100 * np.where(found, errors_m, 0), found),
        "missed": (lost[:, None], seen[:, None]),
    }
    of_hidden = errors_m[hidden]
    false, switches = (sum(int(one.sum()) for one in ones) for ones in _counts(parts))
    identified, estimates = sum(part.identified() for part in parts), int((seen & ~lost).sum()) + false
    return {
        "sequences": len(parts),
        "seen": int(seen.sum()),
        "hidden": int(hidden.sum()),
        **{name: _ratio(above.sum(), below.sum()) for name, (above, below) in sums.items()},
        "hidden_within_10cm": _ratio((of_hidden < WITHIN_M).sum(), of_hidden.size),
        "hidden_mean_error_cm": _ratio(100 * of_hidden[np.isfinite(of_hidden)].sum(), np.isfinite(of_hidden).sum()),
        "false": false,
        "switches": switches,
        "mota": _ratio(seen.sum() - lost.sum() - false - switches, seen.sum()),
        "idf1": _ratio(2 * identified, int(seen.sum()) + estimates),
        "interval": {name: bootstrap.interval(bootstrap.ratios(*pair)) for name, pair in sums.items()},
        "fps": _ratio(sum(len(part.seen) for part in parts), max(sum(part.seconds for part in parts), 1e-9)),
    }


def _counts(parts: list[MatchedSequence]) -> tuple[Iterable[np.ndarray], Iterable[np.ndarray]]:
    return (part.false for part in parts), (part.switches() for part in parts)


def _ratio(above: float, below: float) -> float | None:
    return float(above / below) if below else None
