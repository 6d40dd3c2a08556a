"""Evaluation of people found and followed in films of several: joints and identities, sequence by sequence.

People are found in the raw scene; no estimator is given their number.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import evenly_spaced
from kpopnet.datasets.simulated import PeopleSet
from kpopnet.errors import InputError
from kpopnet.evaluation import engine
from kpopnet.evaluation.engine import Rows, Timed, stage
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.people.matching import NOBODY, MatchedSequence, match
from kpopnet.evaluation.registry import BestConfig, RealtimeConfig
from kpopnet.pose.estimator import MAX_PEOPLE, PersonPose, PoseEstimator
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.estimator import TrackerEstimatorConfig

ALL = "all"
"""The row of all kinds of scenes."""

WITHIN_M = 0.10

Follow = Callable[[np.ndarray, Camera, float], list[PersonPose]]
"""(T, H, W) depth of a whole scene, its camera and the frames per second to all people found."""


def follower(label: str, settings: Any) -> Follow:
    """What finds and follows people with the settings of an estimator.

    Raises:
        InputError: these settings are of an estimator of one person, or cannot be used for several.
    """
    if isinstance(settings, TrackerEstimatorConfig):
        if settings != TrackerEstimatorConfig():
            raise InputError(f"estimator {label}: start, model and network are for one person; leave them out")
        return PoseEstimator(None, "tracker", MAX_PEOPLE).estimate
    if isinstance(settings, RealtimeConfig | BestConfig):
        mode = "realtime" if isinstance(settings, RealtimeConfig) else "best"
        return PoseEstimator.load(settings.checkpoint, mode, MAX_PEOPLE, settings.device).estimate
    raise InputError(f"estimator {label}: estimates one person; for several take 'estimator=[tracker]', realtime or best")


@dataclass
class PeopleEstimation:
    """Reads a sequence by its name and matches all people that each estimator finds in it; `settings` by estimator."""

    benchmark: PeopleSet
    settings: dict[str, Any]
    _followers: dict[str, Timed] = field(default_factory=dict)

    def __call__(self, name: str) -> dict[str, MatchedSequence]:
        sequence, matched = self.benchmark.read(name), {}
        for label, settings in self.settings.items():
            with stage(label):
                if label not in self._followers:
                    self._followers[label] = Timed(follower(label, settings))
                people, seconds = self._followers[label](sequence.depth, sequence.camera, fps=sequence.fps)
                joints_m = [one.joints_camera_m for one in people]
                estimates_m = np.array(joints_m).reshape(len(people), len(sequence.depth), NUM_JOINTS, 3)
                matched[label] = match(sequence, estimates_m, np.array([one.identity for one in people], int), seconds)
        return matched


def run_people(
    benchmark: PeopleSet, settings: dict[str, Any], sequences: int | None, processes: int
) -> Rows[dict[str, MatchedSequence]]:
    """Runs every estimator, by its name, on `sequences` sequences, evenly spaced, or all.

    Raises:
        InputError: no estimator, one that finds one person only, or no sequence gave figures.
    """
    if not settings:
        raise InputError("estimator: expected at least one, for instance 'estimator=[tracker]'")
    for label, one in settings.items():
        follower(label, one)
    names = evenly_spaced(benchmark.names, sequences)
    return engine.run(PeopleEstimation(benchmark, settings), names, processes, "two_people")


def by_kind(parts: list[MatchedSequence], seed: int) -> dict[str, dict]:
    """`figures` of each kind of scene, and of ALL."""
    kinds = dict.fromkeys(part.kind for part in parts)
    groups = {kind: [part for part in parts if part.kind == kind] for kind in kinds} | {ALL: parts}
    return {kind: figures(group, seed) for kind, group in groups.items()}


def figures(parts: list[MatchedSequence], seed: int) -> dict:
    """The figures of some sequences, pooled over frames and people; None where undefined. `seed` is the bootstrap's.

    Returns:
        `seen`, `hidden`: people in frames that are judged, and that others hide; `within_10cm`, `mean_error_cm`: of the seen,
        where a missed person counts as fifteen joints beyond 10 cm and is left out of the mean; the same with `hidden_`;
        `missed`: share of the seen who were not found; `false`: estimates of no person; `switches`: of identities; `mota`:
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
    found_hidden = of_hidden[np.isfinite(of_hidden)]
    false = sum(int(part.false.sum()) for part in parts)
    switches = sum(int(part.switches().sum()) for part in parts)
    identified, estimates = sum(part.identified() for part in parts), int((seen & ~lost).sum()) + false
    return {
        "sequences": len(parts),
        "seen": int(seen.sum()),
        "hidden": int(hidden.sum()),
        **{name: _ratio(above.sum(), below.sum()) for name, (above, below) in sums.items()},
        "hidden_within_10cm": _ratio((of_hidden < WITHIN_M).sum(), of_hidden.size),
        "hidden_mean_error_cm": _ratio(100 * found_hidden.sum(), found_hidden.size),
        "false": false,
        "switches": switches,
        "mota": _ratio(seen.sum() - lost.sum() - false - switches, seen.sum()),
        "idf1": _ratio(2 * identified, int(seen.sum()) + estimates),
        "interval": {name: bootstrap.interval(bootstrap.ratios(*pair)) for name, pair in sums.items()},
        "fps": _ratio(sum(len(part.seen) for part in parts), max(sum(part.seconds for part in parts), 1e-9)),
    }


def _ratio(above: float, below: float) -> float | None:
    return float(above / below) if below else None
