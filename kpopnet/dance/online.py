"""The score during the dance: gives the same result as `kpopnet.dance.scoring.score_dance`, frame by frame.

A frame of the uniform time grid is computed as soon as all samples within its smoothing kernel have arrived, `lag_s` later.
Each new frame adds one row of distances, and the window that ends at it is scored as `score_dance` would score it.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import TURN_WINDOW_S, Features
from kpopnet.dance.performance import Performance, mask_missing_joints
from kpopnet.dance.resampling import kernel_radius_s, resampled, resampled_confidence
from kpopnet.dance.scoring import (
    MIRROR_MARGIN,
    SCORERS,
    Comparison,
    DanceScore,
    ScorerConfig,
    TimeGrid,
    features_of,
    preferred,
    select_rows,
    summary,
)
from kpopnet.dance.window import PARTS, WindowScore
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS


class OnlineScore(NamedTuple):
    """Scores of the latest window and of the dance so far, 0 to 100; see `kpopnet.dance.window.WindowScore` for missing ones.

    Attributes:
        time_s: end of the latest window, seconds.
        delay_s: delay of the learner in it, seconds; negative when early.
        timing: S_t of Eq. (13) of the window.
        posture: S_p of Eq. (14) of the window.
        similarity: S_t S_p of the window.
        parts: body part (see `PARTS`) to its posture in the window.
        coverage: body part to the fraction in 0..1 of it that was seen in the window.
        so_far: score of the dance so far, S of Eq. (15).
        mirrored: whether the learner is compared as the teacher's mirror image.
    """

    time_s: float
    delay_s: float
    timing: float
    posture: float
    similarity: float
    parts: dict[str, float]
    coverage: dict[str, float]
    so_far: float
    mirrored: bool


class _Track:
    """The comparison of the learner, or of the learner's mirror image, with the teacher, and its windows so far."""

    def __init__(self, grid: TimeGrid, config: ScorerConfig, mirrored: bool) -> None:
        self._grid, self._config, self._mirrored = grid, config, mirrored
        self._comparison = Comparison(grid.teacher, config)
        self._windows: list[WindowScore] = []
        self._sum, self._weight = 0.0, 0.0

    def add(self, joints_m: np.ndarray, confidence: np.ndarray) -> None:
        """Adds the last of (T, 15, 3) joints at successive frames."""
        recent = features_of(joints_m, confidence, self._mirrored, self._config)
        self._comparison.add(select_rows(recent, slice(-1, None)))

    def add_missing(self, frames: int) -> None:
        """Adds frames in which nobody was seen."""
        shape = frames, self._grid.teacher.features.angles_rad.shape[1]
        self._comparison.add(Features(np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape)))

    def window(self, start: int) -> WindowScore:
        return self._comparison.window(start)

    def preview(self, frames: list[tuple[np.ndarray, np.ndarray]], known: int, start: int, stop: int) -> WindowScore:
        """Scores a window as if the joints and confidence in `frames` after the first `known` ones had been added."""
        if new := len(frames) - known:
            joints_m, confidence = (np.array(column) for column in zip(*frames, strict=True))
            features = features_of(joints_m, confidence, self._mirrored, self._config)
            self._comparison.add(select_rows(features, slice(known, None)))
        try:
            return self._comparison.window(start, stop - start)
        finally:
            self._comparison.take_back(new)

    def keep(self, window: WindowScore) -> None:
        """Adds the next window of the dance's score."""
        weight = float(self._grid.teacher.movement[len(self._windows)])
        self._windows.append(window)
        if not math.isnan(window.similarity):
            self._sum, self._weight = self._sum + weight * window.similarity, self._weight + weight

    @property
    def so_far(self) -> float:
        return self._sum / self._weight if self._weight else math.nan

    def summary(self) -> DanceScore:
        starts = self._grid.window_starts(len(self._grid.teacher_frames))[: len(self._windows)]
        return summary(
            self._windows, self._grid.time_s(starts), self._grid.teacher.movement[: len(self._windows)], self._config
        )


class OnlineScorer:
    """Scores a learner against a teacher's dance during the dance.

    Attributes:
        config: the scorer's settings.
        lag_s: delay in seconds after which a frame can be scored: all samples within its smoothing kernel have arrived then.
    """

    def __init__(self, teacher: Performance, config: ScorerConfig = SCORERS["dance22"]) -> None:
        """Computes the teacher's features.

        Raises:
            InputError: The teacher's dance is shorter than a window.
        """
        self.config, self.lag_s = config, kernel_radius_s(config.smoothing_s)
        self._grid = TimeGrid(teacher, config)
        self._direct, self._mirrored = (_Track(self._grid, config, mirrored) for mirrored in (False, True))
        history = round(TURN_WINDOW_S * config.fps) + 1 if config.heading else 2  # number of frames that a feature needs
        self._resampled: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=history)
        self._samples: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._first = self._next = 0
        self._latest: OnlineScore | None = None

    def update(self, joints_m: np.ndarray, time_s: float, confidence: np.ndarray | None = None) -> OnlineScore | None:
        """Adds a sample of the learner's joints.

        Args:
            joints_m: (15, 3) in the camera frame, NaN where a joint is missing.
            time_s: seconds on the teacher's clock; later than the previous sample.
            confidence: (15,) in 0..1 of each joint; by default 1 for all.

        Returns:
            The latest scores; None before the first window is complete.

        Raises:
            InputError: Joints or confidence have another shape, or the time is not later than the previous one.
        """
        joints_m, time_s = np.array(joints_m, np.float64), time_s - self.config.latency_s
        if joints_m.shape != (NUM_JOINTS, 3):
            raise InputError(f"joints of shape {joints_m.shape}: a frame has ({NUM_JOINTS}, 3)")
        if not math.isfinite(time_s) or (self._samples and time_s <= self._samples[-1][0]):
            raise InputError(
                f"a frame at {time_s + self.config.latency_s} s: times must be finite and increase from frame to frame"
            )
        joints_m, confidence = mask_missing_joints(joints_m, confidence)
        if not self._samples:
            self._first = max(self._grid.frame_from(time_s), 0)
            self._skip(min(self._first, len(self._grid.teacher_frames)))
        self._samples.append((time_s, joints_m, confidence))
        self._score_frames(before_s=time_s - self.lag_s)
        return self._latest

    def preview(self, end_s: float, least_s: float) -> OnlineScore | None:
        """The score of the window that ends at a time, from the samples that have arrived; the dance's score stays as it is.

        It is known before `lag_s` has passed, for the smoothing of the window's last frames does without the later samples.

        Args:
            end_s: seconds on the teacher's clock, without the set-up's latency; not after the latest sample.
            least_s: at the dance's begin a window may be shorter than `ScorerConfig.window_s`, but not than this, seconds.

        Returns:
            The score; None if there is no such window.
        """
        config, frames = self.config, list(self._resampled)
        stop = min(self._grid.frame_until(end_s) + 1, len(self._grid.teacher_frames))
        start = max(stop - config.window_frames, 0)
        if not self._samples or stop - start < min(round(least_s * config.fps), config.window_frames):
            return None
        known = len(frames)
        frames += [self._frame(frame) for frame in range(self._next, stop)]
        shown, _ = self._preferred()
        return self._told(stop - 1, shown, shown.preview(frames, known, start, stop))

    def score_so_far(self) -> DanceScore | None:
        """The score of the windows that are complete, with everything that `score_dance` returns; None before the first one."""
        return preferred(self._direct.summary(), self._mirrored.summary()) if self._latest else None

    def finish(self) -> DanceScore:
        """Scores the rest of the dance and returns what `score_dance` returns for all samples.

        Raises:
            InputError: The learner's samples contain no whole window.
        """
        last = self._grid.frame_until(self._samples[-1][0]) if self._samples else -1
        self._score_frames(before_s=math.inf, last=last)
        self._grid.check_overlap(range(self._first, last + 1))
        self._skip(len(self._grid.teacher_frames))
        return preferred(self._direct.summary(), self._mirrored.summary())

    def _skip(self, stop: int) -> None:
        """Nobody was recorded in the frames up to `stop`."""
        begin, self._next = self._next, max(self._next, stop)
        for track in (self._direct, self._mirrored):
            track.add_missing(self._next - begin)
        for start in self._grid.window_starts(self._next):
            if start + self.config.window_frames > begin:
                for track in (self._direct, self._mirrored):
                    track.keep(track.window(start))

    def _score_frames(self, before_s: float, last: int | None = None) -> None:
        """Scores the grid's frames before a time in seconds, up to frame `last`."""
        stop = len(self._grid.teacher_frames) if last is None else min(last + 1, len(self._grid.teacher_frames))
        while self._next < stop and self._grid.time_s(self._next) < before_s:
            self._score_frame(self._next)
            self._next += 1

    def _score_frame(self, frame: int) -> None:
        config, at_s = self.config, float(self._grid.time_s(frame))
        while len(self._samples) > 1 and self._samples[0][0] < at_s - self.lag_s:
            self._samples.popleft()
        self._resampled.append(self._frame(frame))
        recent = tuple(np.array(column) for column in zip(*self._resampled, strict=True))
        shown, other = self._preferred()
        for track in (shown, other):
            track.add(*recent)
        start = frame + 1 - config.window_frames
        if start < 0:
            return
        window = shown.window(start)
        if start % config.hop_frames == 0:
            shown.keep(window)
            other.keep(other.window(start))
        self._latest = self._told(frame, shown, window)

    def _frame(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) joints and (15,) confidence at a frame of the grid, of the samples that are there."""
        times_s, samples_m, confidence = (np.array(column) for column in zip(*self._samples, strict=True))
        resampling = times_s, np.array([float(self._grid.time_s(frame))]), self.config.smoothing_s
        return resampled(samples_m, *resampling)[0], resampled_confidence(confidence, *resampling)[0]

    def _preferred(self) -> tuple[_Track, _Track]:
        """The comparison that is shown, and the other one."""
        direct, mirrored, asked = self._direct, self._mirrored, self.config.mirrored
        if asked == "true" or (asked == "auto" and mirrored.so_far > direct.so_far + MIRROR_MARGIN):
            return mirrored, direct
        return direct, mirrored

    def _told(self, frame: int, shown: _Track, window: WindowScore) -> OnlineScore:
        """What is told of a window that ends with a frame."""
        return OnlineScore(
            float(self._grid.time_s(frame)),
            window.delay_s,
            window.timing,
            window.posture,
            window.similarity,
            _by_part(window.parts),
            _by_part(window.coverage),
            shown.so_far,
            shown is self._mirrored,
        )


def _by_part(values: np.ndarray) -> dict[str, float]:
    """(P,) values of `PARTS` by name, without those that are unknown."""
    return {name: float(value) for name, value in zip(PARTS, values, strict=True) if not math.isnan(value)}
