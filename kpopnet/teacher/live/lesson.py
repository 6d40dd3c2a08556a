"""What the page asks for: a dance, or an excerpt of it, at a speed, before a camera; and the clock of the dance."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from kpopnet.errors import InputError, check_between
from kpopnet.languages import Said
from kpopnet.sources.source import LiveCamera
from kpopnet.teacher.library import IDENTITY, MOST_DANCERS, TaughtDance

CALIBRATION_BEAT_S = 1.0
MOST_LEARNERS = 3
MIN_EXCERPT_S = 2.5
"""A window of the score lasts 2 s."""

BOUNDS = {
    "speed": (0.25, 1.5), "latency_s": (-1, 1), "from_s": (0, 7200), "to_s": (0, 7200), "seed": (0, 2**31),
    "people": (1, MOST_LEARNERS), "dancer": (0, MOST_DANCERS - 1),
}  # fmt: skip


@dataclass(frozen=True)
class Lesson:
    """One try of a dance."""

    dance: str  # its identity in the library
    source: str = "simulated"  # name of the source of depth; simulated for a learner made by a program
    skill: str = "good"  # how well a simulated learner dances
    fault: str = ""  # the fault that a simulated learner has, "" for none
    seed: int = 0  # of a simulated learner's body, room and errors
    speed: float = 1.0  # of the dance, 1 for its own tempo; more where it follows the beats of a faster song
    from_s: float = 0.0  # start of the excerpt, seconds of the dance at its own tempo
    to_s: float = 0.0  # its end; 0 for the end of the dance
    mirrored: bool = True  # whether the teacher is shown as in a mirror: the learner's left is the teacher's left
    latency_s: float = 0.0  # delay of camera, sound and display, taken off the learner's times, seconds
    calibrate: bool = False  # that delay is measured: the learner raises an arm every CALIBRATION_BEAT_S, nothing is scored
    record: bool = False  # the page, which may make a dance of them, is told the joints of each image in metres
    who: str = ""  # the profile whose try it is, "" for none; of several learners the first's
    people: int = 1  # learners beside each other
    dancer: int = 0  # whom of a group the learner dances, from 0 on the group's left; of several learners the one on their left

    def __post_init__(self) -> None:
        if not IDENTITY.fullmatch(self.dance):
            raise InputError("there is no such dance")
        for name, (least, most) in BOUNDS.items():
            check_between(name, getattr(self, name), least, most)
        if self.calibrate and self.people > 1:
            raise InputError(Said("the latency is measured with one learner"))

    def excerpt_s(self, dance_s: float) -> tuple[float, float]:
        """Start and end in seconds of the excerpt of a dance of this length. Raises InputError if it is too short to score."""
        end_s = min(self.to_s or dance_s, dance_s)
        if end_s - self.from_s < MIN_EXCERPT_S:
            text = "from {start} to {end} s: choose at least {least} s of the dance"
            raise InputError(Said(text, start=f"{self.from_s:g}", end=f"{end_s:g}", least=f"{MIN_EXCERPT_S:g}"))
        return self.from_s, end_s


class DanceClock:
    """Says where in the dance a moment lies; before it is started it stands at the excerpt's start."""

    def __init__(self, from_s: float, speed: float) -> None:
        self._begin_s, self._speed = from_s, speed
        self.stop()

    @property
    def running(self) -> bool:
        return self._start < math.inf

    @property
    def stopped(self) -> bool:
        """Whether it stands at the excerpt's start: it neither runs nor was interrupted."""
        return self._start == math.inf

    def start(self, in_s: float) -> None:
        """The dance begins `in_s` seconds from now."""
        self.stop()
        self._start = time.monotonic() + in_s

    def stop(self) -> None:
        """It stands at the excerpt's start again."""
        self._from_s, self._start = self._begin_s, math.inf
        self.paused_s: float | None = None  # where in the dance it was interrupted

    def pause(self, at_s: float) -> None:
        """It stands still at a time of the dance."""
        self._from_s = self.paused_s = at_s
        self._start = math.nan

    def resume(self, in_s: float) -> None:
        """After a pause the dance goes on `in_s` seconds from now."""
        if self.paused_s is not None:
            self.paused_s, self._start = None, time.monotonic() + in_s

    def dance_s(self, moment: float) -> float:
        """Seconds of the dance at a moment of `time.monotonic`; before its start, less than the start of the excerpt."""
        return self._from_s + (moment - self._start) * self._speed if self.running else self._from_s


CameraOpener = Callable[[Lesson, TaughtDance, DanceClock], LiveCamera]
"""Opens the source of depth that a lesson names. It is passed to other processes, so it must be a function of a module."""
