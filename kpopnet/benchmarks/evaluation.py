"""One evaluation: a benchmark's sequences through one or more estimators."""

import sys
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from tqdm import tqdm

from kpopnet.benchmarks.estimating import EstimatedSequence, FailedSequence, SequenceEstimation
from kpopnet.benchmarks.metrics import Scored, evaluate
from kpopnet.benchmarks.sequences import Benchmark, evenly_spaced
from kpopnet.benchmarks.spread import spread
from kpopnet.benchmarks.sweep import SweepConfig
from kpopnet.benchmarks.synthetic import SyntheticBenchmark
from kpopnet.errors import InputError
from kpopnet.estimators import Estimator, starts_from_label, who_looks
from kpopnet.extraction import HumanExtractionConfig
from kpopnet.machine import cores_at_hand
from kpopnet.networks.estimator import NetworkEstimator


@dataclass
class EvaluateConfig:
    """What `evaluate.py` does.

    Attributes:
        benchmark: a data set's own settings, with its name.
        estimator: settings by the estimator's name, in the order of the report; the first one's figures head it.
        checkpoint: folder of the trained network, for the estimators that need one.
        sequences: only so many sequences, evenly spaced over the set, for a quick look; the report says so.
        seed: of the bootstrap and of the random example frames.
        processes: how many sequences are worked on at once; 0 takes all cores, or one where an estimator has a GPU.
        extraction: how the person is found in depth that shows a whole scene.
        sweep: the first estimator once more at every combination of two of its settings (`kpopnet.benchmarks.sweep`).
        scorer: settings of the dance scores by their name, for the benchmarks that judge dances.
    """

    benchmark: Any
    estimator: dict[str, Any] = field(default_factory=dict)
    checkpoint: str | None = None
    sequences: int | None = None
    seed: int = 0
    processes: int = 0
    extraction: HumanExtractionConfig = field(default_factory=HumanExtractionConfig)
    sweep: SweepConfig | None = None
    scorer: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.processes < 0:
            raise InputError(f"processes={self.processes}: expected 1 or more, or 0 for all cores")
        if self.seed < 0:
            raise InputError(f"seed={self.seed} must be 0 or more")

    def processes_at_work(self) -> int:
        """The number itself, or what 0 stands for."""
        on_gpu = any(getattr(settings, "device", "cpu") != "cpu" for settings in self.estimator.values())
        return self.processes or (1 if on_gpu else cores_at_hand())

    def files(self) -> dict[str, dict[str, str]]:
        """By each estimator's name the files and folders it reads, by the settings that name them."""
        naming = ("checkpoint", "network", "path", "model")
        return {
            name: {setting: file for setting in naming if (file := getattr(settings, setting, None)) is not None}
            for name, settings in self.estimator.items()
        }


@dataclass(frozen=True)
class Run:
    """What came out of one evaluation.

    Attributes:
        benchmark: what it was judged on.
        scored: per estimator, in order: the joints of all frames.
        metrics: per estimator: `metrics.evaluate`, and fps, frames per second of estimation alone.
        frame: (N,) the number of each frame within its sequence.
        failed: what was wrong with each sequence that gave no figures, by its name.
        sequences_in_set: how many sequences the benchmark holds, evaluated or not.
        images_without_person: frames in which nothing was measured, or nobody was found.
        unlike_training: per estimator, where there are any: `unlike_training`.
        started_from_label: the estimators that were told the first true pose of each sequence.
        extraction_fps: frames per second of finding the person in whole scenes, once for all estimators; None where the
            set's depth shows people alone.
    """

    benchmark: Benchmark
    scored: dict[str, Scored]
    metrics: dict[str, dict]
    frame: np.ndarray
    failed: dict[str, str]
    sequences_in_set: int
    images_without_person: int
    unlike_training: dict[str, list[str]]
    started_from_label: list[str]
    extraction_fps: float | None = None

    def only(self, names: list[str]) -> "Run":
        """The same with some of its estimators."""
        parts = ("scored", "metrics", "unlike_training")
        kept = {part: {name: value for name, value in getattr(self, part).items() if name in names} for part in parts}
        return replace(self, started_from_label=[name for name in self.started_from_label if name in names], **kept)


def unlike_training(benchmark: Benchmark, estimator: Estimator) -> list[str]:
    """The settings by which a simulated set was measured and cut out otherwise than what a network was trained on.

    A ridge image is not among them: a network makes its own of the depth, as in its training.
    """
    estimator = who_looks(estimator)
    if not (isinstance(benchmark, SyntheticBenchmark) and isinstance(estimator, NetworkEstimator)):
        return []
    return [
        f"{part}.{name}={value} ({trained[name]} in training)"
        for part in ("sensor", "extraction")
        if (trained := estimator.meta["config"].get(part))
        for name, value in benchmark.measured_with.get(part, {}).items()
        if name in trained and trained[name] != value
    ]


def run_benchmark(
    benchmark: Benchmark,
    estimators: dict[str, Estimator],
    sequences: int | None = None,
    seed: int = 0,
    processes: int = 1,
    extraction: HumanExtractionConfig | None = None,
) -> Run:
    """Has every estimator estimate every sequence, as `SequenceEstimation` says, and judges what comes out.

    A sequence that cannot be read, or at which an estimator fails, is named in the result and left out, for all
    estimators; the others go on. Estimates do not depend on the number of processes. Each process has one thread: an
    estimator's frames per second, all frames over all its seconds, are those of one core.

    Args:
        benchmark: the data set.
        estimators: by name, the main one first.
        sequences: only so many, evenly spaced.
        seed: of the bootstrap.
        processes: how many work at once; with several, benchmark and estimators are pickled.
        extraction: how the person is found where the depth shows a whole scene, None for the defaults.

    Raises:
        InputError: no sequence gave figures, no joint of them has a label, or a process died.
    """
    names = benchmark.sequence_names()
    estimation = SequenceEstimation(benchmark, estimators, extraction or HumanExtractionConfig())
    outcomes, failed = _estimated(estimation, evenly_spaced(names, sequences), processes)
    parts = outcomes.values()
    if not any(np.isfinite(part.truth_m).all(axis=-1).any() for part in parts):
        raise InputError(f"{benchmark.name}: no joint in any frame of {', '.join(outcomes)} has a label to be judged by")
    in_scenes = [part for part in parts if part.extraction_seconds is not None]
    scored = {label: _scored(outcomes, label) for label in estimators}
    return Run(
        benchmark=benchmark,
        scored=scored,
        metrics={
            label: evaluate(one, seed) | {"fps": _per_second(parts, [part.seconds[label] for part in parts])}
            for label, one in scored.items()
        },
        frame=np.concatenate([np.arange(len(part.truth_m)) for part in parts]),
        failed=failed,
        sequences_in_set=len(names),
        images_without_person=sum(part.images_without_person for part in parts),
        unlike_training={
            label: settings for label, one in estimators.items() if (settings := unlike_training(benchmark, one))
        },
        started_from_label=[label for label, one in estimators.items() if starts_from_label(one)],
        extraction_fps=_per_second(in_scenes, [part.extraction_seconds for part in in_scenes]) if in_scenes else None,
    )


def _estimated(
    estimation: SequenceEstimation, chosen: list[str], processes: int
) -> tuple[dict[str, EstimatedSequence], dict[str, str]]:
    """What came out of each chosen sequence, and why nothing came out of the others, by name and in order."""
    outcomes: dict[int, EstimatedSequence | FailedSequence] = {}
    with tqdm(total=len(chosen), desc=estimation.benchmark.name, unit="sequence") as bar:
        for index, outcome in spread(estimation, chosen, processes):
            outcomes[index] = outcome
            if isinstance(outcome, FailedSequence):
                bar.write(f"left out {chosen[index]}: {outcome.reason}", file=sys.stderr)
            bar.update()
    ordered = {name: outcomes[index] for index, name in enumerate(chosen)}
    failed = {name: outcome.reason for name, outcome in ordered.items() if isinstance(outcome, FailedSequence)}
    if len(failed) == len(chosen):
        first, reason = next(iter(failed.items()))
        raise InputError(f"{estimation.benchmark.name}: none of its {len(chosen)} sequences gave figures; {first}: {reason}")
    return {name: outcome for name, outcome in ordered.items() if name not in failed}, failed


def _scored(outcomes: dict[str, EstimatedSequence], label: str) -> Scored:
    """One estimator's joints in all frames of all sequences."""
    parts = outcomes.values()
    return Scored(
        truth_m=np.concatenate([part.truth_m for part in parts]),
        estimate_m=np.concatenate([part.estimate_m[label] for part in parts]),
        visible=np.concatenate([part.visible for part in parts]),
        sequence=np.repeat(np.arange(len(parts)), [len(part.truth_m) for part in parts]),
        sequence_names=tuple(outcomes),
        yaw_rad=np.concatenate([part.yaw_rad for part in parts]),
    )


def _per_second(parts: Collection[EstimatedSequence], seconds: list[float]) -> float:
    return sum(len(part.truth_m) for part in parts) / max(sum(seconds), 1e-9)
