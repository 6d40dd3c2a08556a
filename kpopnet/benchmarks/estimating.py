"""One sequence of a benchmark through all estimators."""

import logging
import time
from dataclasses import dataclass, replace

import numpy as np
import torch

from kpopnet.benchmarks.sequences import Benchmark, Sequence
from kpopnet.errors import InputError
from kpopnet.estimators import Estimator, first_label, starts_from_label, who_looks
from kpopnet.extraction import HumanExtractionConfig, extract_person

log = logging.getLogger(__name__)

WARM_UP_FRAMES = 30


@dataclass(frozen=True)
class EstimatedSequence:
    """What came out of one sequence of T frames.

    Attributes:
        truth_m, visible, yaw_rad: as in the sequence; an unknown yaw is NaN.
        estimate_m: (T, 15, 3) by the estimator's name.
        seconds: what each estimator took for it, of one core, or by the clock where a GPU works.
        extraction_seconds: what finding the person took, None where the depth shows people alone.
        images_without_person: frames in which nothing was measured, or nobody was found.
    """

    truth_m: np.ndarray
    visible: np.ndarray
    yaw_rad: np.ndarray
    estimate_m: dict[str, np.ndarray]
    seconds: dict[str, float]
    extraction_seconds: float | None
    images_without_person: int


@dataclass(frozen=True)
class FailedSequence:
    """A sequence without figures. Attributes: reason: why, in a line."""

    reason: str


class SequenceEstimation:
    """Called with a sequence's name: reads it, finds the person where it shows a whole scene, and estimates.

    Every estimator gets the same person alone. Time is that of an estimator's calls alone, and of the extraction alone: the
    processor's, which other work on the machine does not lengthen, or the wall clock's where a GPU works. The first
    WARM_UP_FRAMES frames of the first sequence are done once before, uncounted: compilation, caches.
    """

    def __init__(
        self, benchmark: Benchmark, estimators: dict[str, Estimator], extraction: HumanExtractionConfig
    ) -> None:
        self.benchmark = benchmark
        self.estimators = estimators
        self.extraction = extraction
        self.warm: set[str] = set()

    def __call__(self, name: str) -> EstimatedSequence | FailedSequence:
        """What came out. An error of any kind, in the file or in an estimator, takes this sequence only."""
        at_work = ""
        try:
            sequence = self.benchmark.read(name)
            at_work = "extraction: "
            sequence, extraction_seconds = self._person_alone(sequence)  # the scene is not needed any more
            estimate_m, seconds = {}, {}
            for label, estimator in self.estimators.items():
                at_work = f"{label}: "
                estimate_m[label], seconds[label] = self._estimate(label, estimator, sequence)
        except InputError as error:
            return FailedSequence(f"{at_work}{error}")
        except Exception as error:
            log.exception("%s: %sfailed", name, at_work)
            return FailedSequence(f"{at_work}{type(error).__name__}: {error}")
        unknown = np.full(len(sequence.depth_m), np.nan, np.float32)
        return EstimatedSequence(
            truth_m=sequence.joints_camera_m,
            visible=sequence.visible,
            yaw_rad=unknown if sequence.yaw_rad is None else sequence.yaw_rad,
            estimate_m=estimate_m,
            seconds=seconds,
            extraction_seconds=extraction_seconds,
            images_without_person=int((~sequence.depth_m.any(axis=(1, 2))).sum()),
        )

    def _person_alone(self, sequence: Sequence) -> tuple[Sequence, float | None]:
        """The sequence without the scene, and what that took."""
        if sequence.alone:
            return sequence, None
        if "extraction" not in self.warm:
            extract_person(sequence.depth_m[:WARM_UP_FRAMES], sequence.camera, self.extraction)
            self.warm.add("extraction")
        start = time.process_time()
        person_m = extract_person(sequence.depth_m, sequence.camera, self.extraction)
        return replace(sequence, depth_m=person_m, alone=True), time.process_time() - start

    def _estimate(self, label: str, estimator: Estimator, sequence: Sequence) -> tuple[np.ndarray, float]:
        """(T, 15, 3) joints, and what they took."""
        told = {}
        if starts_from_label(estimator):
            told["start"] = first_label(sequence.joints_camera_m)
        if label not in self.warm:
            estimator.estimate(sequence.depth_m[:WARM_UP_FRAMES], sequence.camera, **told)
            self.warm.add(label)
        on_gpu = getattr(who_looks(estimator), "device", torch.device("cpu")).type != "cpu"
        clock = time.perf_counter if on_gpu else time.process_time
        start = clock()
        joints_m = estimator.estimate(sequence.depth_m, sequence.camera, **told).joints_camera_m
        seconds = clock() - start
        assert joints_m.shape == sequence.joints_camera_m.shape, (label, joints_m.shape)
        return joints_m, seconds
