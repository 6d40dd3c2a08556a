"""The guided step that measures the latency of a set-up: an arm on every beat of a metronome."""

import math

import numpy as np

from kpopnet.dance.timing import beat_latency_s
from kpopnet.teacher.live.lesson import CALIBRATION_BEAT_S, DanceClock
from kpopnet.teacher.live.running import RunningLesson
from kpopnet.teacher.live.verdict import Recording
from kpopnet.teacher.live.watching import Image

SETTLED_S = 1.5 * CALIBRATION_BEAT_S
"""The first movement of a learner comes late."""


class Calibration(RunningLesson):
    """What is made of a lesson in which nothing is danced: the latency, instead of a score."""

    def rehearse(self) -> None:
        """Nothing needs to be compiled."""

    def score(self, clock: DanceClock, image: Image, joints_m: np.ndarray | None, confidence: np.ndarray | None) -> None:
        """Keeps an image's joints."""
        time_s = clock.dance_s(image.taken)
        if clock.running and joints_m is not None and confidence is not None and time_s >= SETTLED_S:
            self.recording.add(time_s, joints_m, confidence)

    def finish(self, dropped: int) -> tuple[dict, Recording]:
        """The latency in seconds, None where the learner did not move on the beat."""
        found = self.recording.arrays()
        latency_s = beat_latency_s(found["joints_m"], found["times_s"], CALIBRATION_BEAT_S)
        hint = "no arm moved with the ticks; raise one high at each tick, lower it in between, and try again"
        if math.isnan(latency_s):
            return {"total": None, "latency_s": None, "hints": [hint]}, Recording()
        return {"total": None, "latency_s": round(latency_s, 3), "hints": []}, Recording()
