"""Skeletons over the depth images of a recording, as a sheet, a video or a GIF."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.viz.drawing import ESTIMATED, depth_rgb, draw_skeleton, enlarged, sheet, with_captions

VIDEO_WIDTH_PX, GIF_WIDTH_PX, TILE_WIDTH_PX = 640, 400, 320
TILES_PER_ROW = 4
MOST_GIF_FRAMES = 200
LEAST_GIF_FRAME_MS = 20
"""Browsers show frames of less than this much later than they should."""


def overlay_image(depth_m: np.ndarray, camera: Camera, people_camera_m: Sequence[np.ndarray], width_px: int) -> np.ndarray:
    """Draws the skeletons of people over a depth image.

    Args:
        depth_m: (H, W) metres.
        camera: its camera.
        people_camera_m: (15, 3) joints of each person in metres; NaN where missing.
        width_px: least width of the drawing; the image is enlarged by a whole number.

    Returns:
        RGB whose width and height are even, as video codecs want them.
    """
    image = enlarged(depth_rgb(depth_m), camera.width * max(1, round(width_px / camera.width)))
    for joints_m in people_camera_m:
        draw_skeleton(image, joints_m, camera, ESTIMATED)
    return np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), mode="edge")


def overlay_sheet(tiles: Sequence[tuple[str, np.ndarray]], title: str) -> np.ndarray:
    """Arranges drawings of equal size in rows, each with its caption, with a legend above."""
    small = [with_captions(resized(image, TILE_WIDTH_PX), (caption,)) for caption, image in tiles]
    rows = [("", small[start : start + TILES_PER_ROW]) for start in range(0, len(small), TILES_PER_ROW)]
    return sheet(rows, (ESTIMATED,), title)


def resized(image: np.ndarray, width_px: int) -> np.ndarray:
    """Shrinks an image to a width."""
    height_px = round(image.shape[0] * width_px / image.shape[1])
    return cv2.resize(image, (width_px, height_px), interpolation=cv2.INTER_AREA)


class Video:
    """Writes an .mp4 file frame by frame: H.264 by PyAV where that is installed, else MPEG-4 by OpenCV.

    Used as a context; the file appears whole when it ends.
    """

    def __init__(self, path: Path, fps: float) -> None:
        """`path` ends with .mp4; `fps` are frames per second."""
        self._path, self._fps = path, fps
        self._stack, self._write = ExitStack(), None

    def __enter__(self) -> "Video":
        self._part = self._stack.enter_context(atomic_path(self._path))
        return self

    def __exit__(self, *error: Any) -> None:
        self._stack.__exit__(*error)

    def add(self, image: np.ndarray) -> None:
        """Appends an (H, W, 3) uint8 RGB image of even width and height, of the same size as all others."""
        if self._write is None:
            self._write = self._stack.enter_context(_encoder(self._part, self._fps, image.shape[0], image.shape[1]))
        self._write(image)


@contextmanager
def _encoder(part: Path, fps: float, height_px: int, width_px: int) -> Iterator[Callable[[np.ndarray], None]]:
    """A function that appends an image to the video in `part`, whose name tells no format."""
    try:
        import av
    except ImportError:
        av = None
    if av is not None and "libx264" in av.codecs_available:
        with av.open(str(part), "w", format="mp4", options={"movflags": "+faststart"}) as container:
            rate = Fraction(fps).limit_denominator(1001)
            stream = container.add_stream("libx264", rate=rate, options={"crf": "23", "preset": "veryfast"})
            stream.width, stream.height, stream.pix_fmt = width_px, height_px, "yuv420p"
            yield lambda image: container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            container.mux(stream.encode())
        return
    named = part.with_suffix(".mp4")  # OpenCV takes the format from the name
    writer = cv2.VideoWriter(str(named), cv2.VideoWriter.fourcc(*"mp4v"), fps, (width_px, height_px))
    try:
        if not writer.isOpened():
            raise InputError("no encoder for videos: install PyAV, pip install 'kpopnet[video]'")
        yield lambda image: writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        writer.release()
        named.replace(part)
    finally:
        writer.release()
        named.unlink(missing_ok=True)


def save_gif(path: Path, images: Sequence[np.ndarray], frame_s: float) -> None:
    """Writes (H, W, 3) uint8 RGB images of one size as a GIF that repeats.

    Args:
        path: of the file.
        images: at least one.
        frame_s: seconds that each is shown.
    """
    colours = Image.fromarray(images[len(images) // 2]).quantize(255)
    frames = [Image.fromarray(image).quantize(palette=colours, dither=Image.Dither.NONE) for image in images]
    duration_ms = max(round(1000 * frame_s), LEAST_GIF_FRAME_MS)
    with atomic_path(path) as part:
        frames[0].save(
            part, format="GIF", save_all=True, append_images=frames[1:], duration=duration_ms, loop=0, optimize=False
        )
