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
from kpopnet.finder.people import BESIDE_M, BESIDE_PER_M, NO_PERSON, OwnedCells, pixel_owners
from kpopnet.networks.backend import shipped_session

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
    session = shipped_session("masks")
    return lambda *crops: session.run(list(OUTPUT_NAMES), dict(zip(INPUTS, crops, strict=True)))[0]


class SceneCrop(NamedTuple):
    """The scene around a person, CROP_PX wide and high."""

    depth_m: np.ndarray  # (S, S) float32 metres, 0 where nothing was measured and beyond the image
    rows: np.ndarray  # (S,) int rows of the image that it shows, also such as lie beyond the image
    columns: np.ndarray  # (S,) int its columns
    to_image: np.ndarray  # (2, 2) step and first: its pixel k lies at step x k + first of the image, in x, then in y


def scene_crop(depth_m: np.ndarray, camera: Camera, centre_m: np.ndarray) -> SceneCrop:
    """The crop of an (H, W) image in metres around a (3,) float32 centre, metres, Z > 0."""
    step, first = crop_pixels(camera, Cube(centre_m, HALF_M), CROP_PX, PLAIN_VIEW)
    to_image = np.column_stack([np.diag(step), first])
    columns, rows = np.floor(to_image @ [np.arange(CROP_PX), np.ones(CROP_PX)] + 0.5).astype(int)
    return SceneCrop(taken(depth_m, rows, columns), rows, columns, to_image)


def taken(image: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """The pixels of an image in some rows and columns; 0 beyond the image."""
    # Rows before columns: both at once take five times as long.
    out = image.take(rows, 0, mode="clip").take(columns, 1, mode="clip")
    out[(rows < 0) | (rows >= image.shape[0])] = 0
    out[:, (columns < 0) | (columns >= image.shape[1])] = 0
    return out


def crop_owner(cells: OwnedCells, crop: SceneCrop, number: int) -> np.ndarray:
    """(S, S) uint8 OWN where the finder takes a pixel of a crop for that person's, OTHER where for another's, else 0."""
    kinds = np.full(256, OTHER, np.uint8)
    kinds[NO_PERSON], kinds[number] = 0, OWN
    return kinds[pixel_owners(cells, crop.depth_m, crop.rows, crop.columns)]


def refine_masks(
    network: Network, depth_m: np.ndarray, camera: Camera, cells: OwnedCells, centres_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gives the pixels of an image to the P people of the cells, whose (P, 3) float32 centres, metres, are given.

    Of the people with a probability of THEIRS_FROM or more at a pixel the surest has it, if their torso is within REACH_M in
    depth; one whose crop ends before it has it if the finder takes it for theirs and no other does. (H, W) uint8 person of each
    pixel, and (P, 4) int32 x0, y0, x1, y1 of their pixels, the last two exclusive; of who has none all 0.
    """
    decided, surest = np.zeros(depth_m.shape, np.uint8), np.zeros(depth_m.shape, np.float32)
    if not len(centres_m):
        return decided, np.zeros((0, 4), np.int32)
    centres_m = np.maximum(centres_m, np.float32([-np.inf, -np.inf, NEAREST_M]))
    crops = [scene_crop(depth_m, camera, centre_m) for centre_m in centres_m]
    owner = np.stack([crop_owner(cells, crop, number) for number, crop in enumerate(crops, 1)])
    probability = network(np.stack([crop.depth_m for crop in crops]), owner, centres_m)
    judged = []
    for number, (person, crop, centre_m) in enumerate(zip(probability, crops, centres_m, strict=True), 1):
        least, most = (of(person, np.ones((4, 4)), anchor=(1, 1)) for of in (cv2.erode, cv2.dilate))
        columns, rows = (
            np.clip(_first_pixels(*along, len(person)), 0, size)
            for along, size in zip(crop.to_image, depth_m.shape[::-1], strict=True)
        )
        cells_m = np.ascontiguousarray(crop.depth_m[::STRIDE, ::STRIDE])
        judged.append(_Crop(person, least, most, cells_m, centre_m[2], crop.to_image, rows, columns))
        _decide(depth_m, judged[-1], number, decided, surest)
    for number, crop in enumerate(judged, 1):
        _take_beyond(depth_m, cells, crop, number, decided)
    return decided, _boxes(decided, len(crops))


def _take_beyond(depth_m: np.ndarray, cells: OwnedCells, crop: "_Crop", number: int, decided: np.ndarray) -> None:
    """Gives a person the pixels beyond their crop that the finder takes for theirs and that are no one's."""
    x, y, width, height = cv2.boundingRect((cells.owner == number).view(np.uint8))
    # A cell has a say in the pixels up to two cells away.
    corners = STRIDE * cells.reduction * np.array([(y - 2, x - 2), (y + height + 2, x + width + 2)])
    (y0, x0), (y1, x1) = np.clip(corners, 0, depth_m.shape).astype(int)
    if crop.rows[0] <= y0 and y1 <= crop.rows[-1] and crop.columns[0] <= x0 and x1 <= crop.columns[-1]:
        return
    rows, columns = np.arange(y0, y1), np.arange(x0, x1)
    inside_rows, inside_columns = ((one >= of[0]) & (one < of[-1]) for one, of in ((rows, crop.rows), (columns, crop.columns)))
    free = ~(inside_rows[:, None] & inside_columns) & (decided[y0:y1, x0:x1] == NO_PERSON)
    x, y, width, height = cv2.boundingRect(free.view(np.uint8))
    rows, columns, free = rows[y : y + height], columns[x : x + width], free[y : y + height, x : x + width]
    if len(rows):
        within = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        owners = pixel_owners(cells, np.where(free, depth_m[within], np.float32(0)), rows, columns)
        decided[within][owners == number] = number


class _Crop(NamedTuple):
    """What is known of a person's cells, h x w, and which pixels of the image lie between them."""

    probability: np.ndarray  # (h, w) that a cell shows the person
    least: np.ndarray  # (h, w) of the 4 x 4 cells around the pixels between each cell and the next
    most: np.ndarray  # (h, w) likewise
    cells_m: np.ndarray  # (h, w) depth of the cells, metres, 0 where nothing was measured
    centre_z: np.float32  # metres
    to_image: np.ndarray  # (2, 2) as of `SceneCrop`
    rows: np.ndarray  # (h + 1,) first row of the image at or behind each row of cells, and that behind the last
    columns: np.ndarray  # (w + 1,) likewise


def _first_pixels(step: float, first: float, cells: int) -> np.ndarray:
    """(cells + 1,) int the first pixel of the image at or behind each cell, and the first behind the crop's last pixel."""
    ends = np.append(STRIDE * np.arange(cells), CROP_PX - 1) * step + first
    return np.ceil(ends).astype(int)


@njit(cache=True, error_model="numpy")
def _decide(depth_m, crop, number, decided, surest):
    """Gives a person the pixels of which they are surer than those before them.

    Where the 4 x 4 cells around a pixel agree they decide: against the person whatever their depths, for them where the cell
    before it is at the pixel's. Elsewhere their mean does, weighed by how near they are in the image and in depth. Nothing out
    of reach is theirs. The innermost loop runs along a row of pixels, so that it vectorises.
    """
    h, w = crop.probability.shape
    (step_x, first_x), (step_y, first_y) = crop.to_image
    widest = np.max(np.diff(crop.columns))
    at_x, reach = np.empty(widest, np.float32), np.empty(widest, np.float32)
    total, weights = np.empty(widest, np.float32), np.empty(widest, np.float32)
    reached, agreed = np.empty(widest, np.bool_), np.empty(widest, np.bool_)
    for top in range(h):
        for left in range(w):
            if crop.most[top, left] < THEIRS_FROM:
                continue
            agree, first, last = crop.least[top, left] >= THEIRS_FROM, crop.columns[left], crop.columns[left + 1]
            for x in range(last - first):
                at_x[x] = (first + x - first_x) / (step_x * STRIDE)
            for y in range(crop.rows[top], crop.rows[top + 1]):
                z = depth_m[y, first:last]
                nearest, farthest = np.float32(np.inf), np.float32(0)  # cells beyond these depths have weight 0
                for x in range(last - first):
                    total[x] = weights[x] = 0
                    reach[x] = np.float32(BESIDE_M) + np.float32(BESIDE_PER_M) * z[x]
                    reached[x] = z[x] > 0 and abs(z[x] - crop.centre_z) <= REACH_M
                    agreed[x] = agree and abs(crop.cells_m[top, left] - z[x]) < BESIDE_M
                    if reached[x] and not agreed[x]:
                        nearest, farthest = min(nearest, z[x] - reach[x]), max(farthest, z[x] + reach[x])
                at_y = np.float32((y - first_y) / (step_y * STRIDE))
                for row in range(max(top - 1, 0), min(top + 3, h)):
                    away = np.float32(0.2) + (np.float32(row) - at_y) ** 2
                    for column in range(max(left - 1, 0), min(left + 3, w)):
                        cell_m, probability, at = crop.cells_m[row, column], crop.probability[row, column], np.float32(column)
                        if cell_m == 0 or cell_m <= nearest or cell_m >= farthest:
                            continue
                        for x in range(last - first):
                            aside = at - at_x[x]
                            weight = max(reach[x] - abs(cell_m - z[x]), np.float32(0)) / (away + aside * aside)
                            total[x] += weight * probability
                            weights[x] += weight
                for x in range(last - first):
                    if agreed[x]:
                        theirs = crop.probability[top, left]
                    else:
                        theirs = total[x] / weights[x] if weights[x] > 0 else np.float32(0)
                    if reached[x] and theirs >= THEIRS_FROM and theirs > surest[y, first + x]:
                        decided[y, first + x], surest[y, first + x] = number, theirs


def _boxes(decided: np.ndarray, people: int) -> np.ndarray:
    """(people, 4) x0, y0, x1, y1 of their pixels, the last two exclusive; of who has none all 0."""
    boxes = (cv2.boundingRect((decided == number).view(np.uint8)) for number in range(1, people + 1))
    return np.array([(x, y, x + width, y + height) for x, y, width, height in boxes], np.int32)
