"""Evaluation of one or more pose estimators on the sequences of a benchmark."""

import sys
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.datasets.protocol import Benchmark, evenly_spaced
from kpopnet.datasets.synthetic import SyntheticBenchmark
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator, base_estimator, starts_from_label
from kpopnet.evaluation.poses.causes import missed_by_cause
from kpopnet.evaluation.poses.confidence import evaluate_confidence
from kpopnet.evaluation.poses.definition import in_label_definition
from kpopnet.evaluation.poses.metrics import PoseResults, difference, evaluate
from kpopnet.evaluation.poses.sequence import EstimatedSequence, FailedSequence, SequenceEstimation
from kpopnet.extraction import HumanExtractionConfig
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.runtime.parallel import in_processes


class Resampled(NamedTuple):
    """What the bootstrap intervals of a run resample.

    Attributes:
        units: "rooms" where sequences share rooms and cameras, else "sequences".
        count: number of units.
        people: number of different people; None where some are unknown.
    """

    units: str
    count: int
    people: int | None


@dataclass(frozen=True)
class Run:
    """The results of one evaluation.

    Attributes:
        benchmark: the data set.
        results: joints of all N frames by the estimator's name, in the order of the report.
        metrics: by the estimator's name: the figures of `metrics.evaluate` and `evaluate_confidence`, `missed_by_cause`, and
            `fps`, frames per second of the estimation without the extraction.
        differences: `metrics.difference` of every estimator but the first from the first one, by the estimator's name.
        resampled: what the intervals resample.
        frame: (N,) index of each frame within its sequence.
        failed: the error message of each sequence without results, by the sequence's name.
        sequences_in_set: number of sequences of the benchmark, evaluated or not.
        images_without_person: number of frames without any depth, or in which no person was detected.
        unlike_training: result of `unlike_training` by the estimator's name, where it is not empty.
        started_from_label: names of the estimators that were given the first true pose of each sequence.
        extraction_fps: frames per second of segmenting the person in whole scenes, done once for all estimators; None where
            the depth of the set is segmented.
    """

    benchmark: Benchmark
    results: dict[str, PoseResults]
    metrics: dict[str, dict]
    differences: dict[str, dict]
    resampled: Resampled
    frame: np.ndarray
    failed: dict[str, str]
    sequences_in_set: int
    images_without_person: int
    unlike_training: dict[str, list[str]]
    started_from_label: list[str]
    extraction_fps: float | None = None

    def select(self, names: list[str]) -> "Run":
        """A copy with only the named estimators; without differences if the first estimator is not among them."""
        parts = ("results", "metrics", "differences", "unlike_training")
        kept = {part: {name: value for name, value in getattr(self, part).items() if name in names} for part in parts}
        if next(iter(self.metrics)) not in names:
            kept["differences"] = {}
        return replace(self, started_from_label=[name for name in self.started_from_label if name in names], **kept)


def unlike_training(benchmark: Benchmark, estimator: Estimator) -> list[str]:
    """Settings of sensor and extraction in which a simulated set differs from the training set of a network.

    The ridge image is not compared: a network computes its own from the depth, as in its training.

    Returns:
        One text per setting: "PART.NAME=VALUE (VALUE in training)".
    """
    estimator = base_estimator(estimator)
    if not (isinstance(benchmark, SyntheticBenchmark) and isinstance(estimator, NetworkEstimator)):
        return []
    return [
        f"{part}.{name}={value} ({trained[name]} in training)"
        for part in ("sensor", "extraction")
        if (trained := estimator.meta["config"].get(part))
        for name, value in benchmark.simulation_settings.get(part, {}).items()
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
    """Runs every estimator on every sequence (`SequenceEstimation`) and computes the metrics.

    A sequence that cannot be read, or on which an estimator fails, is reported in `Run.failed` and left out for all
    estimators; the evaluation continues with the others. The estimates do not depend on the number of processes. Each
    process has one thread, so the frames per second of an estimator (all frames divided by its total time) are those of one
    core.

    Intervals resample sequences, or the rooms that sequences share. One person may dance several sequences: these are resampled
    as if they were independent, so the intervals hold for other sequences of the same people. Resampling people would be the
    way to cover others, but most sets show too few for an interval to mean anything; reports state their number.

    Args:
        benchmark: the data set.
        estimators: by name, the main estimator first.
        sequences: number of sequences to evaluate, evenly spaced over the set; None for all.
        seed: of the bootstrap.
        processes: number of processes; with more than one, benchmark and estimators are pickled.
        extraction: settings that segment the person where the depth shows a whole scene; None for the defaults.

    Raises:
        InputError: every sequence failed, no joint has a label, an estimator was given every label, or a process died.
    """
    names = benchmark.sequence_names()
    estimation = SequenceEstimation(benchmark, estimators, extraction or HumanExtractionConfig())
    outcomes, failed = _estimate_sequences(estimation, evenly_spaced(names, sequences), processes)
    parts = outcomes.values()
    extracted = [part for part in parts if part.extraction_seconds is not None]
    units, unit = _units(parts)
    results = {label: _concatenate(outcomes, label, unit) for label in estimators}
    _check_scored(benchmark, results)
    return Run(
        benchmark=benchmark,
        results=results,
        metrics={
            label: evaluate(one, seed)
            | evaluate_confidence(one)
            | _in_label_definition(benchmark, one, parts, seed)
            | {"missed_by_cause": missed_by_cause(one)}
            | {"fps": _frames_per_second(parts, [part.seconds[label] for part in parts])}
            for label, one in results.items()
        },
        differences=_differences(results, seed),
        resampled=units,
        frame=np.concatenate([np.arange(len(part.truth_m)) for part in parts]),
        failed=failed,
        sequences_in_set=len(names),
        images_without_person=sum(part.images_without_person for part in parts),
        unlike_training={label: settings for label, one in estimators.items() if (settings := unlike_training(benchmark, one))},
        started_from_label=[label for label, one in estimators.items() if starts_from_label(one)],
        extraction_fps=_frames_per_second(extracted, [part.extraction_seconds for part in extracted]) if extracted else None,
    )


def _estimate_sequences(
    estimation: SequenceEstimation, chosen: list[str], processes: int
) -> tuple[dict[str, EstimatedSequence], dict[str, str]]:
    """Runs the chosen sequences in parallel.

    Returns:
        The results, and the error messages of the failed sequences, both by name in the order of `chosen`.
    """
    outcomes: dict[int, EstimatedSequence | FailedSequence] = {}
    with tqdm(total=len(chosen), desc=estimation.benchmark.name, unit="sequence") as bar:
        for index, outcome in in_processes(estimation, chosen, processes):
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


def _units(parts: Collection[EstimatedSequence]) -> tuple[Resampled, np.ndarray]:
    """What the bootstrap resamples, and the (N,) number of the unit of each frame. A frame without a label is in no figure."""
    shared = any(part.room for part in parts)
    names = [part.room if part.room else f"sequence {number}" for number, part in enumerate(parts)]
    _, numbers = np.unique(names, return_inverse=True)
    unit = np.repeat(numbers, [len(part.truth_m) for part in parts])
    people = {part.identity for part in parts}
    labelled = np.concatenate([np.isfinite(part.truth_m).all(axis=-1).any(axis=1) for part in parts])
    count = len(np.unique(unit[labelled]))
    return Resampled("rooms" if shared else "sequences", count, None if "" in people else len(people)), unit


def _concatenate(outcomes: dict[str, EstimatedSequence], label: str, unit: np.ndarray) -> PoseResults:
    """The joints of one estimator in all frames of all sequences. `unit` is that of `_units`."""
    parts = outcomes.values()
    return PoseResults(
        truth_m=np.concatenate([part.truth_m for part in parts]),
        estimate_m=np.concatenate([part.estimate_m[label] for part in parts]),
        confidence=np.concatenate([part.confidence[label] for part in parts]),
        visible=np.concatenate([part.visible for part in parts]),
        sequence=np.repeat(np.arange(len(parts)), [len(part.truth_m) for part in parts]),
        sequence_names=tuple(outcomes),
        yaw_rad=np.concatenate([part.yaw_rad for part in parts]),
        unit=unit,
        given=np.concatenate([part.given[label] for part in parts]),
    )


def _check_scored(benchmark: Benchmark, results: dict[str, PoseResults]) -> None:
    """Raises an InputError where there is nothing to score."""
    for label, one in results.items():
        if not np.isfinite(one.truth_m).all(axis=-1).any():
            names = ", ".join(one.sequence_names)
            raise InputError(f"{benchmark.name}: no joint in any frame of {names} has a label to compare with")
        if np.isnan(one.errors_m()).all():
            raise InputError(f"{benchmark.name}: {label} was given every true pose (start=label); no frame is left to score")


def _differences(results: dict[str, PoseResults], seed: int) -> dict[str, dict]:
    """`metrics.difference` of every estimator from the first, by name."""
    first, *others = results
    return {label: difference(results[label], results[first], seed) for label in others}


def _in_label_definition(benchmark: Benchmark, results: PoseResults, parts: Collection[EstimatedSequence], seed: int) -> dict:
    """The figures of an estimator in the definition of the labels, fitted on the other people, as `in_label_definition`.

    Empty where the labels have no definition of their own, somebody's identity is unknown, or only one person is seen.
    """
    definition = getattr(benchmark, "label_definition", None)
    people = {part.identity for part in parts}
    if definition is None or "" in people or len(people) < 2:
        return {}
    person = np.repeat([part.identity for part in parts], [len(part.truth_m) for part in parts])
    labels_m = np.where(results.given[:, None, None], np.nan, results.truth_m)
    defined = replace(results, estimate_m=in_label_definition(labels_m, results.estimate_m, person))
    return {"in_label_definition": {"definition": definition} | evaluate(defined, seed) | evaluate_confidence(defined)}


def _frames_per_second(parts: Collection[EstimatedSequence], seconds: list[float]) -> float:
    return sum(len(part.truth_m) for part in parts) / max(sum(seconds), 1e-9)
