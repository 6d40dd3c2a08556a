"""Estimation of the joints in one sequence of a benchmark, by all estimators."""

import logging
import time
from dataclasses import dataclass, replace

import numpy as np
import torch

from kpopnet.datasets.protocol import Benchmark, Sequence
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate, Estimator, Start, base_estimator, first_label, starts_from_label
from kpopnet.extraction import HumanExtractionConfig, extract_person

log = logging.getLogger(__name__)

WARM_UP_FRAMES = 30


@dataclass(frozen=True)
class EstimatedSequence:
    """Results for one sequence of T frames.

    Attributes:
        truth_m: (T, 15, 3) true joints, as in `Sequence.joints_camera_m`.
        visible: (T, 15) bool, as in the sequence.
        yaw_rad: (T,) as in the sequence; NaN where it is unknown.
        identity: as in the sequence.
        room: as in the sequence.
        estimate_m: (T, 15, 3) estimated joints by the estimator's name.
        confidence: (T, 15) their confidence likewise.
        given: (T,) bool by the estimator's name: the frames whose true joints it was given.
        seconds: estimation time by the estimator's name: processor time of one core, or wall-clock time on a GPU.
        extraction_seconds: processor time of the person extraction; None where the depth is segmented.
        images_without_person: number of frames without any depth, or in which no person was detected.
    """

    truth_m: np.ndarray
    visible: np.ndarray
    yaw_rad: np.ndarray
    identity: str
    room: str
    estimate_m: dict[str, np.ndarray]
    confidence: dict[str, np.ndarray]
    given: dict[str, np.ndarray]
    seconds: dict[str, float]
    extraction_seconds: float | None
    images_without_person: int


@dataclass(frozen=True)
class FailedSequence:
    """A sequence without results.

    Attributes:
        reason: the error in one line.
    """

    reason: str


class SequenceEstimation:
    """A callable that reads a sequence by its name, segments the person in a whole scene, and runs all estimators.

    Every estimator gets the same segmented depth. The times of the extraction and of each estimator are measured
    separately: processor time, which other work on the machine does not lengthen, or wall-clock time on a GPU. Before the
    first sequence, its first WARM_UP_FRAMES frames are processed once untimed, for compilation and caches.
    """

    def __init__(self, benchmark: Benchmark, estimators: dict[str, Estimator], extraction: HumanExtractionConfig) -> None:
        self.benchmark = benchmark
        self.estimators = estimators
        self.extraction = extraction
        self.warmed_up: set[str] = set()

    def __call__(self, name: str) -> EstimatedSequence | FailedSequence:
        """The results of one sequence. Any error, in the file or in an estimator, becomes a FailedSequence."""
        stage = ""
        try:
            sequence = self.benchmark.read(name)
            stage = "extraction: "
            sequence, extraction_seconds = self._segment_person(sequence)  # the scene's depth is not needed any more
            estimates, given, seconds = {}, {}, {}
            for label, estimator in self.estimators.items():
                stage = f"{label}: "
                start = first_label(sequence.joints_camera_m) if starts_from_label(estimator) else None
                given[label] = np.arange(len(sequence.depth_m)) == (-1 if start is None else start.frame)
                estimates[label], seconds[label] = self._estimate(label, estimator, sequence, start)
        except InputError as error:
            return FailedSequence(f"{stage}{error}")
        except Exception as error:
            log.exception("%s: %sfailed", name, stage)
            return FailedSequence(f"{stage}{type(error).__name__}: {error}")
        unknown = np.full(len(sequence.depth_m), np.nan, np.float32)
        return EstimatedSequence(
            truth_m=sequence.joints_camera_m,
            visible=sequence.visible,
            yaw_rad=unknown if sequence.yaw_rad is None else sequence.yaw_rad,
            identity=sequence.identity,
            room=sequence.room,
            estimate_m={label: estimate.joints_camera_m for label, estimate in estimates.items()},
            confidence={label: estimate.confidence for label, estimate in estimates.items()},
            given=given,
            seconds=seconds,
            extraction_seconds=extraction_seconds,
            images_without_person=int((~sequence.depth_m.any(axis=(1, 2))).sum()),
        )

    def _segment_person(self, sequence: Sequence) -> tuple[Sequence, float | None]:
        """The sequence with the person segmented, and the time of it in seconds (None if it was segmented already)."""
        if sequence.is_segmented:
            return sequence, None
        if "extraction" not in self.warmed_up:
            extract_person(sequence.depth_m[:WARM_UP_FRAMES], sequence.camera, self.extraction)
            self.warmed_up.add("extraction")
        start = time.process_time()
        person_m = extract_person(sequence.depth_m, sequence.camera, self.extraction)
        return replace(sequence, depth_m=person_m, is_segmented=True), time.process_time() - start

    def _estimate(self, label: str, estimator: Estimator, sequence: Sequence, given: Start | None) -> tuple[Estimate, float]:
        """The joints of T frames, and the estimation time in seconds. `given` is the true pose to start from, if any."""
        arguments = {} if given is None else {"start": given}
        if label not in self.warmed_up:
            estimator.estimate(sequence.depth_m[:WARM_UP_FRAMES], sequence.camera, **arguments)
            self.warmed_up.add(label)
        on_gpu = getattr(base_estimator(estimator), "device", torch.device("cpu")).type != "cpu"
        clock = time.perf_counter if on_gpu else time.process_time
        start = clock()
        estimate = estimator.estimate(sequence.depth_m, sequence.camera, **arguments)
        seconds = clock() - start
        assert estimate.joints_camera_m.shape == sequence.joints_camera_m.shape, (label, estimate.joints_camera_m.shape)
        return estimate, seconds
