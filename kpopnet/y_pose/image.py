"""Locates torso, head, arms and legs in the image of a person in the Y pose (section 2.3).

The torso's rectangle, its six sub-parts, the joints in four of them, and the head by mean shift over the ridge data above.
Then, in each limb's bounding box: Hough lines over the ridge data, two dominant lines among them by k-means, their
intersection. Points in the image are (u, v) in pixels. A line is (angle, offset): the direction of its normal in radians from u
towards v, and its distance in pixels from the limb's origin along that normal.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.skeleton import MIRROR, Joint

SHOULDER_WIDTH_RATIO = 0.7
"""The torso begins at the first row from the top in which the silhouette has at least this fraction of its maximum width across
the roots of both arms (1.4 to 3.6 waist widths). Narrower rows above are neck and head."""

SHOULDER_ROW, HIP_ROW, SHOULDER_COLUMNS, HIP_COLUMNS = (-0.08, 0.13), (0.72, 0.92), (0.17, 0.38), (0.07, 0.28)
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

HOUGH_STEP_RAD, HOUGH_RANGE_RAD = np.radians(2.0), np.radians(60.0)
"""Lines are searched in these steps up to this angle from the limb's direction, so that no angle wraps around."""

MIN_VOTE_RATIO = 0.5
"""Lines with at least this fraction of the strongest line's votes go into the k-means. A lower fraction adds lines along
neither half of the limb (mean error of elbows in bent arms: 4.3 cm with 0.5, 5.0 cm with 0.3)."""

MIN_BEND_RAD = np.radians(20.0)
"""Below this angle between the two dominant lines a limb counts as straight: the ridge of a straight limb is up to three
pixels wide, which alone gives lines that differ by 10 degrees."""

MIDDLE_RANGE = (0.3, 0.7)
"""Range of the position of elbows and knees on a limb, from root (0) to end (1). Lines that cross elsewhere are two halves of
one line."""

KMEANS_STEPS = 20


class NotYPose(Exception):  # noqa: N818 - not an error: most frames show another pose
    """The frame does not show the Y pose; the message says why."""


class Box(NamedTuple):
    """Pixels from (x0, y0) to (x1, y1), the latter exclusive."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def pixels(self) -> tuple[slice, slice]:
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    @property
    def height(self) -> int:
        return self.y1 - self.y0

    @property
    def middle_u(self) -> float:
        return (self.x0 + self.x1 - 1) / 2


def torso_rectangle(person: np.ndarray) -> Box:
    """The maximal rectangle of the torso without the head in an (H, W) bool silhouette; all 0 if that is empty.

    The largest rectangle may include a head whose hair is as wide as the waist. Scanning the rows upwards from the widest one
    across the arms' roots finds the upper edge of the shoulders. The result is the largest rectangle below that row; it locates
    the shoulders' height with half the error of the largest rectangle of all.
    """
    largest = Box(*_maximal_rectangle(person))
    if largest.height == 0:
        return largest
    runs = np.array([_run_through(person[y], int(largest.middle_u)) for y in range(largest.y1)])
    upper = runs[largest.y0 : largest.y1 - largest.height // 2]
    top = largest.y0 + int(np.argmax(upper))
    while top > 0 and runs[top - 1] >= SHOULDER_WIDTH_RATIO * upper.max():
        top -= 1
    below = Box(*_maximal_rectangle(person[top:]))
    return Box(below.x0, top, below.x1, top + below.y1)


@njit(cache=True)
def _maximal_rectangle(person):
    """The `Box` of the largest rectangle inside an (H, W) bool silhouette; all 0 if that is empty.

    Column-wise scanning counts the connected person pixels upwards from every pixel. Row-wise scanning finds for every row
    the rectangle of the largest area that stands on it and fits below these counts.
    """
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


def torso_parts(torso: Box) -> dict[Joint, Box]:
    """Those of the rectangle's six sub-parts that are averaged for a joint of a person who faces the camera.

    The shoulder parts extend beyond the rectangle's sides. Both sides are rounded symmetrically: a mirrored rectangle has
    mirrored parts.
    """
    left, right = int(np.floor(torso.middle_u)), int(np.ceil(torso.middle_u))
    parts = {}
    for joint, (top, bottom), (inner, outer) in (
        (Joint.RIGHT_SHOULDER, SHOULDER_ROW, SHOULDER_COLUMNS),
        (Joint.RIGHT_HIP, HIP_ROW, HIP_COLUMNS),
    ):
        y0, y1 = (max(torso.y0 + round(fraction * torso.height), 0) for fraction in (top, bottom))
        near, far = round(inner * torso.height), round(outer * torso.height)
        parts[joint] = Box(max(left - far, 0), y0, max(left - near + 1, 0), y1)
        parts[Joint(MIRROR[joint])] = Box(right + near, y0, right + far + 1, y1)
    return parts


def head_candidates(ridge: np.ndarray, torso: Box, radius_px: float) -> np.ndarray:
    """(N, 2) u, v of the modes of mean shift, with a flat kernel of this radius, over the (H, W) bool ridge data above the
    torso; those with the most ridge data first. Raises NotYPose if there are none.
    """
    v, u = np.nonzero(ridge[: torso.y0])
    above = np.abs(u - torso.middle_u) < HEAD_SEARCH_WIDTH * torso.height
    points = np.stack([u, v], axis=1)[above].astype(float)
    if not len(points):
        raise NotYPose("no head is visible above the torso")
    modes = points[:: -(-len(points) // MEAN_SHIFT_STARTS)]
    for _ in range(MEAN_SHIFT_STEPS):
        within = _within(modes, points, radius_px)
        shifted = within @ points / np.maximum(within.sum(1, keepdims=True), 1)
        moved_px = np.abs(shifted - modes).max()
        modes = shifted
        if moved_px < CONVERGED_PX:
            break
    modes = np.unique(modes.round(1), axis=0)
    return modes[np.argsort(-_within(modes, points, radius_px).sum(1), kind="stable")]


def _within(centres: np.ndarray, points: np.ndarray, radius_px: float) -> np.ndarray:
    """(N, M) 1.0 where one of M points lies within the radius around one of N centres."""
    return (((centres[:, None] - points) ** 2).sum(-1) <= radius_px**2).astype(float)


def find_limb(
    person: np.ndarray, ridge: np.ndarray, box: Box, root: np.ndarray, end_px: float, upper_fraction: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(2,) u, v each of a limb's middle, its end, and the silhouette's pixel farthest from the root, shoulder or hip.

    Raises NotYPose if the box contains too little of the limb.
    The end is the mean of the ridge data within `end_px` pixels of the tip. The lines of a straight limb are almost parallel
    and their intersection is ill-conditioned: its middle is the mean of the ridge data around the point at `upper_fraction` of
    the way from root to end.
    """
    silhouette, ridge_data = _pixels(person, box), _pixels(ridge, box)
    if not len(silhouette) or not len(ridge_data):
        raise NotYPose("nothing is visible where the Y pose has the limb")
    tip = silhouette[np.argmax(np.linalg.norm(silhouette - root, axis=1))]
    end = _mean_around(tip, ridge_data, end_px)
    if end is None:
        end = _mean_around(tip, silhouette, end_px)
    if np.linalg.norm(end - root) < end_px:
        raise NotYPose("the limb is too short")
    origin = (root + end) / 2
    lines, votes = hough_lines(ridge_data - origin, end - root)
    first, second = dominant_lines(lines, votes, np.linalg.norm(end - root) / 2)
    if abs(first[0] - second[0]) > MIN_BEND_RAD:
        crossing = intersection(first, second) + origin
        fraction = (crossing - root) @ (end - root) / ((end - root) @ (end - root))
        if MIDDLE_RANGE[0] < fraction < MIDDLE_RANGE[1]:
            return crossing, end, tip
    middle = root + upper_fraction * (end - root)
    on_ridge = _mean_around(middle, ridge_data, end_px / 2)
    return middle if on_ridge is None else on_ridge, end, tip


def hough_lines(points: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hough transform: the strong lines over (N, 2) points, N > 0, approximately along a direction (2,).

    (K, 2) angle and offset of the lines, and (K,) the number of points on each, its votes.
    """
    steps = round(HOUGH_RANGE_RAD / HOUGH_STEP_RAD)
    normal = np.arctan2(direction[1], direction[0]) + np.pi / 2
    angles = normal + HOUGH_STEP_RAD * np.arange(-steps, steps + 1)
    offsets = np.rint(points @ np.stack([np.cos(angles), np.sin(angles)])).astype(int)  # (N, angles)
    reach = np.abs(offsets).max()
    cells = (offsets + reach) * len(angles) + np.arange(len(angles))
    votes = np.bincount(cells.ravel(), minlength=(2 * reach + 1) * len(angles))
    strong = np.flatnonzero(votes >= MIN_VOTE_RATIO * votes.max())
    return np.stack([angles[strong % len(angles)], strong // len(angles) - reach], axis=1), votes[strong]


def dominant_lines(lines: np.ndarray, votes: np.ndarray, half_length_px: float) -> np.ndarray:
    """(2, 2) angle and offset of the centres of two clusters of (K, 2) lines: k-means weighted by (K,) votes.

    It starts from the two lines that differ most in angle. An offset of `half_length_px` has the same weight as a rotation by
    one radian, which moves a limb's end by that distance.
    """
    points = lines / (1, half_length_px)
    centres = points[[np.argmin(points[:, 0]), np.argmax(points[:, 0])]]
    for _ in range(KMEANS_STEPS):
        second = np.linalg.norm(points - centres[1], axis=1) < np.linalg.norm(points - centres[0], axis=1)
        weights = np.stack([~second, second]) * votes
        total = weights.sum(axis=1, keepdims=True)
        moved = np.where(total > 0, weights @ points / np.maximum(total, 1), centres)
        if np.array_equal(moved, centres):
            break
        centres = moved
    return centres * (1, half_length_px)


def intersection(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(2,) intersection of two non-parallel lines (angle, offset) with the same origin."""
    normals = np.array([[np.cos(a[0]), np.sin(a[0])], [np.cos(b[0]), np.sin(b[0])]])
    return np.linalg.solve(normals, [a[1], b[1]])


def _pixels(mask: np.ndarray, box: Box) -> np.ndarray:
    """(N, 2) u, v of the mask's pixels in a box."""
    v, u = np.nonzero(mask[box.pixels])
    return np.stack([u + box.x0, v + box.y0], axis=1).astype(float)


def _mean_around(centre: np.ndarray, points: np.ndarray, radius: float) -> np.ndarray | None:
    """(2,) mean of the points within a radius of the centre; None if there are none."""
    near = points[np.linalg.norm(points - centre, axis=1) <= radius]
    return near.mean(axis=0) if len(near) else None
