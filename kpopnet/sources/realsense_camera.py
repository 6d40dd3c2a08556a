"""A live RealSense camera, which may be unplugged and plugged in again; the extra `realsense`."""

import contextlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.sources.live import CameraAwayError
from kpopnet.sources.realsense import camera_of, depth_of, library

NAME = "RealSense camera"
USUAL_FPS, USUAL_WIDTH = 30, 640
SILENCE_MS = 1000
"""A camera that sends nothing for so long has gone."""

SEARCH_EVERY_S = 0.3


def connected_device() -> Any | None:
    """The first connected device of the library, None without one."""
    return next(iter(library(NAME).context().query_devices()), None)


class RealSenseCamera:
    """A `LiveCamera` of the library's.

    Attributes:
        camera: the intrinsics of its depth.
    """

    def __init__(self, find: Callable[[], Any | None] = connected_device) -> None:
        """Opens the camera.

        Args:
            find: finds the device, None where there is none.

        Raises:
            InputError: the library is missing, or no camera with depth is connected.
        """
        self._library, self._find = library(NAME), find
        self._sensor: Any | None = None
        self.camera: Camera | None = None
        try:
            self._connect()
        except CameraAwayError as error:
            raise InputError(str(error)) from error

    def read(self) -> tuple[np.ndarray, float]:
        """See `LiveCamera.read`."""
        if self._sensor is None:
            time.sleep(SEARCH_EVERY_S)
            self._connect()
        try:
            found, frame = self._queue.try_wait_for_frame(SILENCE_MS)
        except RuntimeError:  # it is torn out while it is asked
            found = False
        taken = time.monotonic()
        if not found:
            self.close()
            raise CameraAwayError("the camera sends no images; look at its cable")
        return depth_in_metres(depth_of(frame.as_depth_frame()), self.camera, where=NAME), taken

    def close(self) -> None:
        """See `LiveCamera.close`."""
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
            camera = camera_of(profile, NAME)
            if self.camera not in (None, camera):
                raise InputError("another camera was plugged in; start the dance again")
            queue = self._library.frame_queue(1)
            sensor.open(profile)
            try:
                sensor.start(queue)
            except RuntimeError:
                with contextlib.suppress(RuntimeError):
                    sensor.close()
                raise
        except RuntimeError as error:
            raise CameraAwayError(f"the camera does not start ({next(iter(str(error).splitlines()), '')[:200]})") from error
        self._sensor, self._queue, self.camera = sensor, queue, camera


def _depth_profiles(sensor: Any) -> list[Any]:
    """A sensor's profiles of 16-bit depth, as profiles of video."""
    profiles = [one for one in sensor.get_stream_profiles() if one.stream_type().name == "depth" and one.format().name == "z16"]
    return [one.as_video_stream_profile() for one in profiles]


def _unusual(profile: Any) -> tuple[bool, int, int]:
    """Orders profiles: the sensor's own choice first, then what is nearest to the usual rate and size."""
    return not profile.is_default(), abs(profile.fps() - USUAL_FPS), abs(profile.width() - USUAL_WIDTH)
