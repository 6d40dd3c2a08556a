"""Depth of Luxonis' OAK cameras, live, by the maker's library; the extra `oak`."""

import contextlib
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.runtime.input_files import first_line
from kpopnet.runtime.provenance import optional_library
from kpopnet.sources.camera_files import optics
from kpopnet.sources.lenses import View
from kpopnet.sources.source import SEARCH_EVERY_S, SILENCE_S, CameraAwayError, CameraClock

NAME = "OAK camera"
SIZE, FPS = (640, 400), 30.0

START_S = 10.0
"""How long a camera may take for its first image: it is sent its program first."""


def library(where: str) -> Any:
    """The module depthai; raises InputError where it does not load."""
    with optional_library(where, "depthai", "oak"):
        import depthai
    return depthai


def stereo_pipeline() -> tuple[Any, Any]:
    """A pipeline of the library for the first connected camera, and its output of depth in millimetres."""
    found = library(NAME)
    if not found.Device.getAllAvailableDevices():  # a pipeline would look for one for ten seconds
        raise CameraAwayError("no OAK camera is connected; plug it in")
    pipeline = found.Pipeline()
    return pipeline, pipeline.create(found.node.StereoDepth).build(True, size=SIZE, fps=FPS).depth


class OakCamera:
    """A live camera, which may be unplugged and plugged in again; a `LiveCamera`."""

    def __init__(self, build: Callable[[], tuple[Any, Any]] = stereo_pipeline) -> None:
        """Opens the camera of a pipeline. Raises InputError where there is none."""
        self._closed_queue = library(NAME).MessageQueue.QueueException
        self._build, self._pipeline = build, None
        self.camera: Camera | None = None
        self._view: View | None = None
        self._clock = CameraClock()
        try:
            self._connect()
        except CameraAwayError as error:
            raise InputError(error.said) from error

    def read(self) -> tuple[np.ndarray, float]:
        if self._pipeline is None:
            time.sleep(SEARCH_EVERY_S)
            self._connect()
        frame = self._next(SILENCE_S)
        now = time.monotonic()
        depth_m = depth_in_metres(frame.getFrame(), where=NAME, unit_known=True)
        return self._view.image(depth_m), self._clock.moment(frame.getTimestamp().total_seconds(), now)

    def close(self) -> None:
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            with contextlib.suppress(RuntimeError):  # of a camera that has gone
                pipeline.stop()
                pipeline.wait()

    def _next(self, patience_s: float) -> Any:
        """The next frame; of several that wait, the queue of one keeps the newest."""
        try:
            frame = self._queue.get(timedelta(seconds=patience_s))
        except (RuntimeError, self._closed_queue):  # it is torn out while it is asked
            frame = None
        if frame is None:
            self.close()
            raise CameraAwayError("the camera sends no images; look at its cable")
        return frame

    def _connect(self) -> None:
        """Starts the depth of the camera, and stops it again where that fails: what was never opened is never closed."""
        try:
            self._start()
            self._look_through(self._next(START_S))
        except BaseException:
            self.close()
            raise

    def _start(self) -> None:
        try:
            self._pipeline, output = self._build()
            self._queue = output.createOutputQueue(maxSize=1, blocking=False)
            self._pipeline.start()
        except RuntimeError as error:
            raise CameraAwayError(Said("no OAK camera starts ({reason}); plug it in", reason=first_line(error))) from error

    def _look_through(self, frame: Any) -> None:
        """Takes the intrinsics, and what is left of the lens's distortion, from the camera's first image."""
        seen = frame.getTransformation()
        (fx, _, cx), (_, fy, cy), _ = seen.getIntrinsicMatrix()
        camera = Camera.from_numbers((fx, fy, cx, cy, frame.getWidth(), frame.getHeight()), f"{NAME}: intrinsics")
        view = optics(camera, seen.getDistortionCoefficients(), str(seen.getDistortionModel()), NAME).view()
        if self.camera not in (None, view.camera):
            raise InputError("another camera was plugged in; start again")
        self._view, self.camera = view, view.camera
