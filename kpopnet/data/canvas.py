"""What the finder sees of an image of any size: its pixels, reduced until they fit into CANVAS."""

from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera

CANVAS = (160, 128)
"""Width and height in pixels."""

STRIDE = 2
"""Pixels of the canvas from one cell, of which the finder's network says something, to the next."""


class Reduced(NamedTuple):
    """An image in the upper left corner of a canvas."""

    depth_m: np.ndarray  # (128, 160) float32 depth in metres, 0 where nothing was measured and outside the image
    intrinsics: np.ndarray  # (4,) float32 fx, fy, cx, cy of the canvas
    reduction: float  # pixels of the image to one of the canvas; below 1 for small images


def reduced(depth_m: np.ndarray, camera: Camera) -> Reduced:
    """Takes the pixels of a (H, W) image, float32 metres, that are nearest to those of the canvas."""
    reduction = max(camera.width / CANVAS[0], camera.height / CANVAS[1])
    rows, columns = (((np.arange(size) + 0.5) * reduction).astype(int) for size in CANVAS[::-1])
    rows, columns = rows[rows < camera.height], columns[columns < camera.width]
    out = np.zeros(CANVAS[::-1], np.float32)
    out[: len(rows), : len(columns)] = depth_m.take(rows, 0).take(columns, 1)  # rows first: both at once take longer
    intrinsics = camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5
    return Reduced(
        out, np.array(intrinsics, np.float32) / np.float32(reduction) - np.array((0, 0, 0.5, 0.5), np.float32), reduction
    )
