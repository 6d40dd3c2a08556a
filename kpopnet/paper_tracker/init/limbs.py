"""Locates middle and end of a stretched arm or leg in the image (section 2.3, second half).

Hough lines over the ridge data in the limb's bounding box, two dominant lines among them by k-means, their intersection.
Points in the image are (u, v) in pixels. A line is (angle, offset): the direction of its normal in radians from u towards
v, and its distance in pixels from the limb's origin along that normal.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.paper_tracker.init.torso import Box

HOUGH_STEP_RAD = np.radians(2.0)
HOUGH_RANGE_RAD = np.radians(60.0)
"""Lines are searched up to this angle from the limb's direction, so that no angle wraps around."""

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
"""Maximum number of k-means iterations."""


class Limb(NamedTuple):
    """One arm or leg in the image.

    Attributes:
        box: its bounding box.
        origin: (2,) u, v from which the lines' offsets are measured.
        dominant: (2, 2) angle and offset of the upper and of the lower dominant line.
        crossed: whether they intersect where a limb can bend; if not, the limb counts as straight.
        middle: (2,) u, v of elbow or knee.
        end: (2,) u, v of hand or foot.
        tip: (2,) u, v of the silhouette's farthest pixel.
    """

    box: Box
    origin: np.ndarray
    dominant: np.ndarray
    crossed: bool
    middle: np.ndarray
    end: np.ndarray
    tip: np.ndarray


def find_limb(
    person: np.ndarray, ridge: np.ndarray, box: Box, root: np.ndarray, end_px: float, upper_fraction: float
) -> Limb | None:
    """Finds middle and end of a limb; None if its box contains too little of it.

    The lines of a straight limb are almost parallel and their intersection is ill-conditioned. Its middle is the mean of the
    ridge data around the point at `upper_fraction` of the way from root to end.

    Args:
        person: (H, W) bool silhouette.
        ridge: (H, W) bool ridge data.
        box: the limb's bounding box.
        root: (2,) u, v of shoulder or hip.
        end_px: radius in pixels around the tip within which ridge data are averaged for the hand or foot.
        upper_fraction: position of the middle of a straight limb from root (0) to end (1).
    """
    silhouette, ridge_data = _pixels(person, box), _pixels(ridge, box)
    if not len(silhouette) or not len(ridge_data):
        return None
    tip = silhouette[np.argmax(np.linalg.norm(silhouette - root, axis=1))]
    end = _mean_around(tip, ridge_data, end_px)
    if end is None:
        end = _mean_around(tip, silhouette, end_px)
    if np.linalg.norm(end - root) < end_px:
        return None
    origin = (root + end) / 2
    lines, votes = hough_lines(ridge_data - origin, end - root)
    upper, lower = dominant_lines(lines, votes, np.linalg.norm(end - root) / 2)
    if _distance(upper, root - origin) + _distance(lower, end - origin) > _distance(lower, root - origin) + _distance(
        upper, end - origin
    ):
        upper, lower = lower, upper
    middle, crossed = root + upper_fraction * (end - root), False
    if abs(upper[0] - lower[0]) > MIN_BEND_RAD:
        crossing = intersection(upper, lower) + origin
        fraction = (crossing - root) @ (end - root) / ((end - root) @ (end - root))
        crossed = bool(MIDDLE_RANGE[0] < fraction < MIDDLE_RANGE[1])
    if crossed:
        middle = crossing
    else:
        on_ridge = _mean_around(middle, ridge_data, end_px / 2)
        middle = middle if on_ridge is None else on_ridge
    return Limb(box, origin, np.stack([upper, lower]), crossed, middle, end, tip)


def hough_lines(points: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hough transform: the strong lines over (N, 2) points, N > 0, approximately along a direction (2,).

    Returns:
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


def _distance(line: np.ndarray, point: np.ndarray) -> float:
    """Distance in pixels of a (2,) point from a line."""
    return abs(np.cos(line[0]) * point[0] + np.sin(line[0]) * point[1] - line[1])


def _pixels(mask: np.ndarray, box: Box) -> np.ndarray:
    """(N, 2) u, v of the mask's pixels in a box."""
    v, u = np.nonzero(mask[box.pixels])
    return np.stack([u + box.x0, v + box.y0], axis=1).astype(float)


def _mean_around(centre: np.ndarray, points: np.ndarray, radius: float) -> np.ndarray | None:
    """(2,) mean of the points within a radius of the centre; None if there are none."""
    near = points[np.linalg.norm(points - centre, axis=1) <= radius]
    return near.mean(axis=0) if len(near) else None
