"""The score of one lesson as it goes, image by image, and what is shown and said of it."""

import math
import time
from dataclasses import replace

import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.config import SCORERS
from kpopnet.dance.online import OnlineScore, OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore, ScorerConfig
from kpopnet.errors import InputError
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.guidance import latest_words, where_to_stand
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.moves import PRAISED_FROM, Moves, MoveVerdict
from kpopnet.teacher.live.verdict import Recording, verdict
from kpopnet.teacher.live.watching import Image, Learner

WORDS_EVERY_S = 0.25
BRIDGE_FPS, MAX_BRIDGE_S = 15.0, 0.5
"""A slow machine drops images. Between images less than MAX_BRIDGE_S seconds of the dance apart joints are interpolated at
BRIDGE_FPS; longer gaps stay gaps."""


class RunningLesson:
    """The score of one lesson, try after try.

    Attributes:
        recording: the learner's joints in this try.
    """

    def __init__(self, lesson: Lesson, dance: TaughtDance, noise: str) -> None:
        self.lesson, self.about, self.learner = lesson, dance.about, Learner()
        self.begin_s, self.end_s = lesson.excerpt_s(len(dance.joints_m) / dance.fps)
        self._config = scorer_config(lesson, noise)
        self._teacher = excerpt(dance.performance, self.begin_s, self.end_s)
        self._ages_ms: list[int] = []
        self._verdicts_ms: list[int] = []
        self.begin()

    def begin(self) -> None:
        """Starts the score of a try."""
        self._scorer, self.recording = OnlineScorer(self._teacher, self._config), Recording()
        self._latest: OnlineScore | None = None
        self._words, self._told_at = "", -math.inf
        self._moves = Moves(self.begin_s, self.end_s, 60 / self.about.bpm)
        self._judged: MoveVerdict | None = None
        self._ages_ms.clear()
        self._verdicts_ms.clear()

    def rehearse(self) -> None:
        """Lets a perfect learner dance for a while, which compiles the scorer's kernels."""
        frames = min(round((self._config.window_s + 1) * 30), len(self._teacher))
        for joints_m, time_s in zip(self._teacher.joints_m[:frames], self._teacher.times_s[:frames], strict=True):
            self._scorer.update(joints_m, float(time_s))
        if (score := self._scorer.score_so_far()) is not None:
            latest_words(score)
        self.begin()

    @property
    def seen_s(self) -> float:
        """Up to where the dance was scored."""
        return self.recording.times_s[-1] + self._config.latency_s if self.recording.times_s else self.begin_s

    def count(self, age_ms: int) -> None:
        self._ages_ms.append(age_ms)

    def is_over(self, clock: DanceClock) -> bool:
        return clock.dance_s(time.monotonic()) > self.end_s + self._config.latency_s + 0.1

    def score(self, clock: DanceClock, image: Image, joints_m: np.ndarray | None, confidence: np.ndarray | None) -> None:
        """Adds an image's joints to the score, if the dance is going on and somebody is there."""
        time_s = clock.dance_s(image.taken)
        if not clock.running or joints_m is None or confidence is None or time_s < self.begin_s:
            return
        if self.recording.times_s and time_s <= self.seen_s:
            return
        confidence = np.clip(confidence, 0, 1)
        for between_s, between_m in self._bridge(time_s, joints_m):
            self._scorer.update(between_m, between_s, confidence)
        self.recording.add(time_s - self._config.latency_s, joints_m, confidence)
        self._latest = self._scorer.update(joints_m, time_s, confidence)
        self._judged = self._moves.judged(self._scorer, self.recording.times_s[-1], self.lesson.speed)
        if self._latest is not None and time_s - self._told_at >= WORDS_EVERY_S * self.lesson.speed:
            self._told_at = time_s
            so_far = self._scorer.score_so_far()
            self._words = "" if so_far is None else latest_words(so_far)

    def next_verdict(self, clock: DanceClock) -> dict | None:
        """The verdict on a move that has just ended, once, and how many milliseconds after the move it is told."""
        judged, self._judged = self._judged, None
        if judged is None:
            return None
        after_s = clock.dance_s(time.monotonic()) - self._config.latency_s - judged.end_s
        self._verdicts_ms.append(round(1000 * after_s / self.lesson.speed))
        return judged._asdict() | {"total": _short(judged.total), "after_ms": self._verdicts_ms[-1]}

    def _bridge(self, time_s: float, joints_m: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """Times and joints on straight lines from the last image's to these, where some images were dropped in between."""
        if not self.recording.times_s:
            return []
        before_s, before_m = self.seen_s, self.recording.joints_m[-1]
        gap_s = time_s - before_s
        steps = round(gap_s * BRIDGE_FPS) if gap_s < MAX_BRIDGE_S else 1
        shares = [step / steps for step in range(1, steps)]
        return [(before_s + share * gap_s, before_m + share * (joints_m - before_m)) for share in shares]

    def shown(
        self, clock: DanceClock, image: Image, joints_m: np.ndarray | None, confidence: np.ndarray | None, camera: Camera
    ) -> dict:
        """What the page shows of an image: joints in fractions of the picture, scores, words."""
        points = None
        if joints_m is not None and confidence is not None:
            uvz = camera.project(joints_m) / [camera.width, camera.height, 1.0]
            points = [[_short(value) for value in point] for point in (*np.column_stack([uvz, confidence]),)]
        latest, running = self._latest, clock.running
        return {
            "time_s": _short(clock.dance_s(image.taken)) if running else None,
            "joints": points,
            "guidance": where_to_stand(joints_m, confidence, camera),
            "words": self._words if running and latest and not latest.similarity >= PRAISED_FROM else "",
            "total": _short(latest.similarity) if latest and running else None,
            "so_far": _short(latest.so_far) if latest and running else None,
            "delay_s": _short(latest.delay_s) if latest and running else None,
            "parts": {name: _short(value) for name, value in latest.parts.items()} if latest and running else {},
        }

    def finish(self, dropped: int) -> tuple[dict, Recording]:
        """The result of the try and the learner's joints."""
        score: DanceScore | None
        try:
            score = self._scorer.finish()
        except InputError:  # nobody was in view for a whole window
            score = None
        ages, verdicts = np.array(self._ages_ms or [0]), np.array(self._verdicts_ms or [0])
        notes = {
            "frames": len(self.recording.times_s),
            "fps": _short(len(self.recording.times_s) / (self.end_s - self.begin_s) * self.lesson.speed),
            "dropped": dropped,
            "age_ms_median": float(np.median(ages)),
            "age_ms_p95": float(np.percentile(ages, 95)),
            "verdict_ms_median": float(np.median(verdicts)),
            "verdict_ms_p95": float(np.percentile(verdicts, 95)),
        }
        return verdict(score, self.lesson, self.about, notes), self.recording


def scorer_config(lesson: Lesson, noise: str) -> ScorerConfig:
    """The scorer of a lesson.

    As in a mirror, left is left. Who faces a teacher as on a stage may do the same or its mirror image: both are right.
    """
    mirrored = "false" if lesson.mirrored else "auto"
    return replace(SCORERS["dance22"], mirrored=mirrored, latency_s=lesson.latency_s * lesson.speed, noise=noise)


def excerpt(dance: Performance, begin_s: float, end_s: float) -> Performance:
    """The part of a dance between two times, on the dance's own clock."""
    inside = (dance.times_s >= begin_s - 1e-6) & (dance.times_s <= end_s + 1e-6)
    return Performance(dance.joints_m[inside], dance.times_s[inside], dance.confidence[inside])


def _short(value: float | None) -> float | None:
    return round(float(value), 3) if value is not None and math.isfinite(value) else None
