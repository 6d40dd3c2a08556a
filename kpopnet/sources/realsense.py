"""Depth of RealSense cameras, from their recordings and live, by the maker's library; the extra `realsense`."""

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera, depth_in_metres, measured
from kpopnet.errors import InputError
from kpopnet.languages import Said
from kpopnet.runtime.input_files import expect, first_line, parsing
from kpopnet.runtime.provenance import optional_library
from kpopnet.sources.source import SEARCH_EVERY_S, SILENCE_S, CameraAwayError, Recording, StoredImage

NAME = "RealSense camera"
WAIT_MS, PATIENCE_MS = 200, 5000
"""How often to ask whether the recording has ended, and how long the library may take for one image."""

START_S = 10.0
"""How long the first image after a start may take, seconds."""

USUAL_FPS, USUAL_WIDTH = 30, 640


def library(where: str) -> Any:
    """The module pyrealsense2; raises InputError where it does not load."""
    with optional_library(where, "pyrealsense2", "realsense", " (on Linux it needs libusb, the package libusb-1.0-0)"):
        import pyrealsense2
    return pyrealsense2


def _camera_of(profile: Any, where: str) -> Camera:
    lens = profile.get_intrinsics()
    return Camera.from_numbers((lens.fx, lens.fy, lens.ppx, lens.ppy, lens.width, lens.height), f"{where}: intrinsics")


def _depth_of(frame: Any) -> np.ndarray:
    """The (H, W) depth of a depth frame: uint16 millimetres, or float32 metres where the camera's unit is another."""
    depth, unit_m = np.array(frame.get_data()), frame.get_units()
    return depth if np.isclose(unit_m, 1 / MM_PER_METRE) else measured(depth) * np.float32(unit_m)


def read_bag(path: Path) -> Recording:
    """A recording of a RealSense camera: its depth, times and intrinsics."""
    found = library(str(path))
    with parsing(str(path), "not a RealSense recording with depth, or damaged"):
        # It is not played for that: at times the library crashes where a recording is stopped as soon as it plays.
        sensors = found.context().load_device(str(path)).query_sensors()
        profiles = [profile for sensor in sensors for profile in _depth_profiles(sensor)]
        expect(bool(profiles), str(path), "a stream of depth")
        depth = profiles[0]
        camera, fps = _camera_of(depth, str(path)), float(depth.fps())
    return Recording(lambda: _images(path), camera.width, camera.height, None, fps, camera)


def _images(path: Path) -> Iterator[StoredImage]:
    stopped = library(str(path)).playback_status.stopped
    with _playing(path) as (pipeline, playback):
        first_ms, number, waited_ms = None, 0, 0
        while waited_ms < PATIENCE_MS:
            found, frames = pipeline.try_wait_for_frames(WAIT_MS)
            if not found and playback.current_status() == stopped:
                break
            waited_ms = 0 if found else waited_ms + WAIT_MS
            if found and (frame := frames.get_depth_frame()):
                first_ms = frame.get_timestamp() if first_ms is None else first_ms
                yield StoredImage(_depth_of(frame), f"{path}: frame {number}", (frame.get_timestamp() - first_ms) / 1000)
                number += 1


@contextlib.contextmanager
def _playing(path: Path) -> Iterator[tuple[Any, Any]]:
    """The library's pipeline that plays a recording once, as fast as it is read, and what plays it."""
    found = library(str(path))
    pipeline, config = found.pipeline(), found.config()
    with parsing(str(path), "not a RealSense recording with depth, or damaged"):
        config.enable_device_from_file(str(path), repeat_playback=False)
        config.enable_stream(found.stream.depth)
        playback = config.resolve(found.pipeline_wrapper(pipeline)).get_device().as_playback()
        playback.set_real_time(False)  # before it starts: else images are lost that are not asked for yet
        pipeline.start(config)
        try:
            yield pipeline, playback
        finally:
            pipeline.stop()


def connected_device() -> Any | None:
    """The first connected device of the library, None without one."""
    return next(iter(library(NAME).context().query_devices()), None)


class RealSenseCamera:
    """A live camera, which may be unplugged and plugged in again; a `LiveCamera`."""

    def __init__(self, find: Callable[[], Any | None] = connected_device) -> None:
        """Opens the camera whose device `find` returns, None where there is none: then InputError is raised."""
        self._library, self._find = library(NAME), find
        self._sensor: Any | None = None
        self.camera: Camera | None = None
        try:
            self._connect()
        except CameraAwayError as error:
            raise InputError(error.said) from error

    def read(self) -> tuple[np.ndarray, float]:
        if self._sensor is None:
            time.sleep(SEARCH_EVERY_S)
            self._connect()
        try:
            found, frame = self._queue.try_wait_for_frame(round(1000 * self._patience_s))
        except RuntimeError:  # it is torn out while it is asked
            found = False
        taken = time.monotonic()
        if not found:
            self.close()
            raise CameraAwayError("the camera sends no images; look at its cable")
        self._patience_s = SILENCE_S
        return depth_in_metres(_depth_of(frame.as_depth_frame()), self.camera, where=NAME, unit_known=True), taken

    def close(self) -> None:
        sensor, self._sensor = self._sensor, None
        if sensor is not None:
            with contextlib.suppress(RuntimeError):  # of a camera that has gone
                sensor.stop()
                sensor.close()

    def _connect(self) -> None:
        """Starts the depth of the device; of several images that wait, the queue of one keeps the newest."""
        try:
            device = self._find()
            sensors = [] if device is None else device.query_sensors()
            offers = [(sensor, profile) for sensor in sensors for profile in _depth_profiles(sensor)]
            if not offers:
                raise CameraAwayError("no RealSense camera with depth is connected; plug it in")
            sensor, profile = min(offers, key=lambda offer: _unusual(offer[1]))
            camera = _camera_of(profile, NAME)
            if self.camera not in (None, camera):
                raise InputError("another camera was plugged in; start again")
            queue = self._library.frame_queue(1)
            sensor.open(profile)
            try:
                sensor.start(queue)
            except RuntimeError:
                with contextlib.suppress(RuntimeError):
                    sensor.close()
                raise
        except RuntimeError as error:
            raise CameraAwayError(Said("the camera does not start ({reason})", reason=first_line(error))) from error
        self._sensor, self._queue, self.camera, self._patience_s = sensor, queue, camera, START_S


def _depth_profiles(sensor: Any) -> list[Any]:
    """A sensor's profiles of 16-bit depth, as profiles of video."""
    profiles = [one for one in sensor.get_stream_profiles() if one.stream_type().name == "depth" and one.format().name == "z16"]
    return [one.as_video_stream_profile() for one in profiles]


def _unusual(profile: Any) -> tuple[bool, int, int]:
    """Orders profiles: the sensor's own choice first, then what is nearest to the usual rate and size."""
    return not profile.is_default(), abs(profile.fps() - USUAL_FPS), abs(profile.width() - USUAL_WIDTH)
