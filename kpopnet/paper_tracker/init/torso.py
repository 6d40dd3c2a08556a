"""Locates torso and head in the image of a person who stands upright with raised arms (section 2.3, first half).

The torso's rectangle, its six sub-parts, the joints in four of them, and the head by mean shift over the ridge data above.
Points in the image are (u, v) in pixels.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.skeleton import Joint

SHOULDER_WIDTH_RATIO = 0.7
"""The torso begins at the first row from the top in which the silhouette has at least this fraction of its maximum width across
the roots of both arms (1.4 to 3.6 waist widths). Narrower rows above are neck and head."""

SHOULDER_ROW, MIDDLE_ROW, HIP_ROW = (-0.08, 0.13), (0.13, 0.72), (0.72, 0.92)
SHOULDER_COLUMNS, HIP_COLUMNS = (0.17, 0.38), (0.07, 0.28)
"""Limits of the sub-parts in heights of the torso's rectangle: rows down from its top, columns to either side of its middle.
Assumptions: the paper does not define the division of the rectangle. On simulated people (split train) the height, from the
shoulders to the crotch and 60 cm on average, predicts the joints better than the width, which is the waist's. The shoulders
lie 0.02 heights below the top (standard deviation 1.6 cm) and 0.27 to either side (1.9 cm), the hips 0.82 below the top
(2.0 cm) and 0.175 to either side (0.8 cm). The parts are centred there."""

HEAD_RADIUS_M = 0.12
"""Radius in metres of the mean shift's flat kernel: a head with hair. From 0.08 to 0.15 the results agree within 5 mm."""

HEAD_SEARCH_WIDTH = 0.25
"""Heads are searched up to this distance to either side of the torso's middle, in heights of its rectangle."""

MEAN_SHIFT_STARTS, MEAN_SHIFT_STEPS, CONVERGED_PX = 100, 30, 0.05
"""Maximum number of mean shift's starts and iterations, and the shift in pixels below which it has converged."""


class Box(NamedTuple):
    """Pixels from (x0, y0) to (x1, y1), the latter exclusive."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def pixels(self) -> tuple[slice, slice]:
        """Slices of the rows and columns."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.y1 - self.y0

    @property
    def middle_u(self) -> float:
        """Column of the middle, in pixels."""
        return (self.x0 + self.x1 - 1) / 2


def torso_rectangle(person: np.ndarray) -> Box:
    """The maximal rectangle of the torso without the head in an (H, W) bool silhouette; all 0 if that is empty.

    The largest rectangle may include the head, if with its hair it is about as wide as the waist. Scanning the rows upwards
    from the widest one across the arms' roots finds the upper edge of the shoulders. The result is the largest rectangle below
    that row; it locates the shoulders' height with half the error of the largest rectangle of all.
    """
    largest = maximal_rectangle(person)
    if largest.height == 0:
        return largest
    runs = np.array([_run_through(person[y], int(largest.middle_u)) for y in range(largest.y1)])
    upper = runs[largest.y0 : largest.y1 - largest.height // 2]
    top = largest.y0 + int(np.argmax(upper))
    while top > 0 and runs[top - 1] >= SHOULDER_WIDTH_RATIO * upper.max():
        top -= 1
    below = maximal_rectangle(person[top:])
    return Box(below.x0, top, below.x1, top + below.y1)


def maximal_rectangle(person: np.ndarray) -> Box:
    """The largest rectangle inside an (H, W) bool silhouette; all 0 if that is empty.

    Column-wise scanning counts the connected person pixels upwards from every pixel. Row-wise scanning finds for every row the
    rectangle of the largest area that stands on it and fits below these counts.
    """
    return Box(*_maximal_rectangle(np.ascontiguousarray(person)))


@njit(cache=True)
def _maximal_rectangle(person):
    height, width = person.shape
    column_run = np.zeros(width + 1, np.int32)  # the last entry stays 0 and closes every rectangle
    starts, heights = np.empty(width + 1, np.int32), np.empty(width + 1, np.int32)
    area, x0, y0, x1, y1 = 0, 0, 0, 0, 0
    for y in range(height):
        for x in range(width):
            column_run[x] = column_run[x] + 1 if person[y, x] else 0
        num_open = 0  # open rectangles, of increasing height
        for x in range(width + 1):
            start = x
            while num_open and heights[num_open - 1] >= column_run[x]:
                num_open -= 1
                start = starts[num_open]
                if heights[num_open] * (x - start) > area:
                    area = heights[num_open] * (x - start)
                    x0, y0, x1, y1 = start, y + 1 - heights[num_open], x, y + 1
            starts[num_open], heights[num_open] = start, column_run[x]
            num_open += 1
    return x0, y0, x1, y1


def _run_through(row: np.ndarray, x: int) -> int:
    """Number of connected person pixels of a row around column x."""
    if not row[x]:
        return 0
    gaps = np.flatnonzero(~row)
    k = np.searchsorted(gaps, x)
    return int((gaps[k] if k < len(gaps) else len(row)) - (gaps[k - 1] + 1 if k else 0))


TORSO_PARTS = {Joint.RIGHT_SHOULDER: 0, Joint.LEFT_SHOULDER: 1, Joint.RIGHT_HIP: 4, Joint.LEFT_HIP: 5}
"""Index in `six_parts` of the part that is averaged for each joint of a person who faces the camera."""


def six_parts(torso: Box) -> list[Box]:
    """The rectangle's sub-parts in three rows from the top, in each row the one at smaller x first.

    The shoulder parts extend beyond the rectangle's sides. Both sides are rounded symmetrically: a mirrored rectangle has
    mirrored parts.
    """
    rows = (SHOULDER_ROW, SHOULDER_COLUMNS), (MIDDLE_ROW, HIP_COLUMNS), (HIP_ROW, HIP_COLUMNS)
    left, right = int(np.floor(torso.middle_u)), int(np.ceil(torso.middle_u))
    parts = []
    for (top, bottom), (inner, outer) in rows:
        y0, y1 = (max(torso.y0 + round(fraction * torso.height), 0) for fraction in (top, bottom))
        near, far = round(inner * torso.height), round(outer * torso.height)
        parts.append(Box(max(left - far, 0), y0, max(left - near + 1, 0), y1))
        parts.append(Box(right + near, y0, right + far + 1, y1))
    return parts


def mean_pixel(mask: np.ndarray, part: Box) -> np.ndarray | None:
    """(2,) mean u, v of the mask's pixels within a part; None if there are none."""
    v, u = np.nonzero(mask[part.pixels])
    return np.array([u.mean() + part.x0, v.mean() + part.y0]) if len(v) else None


def head_candidates(ridge: np.ndarray, torso: Box, radius_px: float) -> np.ndarray:
    """(N, 2) u, v of the modes of mean shift over the ridge data above the torso; those with the most ridge data first.

    Args:
        ridge: (H, W) bool ridge data.
        torso: the torso's rectangle.
        radius_px: radius of the flat kernel in pixels.
    """
    v, u = np.nonzero(ridge[: torso.y0])
    above = np.abs(u - torso.middle_u) < HEAD_SEARCH_WIDTH * torso.height
    points = np.stack([u, v], axis=1)[above].astype(float)
    modes = points[:: -(-len(points) // MEAN_SHIFT_STARTS) or 1]
    for _ in range(MEAN_SHIFT_STEPS):
        within = _within(modes, points, radius_px)
        shifted = within @ points / np.maximum(within.sum(1, keepdims=True), 1)
        moved_px = np.abs(shifted - modes).max(initial=0)
        modes = shifted
        if moved_px < CONVERGED_PX:
            break
    modes = np.unique(modes.round(1), axis=0)
    return modes[np.argsort(-_within(modes, points, radius_px).sum(1), kind="stable")]


def _within(centres: np.ndarray, points: np.ndarray, radius_px: float) -> np.ndarray:
    """(N, M) 1.0 where one of M points lies within the radius around one of N centres."""
    return (((centres[:, None] - points) ** 2).sum(-1) <= radius_px**2).astype(float)
