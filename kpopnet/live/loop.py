"""Watches a camera: newest image, all people's joints, streams and recordings; in a process of its own where a page looks on.

The server sends ("record", on), ("joints", on), ("pause", on), ("watched", on) and ("quit",). It gets a kind, its content as
JSON, and a picture of the depth or None.
"""

import contextlib
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.live.keeping import WRITING, DepthRecorder, JointKeeper
from kpopnet.live.streams import ReaderGoneError, Seen, open_stream
from kpopnet.runtime.endings import OF_TERMINAL, of_the_disk
from kpopnet.runtime.parallel import end_with_parent
from kpopnet.sources.live import Image, NewestImage, PlayedRecording
from kpopnet.sources.source import CameraAwayError, LiveCamera
from kpopnet.teacher.live.loop import STEADY_FRAMES, STEADY_S, load_estimator, picture
from kpopnet.teacher.live.words import rounded

PICTURE_WIDTH = 320
NOBODY_S = 3.0
"""After this time it is taken to be warm although no person is in view."""

ASK_EVERY_S = 0.1
RATE_IMAGES = 30
"""Images over which their number a second is measured."""


@dataclass(frozen=True)
class Watching:
    """What is watched and how; it travels to another process."""

    name: str  # of the source
    open_camera: Callable[[], LiveCamera]  # opens it; a function of a module
    folder: Path  # of recordings and joints
    checkpoint: str | None = None  # of `load_estimator`
    people: int = 16  # largest number of people
    stream: str | None = None  # a kind of `open_stream`, None for none
    port: int | None = None  # of the stream, None for the usual one


Tell = Callable[..., None]
Orders = Callable[[], Iterator[tuple]]


class Watcher:
    """Estimates all people's joints in the newest image until the source ends or the user quits."""

    def __init__(self, watching: Watching, tell: Tell, orders: Orders) -> None:
        """Opens the source; `tell` takes what the page shows (kind, content, picture), `orders` gives what it asks for."""
        self._estimator = load_estimator(watching.checkpoint, watching.people)
        self._stream_to, self._stream = (watching.stream, watching.port), None
        self._camera = watching.open_camera()
        self._opened: LiveCamera | NewestImage = self._camera  # what is closed in the end
        self._name, self._tell, self._orders = watching.name, tell, orders
        self._depth, self._joints = DepthRecorder(watching.folder, self._camera.camera), JointKeeper(watching.folder)
        self._away, self._paused, self._watched, self._quit, self._is_warm = "", False, False, False, False
        self._first: float | None = None
        self._number, self._dropped = 0, 0
        self._done: deque[float] = deque(maxlen=RATE_IMAGES)

    def run(self) -> None:
        """Watches. Raises InputError where the source fails, ReaderGoneError where no program reads the stream any more."""
        self._tell("opened", {"name": self._name, "camera": astuple(self._camera.camera)})
        try:
            with open_stream(*self._stream_to) as self._stream:
                if self._warm():
                    self._go_on()
        finally:
            self._order(("record", False))
            self._order(("joints", False))
            self._follow_news()
            self._opened.close()  # last: it may wait for the camera

    def _warm(self) -> bool:
        """Handles each image in turn until joints come in real time or it is paused; a recording waits for this.

        False at the end of a recording, or where the user quits.
        """
        steady, began, compiled, image = 0, time.monotonic(), False, None
        while steady < STEADY_FRAMES and time.monotonic() - began < NOBODY_S:
            self._follow()
            if self._quit:
                return False
            if compiled and self._paused:
                return True
            try:
                read = self._camera.read()
            except CameraAwayError as error:
                self._follow_away(str(error))
                began = time.monotonic()
                continue
            if read is None:
                if image is not None and not self._number and not self._paused:
                    self._see(image)  # a short recording: all of it came while kernels were compiled
                return False
            image, before = Image(*read), time.monotonic()
            if not compiled:  # the first time on a machine this takes up to a minute
                self._estimator.update(image.depth_m, self._camera.camera)
                self._estimator.reset()
                compiled, began = True, time.monotonic()
                if self._paused or not isinstance(self._camera, PlayedRecording):
                    continue  # its image is old by now
                image, before = image._replace(taken=began), began
            self._depth.add(image)
            people = self._see(image)
            steady = steady + 1 if people and time.monotonic() - before < STEADY_S else 0
        return True

    def _go_on(self) -> None:
        images = self._opened = NewestImage(self._camera, self._keep)
        self._is_warm = True
        self._hold(self._paused)
        while not self._quit and not images.ended:
            self._follow()
            image = images.fetch(ASK_EVERY_S)
            self._follow_away(images.away)
            self._dropped = images.dropped
            if image is not None and not self._paused:
                self._see(image)
        if images.error:
            raise InputError(images.error)

    def _keep(self, image: Image) -> None:
        if not self._paused:
            self._depth.add(image)

    def _see(self, image: Image) -> int:
        """One image: joints, stream, and what the page shows; the number of people."""
        self._follow_away("")
        found = self._estimator.update(image.depth_m, self._camera.camera, image.taken)
        people = [one._replace(identity=one.identity + 1, network=None) for one in found]  # of which an hour may be kept
        now = time.monotonic()
        self._first = image.taken if self._first is None else self._first
        seen = Seen(self._number, image.taken - self._first, 1000 * (now - image.taken), people)
        self._number += 1
        self._done.append(now)
        if self._stream is not None:
            try:
                self._stream(seen)
            except BrokenPipeError as error:
                raise ReaderGoneError("no program reads the stream any more") from error
            except OSError as error:
                raise InputError(f"--stream {self._stream_to[0]}: {of_the_disk(error)}") from error
        if self._joints.add(seen):
            self._order(("joints", False))
            self._order(("joints", True))  # no page has asked for an end
        if self._watched:
            self._tell("frame", self._shown(seen), picture(image.depth_m, PICTURE_WIDTH))
        return len(people)

    def _shown(self, seen: Seen) -> dict:
        seconds, clock_s = self._done[-1] - self._done[0], time.time() - time.monotonic()
        people = [
            {
                "identity": one.identity,
                "joints": [[rounded(v, 3) for v in row] for row in np.column_stack([one.joints_camera_m, one.confidence])],
            }
            for one in seen.people
        ]
        return {
            "time_s": rounded(seen.time_s, 2), "taken_ms": rounded(1000 * (clock_s + self._done[-1]) - seen.delay_ms, 1),
            "delay_ms": rounded(seen.delay_ms, 1), "dropped": self._dropped,
            "fps": rounded((len(self._done) - 1) / seconds, 1) if seconds > 0 else None,
            "depth": self._depth.state, "joints": self._joints.state, "people": people,
        }  # fmt: skip

    def _follow(self) -> None:
        """Does what the page asks."""
        for order in self._orders():
            self._order(order)
            self._tell("state", self.state)
        self._follow_news()

    def _follow_news(self) -> None:
        if news := self._depth.news():
            self._tell("said", {"text": news})
            self._tell("state", self.state)

    def _order(self, order: tuple) -> None:
        what, *on = order
        try:
            match what, on:
                case "record", [True]:
                    self._depth.start()
                case "record", _:
                    self._depth.stop()
                case "joints", [True]:
                    self._joints.start()
                case "joints", _:
                    if text := self._joints.write():
                        self._tell("said", {"text": text})
                case "pause", [paused]:
                    self._hold(paused)
                case "watched", [watched]:
                    self._watched = watched
                case "quit", _:
                    self._quit = True
                    self._hold(False)  # a recording that stands still would be waited for
        except (InputError, *WRITING) as error:
            self._tell("said", {"text": f"not saved: {of_the_disk(error)}"})

    def _hold(self, paused: bool) -> None:
        self._paused = paused
        if isinstance(self._camera, PlayedRecording):
            self._camera.paused = paused and self._is_warm  # before, this thread itself reads it

    @property
    def state(self) -> dict:
        """What goes on, and what is the matter with the camera, "" for nothing."""
        recording, keeping = self._depth.state is not None, self._joints.state is not None
        return {"paused": self._paused, "recording": recording, "keeping": keeping, "text": self._away, "ended": False}

    def _follow_away(self, away: str) -> None:
        if away != self._away:
            self._away = away
            self._tell("state", self.state)


def serve_watching(connection: Connection, watching: Watching) -> None:
    """Watches until the other end of the connection says so, or closes; it reports a source that ends or fails."""
    end_with_parent()
    for number in OF_TERMINAL:  # they reach the server too, which asks to end: joints are saved then
        signal.signal(number, signal.SIG_IGN)

    def tell(kind: str, content: dict, attached: bytes | None = None) -> None:
        connection.send((0, kind, content, attached))

    def orders() -> Iterator[tuple]:
        nonlocal is_over
        while connection.poll():
            order = connection.recv()
            is_over |= order[0] == "quit"
            yield order

    is_over, text = False, f"{watching.name} has ended"
    with contextlib.suppress(EOFError, BrokenPipeError):
        try:
            Watcher(watching, tell, orders).run()
        except InputError as error:
            text = str(error)
        tell("state", {"paused": False, "recording": False, "keeping": False, "text": text, "ended": True})
        while not is_over:
            is_over = connection.recv()[0] == "quit"
