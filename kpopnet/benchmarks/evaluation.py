"""One evaluation: a benchmark's sequences through one or more estimators."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from kpopnet.benchmarks.metrics import Scored, evaluate
from kpopnet.benchmarks.sequences import Benchmark, evenly_spaced
from kpopnet.benchmarks.synthetic import SyntheticBenchmark
from kpopnet.errors import InputError
from kpopnet.estimators import Estimator
from kpopnet.extraction import extract_person
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.tracker.estimator import TrackerEstimator, first_label


@dataclass
class EvaluateConfig:
    """What `evaluate.py` does.

    Attributes:
        benchmark: a data set's own settings, with its name.
        estimator: settings by the estimator's name, in the order of the report; the first one's figures head it.
        checkpoint: folder of the trained network, for the estimators that need one.
        sequences: only so many sequences, evenly spaced over the set, for a quick look; the report says so.
        seed: of the bootstrap and of the random example frames.
    """

    benchmark: Any
    estimator: dict[str, Any]
    checkpoint: str | None = None
    sequences: int | None = None
    seed: int = 0


@dataclass(frozen=True)
class Run:
    """What came out of one evaluation.

    Attributes:
        benchmark: what it was judged on.
        scored: per estimator, in order: the joints of all frames.
        metrics: per estimator: `metrics.evaluate`, and fps, frames per second of estimation alone.
        frame: (N,) the number of each frame within its sequence.
        failed: what was wrong with each sequence that could not be read, by its name.
        sequences_in_set: how many sequences the benchmark holds, evaluated or not.
        images_without_person: frames in which nothing was measured, or nobody was found.
        unlike_training: per estimator, where there are any: `unlike_training`.
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
    extraction_fps: float | None = None


def unlike_training(benchmark: Benchmark, estimator: Estimator) -> list[str]:
    """The settings by which a simulated set was measured and cut out otherwise than what a network was trained on.

    A ridge image is not among them: a network makes its own of the depth, as in its training.
    """
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
    benchmark: Benchmark, estimators: dict[str, Estimator], sequences: int | None = None, seed: int = 0
) -> Run:
    """Reads one sequence after the other and has every estimator estimate it.

    A sequence that cannot be read is named in the result and left out; the others go on. Where the depth shows a whole
    scene the person is extracted from it first, and every estimator gets the same person alone. An estimator's time is
    taken around its calls alone, after one call on the first frame that is not counted (compilation, caches); so is the
    extraction's.

    Args:
        benchmark: the data set.
        estimators: by name, the main one first.
        sequences: only so many, evenly spaced.
        seed: of the bootstrap.

    Raises:
        InputError: no sequence could be read.
    """
    names = benchmark.sequence_names()
    chosen = evenly_spaced(names, sequences)
    estimates: dict[str, list[np.ndarray]] = {name: [] for name in estimators}
    seconds = dict.fromkeys(estimators, 0.0)
    truths: list[dict[str, np.ndarray]] = []
    failed: dict[str, str] = {}
    images_without_person = scene_frames = 0
    extraction_seconds = 0.0
    for name in tqdm(chosen, desc=benchmark.name, unit="sequence"):
        try:
            sequence = benchmark.read(name)
        except InputError as error:
            failed[name] = str(error)
            tqdm.write(f"left out {name}: {error}")
            continue
        person_m = sequence.depth_m
        if not sequence.alone:
            if not truths:
                extract_person(sequence.depth_m[:1], sequence.camera)
            start = time.perf_counter()
            person_m = extract_person(sequence.depth_m, sequence.camera)
            extraction_seconds += time.perf_counter() - start
            scene_frames += len(person_m)
        for label, estimator in estimators.items():
            if not truths:
                estimator.estimate(person_m[:1], sequence.camera)
            told = {}
            if isinstance(estimator, TrackerEstimator) and estimator.starts_from_label:
                told["start"] = first_label(sequence.joints_camera_m)
            start = time.perf_counter()
            estimate = estimator.estimate(person_m, sequence.camera, **told)
            seconds[label] += time.perf_counter() - start
            assert estimate.joints_camera_m.shape == sequence.joints_camera_m.shape, (label, name)
            estimates[label].append(estimate.joints_camera_m)
        images_without_person += int((~person_m.any(axis=(1, 2))).sum())
        frames = len(sequence.depth_m)
        truths.append(
            {
                "truth_m": sequence.joints_camera_m,
                "visible": sequence.visible,
                "sequence": np.full(frames, len(truths)),
                "yaw_rad": np.full(frames, np.nan) if sequence.yaw_rad is None else sequence.yaw_rad,
                "frame": np.arange(frames),
            }
        )
    if not truths:
        first, reason = next(iter(failed.items()))
        raise InputError(f"{benchmark.name}: none of its {len(chosen)} sequences can be read; {first}: {reason}")
    truth = {field: np.concatenate([part[field] for part in truths]) for field in truths[0]}
    frame = truth.pop("frame")
    read = tuple(name for name in chosen if name not in failed)
    scored = {
        label: Scored(**truth, estimate_m=np.concatenate(parts), sequence_names=read)
        for label, parts in estimates.items()
    }
    metrics = {
        label: evaluate(one, seed) | {"fps": len(frame) / max(seconds[label], 1e-9)} for label, one in scored.items()
    }
    unlike = {label: settings for label, one in estimators.items() if (settings := unlike_training(benchmark, one))}
    extraction_fps = scene_frames / max(extraction_seconds, 1e-9) if scene_frames else None
    return Run(benchmark, scored, metrics, frame, failed, len(names), images_without_person, unlike, extraction_fps)
