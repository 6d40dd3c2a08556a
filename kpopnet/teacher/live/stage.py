"""The process that watches the learner: camera, pose and score, in real time and away from the server.

The camera is read in a thread (`watching.NewestImage`); each image that is fetched is followed by its pose and its score. The
server sends ("prepare", number, lesson, dance), ("go", seconds), ("resume", seconds), ("stop",) and ("quit",); back come the
number of the lesson, a kind, its content as JSON, and a picture, the learner's joints or None.
"""

import contextlib
import time
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np
from numba.core import event

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.calibration import Calibration
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.running import RunningLesson
from kpopnet.teacher.live.watching import CameraOpener, NewestImage, load_estimator, noise_of

PICTURE_WIDTH = 160
NEAR_M, FAR_M = 0.5, 5.5
"""Range of depth that the picture shows."""

STEADY_FRAMES, STEADY_S = 5, 0.15
"""The estimator is ready when it took less than STEADY_S seconds for so many images one after another."""

KERNELS = 60
"""About how many kernels are compiled where nothing is cached: for the progress bar."""

FRAME_PATIENCE_S = 0.2
NOBODY_PATIENCE_S = 20.0
"""Without anybody in view the lesson is ready all the same after so many seconds: the page says that nobody is there."""


class Settings(NamedTuple):
    """What a stage is made with: how cameras are opened, and the checkpoint of `load_estimator`."""

    opener: CameraOpener
    checkpoint: str | None


def run_stage(connection: Connection, settings: Settings) -> None:
    """Serves lessons until the other end says so, or closes."""
    with contextlib.suppress(EOFError, BrokenPipeError, KeyboardInterrupt):
        Stage(connection, settings).serve()


class _Compilation(event.Listener):
    """Counts kernels while they are compiled."""

    def __init__(self) -> None:
        self.kernels = 0

    def on_start(self, event: event.Event) -> None:
        self.kernels += 1

    def on_end(self, event: event.Event) -> None:
        pass


class Stage:
    """Holds the estimator, which stays warm from lesson to lesson."""

    def __init__(self, connection: Connection, settings: Settings) -> None:
        self._connection, self._settings, self._number = connection, settings, 0
        self._compilation = _Compilation()
        event.register("numba:compile", self._compilation)
        self._estimator = load_estimator(settings.checkpoint)

    def serve(self) -> None:
        """Answers the server's messages."""
        while (message := self._connection.recv())[0] != "quit":
            if message[0] != "prepare":
                continue  # of a lesson that has ended
            self._number = message[1]
            try:
                self._hold(*message[2:])
            except InputError as error:
                self._tell("error", {"text": str(error)})

    def _tell(self, kind: str, content: dict, attached: Any = None) -> None:
        self._connection.send((self._number, kind, content, attached))

    def _hold(self, lesson: Lesson, dance: TaughtDance) -> None:
        self._tell("preparing", {"fraction": 0.0, "text": "opening the camera"})
        clock = DanceClock(lesson.from_s, lesson.speed)
        running = (Calibration if lesson.calibrate else RunningLesson)(lesson, dance, noise_of(self._estimator))
        images = NewestImage(camera := self._settings.opener(lesson, dance, clock))
        self._estimator.reset()
        self._away = ""
        try:
            self._warm(running, images, camera.camera)
            size = {"width": camera.camera.width, "height": camera.camera.height}
            self._tell("ready", size | {"from_s": running.begin_s, "to_s": running.end_s})
            while self._obey(running, clock):
                self._step(running, images, camera.camera, clock)
        finally:
            images.close()

    def _obey(self, running: RunningLesson, clock: DanceClock) -> bool:
        """Follows the server's messages; False where the lesson ends."""
        while self._connection.poll():
            message = self._connection.recv()
            if message[0] == "go":
                running.begin()
                clock.start(message[1])
            elif message[0] == "resume":
                clock.resume(message[1])
            elif message[0] in ("stop", "quit"):
                return False
        return True

    def _warm(self, running: RunningLesson, images: NewestImage, camera: Camera) -> None:
        """Compiles everything that the lesson needs, with progress, until poses come in real time."""
        running.rehearse()
        steady, began = 0, time.monotonic()
        while steady < STEADY_FRAMES and time.monotonic() - began < NOBODY_PATIENCE_S + self._compilation.kernels:
            image = images.fetch(FRAME_PATIENCE_S)
            if image is None:
                if images.ended:
                    raise InputError(images.error or "the recording ended before the dance began")
                if images.away:
                    began = time.monotonic()
                    self._tell("preparing", {"fraction": 0.0, "text": images.away})
                continue
            before = time.monotonic()
            people = self._estimator.update(image.depth_m, camera)
            steady = steady + 1 if people and time.monotonic() - before < STEADY_S else 0
            fraction = min(self._compilation.kernels / KERNELS, 0.9)
            text = "preparing the scorer for this machine, once" if self._compilation.kernels else "looking for you"
            self._tell("preparing", {"fraction": fraction, "text": text})

    def _step(self, running: RunningLesson, images: NewestImage, camera: Camera, clock: DanceClock) -> None:
        """One image: pose, score, and what the page shows of it."""
        image = images.fetch(FRAME_PATIENCE_S)
        self._mind(images.away, running, clock)
        if image is not None:
            person = running.learner.choose(self._estimator.update(image.depth_m, camera), image.taken)
            joints_m, confidence = (None, None) if person is None else person[1:]
            running.score(clock, image, joints_m, confidence)
            shown = running.shown(clock, image, joints_m, confidence, camera)
            shown |= {"dropped": images.dropped}
            shown["age_ms"] = round(1000 * (time.monotonic() - image.taken))
            running.count(shown["age_ms"])
            self._tell("frame", shown, picture(image.depth_m))
        if (judged := running.next_verdict(clock)) is not None:
            self._tell("verdict", judged)
        if clock.running and (running.is_over(clock) or images.ended):
            clock.stop()
            result, recording = running.finish(images.dropped)
            self._tell("done", result, recording.arrays())
        elif images.ended:
            raise InputError(images.error or "the recording of depth has ended")

    def _mind(self, away: str, running: RunningLesson, clock: DanceClock) -> None:
        """While the camera is away the dance stands still where the learner was seen last; the page asks to resume it."""
        if away and clock.running:
            clock.pause(running.seen_s)
        if away and not self._away:
            self._tell("away", {"text": away})
        elif self._away and not away:
            self._tell("back", {"from_s": clock.paused_s})
        self._away = away


def picture(depth_m: np.ndarray) -> bytes:
    """A small picture of (H, W) depth: width and height as two uint16, then a byte a pixel, 0 not measured, 1 near, 255 far."""
    stride = max(1, round(depth_m.shape[1] / PICTURE_WIDTH))
    small = depth_m[::stride, ::stride]
    shade = 1 + np.clip((small - NEAR_M) / (FAR_M - NEAR_M), 0, 1) * 254
    pixels = np.where(small > 0, shade, 0).astype(np.uint8)
    return np.array(pixels.shape[::-1], "<u2").tobytes() + pixels.tobytes()
