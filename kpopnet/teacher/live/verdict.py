"""What the learner is told after a dance: total, timing, posture, per part and phrase, the worst moments, the course."""

import math
from dataclasses import dataclass, field

import numpy as np

from kpopnet.dance.feedback import Moment, feedback
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.timing import measured_latency_s
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.teacher.library import About
from kpopnet.teacher.live.guidance import in_words
from kpopnet.teacher.live.lesson import Lesson

WORST = 3
MIN_FPS = 10.0
"""Fewer images a second leave gaps between the samples of the score."""


@dataclass
class Recording:
    """The learner's joints as they were scored.

    Attributes:
        times_s: seconds on the clock of the dance.
        joints_m: each (15, 3) metres, camera frame.
        confidence: each (15,).
    """

    times_s: list[float] = field(default_factory=list)
    joints_m: list[np.ndarray] = field(default_factory=list)
    confidence: list[np.ndarray] = field(default_factory=list)

    def add(self, time_s: float, joints_m: np.ndarray, confidence: np.ndarray) -> None:
        self.times_s.append(time_s)
        self.joints_m.append(joints_m)
        self.confidence.append(confidence)

    def arrays(self) -> dict[str, np.ndarray]:
        """times_s (T,), joints_m (T, 15, 3) and confidence (T, 15), in the form that `read_performance` reads."""
        frames = len(self.times_s)
        return {
            "times_s": np.array(self.times_s, np.float64),
            "joints_m": np.array(self.joints_m, np.float32).reshape(frames, NUM_JOINTS, 3),
            "confidence": np.array(self.confidence, np.float32).reshape(frames, NUM_JOINTS),
        }


def verdict(score: DanceScore | None, lesson: Lesson, about: About, notes: dict) -> dict:
    """The result of a lesson as JSON of finite numbers and null.

    Args:
        score: None where nobody was seen long enough.
        lesson: what was asked for.
        about: of the dance.
        notes: more to keep: frames per second, dropped images.
    """
    head = {
        "dance": lesson.dance, "name": about.name, "source": lesson.source, "skill": lesson.skill, "fault": lesson.fault,
        "speed": lesson.speed, "from_s": lesson.from_s, "to_s": lesson.to_s, "mirrored": lesson.mirrored, "notes": notes,
    }  # fmt: skip
    if score is None or math.isnan(score.similarity):
        return head | {"total": None, "hints": ["nobody was seen dancing; stand in the picture from head to feet"]}
    told = feedback(score, 60 / about.bpm)
    windows = score.windows
    middle_s = windows.start_s + score.config.window_s / 2
    latency_s = measured_latency_s(windows.delay_s, windows.posture)
    return head | {
        "total": _number(score.similarity),
        "timing": _number(score.timing),
        "posture": _number(score.posture),
        "parts": {name: _number(value) for name, value in score.parts.items()},
        "phrases": [
            {"start_s": _number(one.start_s), "end_s": _number(one.end_s), "total": _number(one.similarity),
             "moments": [_moment(moment) for moment in one.moments]}
            for one in told.phrases
        ],
        "worst": [_moment(moment) for moment in _worst(told.phrases)],
        "faults": [one.text for one in told.faults[:5]],
        "hints": [*_slow(notes), *told.hints],
        "latency_s": _number(latency_s, 3),
        "course": {
            "time_s": _numbers(middle_s), "total": _numbers(windows.similarity), "timing": _numbers(windows.timing),
            "posture": _numbers(windows.posture), "delay_s": _numbers(windows.delay_s, 3),
            "parts": {name: _numbers(values) for name, values in windows.parts.items() if name in score.parts},
        },
    }  # fmt: skip


def _slow(notes: dict) -> list[str]:
    """A sentence where too few images were scored."""
    if notes["fps"] >= MIN_FPS:
        return []
    return [f"only {notes['fps']:.0f} images a second were scored, which costs points: this machine is busy with other things"]


def _worst(phrases: tuple) -> list[Moment]:
    """The costliest moments of all phrases; one that lasts over two phrases is told once."""
    moments = {(one.start_s, one.part, one.direction): one for phrase in phrases for one in phrase.moments}
    return sorted(moments.values(), key=lambda one: -one.cost)[:WORST]


def _moment(moment: Moment) -> dict:
    return {
        "start_s": _number(moment.start_s), "end_s": _number(moment.end_s), "part": moment.part, "words": in_words(moment),
        "text": moment.text, "degrees": _number(moment.degrees), "delay_s": _number(moment.delay_s),
    }  # fmt: skip


def _number(value: float | None, digits: int = 1) -> float | None:
    return round(float(value), digits) if value is not None and math.isfinite(value) else None


def _numbers(values: np.ndarray, digits: int = 1) -> list[float | None]:
    return [_number(value, digits) for value in values]
