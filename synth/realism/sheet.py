"""The comparison as an image: random real frames on the left, random generated ones on the right, at the same scale."""

import cv2
import numpy as np

from kpopnet.viz.drawing import BACKGROUND, depth_rgb, sheet, with_captions
from synth.realism.shapes import Frame, distance_m
from synth.realism.sources import Source

SIDE_M, SIDE_PX = 2.2, 230
"""Size of a tile at the person's distance, and in the image."""

ROWS, COLUMNS = 3, 3
"""Rows for each kind of frames, and tiles of each origin in a row."""


def comparison_sheet(real: Source | None, synthetic: Source, seed: int) -> np.ndarray:
    """RGB image of random frames, upright people above, all poses below; without a real source of generated ones only."""
    rng = np.random.default_rng([seed, 2])
    rows = []
    for kind in ("upright", "frames"):
        chosen = [_chosen(rng, getattr(source, kind)) for source in (real, synthetic) if source is not None]
        for row in range(ROWS):
            tiles = [tile(frame) for frames in chosen for frame in frames[row * COLUMNS : (row + 1) * COLUMNS]]
            if tiles:
                rows.append(("", _with_gap(tiles, 0 if real is None else len(chosen[0][row * COLUMNS : (row + 1) * COLUMNS]))))
    left = "" if real is None else f"left: {real.name}, real; "
    return sheet(rows, (), f"{left}right: generated, after the sensor. Every tile is {SIDE_M} m wide at the person")


def _chosen(rng: np.random.Generator, frames: list[Frame]) -> list[Frame]:
    return [frames[index] for index in rng.permutation(len(frames))[: ROWS * COLUMNS]]


def _with_gap(tiles: list[np.ndarray], after: int) -> list[np.ndarray]:
    gap = np.full((tiles[0].shape[0], 12, 3), 255, np.uint8)
    return [*tiles[:after], gap, *tiles[after:]] if 0 < after < len(tiles) else tiles


def tile(frame: Frame) -> np.ndarray:
    """A frame's surroundings of the person as a square image, SIDE_M wide at the person's median distance, with its name."""
    rows, columns = np.nonzero(frame.depth_m)
    if not len(rows):
        return with_captions(np.full((SIDE_PX, SIDE_PX, 3), BACKGROUND, np.uint8), (frame.name,))
    scale = SIDE_PX * distance_m(frame) / (SIDE_M * frame.camera.fx)
    u, v = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
    shift = (SIDE_PX - 1) / 2
    placed = np.array([[scale, 0, shift - scale * u], [0, scale, shift - scale * v]])
    image = cv2.warpAffine(
        depth_rgb(frame.depth_m), placed, (SIDE_PX, SIDE_PX), flags=cv2.INTER_NEAREST, borderValue=BACKGROUND
    )
    return with_captions(image, (frame.name,))
