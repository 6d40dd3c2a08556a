"""Statistics of one depth frame in which one person is segmented. Each returns NaN where it does not apply."""

from dataclasses import dataclass

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.skeleton import Joint

STEPS_PER_M = 345.0
"""Kinect v1's depth steps are z^2 / 345 m (synth.sensor.model), so 345 / z is the disparity in steps."""

SHIN_ROWS, THIGH_ROWS, FOOT_ROWS = (0.08, 0.22), (0.31, 0.37), (0.0, 0.05)
"""Parts of the silhouette's height, from its lowest row: the lower legs, the thighs below hanging hands, the feet."""

SMOOTHED_PX = 7

LARGEST_HOLE_CM2 = 100.0
"""A larger empty region that the silhouette encloses is the loop of an arm or between the legs, not a hole."""

SAME_SURFACE_STEPS = 3.0
"""Neighbours that differ by less lie on the same surface."""


@dataclass(frozen=True)
class Frame:
    """A segmented person.

    Attributes:
        name: where the frame comes from.
        depth_m: (H, W) float32 metres of the whole image, 0 outside the person.
        camera: of this image.
        joints_camera_m: (15, 3) labelled joints, metres.
    """

    name: str
    depth_m: np.ndarray
    camera: Camera
    joints_camera_m: np.ndarray


def distance_m(frame: Frame) -> float:
    """Median depth of the silhouette, metres."""
    return float(np.median(frame.depth_m[frame.depth_m > 0])) if frame.depth_m.any() else np.nan


def is_cut(frame: Frame) -> float:
    """1 where the silhouette touches the border of the image, else 0."""
    inside = frame.depth_m > 0
    return float(inside[[0, -1]].any() or inside[:, [0, -1]].any()) if inside.any() else np.nan


def area_share(frame: Frame) -> float:
    """Pixels of the silhouette over the square of its height."""
    body, height_px = _whole_body(frame)
    return np.count_nonzero(body) / height_px**2 if height_px else np.nan


def shins_width(frame: Frame) -> float:
    """Width of both lower legs together over the height: mean of the rows of SHIN_ROWS that show two separate legs.

    NaN where fewer than half of these rows do.
    """
    body, height_px = _whole_body(frame)
    if not height_px:
        return np.nan
    rows = _rows(body, SHIN_ROWS)
    runs = [_run_lengths(row) for row in rows]
    widths_px = [sum(lengths) for lengths in runs if len(lengths) == 2]
    return float(np.mean(widths_px)) / height_px if 2 * len(widths_px) >= len(rows) > 0 else np.nan


def thighs_width(frame: Frame) -> float:
    """Width of both thighs together over the height: mean number of pixels in the rows of THIGH_ROWS."""
    body, height_px = _whole_body(frame)
    rows = _rows(body, THIGH_ROWS)
    return float(rows.sum(axis=1).mean()) / height_px if len(rows) else np.nan


def feet_width_cm(frame: Frame) -> float:
    """Width of the block of both feet, centimetres: the most pixels in any of the lowest rows, FOOT_ROWS."""
    body, _ = _whole_body(frame)
    rows = _rows(body, FOOT_ROWS)
    if not len(rows):
        return np.nan
    lowest_z_m = np.median(_rows(np.where(body, frame.depth_m, 0), FOOT_ROWS, body)[rows])
    return float(rows.sum(axis=1).max() * lowest_z_m / frame.camera.fx * 100)


def outline_shape(frame: Frame) -> float:
    """Square of the outline's length over the enclosed area: 4 pi for a disc, more for thin or spread limbs."""
    body, height_px = _whole_body(frame)
    return _outline_px(body) ** 2 / np.count_nonzero(body) if height_px else np.nan


def raggedness(frame: Frame) -> float:
    """Length of the outline over that of the silhouette smoothed by a median of SMOOTHED_PX: 1 for a smooth outline.

    Unlike `outline_shape` it hardly depends on the pose.
    """
    body, height_px = _whole_body(frame)
    if not height_px:
        return np.nan
    smooth = cv2.medianBlur(body.astype(np.uint8), SMOOTHED_PX)
    return _outline_px(body) / _outline_px(smooth) if smooth.any() else np.nan


def hole_share(frame: Frame) -> float:
    """Fraction of the pixels inside the outline that were not measured, in holes of at most LARGEST_HOLE_CM2."""
    inside = frame.depth_m > 0
    if not inside.any():
        return np.nan
    padded = np.pad(~inside, 1, constant_values=True).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(padded, connectivity=4)
    pixel_cm2 = (100 * distance_m(frame)) ** 2 / (frame.camera.fx * frame.camera.fy)
    sizes_px = np.delete(stats[:, cv2.CC_STAT_AREA], [0, labels[0, 0]])  # without the silhouette and its surroundings
    holes_px = sizes_px[sizes_px * pixel_cm2 <= LARGEST_HOLE_CM2].sum()
    return float(holes_px / (holes_px + np.count_nonzero(inside)))


def roughness_steps(frame: Frame) -> float:
    """Standard deviation, in disparity steps, of the white noise that has the second differences along the rows.

    White noise of standard deviation s has second differences of sqrt(6) s. Only pixels whose both neighbours lie on the
    same surface count.
    """
    steps = _disparity(frame.depth_m)
    left, middle, right = steps[:, :-2], steps[:, 1:-1], steps[:, 2:]
    with np.errstate(invalid="ignore"):
        smooth = (np.abs(left - middle) < SAME_SURFACE_STEPS) & (np.abs(right - middle) < SAME_SURFACE_STEPS)
        second = (left - 2 * middle + right)[smooth]
    return float(np.sqrt(np.mean(second**2) / 6)) if len(second) else np.nan


def ridge_share(frame: Frame) -> float:
    """Fraction of the silhouette whose ridge probability (kpopnet.ridge) exceeds 0.5."""
    inside = frame.depth_m > 0
    if not inside.any():
        return np.nan
    return float(np.count_nonzero(ridge_probability(frame.depth_m, RidgeConfig()) > 0.5) / np.count_nonzero(inside))


def joint_depth_cm(frame: Frame, joints: tuple[Joint, ...]) -> float:
    """Mean depth of these joints behind the surface that is measured at their pixels, centimetres; joints at pixels without
    a measurement are left out.
    """
    height, width = frame.depth_m.shape
    depths_m = []
    for u, v, z in frame.camera.project(frame.joints_camera_m[list(joints)]):
        if np.isfinite([u, v]).all() and 0 <= round(v) < height and 0 <= round(u) < width:
            surface_m = frame.depth_m[round(v), round(u)]
            depths_m += [z - surface_m] if surface_m > 0 else []
    return 100 * float(np.mean(depths_m)) if depths_m else np.nan


def _whole_body(frame: Frame) -> tuple[np.ndarray, int]:
    """The largest connected part of the silhouette, (H, W) bool, and its height in pixels: 0 where the border cuts it."""
    inside = (frame.depth_m > 0).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(inside, connectivity=8)
    if count < 2 or is_cut(frame):
        return np.zeros(inside.shape, bool), 0
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return labels == largest, int(stats[largest, cv2.CC_STAT_HEIGHT])


def _outline_px(body: np.ndarray) -> float:
    """Length of the longest outer outline of an (H, W) mask, pixels."""
    outlines, _ = cv2.findContours(body.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return max(cv2.arcLength(outline, True) for outline in outlines)


def _rows(image: np.ndarray, part: tuple[float, float], body: np.ndarray | None = None) -> np.ndarray:
    """The rows of an image between two parts of the body's height, measured from its lowest row; none without a body."""
    rows = np.flatnonzero((image if body is None else body).any(axis=1))
    if not len(rows):
        return image[:0]
    bottom, height_px = rows[-1] + 1, rows[-1] + 1 - rows[0]
    first, last = bottom - round(part[1] * height_px), bottom - round(part[0] * height_px)
    return image[min(first, last - 1) : last]


def _run_lengths(row: np.ndarray) -> list[int]:
    """Lengths of the runs of true pixels in a row; single pixels are noise and left out."""
    ends = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
    return [int(length) for length in ends[1::2] - ends[::2] if length > 1]


def _disparity(depth_m: np.ndarray) -> np.ndarray:
    """Disparity in Kinect v1's steps, NaN where nothing was measured."""
    with np.errstate(divide="ignore"):
        return np.where(depth_m > 0, STEPS_PER_M / depth_m, np.nan)
