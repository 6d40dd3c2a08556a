"""Skeletons over the depth images of a recording, as a sheet, a video or a GIF."""

import errno
import os
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.provenance import install_command
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import BACKGROUND, ESTIMATED, TEXT, enlarged, scene_tile, sheet, with_captions

VIDEO_WIDTH_PX, GIF_WIDTH_PX, TILE_WIDTH_PX = 640, 400, 320
MOST_HEIGHT_PX = 2048
TILES_PER_ROW = 4
MOST_GIF_FRAMES = 200
LEAST_GIF_FRAME_MS = 20
"""Browsers show frames of less than this much later than they should."""


def overlay_image(depth_m: np.ndarray, camera: Camera, people_camera_m: Sequence[np.ndarray], width_px: int) -> np.ndarray:
    """Draws the (15, 3) joints of people in metres, NaN where missing, over (H, W) depth in metres.

    Of several each has its number above the head, as their files have. RGB, enlarged by the whole number that comes closest to
    `width_px`; even in width and height, as video codecs want.
    """
    # Of a narrow image the height is what limits it.
    factor = max(min(round(width_px / camera.width), MOST_HEIGHT_PX // camera.height), 1)
    image = scene_tile(depth_m, camera, ((joints_m, ESTIMATED) for joints_m in people_camera_m), factor * camera.width)
    for number, joints_m in enumerate(people_camera_m if len(people_camera_m) > 1 else (), 1):
        u, v, z = camera.project(joints_m[Joint.HEAD])
        if z > 0 and 0 <= u < camera.width and 0 <= v < camera.height:
            at = round(factor * u) - 8, max(round(factor * v) - 28, 20)
            for colour, width in ((BACKGROUND, 5), (TEXT, 2)):
                cv2.putText(image, str(number), at, cv2.FONT_HERSHEY_SIMPLEX, 0.8, colour, width, cv2.LINE_AA)
    return np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), mode="edge")


def overlay_sheet(tiles: Sequence[tuple[str, np.ndarray]], title: str) -> np.ndarray:
    """Arranges drawings of equal size in rows, each with its caption, with a legend above."""
    small = [with_captions(resized(image, TILE_WIDTH_PX), (caption,)) for caption, image in tiles]
    rows = [("", small[start : start + TILES_PER_ROW]) for start in range(0, len(small), TILES_PER_ROW)]
    return sheet(rows, (ESTIMATED,), title)


def resized(image: np.ndarray, width_px: int) -> np.ndarray:
    return enlarged(image, width_px, cv2.INTER_AREA)


def write_video(path: Path, images: Iterable[np.ndarray], fps: float) -> None:
    """Writes an .mp4 file: H.264 by PyAV where that is installed, else MPEG-4 by OpenCV. It appears whole when `images` end.

    These are at least one, (H, W, 3) uint8 RGB, all of one even width and height. Raises InputError without any encoder.
    """
    try:
        import av
    except ImportError:
        av = None
    images = iter(images)
    first = next(images)
    height_px, width_px = first.shape[:2]
    with atomic_path(path) as part:
        if av is not None and "libx264" in av.codecs_available:
            with av.open(str(part.absolute()), "w", format="mp4", options={"movflags": "+faststart"}) as container:
                rate = Fraction(fps).limit_denominator(1001)
                stream = container.add_stream("libx264", rate=rate, options={"crf": "23", "preset": "veryfast"})
                stream.width, stream.height, stream.pix_fmt = width_px, height_px, "yuv420p"
                for image in chain([first], images):
                    container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
                container.mux(stream.encode())
            return
        named = part.with_suffix(".mp4")  # OpenCV takes the format from the name
        writer = cv2.VideoWriter(str(named), cv2.VideoWriter.fourcc(*"mp4v"), fps, (width_px, height_px))
        try:
            if not writer.isOpened():
                raise InputError(f"no encoder for videos; install PyAV: {install_command('video')}")
            for image in chain([first], images):
                writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
            writer.release()
            if not cv2.VideoCapture(str(named)).isOpened():  # OpenCV does not tell of a full disk
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
            named.replace(part)
        finally:
            writer.release()
            named.unlink(missing_ok=True)


def save_gif(path: Path, images: Sequence[np.ndarray], frame_s: float) -> None:
    """Writes at least one (H, W, 3) uint8 RGB images of one size as a GIF that repeats and shows each for `frame_s` seconds."""
    colours = Image.fromarray(images[len(images) // 2]).quantize(255)
    frames = [Image.fromarray(image).quantize(palette=colours, dither=Image.Dither.NONE) for image in images]
    duration_ms = max(round(1000 * frame_s), LEAST_GIF_FRAME_MS)
    with atomic_path(path) as part:
        frames[0].save(
            part, format="GIF", save_all=True, append_images=frames[1:], duration=duration_ms, loop=0, optimize=False
        )
