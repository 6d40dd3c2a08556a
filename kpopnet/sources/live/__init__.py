"""Live depth: cameras by their names, how they are mounted, and the newest image of one."""

import gc
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import NamedTuple

import numpy as np

from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.sources import realsense
from kpopnet.sources.lenses import View
from kpopnet.sources.live import oak, pipe
from kpopnet.sources.source import CameraAwayError, DepthSource, LiveCamera, TimedDepth

LIVE_CAMERAS = {
    "realsense": "a RealSense camera (the extra realsense)",
    "oak": "an OAK camera (the extra oak)",
    "-": "depth that another program sends to standard input",
    "tcp:127.0.0.1:PORT": "depth that another program offers at a port of this machine",
    "unix:PATH": "depth that another program offers at a socket",
}
"""The live cameras: name to what it is."""

_KINDS = {"realsense": (realsense.library, realsense.RealSenseCamera), "oak": (oak.library, oak.OakCamera)}
"""Of cameras that need one: what checks that it is installed, given a place for messages, and what opens the camera."""


def check_live(name: str, where: str) -> str:
    """Returns what the live camera of a name is.

    Raises InputError, which names the place `where`, for an unknown camera or one whose library is missing.
    """
    if name in _KINDS:
        _KINDS[name][0](where)
    elif name.startswith(pipe.STDIN):
        name = "-"
    elif name.startswith(pipe.SCHEMES):
        return f"depth from {pipe.check_address(name)}"
    elif name not in LIVE_CAMERAS:
        raise InputError(f"{where}: no live camera {name}; there are {', '.join(LIVE_CAMERAS)}")
    return LIVE_CAMERAS[name].partition(" (")[0]


def is_live(name: str) -> bool:
    """Whether a name is meant for a live camera, and not for a file."""
    return name in LIVE_CAMERAS or name.startswith(pipe.SCHEMES)


def open_live(name: str, rotate_deg: int = 0) -> LiveCamera:
    """Opens the live camera of a name that `shared_live` gives; its images are turned clockwise by 0, 90, 180 or 270 degrees.

    Raises InputError: there is no such camera, its library is missing, or none is connected.
    """
    check_live(name, name)
    camera = _KINDS[name][1]() if name in _KINDS else pipe.PipeCamera(name)
    return TurnedCamera(camera, rotate_deg) if rotate_deg else camera


@contextmanager
def shared_live(name: str | None) -> Iterator[str | None]:
    """The name by which other processes open a live camera: standard input reaches them through a port with a secret."""
    if name != "-":
        yield name
        return
    with closing(pipe.Relay()) as relay:
        yield relay.address


class TurnedCamera:
    """A camera that is mounted on its side or head; a `LiveCamera`."""

    def __init__(self, camera: LiveCamera, clockwise_deg: int) -> None:
        self._mounted, self._view = camera, View(camera.camera).rotated(clockwise_deg)
        self.camera = self._view.camera

    def read(self) -> tuple[np.ndarray, float] | None:
        if (read := self._mounted.read()) is None:
            return None
        depth_m, taken = read
        return self._view.image(depth_m), taken

    def close(self) -> None:
        self._mounted.close()


class PlayedRecording:
    """A recording that is played in its own time, once or again and again; a `LiveCamera`.

    Where images are not fetched in time, or while it is paused, it stands still, and where reading takes longer than recording
    took, it plays more slowly: no image is left out.

    Attributes:
        paused: whether it stands still.
    """

    def __init__(self, open_source: Callable[[], DepthSource], loop: bool = False) -> None:
        self._source, self._loop, self._closed = open_source(), loop, False
        self.camera, self.paused = self._source.camera, False
        self._images: Iterator[TimedDepth] = self._source.timed()
        self._start: float | None = None

    def read(self) -> tuple[np.ndarray, float] | None:
        image = next(self._images, None)
        if image is None and self._loop:
            self._images, self._start = self._source.timed(), None
            image = next(self._images, None)
        if image is None:
            return None
        while not self._closed and (self.paused or self._early_s(image) > 0):
            time.sleep(WAIT_S if self.paused else min(max(self._early_s(image), 0), WAIT_S))
        now = time.monotonic()
        if self._start is None or self._early_s(image) < -LATE_S:
            self._start = now - image.time_s
        return None if self._closed else (image.depth_m, now)

    def _early_s(self, image: TimedDepth) -> float:
        """Seconds until an image is due."""
        return 0.0 if self._start is None else self._start + image.time_s - time.monotonic()

    def close(self) -> None:
        self._closed = True


WAIT_S, LATE_S = 0.05, 0.1
"""Longest wait without a look at orders; a recording that is read later than the second has stood still, and goes on there."""


class Image(NamedTuple):
    """One image: (H, W) metres, and when it was taken, in seconds of `time.monotonic`."""

    depth_m: np.ndarray
    taken: float


class NewestImage:
    """Reads a camera in a thread of its own and keeps the newest image: what is not fetched in time is dropped.

    Attributes:
        dropped: number of images that were not fetched.
        away: what to do about a camera that sends nothing just now, "" while images come.
        error: why reading ended, None while it goes on.
    """

    def __init__(self, camera: LiveCamera, keep: Callable[[Image], None] = lambda image: None) -> None:
        """Begins to read; `keep` gets every image, after it was offered."""
        self.dropped, self.away, self.error = 0, "", None
        self._camera, self._keep, self._image, self._ended = camera, keep, None, False
        self._changed = threading.Condition()
        # Once in some minutes Python looks through all objects for garbage: of all that was imported 70 to 120 ms, in which no
        # thread goes on. From here on it looks through new objects alone. Circles that the lessons before left, of learners
        # and rooms, are collected first: frozen they would never be.
        gc.unfreeze()
        gc.collect()
        gc.freeze()
        self._thread = threading.Thread(target=self._read, daemon=True, name="camera")
        self._thread.start()

    def fetch(self, timeout_s: float) -> Image | None:
        """The newest image that was not fetched before; None if none comes in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._image is not None or self._ended, timeout_s)
            image, self._image = self._image, None
            return image

    @property
    def ended(self) -> bool:
        return self._ended and self._image is None

    def close(self) -> None:
        self._ended = True
        self._thread.join(timeout=5)
        self._camera.close()

    def _read(self) -> None:
        try:
            while not self._ended:
                try:
                    read = self._camera.read()
                except CameraAwayError as error:
                    self.away = error.said
                    continue
                if read is None:
                    break
                image = Image(*read)
                with self._changed:
                    self.dropped += self._image is not None
                    self._image, self.away = image, ""
                    self._changed.notify()
                self._keep(image)
        except Exception as error:
            self.error = Said(
                "the camera stopped: {reason}", reason=error.said if isinstance(error, InputError) else str(error)
            )
        with self._changed:
            self._ended = True
            self._changed.notify()
