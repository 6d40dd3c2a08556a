"""Refines the masks of the people whom the finder found: a network segments each again, in a crop of their own.

The finder sees the whole image, reduced; its masks lose hands and feet, and take in parts of others and of things. In the cube
around a person everybody is of one size however far away, and it is known whose pixels are sought (as the mask head of
Mask R-CNN, He et al. 2017, is for each box).
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.data.canvas import STRIDE
from kpopnet.data.cube import PLAIN_VIEW, Cube, crop_pixels
from kpopnet.data.person_masks import CROP_PX, HALF_M, OTHER, OWN
from kpopnet.finder.people import BESIDE_M, BESIDE_PER_M, NO_PERSON
from kpopnet.networks.backend import filters, onnx_session
from kpopnet.weights import shipped

INPUTS, OUTPUT_NAMES = ("depth_m", "owner", "centre_m"), ("probability",)
Network = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From (B, S, S) float32 metres, (B, S, S) uint8 OWN, OTHER or 0, and (B, 3) float32 metres to the (B, S / 2, S / 2)
probability that a crop's cells, its every second pixel, show its person."""

THEIRS_FROM = 0.35
"""Pixels of this probability or more are the person's."""

REACH_M = 1.3
"""No person reaches farther behind or before their torso."""

NEAREST_M = 0.1
"""A torso that is voted nearer to the camera counts as that near."""


@cache
def open_masks() -> Network:
    """The mask network that comes with the package, which ONNX Runtime runs. Opened once, on one thread.

    Raises InputError if it is missing.
    """
    stored, graph = shipped("masks")
    session = onnx_session(graph, graph.read_bytes(), filters(stored))
    return lambda *crops: session.run(list(OUTPUT_NAMES), dict(zip(INPUTS, crops, strict=True)))[0]


def scene_crops(
    depth_m: np.ndarray, camera: Camera, owners: np.ndarray, centres_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The crops of the scene around P people: (P, S, S) depth in metres, 0 where nothing was measured and beyond the image;
    (P, S, S) uint8 OWN, OTHER or 0; and (P, 2, 2) float64 step and first, so that a pixel of the crop lies at step x pixel +
    first of the image, in x, then in y.

    From (H, W) float32 metres, the (H, W) uint8 person of each pixel, 1..P, and the (P, 3) float32 centres, metres, Z > 0.
    """
    count = len(centres_m)
    crops_m, owner = np.empty((count, CROP_PX, CROP_PX), np.float32), np.empty((count, CROP_PX, CROP_PX), np.uint8)
    to_image = np.empty((count, 2, 2))
    for row, centre_m in enumerate(centres_m):
        step, first = crop_pixels(camera, Cube(centre_m, HALF_M), CROP_PX, PLAIN_VIEW)
        to_image[row] = np.column_stack([np.diag(step), first])
        columns, rows = np.floor(to_image[row] @ [np.arange(CROP_PX), np.ones(CROP_PX)] + 0.5).astype(int)
        for image, crop in ((depth_m, crops_m[row]), (owners, owner[row])):
            # Rows before columns: both at once take five times as long.
            crop[:] = image.take(rows, 0, mode="clip").take(columns, 1, mode="clip")
            crop[(rows < 0) | (rows >= camera.height)] = 0
            crop[:, (columns < 0) | (columns >= camera.width)] = 0
        kinds = np.full(256, OTHER, np.uint8)
        kinds[NO_PERSON], kinds[row + 1] = 0, OWN
        owner[row] = kinds[owner[row]]
    return crops_m, owner, to_image


def refine_masks(
    network: Network, depth_m: np.ndarray, camera: Camera, owners: np.ndarray, centres_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gives every pixel to a person anew; arguments as of `scene_crops`.

    A pixel is the person's of whom the cells around it say so most surely; one that no crop shows, or where the cells around do
    not agree and none is at its depth, stays whose it was. (H, W) uint8 person of each pixel, and (P, 4) int32 x0, y0, x1, y1
    of their pixels, the last two exclusive; of who keeps none all 0.
    """
    centres_m = np.maximum(centres_m, np.float32([-np.inf, -np.inf, NEAREST_M]))
    crops_m, owner, maps = scene_crops(depth_m, camera, owners, centres_m)
    probability = network(crops_m, owner, centres_m)
    cells_m = np.ascontiguousarray(crops_m[:, ::STRIDE, ::STRIDE])
    decided, surest = owners.copy(), np.zeros(owners.shape, np.float32)
    for number, (person, cell_m, to_image, centre_m) in enumerate(zip(probability, cells_m, maps, centres_m, strict=True), 1):
        least, most = (look(person, np.ones((4, 4)), anchor=(1, 1)) for look in (cv2.erode, cv2.dilate))
        columns, rows = (
            np.clip(_first_pixels(*along, len(person)), 0, size)
            for along, size in zip(to_image, depth_m.shape[::-1], strict=True)
        )
        crop = _Crop(person, least, most, cell_m, centre_m[2], to_image, rows, columns)
        _decide(depth_m, crop, number, decided, surest)
    x, y, width, height = cv2.boundingRect(np.minimum(decided, 1))
    within = decided[y : y + height, x : x + width]
    boxes = np.reshape([cv2.boundingRect((within == number).view(np.uint8)) for number in range(1, len(crops_m) + 1)], (-1, 4))
    boxes[:, :2] += (x, y)
    boxes[:, 2:] += boxes[:, :2]
    return decided, boxes.astype(np.int32)


class _Crop(NamedTuple):
    """What is known of a person's cells, h x w, and which pixels of the image lie between them."""

    probability: np.ndarray  # (h, w) that a cell shows the person
    least: np.ndarray  # (h, w) of the 4 x 4 cells around the pixels between each cell and the next
    most: np.ndarray  # (h, w) likewise
    cells_m: np.ndarray  # (h, w) depth of the cells, metres, 0 where nothing was measured
    centre_z: np.float32  # metres
    to_image: np.ndarray  # (2, 2) as of `scene_crops`
    rows: np.ndarray  # (h + 1,) first row of the image at or behind each row of cells, and that behind the last
    columns: np.ndarray  # (w + 1,) likewise


def _first_pixels(step: float, first: float, cells: int) -> np.ndarray:
    """(cells + 1,) int the first pixel of the image at or behind each cell, and the first behind the crop's last pixel."""
    ends = np.append(STRIDE * np.arange(cells), CROP_PX - 1) * step + first
    return np.ceil(ends).astype(int)


@njit(cache=True)
def _decide(depth_m, crop, number, decided, surest):
    """Gives a person's pixels to them, and takes those that are not theirs from them.

    Where the 4 x 4 cells around a pixel agree they decide: against the person whatever their depths, for them where the cell
    before it is at the pixel's. Elsewhere their mean does, weighed by how near they are in the image and in depth. Nothing out
    of reach is theirs.
    """
    h, w = crop.probability.shape
    for top in range(h):
        for left in range(w):
            low, high = crop.least[top, left], crop.most[top, left]
            for y in range(crop.rows[top], crop.rows[top + 1]):
                for x in range(crop.columns[left], crop.columns[left + 1]):
                    z = depth_m[y, x]
                    may_be_theirs = high >= THEIRS_FROM and abs(z - crop.centre_z) <= REACH_M
                    if z == 0 or not (may_be_theirs or decided[y, x] == number):
                        continue
                    if not may_be_theirs:
                        theirs = np.float32(0)
                    elif low >= THEIRS_FROM and abs(crop.cells_m[top, left] - z) < BESIDE_M:
                        theirs = crop.probability[top, left]
                    else:
                        theirs = _said(crop, top, left, y, x, z)
                    if theirs > surest[y, x] and theirs >= THEIRS_FROM:
                        decided[y, x], surest[y, x] = number, theirs
                    elif 0 <= theirs < THEIRS_FROM and decided[y, x] == number:
                        decided[y, x] = NO_PERSON


@njit(cache=True)
def _said(crop, top, left, y, x, z):
    """What the cells around a pixel say in the mean; -1 where none is at its depth."""
    h, w = crop.probability.shape
    at_y = (y - crop.to_image[1, 1]) / crop.to_image[1, 0] / STRIDE
    at_x = (x - crop.to_image[0, 1]) / crop.to_image[0, 0] / STRIDE
    reach, total, weights = np.float32(BESIDE_M + BESIDE_PER_M * z), np.float32(0), np.float32(0)
    for row in range(max(top - 1, 0), min(top + 3, h)):
        for column in range(max(left - 1, 0), min(left + 3, w)):
            apart = abs(crop.cells_m[row, column] - z) / reach
            if crop.cells_m[row, column] > 0 and apart <= 1:
                weight = np.float32((1 - apart) / (0.2 + (row - at_y) ** 2 + (column - at_x) ** 2))
                total += weight * crop.probability[row, column]
                weights += weight
    return total / weights if weights > 0 else np.float32(-1)
