"""Scores a learner's dance against a teacher's: timing, posture and similarity (section 3.2), 0 to 100.

    joints -> uniform frame rate -> features -> windows of 2 s -> DTW -> S_t, S_p of each window -> S

The delay of a window is the time between the middle of the learner's window and the middle of the teacher's frames that match
it. All windows of the teacher's dance count: where the learner is not seen, or what of the learner is not seen, scores 0. The
scorers that follow the papers (`distance=whole`) know no missing joints and leave such windows out instead.
"""

import math
from typing import NamedTuple

import numpy as np

from kpopnet.dance.config import SCORERS, ScorerConfig
from kpopnet.dance.dtw import banded_distances
from kpopnet.dance.features import Features, dance_features
from kpopnet.dance.noise import NOISE
from kpopnet.dance.performance import Performance, as_performance
from kpopnet.dance.resampling import resampled, resampled_confidence
from kpopnet.dance.timing import tempo
from kpopnet.dance.window import PARTS, Teacher, WindowScore, prepared_teacher, score_window
from kpopnet.errors import InputError
from kpopnet.skeleton import MIRROR

MIRROR_MARGIN = 10.0
"""Points by which the mirrored comparison has to be better before it is preferred, or hinted at."""


class Windows(NamedTuple):
    """Scores of a dance's windows, 0 to 100.

    Attributes:
        start_s: (N,) start of each window, seconds on the teacher's clock.
        delay_s: (N,) delay of the learner, seconds; negative when early; NaN where too few frames could be compared.
        timing: (N,) S_t of Eq. (13); NaN with the delay.
        posture: (N,) S_p of Eq. (14).
        similarity: (N,) S_t S_p; 0 where nobody is seen to dance.
        weight: (N,) weight in 0..1 in the scores of the dance, see `kpopnet.dance.window.Teacher.movement`.
        parts: name of `PARTS` to (N,) posture of that part alone.
        coverage: name of `PARTS` to (N,) fraction in 0..1 of the part in the teacher's frames that the learner shows.
        error_rad: (N, D) mean difference, learner minus teacher, of each angle of `kpopnet.dance.features.feature_names` in the
            middle of each window, which lasts a hop, so that the windows' middles follow each other without gaps.
        error_weight: (N, D) mean weight of these differences, 0..1.
    """

    start_s: np.ndarray
    delay_s: np.ndarray
    timing: np.ndarray
    posture: np.ndarray
    similarity: np.ndarray
    weight: np.ndarray
    parts: dict[str, np.ndarray]
    coverage: dict[str, np.ndarray]
    error_rad: np.ndarray
    error_weight: np.ndarray


class DanceScore(NamedTuple):
    """Scores of a learner's dance, 0 to 100; NaN if no window could be compared. Means over the windows are weighted.

    Attributes:
        similarity: S of Eq. (15), the mean of the windows' S_t S_p.
        timing: the mean of S_t over the windows in which the learner was seen.
        posture: the mean of the windows' S_p.
        parts: name of `PARTS` to the mean posture of that part alone, without regard to time and to the other parts; nothing is
            taken off for standing still. Parts that the teacher does not show are left out.
        scored: fraction of the windows that could be compared.
        windows: the scores of each window, by part of the body.
        coverage: name of `PARTS` to the fraction in 0..1 of what the teacher dances with it that the learner shows.
        mirrored: whether the learner was compared as the teacher's mirror image.
        mirror_fits_better: whether the learner fits the teacher's mirror image clearly better than the teacher.
        tempo: the learner's tempo divided by the teacher's; NaN where unknown.
        ceiling: what perfect dancing scores on average through the estimator whose noise was set; 100 for true joints.
        config: the scorer's settings.
    """

    similarity: float
    timing: float
    posture: float
    parts: dict[str, float]
    scored: float
    windows: Windows
    coverage: dict[str, float]
    mirrored: bool
    mirror_fits_better: bool
    tempo: float
    ceiling: float
    config: ScorerConfig

    @property
    def completeness(self) -> float:
        """Fraction in 0..1 of what the teacher dances that the learner shows, the mean over the parts."""
        return sum(self.coverage.values()) / len(self.coverage) if self.coverage else math.nan


def score_dance(
    teacher: Performance | np.ndarray,
    learner: Performance | np.ndarray,
    config: ScorerConfig = SCORERS["dance22"],
    *,
    fps: float | None = None,
    unobserved_is_nan: bool = False,
) -> DanceScore:
    """Scores a learner against a teacher.

    Windows start at multiples of `config.hop_s` from the teacher's first frame and cover the teacher's dance. Frames of the
    learner before the teacher's first frame or after the last one are not scored.

    Args:
        teacher: the reference dance, or its (T, 15, 3) joints in metres in the camera frame.
        learner: the dance to score, on the same clock, or its joints.
        config: the scorer's settings.
        fps: frames per second of dances that are given as joints.
        unobserved_is_nan: a learner of whom no joint is known scores NaN, for evaluations that count such dances.

    Raises:
        InputError: The teacher's dance is shorter than a window, or the learner's recording covers no whole window of it; or
            no joint is known in one of the dances; or joints are given without `fps`.
    """
    teacher, learner = as_performance(teacher, fps, "teacher"), as_performance(learner, fps, "learner")
    if not unobserved_is_nan:
        _check_observed(learner, "learner")
    learner = learner.earlier(config.latency_s)
    grid = TimeGrid(teacher, config)
    grid.check_overlap(grid.frames_of(learner))
    frames, scores = grid.resampled(learner, grid.teacher_frames), []
    for mirrored in (False, True):
        comparison = Comparison(grid.teacher, config)
        comparison.add(features_of(*frames, mirrored, config))
        starts = grid.window_starts(len(grid.teacher_frames))
        windows = [comparison.window(start) for start in starts]
        scores.append(summary(windows, grid.time_s(starts), grid.teacher.movement, config))
    return preferred(*scores)


def _check_observed(dance: Performance, whose: str) -> None:
    if not dance.is_observed:
        raise InputError(
            f"the {whose}'s dance: no joint is known in any of its {len(dance)} frames; was a person found in the recording?"
        )


class TimeGrid:
    """The uniformly spaced times at which a teacher's and a learner's dance are resampled; frame 0 is the teacher's first.

    Attributes:
        teacher_frames: numbers of the frames within the teacher's dance.
        teacher: the teacher's features at these frames.
    """

    def __init__(self, teacher: Performance, config: ScorerConfig) -> None:
        _check_observed(teacher, "teacher")
        self._config, self._start_s = config, float(teacher.times_s[0])
        self.teacher_frames = self.frames_of(teacher)
        if len(self.teacher_frames) < config.window_frames:
            raise InputError(
                f"the teacher's dance lasts {teacher.times_s[-1] - teacher.times_s[0]:.2f} s, less than a window of "
                f"{config.window_s} s; give a longer dance or a shorter window_s"
            )
        self.teacher = prepared_teacher(features_of(*self.resampled(teacher, self.teacher_frames), False, config), config)

    def frames_of(self, performance: Performance) -> range:
        """The frames between a performance's first sample and its last."""
        return range(self.frame_from(performance.times_s[0]), self.frame_until(performance.times_s[-1]) + 1)

    def frame_from(self, time_s: float) -> int:
        """The first frame at or after a time in seconds."""
        return math.ceil((time_s - self._start_s) * self._config.fps - 1e-6)

    def frame_until(self, time_s: float) -> int:
        """The last frame at or before a time in seconds."""
        return math.floor((time_s - self._start_s) * self._config.fps + 1e-6)

    def time_s(self, frames: int | range) -> np.ndarray:
        """Times of frames in seconds, on the teacher's clock."""
        return self._start_s + np.asarray(frames) / self._config.fps

    def resampled(self, performance: Performance, frames: range) -> tuple[np.ndarray, np.ndarray]:
        """(G, 15, 3) joints and (G, 15) confidence of a performance at these frames; missing outside the recording."""
        times = performance.times_s, self.time_s(frames), self._config.smoothing_s
        return resampled(performance.joints_m, *times), resampled_confidence(performance.confidence, *times)

    def window_starts(self, frames: int) -> range:
        """First frames of the windows within the first `frames` frames of the teacher's dance."""
        return range(0, frames - self._config.window_frames + 1, self._config.hop_frames)

    def check_overlap(self, learner: range) -> None:
        """Raises InputError if the learner's recorded frames cover no whole window of the teacher's dance."""
        fps = self._config.fps
        common = range(max(learner.start, 0), min(learner.stop, self.teacher_frames.stop))
        if len(common) < self._config.window_frames:
            raise InputError(
                f"the learner was recorded for {max(len(common) - 1, 0) / fps:.2f} s of a dance of "
                f"{(len(self.teacher_frames) - 1) / fps:.2f} s, in no whole window of {self._config.window_s} s; "
                "the times of both must be on the same clock"
            )


class Comparison:
    """Compares a learner's frames with a teacher's; the result is the same for frames added at once or one by one."""

    def __init__(self, teacher: Teacher, config: ScorerConfig) -> None:
        """Starts without frames of the learner."""
        self._teacher, self._config = teacher, config
        self._learner = Features(*(np.full_like(array, np.nan) for array in teacher.features))
        # Filled, so that all memory is taken before the dance begins, not page by page while it is scored in real time.
        self._distances = np.full((len(teacher.features.angles_rad), 2 * config.band_frames + 1), np.nan)
        self._end = 0

    def add(self, features: Features) -> None:
        """Adds the learner's next frames; the first is the teacher's frame 0."""
        begin, self._end = self._end, self._end + len(features.angles_rad)
        for stored, new in zip(self._learner, features, strict=True):
            stored[begin : self._end] = new
        self._distances[begin : self._end] = banded_distances(
            features, self._teacher.features, begin, self._config.band_frames, self._config.outlier_rad
        )

    def take_back(self, frames: int) -> None:
        """Forgets the last frames."""
        self._end -= frames

    def window(self, start: int, frames: int | None = None) -> WindowScore:
        """Scores the window that starts at a frame, by default one of `window_s`; all of its frames must have been added."""
        end = start + (frames or self._config.window_frames)
        context = self._distances[max(end - self._config.context_frames, 0) : end]
        return score_window(context, select_rows(self._learner, slice(start, end)), self._teacher, start, self._config)


def features_of(joints_m: np.ndarray, confidence: np.ndarray, mirrored: bool, config: ScorerConfig) -> Features:
    """Features of (T, 15, 3) joints at uniform frames with (T, 15) confidence, or of their mirror image."""
    if mirrored:
        joints_m, confidence = joints_m[:, MIRROR] * [-1.0, 1.0, 1.0], confidence[:, MIRROR]
    return dance_features(joints_m, config.feature, config.fps, config.heading, confidence)


def summary(scores: list[WindowScore], start_s: np.ndarray, weight: np.ndarray, config: ScorerConfig) -> DanceScore:
    """Combines the scores of windows that start at (N,) times in seconds and have (N,) weights into the dance's score."""
    names = ("delay_s", "timing", "posture", "similarity", "parts", "coverage", "error_rad", "error_weight")
    delay_s, timing, posture, similarity, *arrays = (np.array([getattr(one, name) for one in scores]) for name in names)
    parts, coverage = ({name: array[:, i] for i, name in enumerate(PARTS)} for array in arrays[:2])
    windows = Windows(start_s, delay_s, timing, posture, similarity, weight, parts, coverage, *arrays[2:])
    scored = float(np.isfinite(delay_s).mean())
    shown = [name for name in PARTS if np.isfinite(parts[name]).any()]
    return DanceScore(
        similarity=_mean(similarity, weight) if scored else math.nan,  # Eq. (15)
        timing=_mean(timing, weight),
        posture=_mean(posture, weight) if scored else math.nan,
        parts={name: _mean(parts[name], weight) for name in shown},
        scored=scored,
        windows=windows,
        coverage={name: _mean(coverage[name], weight) for name in shown},
        mirrored=False,
        mirror_fits_better=False,
        tempo=tempo(start_s, np.where(weight > 0, delay_s, math.nan), posture),
        ceiling=NOISE["none" if config.noise == "auto" else config.noise].ceiling,
        config=config,
    )


def preferred(direct: DanceScore, mirrored: DanceScore) -> DanceScore:
    """The score that `ScorerConfig.mirrored` asks for, of the learner and of the learner's mirror image."""
    fits_better = mirrored.similarity > direct.similarity + MIRROR_MARGIN
    use = {"false": False, "true": True, "auto": fits_better}[direct.config.mirrored]
    return (mirrored if use else direct)._replace(mirrored=use, mirror_fits_better=fits_better)


def select_rows(features: Features, rows: slice) -> Features:
    return Features(*(array[rows] for array in features))


def _mean(values: np.ndarray, weight: np.ndarray) -> float:
    """The weighted mean of the known values; NaN if none of them has weight."""
    known = np.isfinite(values) & (weight > 0)
    return float(np.average(values[known], weights=weight[known])) if known.any() else math.nan
