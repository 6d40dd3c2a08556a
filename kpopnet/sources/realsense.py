"""Depth of RealSense cameras, from their recordings and live, by the maker's library; the extra `realsense`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.errors import InputError
from kpopnet.sources.arrays import rate_of
from kpopnet.sources.source import Recording, StoredImage, check_size

WAIT_MS, PATIENCE_MS = 200, 5000
"""How often to ask whether the recording has ended, and how long the library may take for one image."""

MILLIMETRE = 1 / MM_PER_METRE


def library(where: str) -> Any:
    """The module pyrealsense2.

    Raises:
        InputError: it is missing, or does not load.
    """
    try:
        import pyrealsense2
    except ImportError as error:
        raise InputError(
            f"{where}: needs pyrealsense2, which does not load ({error}); install it: pip install "
            "'kpopnet[realsense]' (on Linux it needs libusb, the package libusb-1.0-0)"
        ) from error
    return pyrealsense2


def camera_of(profile: Any, where: str) -> Camera:
    """The camera of a profile of video.

    Raises:
        InputError: its images are empty or too large, or its intrinsics are none.
    """
    lens = profile.get_intrinsics()
    check_size(where, lens.width, lens.height)
    return Camera.from_numbers((lens.fx, lens.fy, lens.ppx, lens.ppy, lens.width, lens.height), f"{where}: intrinsics")


def depth_of(frame: Any) -> np.ndarray:
    """The (H, W) depth of a depth frame: uint16 millimetres, or float32 metres where the camera's unit is another."""
    depth, unit_m = np.array(frame.get_data()), frame.get_units()
    return depth if np.isclose(unit_m, MILLIMETRE) else depth.astype(np.float32) * np.float32(unit_m)


def read_bag(path: Path, key: str | None) -> Recording:
    """A recording of a RealSense camera: its depth, times and intrinsics.

    Raises:
        InputError: the library is missing, the file is no such recording or has no depth, or a key is given.
    """
    if key is not None:
        raise InputError(f"{path}: a RealSense recording has no arrays by name, such as {key}")
    player = _Player(path)
    try:
        profile = player.depth_profile()
        camera, fps = camera_of(profile, str(path)), profile.fps()
    finally:
        player.close()
    return Recording(lambda: _images(path), camera.width, camera.height, None, rate_of(str(path), None, float(fps)), camera)


def _images(path: Path) -> Iterator[StoredImage]:
    player, first_ms, number = _Player(path), None, 0
    try:
        for number, frame in enumerate(player.depth_frames()):
            first_ms = frame.get_timestamp() if first_ms is None else first_ms
            yield StoredImage(depth_of(frame), f"{path}: frame {number}", (frame.get_timestamp() - first_ms) / 1000)
    finally:
        player.close()
    if first_ms is None:
        raise InputError(f"{path}: no depth image in it")


class _Player:
    """Plays a recording once, as fast as it is read."""

    def __init__(self, path: Path) -> None:
        self._path, self._library = path, library(str(path))
        self._pipeline, config = self._library.pipeline(), self._library.config()
        try:
            config.enable_device_from_file(str(path), repeat_playback=False)
            config.enable_stream(self._library.stream.depth)
            self._profile = self._pipeline.start(config)
            self._playback = self._profile.get_device().as_playback()
            self._playback.set_real_time(False)
        except RuntimeError as error:
            raise InputError(f"{path}: not a RealSense recording with depth ({_line(error)})") from error

    def depth_profile(self) -> Any:
        """The stream of depth, as a profile of video."""
        return self._profile.get_stream(self._library.stream.depth).as_video_stream_profile()

    def depth_frames(self) -> Iterator[Any]:
        """The frames of depth, each valid until the next."""
        stopped, waited_ms = self._library.playback_status.stopped, 0
        try:
            while waited_ms < PATIENCE_MS:
                found, frames = self._pipeline.try_wait_for_frames(WAIT_MS)
                if not found and self._playback.current_status() == stopped:
                    return
                waited_ms = 0 if found else waited_ms + WAIT_MS
                if found and (depth := frames.get_depth_frame()):
                    yield depth
        except RuntimeError as error:
            raise InputError(f"{self._path}: a damaged RealSense recording ({_line(error)})") from error

    def close(self) -> None:
        """Ends playing."""
        self._pipeline.stop()


def _line(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)[:200]
