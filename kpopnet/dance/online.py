"""The score while somebody dances: the same as `kpopnet.dance.scoring.score_dance`, frame by frame as they come.

Even frames come into being as soon as all samples that count for them are there, `lag_s` later. A new frame adds one row of
distances; what `score_dance` would do with a window is done with the last one.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import TURN_S
from kpopnet.dance.performance import Performance, whole_joints
from kpopnet.dance.resampling import reach_s, resampled, resampled_confidence
from kpopnet.dance.scoring import (
    PARTS,
    SCORERS,
    Clock,
    Comparison,
    DanceScore,
    ScorerConfig,
    WindowScore,
    features_of,
    rows_of,
    summary,
)
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS


class OnlineScore(NamedTuple):
    """What is known while the dance goes on, 0 to 100; NaN where too little could be seen.

    Attributes:
        time_s: the end of the last window.
        delay_s: how late the learner is in it.
        timing: its S_t.
        posture: its S_p.
        similarity: its S_t S_p.
        parts: its similarity by part of the body.
        so_far: the score of the dance until now, S of Eq. (15).
    """

    time_s: float
    delay_s: float
    timing: float
    posture: float
    similarity: float
    parts: dict[str, float]
    so_far: float


class OnlineScorer:
    """Scores a learner against a teacher's dance while it is danced.

    Attributes:
        lag_s: a frame can be scored when samples that much later have come.
    """

    def __init__(self, teacher: Performance, config: ScorerConfig = SCORERS["dance22"]) -> None:
        """Prepares the teacher's features.

        Raises:
            InputError: the teacher's dance is shorter than a window.
        """
        self.config, self.lag_s = config, reach_s(config.smoothing_s)
        self._clock = Clock(teacher, config)
        frames = self._clock.teacher_frames
        self._taught = self._clock.features(teacher, frames)
        self._comparison: Comparison | None = None
        self._history = round(TURN_S * config.fps) + 1 if config.heading else 2  # frames that a feature needs
        self._even: deque[tuple[np.ndarray, np.ndarray]] = deque(maxlen=self._history)
        self._samples: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._first = self._next = 0
        self._latest: OnlineScore | None = None
        self._windows: dict[int, WindowScore] = {}

    def update(self, joints_m: np.ndarray, time_s: float, confidence: np.ndarray | None = None) -> OnlineScore | None:
        """Takes a frame in.

        Args:
            joints_m: (15, 3) in the camera frame, NaN where a joint is missing.
            time_s: when, on the teacher's clock; later than the last.
            confidence: (15,) in 0..1, how sure each joint is; by default all are.

        Returns:
            The latest scores, None before the first window is complete.

        Raises:
            InputError: joints or confidence of another shape, or a time that is not later than the last.
        """
        joints_m = np.array(joints_m, np.float64)
        if joints_m.shape != (NUM_JOINTS, 3):
            raise InputError(f"joints of shape {joints_m.shape}: a frame has ({NUM_JOINTS}, 3)")
        if not math.isfinite(time_s) or (self._samples and time_s <= self._samples[-1][0]):
            raise InputError(f"a frame at {time_s} s: times must be finite and grow from frame to frame")
        joints_m, confidence = whole_joints(joints_m, confidence)
        if not self._samples:
            self._first = self._next = max(self._clock.frame_from(time_s), 0)
            self._comparison = Comparison(self._taught, self._first, self.config)
        self._samples.append((time_s, joints_m, confidence))
        self._score_frames(before_s=time_s - self.lag_s)
        return self._latest

    def finish(self) -> DanceScore:
        """Scores what is left when no more frames come: what `score_dance` gives of all of them.

        Raises:
            InputError: the learner danced no whole window.
        """
        last = self._clock.frame_until(self._samples[-1][0]) if self._samples else -1
        self._score_frames(before_s=math.inf, last=last)
        starts = self._clock.window_starts(range(self._first, self._next))
        return summary([self._windows[start] for start in starts], self._clock.time_s(starts))

    def _score_frames(self, before_s: float, last: int | None = None) -> None:
        """Scores the even frames before a time, up to the last one."""
        stop = len(self._clock.teacher_frames) if last is None else min(last + 1, len(self._clock.teacher_frames))
        while self._next < stop and self._clock.time_s(self._next) < before_s:
            self._score_frame(self._next)
            self._next += 1

    def _score_frame(self, frame: int) -> None:
        config, at_s = self.config, self._clock.time_s(frame)
        while len(self._samples) > 1 and self._samples[0][0] < at_s - self.lag_s:
            self._samples.popleft()
        times_s, samples_m, confidence = (np.array(column) for column in zip(*self._samples, strict=True))
        when = times_s, np.array([at_s]), config.smoothing_s
        self._even.append((resampled(samples_m, *when)[0], resampled_confidence(confidence, *when)[0]))
        recent = features_of(*(np.array(column) for column in zip(*self._even, strict=True)), config)
        self._comparison.add(rows_of(recent, slice(-1, None)))

        start = frame + 1 - config.window_frames
        if start < self._first:
            return
        window = self._comparison.window(start)
        if start % config.hop_frames == 0:
            self._windows[start] = window
        similarity = window.timing * window.posture / 100
        known = [w.timing * w.posture / 100 for w in self._windows.values() if not math.isnan(w.posture)]
        parts = {name: window.timing * float(posture) / 100 for name, posture in zip(PARTS, window.parts, strict=True)}
        so_far = sum(known) / len(known) if known else math.nan
        self._latest = OnlineScore(at_s, window.delay_s, window.timing, window.posture, similarity, parts, so_far)
