"""Evaluation of pose estimators on the sequences of a benchmark of one person each: from depth to metrics."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import Benchmark, evenly_spaced
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Estimator, Start, first_label, starts_from_label
from kpopnet.evaluation import engine
from kpopnet.evaluation.engine import Timed, device_of, stage
from kpopnet.evaluation.poses.causes import missed_by_cause
from kpopnet.evaluation.poses.confidence import evaluate_confidence
from kpopnet.evaluation.poses.definition import in_label_definition
from kpopnet.evaluation.poses.label_free import label_free, pooled
from kpopnet.evaluation.poses.metrics import PoseResults, concatenated, difference, evaluate
from kpopnet.evaluation.values import plain
from kpopnet.pose.extraction import DEFAULT_EXTRACTION, extract_person, extraction_name
from kpopnet.pose.person import PersonEstimator
from kpopnet.skeleton import NUM_JOINTS


class EstimatedSequence(NamedTuple):
    """What every estimator found in one sequence, by the estimator's name."""

    results: dict[str, PoseResults]  # whose `unit` is the room
    seconds: dict[str, float]  # of the estimation
    label_free: dict[str, np.ndarray]  # sums and counts, see there; empty for stills
    extraction_seconds: float | None  # of segmenting the person; None where the depth is segmented
    images_without_person: int  # without any depth, or in which no person was detected


@dataclass
class SequenceEstimation:
    """Reads a sequence by its name, segments the person in a whole scene once, and runs all estimators on the result."""

    benchmark: Benchmark
    estimators: dict[str, Estimator]
    extraction: Any = DEFAULT_EXTRACTION

    def __post_init__(self) -> None:
        self._timed = {label: Timed(partial(_estimated, one), device_of(one)) for label, one in self.estimators.items()}
        self._extract = Timed(extract_person)

    def __call__(self, name: str) -> EstimatedSequence:
        sequence, extraction_seconds = self.benchmark.read(name), None
        depth_m, camera, truth_m = sequence.depth_m, sequence.camera, sequence.joints_camera_m
        if not sequence.is_segmented:
            with stage("extraction"):
                how = {"settings": self.extraction, "fps": sequence.fps or 30.0}
                depth_m, extraction_seconds = self._extract(depth_m, camera, **how)
        elif self.extraction != DEFAULT_EXTRACTION:
            raise InputError(f"extraction={extraction_name(self.extraction)}: the depth is segmented; leave it out")
        frames = len(depth_m)
        yaw_rad = np.full(frames, np.nan, np.float32) if sequence.yaw_rad is None else sequence.yaw_rad
        names = [np.full(frames, one) for one in (name, sequence.identity, sequence.room)]
        results, seconds, without_labels = {}, {}, {}
        for label, estimator in self.estimators.items():
            with stage(label):
                if isinstance(estimator, PersonEstimator):
                    estimator.fps = sequence.fps or 30.0
                start = {"start": first_label(truth_m)} if starts_from_label(estimator) else {}
                stills = sequence.fps == 0
                (joints_m, confidence), seconds[label] = self._timed[label](depth_m, camera, stills=stills, **start)
                _check_estimate(joints_m, confidence, frames)
            given = np.arange(frames) == (start["start"].frame if start else -1)
            if sequence.fps:
                without_labels[label] = label_free(joints_m, depth_m, camera, sequence.fps)
            results[label] = PoseResults(truth_m, joints_m, confidence, sequence.visible, yaw_rad, given, *names)
        return EstimatedSequence(results, seconds, without_labels, extraction_seconds, int((~depth_m.any(axis=(1, 2))).sum()))


def _check_estimate(joints_m: np.ndarray, confidence: np.ndarray, frames: int) -> None:
    """Raises InputError unless an estimator answered as `Estimate` says."""
    for name, one, shape in (("joints", joints_m, (frames, NUM_JOINTS, 3)), ("confidence", confidence, (frames, NUM_JOINTS))):
        if one.shape != shape:
            raise InputError(f"{name}: expected {shape}, found {one.shape}")
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise InputError(f"confidence: expected 0 to 1, found {confidence.min():g} to {confidence.max():g}")


def _estimated(estimator: Estimator, depth_m: np.ndarray, camera: Camera, stills: bool, **start: Start) -> Estimate:
    """The joints in a film; in stills of other moments those of each alone, but where the estimator needs the first label."""
    if not stills or start:
        return estimator.estimate(depth_m, camera, **start)
    alone = [estimator.estimate(depth_m[[frame]], camera) for frame in range(len(depth_m))]
    return Estimate(*map(np.concatenate, zip(*alone, strict=True)))


@dataclass(frozen=True)
class PoseRun:
    """The results of one evaluation; dicts are by the estimator's name, in the order of the report."""

    benchmark: Benchmark
    results: dict[str, PoseResults]  # all N frames
    # Figures of `evaluate`, `evaluate_confidence`, `missed_by_cause`, `label_free` (None for stills); `fps` of the estimation
    # alone; `sees_future`: whether it uses later images.
    metrics: dict[str, dict]
    differences: dict[str, dict]  # `metrics.difference` of every estimator but the first from the first one
    about: dict  # the benchmark and what was done with it: "benchmark" in metrics.json

    @property
    def main(self) -> str:
        """The name of the main estimator."""
        return next(iter(self.metrics))

    def without(self, names: Collection[str]) -> "PoseRun":
        """A copy without some estimators, of which the main one is none."""
        parts = ("results", "metrics", "differences")
        kept = {part: {name: one for name, one in getattr(self, part).items() if name not in names} for part in parts}
        started = [name for name in self.about["started_from_label"] if name not in names]
        return replace(self, about=self.about | {"started_from_label": started}, **kept)


def run_benchmark(
    benchmark: Benchmark,
    estimators: dict[str, Estimator],
    sequences: int | None = None,
    seed: int = 0,
    processes: int = 1,
    extraction: Any = DEFAULT_EXTRACTION,
) -> PoseRun:
    """Runs every estimator on every sequence and computes the metrics.

    A sequence that cannot be read, or on which an estimator fails, is left out for all estimators. Each process has one
    thread, so the frames per second of an estimator (all frames divided by its total time) are those of one core.

    The main estimator comes first. `sequences` are evenly spaced over the set, `seed` is the bootstrap's, and `extraction` are
    the settings of what segments the person where the depth shows a whole scene. Raises InputError if every sequence failed, no
    joint has a label, an estimator was given every label, or a process died.
    """
    names = benchmark.sequence_names()
    work = SequenceEstimation(benchmark, estimators, extraction)
    found, failed = engine.run(work, evenly_spaced(names, sequences), processes, benchmark.name)
    parts = list(found.values())
    results = {label: concatenated([part.results[label] for part in parts]) for label in estimators}
    resampled, unit = _resampled(next(iter(results.values())))
    results = {label: replace(one, unit=unit) for label, one in results.items()}
    _check_scored(benchmark, results)
    extracted = [part.extraction_seconds for part in parts if part.extraction_seconds is not None]
    metrics = {}
    for label, one in results.items():
        metrics[label] = evaluate(one, seed) | evaluate_confidence(one) | _in_label_definition(benchmark, one, seed)
        fps = len(one.truth_m) / max(sum(part.seconds[label] for part in parts), 1e-9)
        sees_future = getattr(estimators[label], "sees_future", False)
        metrics[label] |= {"missed_by_cause": missed_by_cause(one), "fps": fps, "sees_future": sees_future}
        films = [part.label_free[label] for part in parts if part.label_free]
        metrics[label]["label_free"] = plain(pooled(films)) if films else None
    first, *others = results
    about = {
        "sequences": len(results[first].sequence_names),
        "sequences_in_set": len(names),
        "failed_sequences": failed,
        "images_without_person": sum(part.images_without_person for part in parts),
        "started_from_label": [label for label, one in estimators.items() if starts_from_label(one)],
        "extraction": extraction_name(extraction) if extracted else None,
        "extraction_fps": len(unit) / max(sum(extracted), 1e-9) if extracted else None,
        "resampled": resampled,
    }
    differences = {label: difference(results[label], results[first], seed) for label in others}
    return PoseRun(benchmark, results, metrics, differences, _described(benchmark) | about)


def _described(benchmark: Benchmark) -> dict:
    """The benchmark in metrics.json; with seed, version and config_hash of a simulated set, null of a real one."""
    provenance = getattr(benchmark, "provenance", {})
    known = {"name": benchmark.name, "depth": benchmark.origin.value, "against": benchmark.truth, "about": benchmark.about}
    return known | {key: provenance.get(key) for key in ("seed", "version", "config_hash")}


def _resampled(results: PoseResults) -> tuple[dict, np.ndarray]:
    """What the bootstrap resamples, and the unit of each frame (N,); the `unit` of the results is the room.

    Units are "rooms" where sequences share rooms and cameras, else "people", or "sequences" where some people are unknown;
    `people` is None there. A unit without a label is in no figure.
    """
    room, people = results.unit, set(results.person.tolist())
    units, unit = "sequences", results.sequence
    if (room != "").any():
        units, unit = "rooms", np.where(room == "", results.sequence, room)
    elif "" not in people:
        units, unit = "people", results.person
    labelled = np.isfinite(results.truth_m).all(axis=-1).any(axis=1)
    count = len(np.unique(unit[labelled]))
    return {"units": units, "count": count, "people": None if "" in people else len(people)}, unit


def _check_scored(benchmark: Benchmark, results: dict[str, PoseResults]) -> None:
    """Raises an InputError where there is nothing to score."""
    for label, one in results.items():
        if not np.isfinite(one.truth_m).all(axis=-1).any():
            names = ", ".join(one.sequence_names)
            raise InputError(f"{benchmark.name}: no joint in any frame of {names} has a label to compare with")
        if np.isnan(one.errors_m()).all():
            raise InputError(f"{benchmark.name}: {label} was given every true pose (start=label); no frame is left to score")


def _in_label_definition(benchmark: Benchmark, results: PoseResults, seed: int) -> dict:
    """The figures of an estimator in the definition of the labels, fitted on the other people, as `in_label_definition`.

    Empty where the labels have no definition of their own, a person's identity is unknown, or only one person is seen.
    """
    definition = getattr(benchmark, "label_definition", None)
    if definition is None or "" in results.person or len(np.unique(results.person)) < 2:
        return {}
    labels_m = np.where(results.given[:, None, None], np.nan, results.truth_m)
    defined = replace(results, estimate_m=in_label_definition(labels_m, results.estimate_m, results.person))
    return {"in_label_definition": {"definition": definition} | evaluate(defined, seed) | evaluate_confidence(defined)}
