"""The score during the dance: gives the same result as `kpopnet.dance.scoring.score_dance`, frame by frame.

A frame of the uniform time grid is computed as soon as all samples within its smoothing kernel have arrived, `lag_s` later.
Each new frame adds one row of distances, and the window that ends at it is scored as `score_dance` would score it.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import TURN_WINDOW_S
from kpopnet.dance.performance import Performance, mask_missing_joints
from kpopnet.dance.resampling import kernel_radius_s, resampled, resampled_confidence
from kpopnet.dance.scoring import (
    PARTS,
    SCORERS,
    Comparison,
    DanceScore,
    ScorerConfig,
    TimeGrid,
    WindowScore,
    select_rows,
    summary,
    weighted_features,
)
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS


class OnlineScore(NamedTuple):
    """Scores of the latest window and of the dance so far, 0 to 100; NaN where too many joints were missing.

    Attributes:
        time_s: end of the latest window, seconds.
        delay_s: delay of the learner in it, seconds; negative when early.
        timing: S_t of Eq. (13) of the window.
        posture: S_p of Eq. (14) of the window.
        similarity: S_t S_p of the window.
        parts: body part (see `PARTS`) to its similarity in the window.
        so_far: score of the dance so far, S of Eq. (15).
    """

    time_s: float
    delay_s: float
    timing: float
    posture: float
    similarity: float
    parts: dict[str, float]
    so_far: float


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
        frames = self._grid.teacher_frames
        self._teacher = self._grid.features(teacher, frames)
        self._comparison: Comparison | None = None
        self._history = round(TURN_WINDOW_S * config.fps) + 1 if config.heading else 2  # number of frames that a feature needs
        self._resampled: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=self._history)
        self._samples: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._first = self._next = 0
        self._latest: OnlineScore | None = None
        self._windows: dict[int, WindowScore] = {}
        self._similarity_sum, self._scored_windows = 0.0, 0

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
        joints_m = np.array(joints_m, np.float64)
        if joints_m.shape != (NUM_JOINTS, 3):
            raise InputError(f"joints of shape {joints_m.shape}: a frame has ({NUM_JOINTS}, 3)")
        if not math.isfinite(time_s) or (self._samples and time_s <= self._samples[-1][0]):
            raise InputError(f"a frame at {time_s} s: times must be finite and increase from frame to frame")
        joints_m, confidence = mask_missing_joints(joints_m, confidence)
        if not self._samples:
            self._first = self._next = max(self._grid.frame_from(time_s), 0)
            self._comparison = Comparison(self._teacher, self._first, self.config)
        self._samples.append((time_s, joints_m, confidence))
        self._score_frames(before_s=time_s - self.lag_s)
        return self._latest

    def finish(self) -> DanceScore:
        """Scores the remaining frames after the last sample and returns what `score_dance` returns for all samples.

        Raises:
            InputError: The learner's samples contain no whole window.
        """
        last = self._grid.frame_until(self._samples[-1][0]) if self._samples else -1
        self._score_frames(before_s=math.inf, last=last)
        starts = self._grid.window_starts(range(self._first, self._next))
        return summary([self._windows[start] for start in starts], self._grid.time_s(starts))

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
        times_s, samples_m, confidence = (np.array(column) for column in zip(*self._samples, strict=True))
        resampling = times_s, np.array([at_s]), config.smoothing_s
        self._resampled.append((resampled(samples_m, *resampling)[0], resampled_confidence(confidence, *resampling)[0]))
        joints_m, joint_confidence = (np.array(column) for column in zip(*self._resampled, strict=True))
        recent = weighted_features(joints_m, joint_confidence, config)
        assert self._comparison is not None  # made with the grid
        self._comparison.add(select_rows(recent, slice(-1, None)))

        start = frame + 1 - config.window_frames
        if start < self._first:
            return
        window = self._comparison.window(start)
        if start % config.hop_frames == 0:
            self._windows[start] = window
            if not math.isnan(window.posture):
                self._similarity_sum += window.timing * window.posture / 100
                self._scored_windows += 1
        similarity = window.timing * window.posture / 100
        parts = {name: window.timing * float(posture) / 100 for name, posture in zip(PARTS, window.parts, strict=True)}
        so_far = self._similarity_sum / self._scored_windows if self._scored_windows else math.nan
        self._latest = OnlineScore(at_s, window.delay_s, window.timing, window.posture, similarity, parts, so_far)
