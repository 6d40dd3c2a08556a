"""The score during the dance: gives the same result as `kpopnet.dance.scoring.score_dance`, frame by frame.

A frame of the uniform time grid is computed as soon as all samples within its smoothing kernel have arrived, `lag_s` later.
Each new frame adds one row of distances, and the window that ends at it is scored as `score_dance` would score it. Of the two
comparisons, with the learner and with the learner's mirror image, only the one that is shown is made frame by frame. The other
catches up every second, and when it is asked for.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from kpopnet.dance.features import FEATURES
from kpopnet.dance.performance import (
    KERNEL_RADIUS_S,
    MAX_DURATION_S,
    MAX_TIME_S,
    Performance,
    checked_dance,
    mask_missing_joints,
    numbers,
    resampled,
    with_derived_torso,
)
from kpopnet.dance.scoring import (
    OURS,
    Comparison,
    DanceScore,
    Scorer,
    Stretches,
    TimeGrid,
    beside,
    check_observed,
    derived_torso,
    derives_torso,
    mirror_fits_better,
    preferred,
)
from kpopnet.dance.window import FPS, PARTS, WINDOW_FRAMES, WindowScore
from kpopnet.errors import InputError, check_between
from kpopnet.skeleton import NUM_JOINTS

MOST_BEHIND = round(FPS)
"""Frames that wait for the comparison which is not shown: kept to the end of a dance they would take 2 MB a minute."""


class OnlineScore(NamedTuple):
    """Scores of the latest window, as in `kpopnet.dance.window.WindowScore`, and of the dance so far, 0 to 100."""

    time_s: float  # end of the latest window, seconds
    delay_s: float
    timing: float
    posture: float
    similarity: float
    parts: dict[str, float]  # posture by the name of one of `PARTS` that the teacher shows
    so_far: float  # score of the dance so far, S of Eq. (15)
    mirrored: bool  # whether the learner is compared as the teacher's mirror image


class OnlineScorer:
    """Scores a learner against a teacher's dance during the dance; a frame can be scored after `lag_s` seconds.

    It is of one dance, once, and of one thread.
    """

    def __init__(
        self, teacher: Performance, scorer: Scorer = OURS, free_s: Stretches = (), torso_is_derived: bool = False
    ) -> None:
        """`free_s` as for `score_dance`; `torso_is_derived` as of the whole learner's `Performance`, which is not known yet.

        Raises InputError if the teacher's dance is shorter than a window, and as `noise_between`.
        """
        scorer = beside(scorer, checked_dance(teacher, "the teacher's dance"))
        self.scorer, self.lag_s = scorer, KERNEL_RADIUS_S
        self._derives_torso = derives_torso(scorer, teacher, torso_is_derived)
        self._grid = TimeGrid(derived_torso(teacher) if self._derives_torso else teacher, scorer.feature, free_s=free_s)
        self._danced_s = float(teacher.times_s[0]), float(teacher.times_s[-1])
        prepared = scorer.teacher(self._grid.teacher)
        self._direct, self._mirrored = (Comparison(self._grid, prepared, mirrored) for mirrored in (False, True))
        self._shown, self._other = self._direct, self._mirrored
        if scorer.mirrored == "true":
            self._shown, self._other = self._other, self._shown
        # Joints and confidence at the grid's frames that the comparison which is not shown lacks, the last `_behind`, and at
        # those before that features look back on; and the samples that later frames need.
        self._frames: list[tuple[np.ndarray, np.ndarray]] = []
        self._history, self._behind = FEATURES[scorer.feature].history_frames(FPS), 0
        self._samples: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._first = self._next = self._given = 0
        self._is_observed = self._finished = False
        self._latest: OnlineScore | None = None

    def update(self, joints_m: np.ndarray, time_s: float, confidence: np.ndarray | None = None) -> OnlineScore | None:
        """Adds a sample of the learner's joints; returns the latest scores, None before the first window is complete.

        The (15, 3) joints are in the camera frame, metres, NaN where missing, their (15,) confidence in 0..1 is 1 by default;
        the time is in seconds on the teacher's clock, later than that of the previous sample.
        """
        joints_m = numbers("joints", joints_m)
        if joints_m.shape != (NUM_JOINTS, 3):
            raise InputError(f"joints of shape {joints_m.shape}: a frame has ({NUM_JOINTS}, 3)")
        time_s = self._on_clock(time_s)
        joints_m, confidence = mask_missing_joints(joints_m, confidence)
        if self._derives_torso:
            joints_m, confidence = with_derived_torso(joints_m, confidence)
        if not self._samples:
            self._first = max(self._grid.frame_from(time_s), 0)
            self._skip(min(self._first, len(self._grid.frames)))
        self._given, self._is_observed = self._given + 1, self._is_observed or bool(confidence.any())
        self._samples.append((time_s, joints_m, confidence))
        self._forget_samples()
        self._score_frames(time_s - self.lag_s, len(self._grid.frames))
        return self._latest

    def _on_clock(self, given_s: float) -> float:
        """The time of the next sample without the latency; raises InputError where it can be none."""
        try:
            time_s = float(given_s) - self.scorer.latency_s
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"a frame at {given_s!r:.80}: expected its time in seconds") from None
        if not math.isfinite(time_s) or (self._samples and time_s <= self._samples[-1][0]):
            advice = "; for another dance make another OnlineScorer" if self._samples else ""
            raise InputError(f"a frame at {given_s} s: times must be finite and increase from frame to frame{advice}")
        if self._finished:
            raise InputError(f"a frame at {given_s} s after finish(); for another dance make another OnlineScorer")
        begin_s, end_s = self._danced_s
        if not begin_s - MAX_DURATION_S <= time_s <= end_s + MAX_DURATION_S:
            raise InputError(
                f"a frame at {time_s:g} s of a dance from {begin_s:g} to {end_s:g} s: expected seconds on the teacher's clock"
            )
        return time_s

    def preview(self, end_s: float, least_s: float) -> OnlineScore | None:
        """The score of the window that ends at a time, from the samples that have arrived; None if there is no such window.

        It is known before `lag_s` has passed, for the smoothing of the window's last frames does without the later samples. The
        dance's score stays as it is. The end is in seconds on the teacher's clock, without the set-up's latency, and not after
        the latest sample. At the dance's begin a window may be shorter than WINDOW_S, but not than `least_s`.
        """
        check_between("end_s", end_s, -MAX_TIME_S, MAX_TIME_S)
        check_between("least_s", least_s, 0, MAX_TIME_S)
        stop = min(self._grid.frame_until(end_s) + 1, len(self._grid.frames))
        start = max(stop - WINDOW_FRAMES, 0)
        if not self._samples or stop - start < min(round(least_s * FPS), WINDOW_FRAMES):
            return None
        is_first = self.scorer.mirrored == "auto" and self._latest is None
        if is_first:  # no window has told yet whether the learner mirrors: this one does
            self._catch_up()
        known, new = self._frames[-self._history :], [self._frame(frame) for frame in range(self._next, stop)]
        windows = {}
        for comparison in (self._direct, self._mirrored) if is_first else (self._shown,):
            if new:
                _add([*known, *new], comparison, len(new))
            try:
                windows[comparison] = comparison.window(start, stop - start)
            finally:
                comparison.remove(len(new))
        if is_first and mirror_fits_better(*((one.similarity, one.posture) for one in windows.values())):
            self._shown, self._other = self._mirrored, self._direct
        return self._score(stop - 1, windows[self._shown])

    def score_so_far(self) -> DanceScore | None:
        """The score of the windows that are complete, with everything that `score_dance` returns; None before the first one."""
        self._catch_up()
        return self._summary() if self._latest else None

    def finish(self) -> DanceScore:
        """What `score_dance` returns for all samples, the last of the dance; raises InputError as it does."""
        if self._samples:
            check_observed(self._is_observed, self._given, "learner")
        last = self._grid.frame_until(self._samples[-1][0]) if self._samples else -1
        self._score_frames(math.inf, min(last + 1, len(self._grid.frames)))
        self._grid.check_overlap(range(self._first, last + 1))
        self._skip(len(self._grid.frames))
        self._finished = True
        return self._summary()

    def _summary(self) -> DanceScore:
        """The preferred score; a caller may change its arrays, and the dance goes on."""
        score = preferred(self._direct.summary(), self._mirrored.summary())
        windows = score.windows._replace(weight=score.windows.weight.copy())
        names = "teacher_m", "learner_m", "is_free"
        return score._replace(windows=windows, **{name: getattr(score, name).copy() for name in names})

    def _skip(self, stop: int) -> None:
        """No person was recorded in the frames up to `stop`."""
        self._catch_up()
        begin, self._next = self._next, max(self._next, stop)
        for comparison in (self._direct, self._mirrored):
            comparison.add_missing(self._next - begin)
        self._catch_up()

    def _score_frames(self, before_s: float, stop: int) -> None:
        """Adds the grid's frames before a time in seconds and the frame `stop`, and scores the window that ends with them."""
        new = 0
        while self._next < stop and float(self._grid.time_s(self._next)) < before_s:
            self._forget_samples()
            self._frames.append(self._frame(self._next))
            self._next, new = self._next + 1, new + 1
        if not new:
            return
        self._behind += new
        _add(self._frames[-(self._history + new) :], self._shown, new)
        if self._next < WINDOW_FRAMES:
            return
        kept = len(self._shown.kept)
        is_kept = self._shown.keep_windows(self._next)
        window = self._shown.kept[-1] if is_kept else self._shown.window(self._next - WINDOW_FRAMES)
        self._latest = self._score(self._next - 1, window)
        if (len(self._shown.kept) > kept and self.scorer.mirrored == "auto") or self._behind >= MOST_BEHIND:
            self._catch_up()

    def _forget_samples(self) -> None:
        """Drops the samples that the next frame is not computed from, but for the last one; after the dance all others."""
        of_dance = self._next < len(self._grid.frames)
        since_s = float(self._grid.time_s(self._next)) - self.lag_s if of_dance else math.inf
        while len(self._samples) > 1 and self._samples[0][0] < since_s:
            self._samples.popleft()

    def _catch_up(self) -> None:
        """Adds to the comparison that is not shown the frames that it lacks; from now on the preferred one is shown."""
        if self._behind:
            _add(self._frames, self._other, self._behind)
        self._frames, self._behind = self._frames[-self._history :], 0
        for comparison in (self._direct, self._mirrored):
            comparison.keep_windows(self._next)
        if self.scorer.mirrored == "auto":
            fits_better = mirror_fits_better(self._direct.similarity_and_posture, self._mirrored.similarity_and_posture)
            order = (self._mirrored, self._direct) if fits_better else (self._direct, self._mirrored)
            self._shown, self._other = order

    def _frame(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) joints and (15,) confidence at a frame of the grid, of the samples that are there."""
        times_s, samples_m, confidence = (np.array(column) for column in zip(*self._samples, strict=True))
        joints_m, confidence = resampled(samples_m, confidence, times_s, np.array([float(self._grid.time_s(frame))]))
        return joints_m[0], confidence[0]

    def _score(self, frame: int, window: WindowScore) -> OnlineScore:
        """The score of a window that ends with a frame, of the comparison that is shown."""
        parts = {
            name: float(value)
            for name, value in zip(PARTS, np.minimum(window.parts, window.parts_most), strict=True)
            if not math.isnan(value)
        }
        whole = window.delay_s, window.timing, min(window.posture, window.most), min(window.similarity, window.limit)
        return OnlineScore(float(self._grid.time_s(frame)), *whole, parts, self._shown.so_far, self._shown.mirrored)


def _add(frames: list[tuple[np.ndarray, np.ndarray]], comparison: Comparison, new: int) -> None:
    """Adds the last `new` of successive frames of joints and confidence to a comparison."""
    joints_m, confidence = (np.array(column) for column in zip(*frames, strict=True))
    comparison.add(joints_m, confidence, new)
