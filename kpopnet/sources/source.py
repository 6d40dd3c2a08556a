"""Where depth comes from, image by image: a recording, or a live camera."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from kpopnet.camera import MAX_IMAGE_PIXELS, Camera, depth_in_metres, measured, tells_unit
from kpopnet.errors import InputError
from kpopnet.sources.lenses import Lens, View

MAX_FRAMES = 1_000_000
"""Longest recording in images, nine hours at 30 a second: it bounds the memory that joints take."""


class StoredImage(NamedTuple):
    """One image as a file holds it."""

    depth: np.ndarray  # (H, W) uint16 millimetres or float metres; numbers of another unit where the recording states it
    where: str  # file and frame, for messages
    time_s: float | None = None  # when it was taken, in seconds; None where the file does not state it


class Recording(NamedTuple):
    """What the reader of one kind of file finds; None where the file does not state it."""

    # reads the images, `width` x `height` pixels, in order; each call begins with the first one
    images: Callable[[], Iterator[StoredImage]]
    width: int
    height: int
    frames: int | None = None  # number of images
    fps: float | None = None  # images per second
    camera: Camera | None = None
    lens: Lens | None = None  # of the camera; None for a pinhole
    # how many of the stored numbers make a metre; None for millimetres of integers and metres of floats
    units_per_m: float | None = None


class TimedDepth(NamedTuple):
    """One depth image of a recording."""

    time_s: float  # seconds, more than that of the image before
    depth_m: np.ndarray  # (H, W) float32 metres, 0 where nothing was measured


@dataclass(frozen=True)
class DepthSource:
    """Depth images of one camera; they may be iterated several times, and need not fit into memory."""

    name: str  # of the file or folder, for messages
    stored: Camera  # the camera of the images as the file holds them
    view: View  # the pinhole camera of the images that are given, without the lens's distortion, and upright
    fps: float  # images per second
    fps_is_known: bool  # whether the file or the user gave `fps`; else it is a default
    frames: int | None  # number of images, None where it is known only after reading
    images: Callable[[], Iterator[StoredImage]]  # reads the images as the file holds them
    file_times: bool = True  # whether times are the file's; else they follow from `fps`
    units_per_m: float | None = None  # see `Recording`

    @property
    def camera(self) -> Camera:
        """The camera of the images that are given."""
        return self.view.camera

    def __iter__(self) -> Iterator[np.ndarray]:
        """The images, (H, W) float32 metres; raises as `timed`."""
        return (image.depth_m for image in self.timed())

    def timed(self) -> Iterator[TimedDepth]:
        """The images with their times.

        Raises InputError: no image, or one that is damaged, no depth, not of the camera's size, or not after the one before.
        """
        before_s, unit_known = -np.inf, False
        for number, image in enumerate(self.images()):
            if number >= MAX_FRAMES:
                raise InputError(f"{self.name}: more than {MAX_FRAMES:,} images; cut it into parts")
            depth = image.depth if self.units_per_m is None else measured(image.depth) / np.float32(self.units_per_m)
            depth_m = depth_in_metres(depth, self.stored, where=image.where, unit_known=unit_known)
            unit_known = unit_known or tells_unit(depth_m)
            time_s = image.time_s if self.file_times and image.time_s is not None else number / self.fps
            if not before_s < time_s < np.inf:
                raise InputError(
                    f"{image.where}: taken at {time_s:g} s, after one at {before_s:g} s; give the images per second "
                    "(--fps), which then replace the file's times"
                )
            before_s = time_s
            yield TimedDepth(time_s, self.view.image(depth_m))
        if before_s == -np.inf:
            raise InputError(f"{self.name}: no image in it")


MOST_TIMES_AS_LONG = 64
"""Longer side of an image over its shorter one: drawn at a given width, a strip would have no height, or take gigabytes."""

LONGEST_SIDE = 16_384
"""Pixels; no encoder of H.264 takes more."""


def check_size(where: str, width: int, height: int, frames: int | None = None) -> None:
    """Raises InputError for images, or a number of them, that no depth camera makes, before memory is taken for them."""
    if not (width > 0 and height > 0 and width * height <= MAX_IMAGE_PIXELS):
        raise InputError(f"{where}: images of {width}x{height} pixels; expected 1 to {MAX_IMAGE_PIXELS:,} pixels")
    if max(width, height) > LONGEST_SIDE:
        raise InputError(f"{where}: images of {width}x{height} pixels; expected sides of at most {LONGEST_SIDE:,} pixels")
    if max(width, height) > MOST_TIMES_AS_LONG * min(width, height):
        expected = f"one side at most {MOST_TIMES_AS_LONG} times as long as the other"
        raise InputError(f"{where}: images of {width}x{height} pixels; expected {expected}")
    if frames is not None and not 0 < frames <= MAX_FRAMES:
        raise InputError(f"{where}: {frames:,} images; expected 1 to {MAX_FRAMES:,}")


def rate(times_s: Sequence[float] | np.ndarray | None) -> float | None:
    """Images per second by the median step of (T,) times; None for fewer than two."""
    if times_s is None or len(times_s) < 2:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(1 / np.median(np.diff(times_s)))


class CameraAwayError(Exception):
    """The camera sends no images just now; a later call may find it again. The text says what to do."""

    @property
    def said(self) -> str:
        """The text as a page is told it: one that is `kpopnet.languages.Said` can be worded there."""
        return self.args[0]


SILENCE_S = 1.0
"""A live camera that sends nothing for this time is away; a time that lies farther back is one of another clock."""

SEARCH_EVERY_S = 0.3
"""How often a camera that is away is looked for."""


class CameraClock:
    """When the images of a live camera were taken, in seconds of `time.monotonic`, each later than the one before."""

    def __init__(self) -> None:
        self._before_s = -math.inf

    def moment(self, stated_s: float | None, arrived_s: float) -> float:
        """What the camera states, if that is a time of this clock and not before the last image; else when the image arrived.

        After a stall the first images are old and count as taken when they arrive: those that follow were stated to be earlier.
        """
        if stated_s is None or not 0 <= arrived_s - stated_s < SILENCE_S or stated_s <= self._before_s:
            stated_s = arrived_s
        self._before_s = stated_s
        return stated_s


class LiveCamera(Protocol):
    """A depth camera, or what stands in for one."""

    camera: Camera

    def read(self) -> tuple[np.ndarray, float] | None:
        """Waits for the next image: (H, W) float32 depth of the whole scene, metres, 0 where nothing was measured, and when it
        was taken, in seconds of `time.monotonic`; None after the last one of a recording.

        Raises CameraAwayError: no image came for a while, and the next call looks for the camera again; InputError: there will
        be no more images.
        """

    def close(self) -> None:
        """Lets go of the camera."""
