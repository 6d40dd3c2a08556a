"""The process that watches the learner: camera, pose and score, in real time and away from the server.

The camera is read in a thread (`watching.NewestImage`); each image that is fetched is followed by its pose and its score. The
server sends ("prepare", number, lesson, dance), ("go", seconds), ("resume", seconds), ("stop",) and ("quit",); back come the
number of the lesson, a kind, its content as JSON, and a picture, the learner's joints or None.
"""

import contextlib
import math
import time
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np
from numba.core import event

from kpopnet.camera import Camera
from kpopnet.dance.config import SCORERS
from kpopnet.dance.online import OnlineScore, OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore, ScorerConfig
from kpopnet.errors import InputError
from kpopnet.teacher.library import TaughtDance
from kpopnet.teacher.live.guidance import latest_words, where_to_stand
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.verdict import Recording, verdict
from kpopnet.teacher.live.watching import CameraOpener, Image, Learner, NewestImage, load_estimator, noise_of

PICTURE_WIDTH = 160
NEAR_M, FAR_M = 0.5, 5.5
"""Range of depth that the picture shows."""

STEADY_FRAMES, STEADY_S = 5, 0.15
"""The estimator is ready when it took less than STEADY_S seconds for so many images one after another."""

KERNELS = 60
"""About how many kernels are compiled where nothing is cached: for the progress bar."""

WORDS_EVERY_S = 0.25
BRIDGE_FPS, MAX_BRIDGE_S = 15.0, 0.5
"""A slow machine drops images. Between images less than MAX_BRIDGE_S seconds of the dance apart joints are interpolated at
BRIDGE_FPS; longer gaps stay gaps."""

PRAISED_FROM = 90.0
"""A window with at least this score is praised: what differs in it may be the estimator's errors."""

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
        running = RunningLesson(lesson, dance, noise_of(self._estimator))
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

    def _obey(self, running: "RunningLesson", clock: DanceClock) -> bool:
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

    def _warm(self, running: "RunningLesson", images: NewestImage, camera: Camera) -> None:
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

    def _step(self, running: "RunningLesson", images: NewestImage, camera: Camera, clock: DanceClock) -> None:
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
        if clock.running and (running.is_over(clock) or images.ended):
            clock.stop()
            result, recording = running.finish(images.dropped)
            self._tell("done", result, recording.arrays())
        elif images.ended:
            raise InputError(images.error or "the recording of depth has ended")

    def _mind(self, away: str, running: "RunningLesson", clock: DanceClock) -> None:
        """While the camera is away the dance stands still where the learner was seen last; the page asks to resume it."""
        if away and clock.running:
            clock.pause(running.seen_s)
        if away and not self._away:
            self._tell("away", {"text": away})
        elif self._away and not away:
            self._tell("back", {"from_s": clock.paused_s})
        self._away = away


class RunningLesson:
    """The score of one lesson, try after try."""

    def __init__(self, lesson: Lesson, dance: TaughtDance, noise: str) -> None:
        self.lesson, self.about, self.learner = lesson, dance.about, Learner()
        self.begin_s, self.end_s = lesson.excerpt_s(len(dance.joints_m) / dance.fps)
        self._config = scorer_config(lesson, noise)
        self._teacher = excerpt(dance.performance, self.begin_s, self.end_s)
        self._ages_ms: list[int] = []
        self.begin()

    def begin(self) -> None:
        """Starts the score of a try."""
        self._scorer, self._recording = OnlineScorer(self._teacher, self._config), Recording()
        self._latest: OnlineScore | None = None
        self._words, self._told_at = "", -math.inf
        self._ages_ms.clear()

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
        return self._recording.times_s[-1] + self._config.latency_s if self._recording.times_s else self.begin_s

    def count(self, age_ms: int) -> None:
        self._ages_ms.append(age_ms)

    def is_over(self, clock: DanceClock) -> bool:
        return clock.dance_s(time.monotonic()) > self.end_s + self._config.latency_s + 0.1

    def score(self, clock: DanceClock, image: Image, joints_m: np.ndarray | None, confidence: np.ndarray | None) -> None:
        """Adds an image's joints to the score, if the dance is going on and somebody is there."""
        time_s = clock.dance_s(image.taken)
        if not clock.running or joints_m is None or confidence is None or time_s < self.begin_s:
            return
        if self._recording.times_s and time_s <= self.seen_s:
            return
        confidence = np.clip(confidence, 0, 1)
        for between_s, between_m in self._bridge(time_s, joints_m):
            self._scorer.update(between_m, between_s, confidence)
        self._recording.add(time_s - self._config.latency_s, joints_m, confidence)
        self._latest = self._scorer.update(joints_m, time_s, confidence)
        if self._latest is not None and time_s - self._told_at >= WORDS_EVERY_S * self.lesson.speed:
            self._told_at = time_s
            so_far = self._scorer.score_so_far()
            self._words = "" if so_far is None else latest_words(so_far)

    def _bridge(self, time_s: float, joints_m: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """Times and joints on straight lines from the last image's to these, where some images were dropped in between."""
        if not self._recording.times_s:
            return []
        before_s, before_m = self.seen_s, self._recording.joints_m[-1]
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
        ages = np.array(self._ages_ms or [0])
        notes = {
            "frames": len(self._recording.times_s),
            "fps": _short(len(self._recording.times_s) / (self.end_s - self.begin_s) * self.lesson.speed),
            "dropped": dropped,
            "age_ms_median": float(np.median(ages)),
            "age_ms_p95": float(np.percentile(ages, 95)),
        }
        return verdict(score, self.lesson, self.about, notes), self._recording


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


def picture(depth_m: np.ndarray) -> bytes:
    """A small picture of (H, W) depth: width and height as two uint16, then a byte a pixel, 0 not measured, 1 near, 255 far."""
    stride = max(1, round(depth_m.shape[1] / PICTURE_WIDTH))
    small = depth_m[::stride, ::stride]
    shade = 1 + np.clip((small - NEAR_M) / (FAR_M - NEAR_M), 0, 1) * 254
    pixels = np.where(small > 0, shade, 0).astype(np.uint8)
    return np.array(pixels.shape[::-1], "<u2").tobytes() + pixels.tobytes()


def _short(value: float | None) -> float | None:
    return round(float(value), 3) if value is not None and math.isfinite(value) else None
