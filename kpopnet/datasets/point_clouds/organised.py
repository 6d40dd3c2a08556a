"""Organised point clouds of EVAL and SMMC-10: one point per pixel, x right, y up, z negative in front of the camera."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_budget
from kpopnet.skeleton import NUM_JOINTS

FROM_OPENGL = np.array([1, -1, -1], np.float32)
"""Multiply a position in these axes by this for the camera frame (x right, y down, z forward), and vice versa."""

MAX_FIT_RMS_PX = 0.5
"""Largest accepted root-mean-square reprojection error of the fitted pinhole camera, in pixels."""

MAX_MARKERS = 256
"""A file that names more markers, each with a track of its own as long as the sequence, is damaged."""


@dataclass(frozen=True)
class PointSequence:
    """The contents of a file of T frames, converted to the camera frame.

    Attributes:
        camera: pinhole camera fitted to the points.
        depth_m: (T, H, W) float32 metres, 0 where nothing was measured.
        joints_camera_m: (T, 15, 3) float32 metres, NaN where the joint, or one of its markers, is absent or not in the map.
        markers_camera_m: (T, 3) float32 metres by the marker's name or id, NaN where it is absent or not visible.
        skipped: number of values that were left out, by their kind.
    """

    camera: Camera
    depth_m: np.ndarray
    joints_camera_m: np.ndarray
    markers_camera_m: dict[str, np.ndarray] | dict[int, np.ndarray]
    skipped: Counter[str]


def check_sequence_budget(path: Path, frames: int, pixels: int) -> None:
    """Raises InputError if the depth of a file's frames and MAX_MARKERS tracks would exceed the budget of one file."""
    check_budget(path, 4 * frames * (pixels + 3 * (NUM_JOINTS + MAX_MARKERS)), f"its {frames} frames")


def check_marker_count(path: Path, markers: Collection) -> None:
    """Raises InputError if a file has named more than MAX_MARKERS markers."""
    if len(markers) > MAX_MARKERS:
        raise InputError(f"{path}: names {len(markers)} markers, expected at most {MAX_MARKERS}; download it again")


def depth_of_points(xyz_opengl_m: np.ndarray, skipped: Counter[str]) -> np.ndarray:
    """Converts (..., H, W, 3) organised points to (..., H, W) float32 depth in metres, 0 where nothing was measured.

    Invalid points that are not marked by z = 0 are counted in `skipped`.
    """
    finite = np.isfinite(xyz_opengl_m).all(axis=-1)
    z = xyz_opengl_m[..., 2]
    skipped["points that are not finite"] += int((~finite).sum())
    skipped["points behind the camera"] += int((finite & (z > 0)).sum())
    return np.where(finite & (z < 0), -z, 0).astype(np.float32)


def fit_camera(xyz_opengl_m: np.ndarray, where: str) -> Camera:
    """Fits a pinhole camera to organised points by least squares: u = cx + fx X/(-Z), v = cy - fy Y/(-Z).

    Args:
        xyz_opengl_m: (..., H, W, 3) metres; points that are not finite or not in front of the camera are left out.
        where: name of the file, for messages.

    Raises:
        InputError: there are too few points, or no pinhole camera fits them.
    """
    height, width = xyz_opengl_m.shape[-3:-1]
    v, u = np.broadcast_arrays(*np.mgrid[:height, :width], np.empty(xyz_opengl_m.shape[:-1]))[:2]
    usable = np.isfinite(xyz_opengl_m).all(axis=-1) & (xyz_opengl_m[..., 2] < 0)
    x, y, z = np.moveaxis(xyz_opengl_m[usable].astype(np.float64), -1, 0)
    intrinsics, rms_px = [], []
    for pixel, slope in ((u[usable], x / -z), (v[usable], -y / -z)):
        if not slope.size or np.ptp(slope) < 1e-6:
            raise InputError(f"{where}: too few measured points to fit a camera; download it again")
        matrix = np.stack([slope, np.ones_like(slope)], axis=1)
        (focal_px, centre_px), *_ = np.linalg.lstsq(matrix, pixel.astype(np.float64), rcond=None)
        intrinsics.append((float(focal_px), float(centre_px)))
        rms_px.append(float(np.sqrt(np.mean((matrix @ [focal_px, centre_px] - pixel) ** 2))))
    (fx, cx), (fy, cy) = intrinsics
    if max(rms_px) > MAX_FIT_RMS_PX or min(fx, fy) <= 0:
        raise InputError(
            f"{where}: the best-fitting camera (fx {fx:.1f}, fy {fy:.1f}) has a reprojection error of {max(rms_px):.2f} "
            f"pixels; expected {width}x{height} organised points, x right, y up, z negative in front of the camera"
        )
    return Camera(fx, fy, cx, cy, width, height)


def describe_camera(camera: Camera) -> str:
    """Size and intrinsics of a camera as text."""
    return (
        f"{camera.width}x{camera.height}, fx {camera.fx:.2f}, fy {camera.fy:.2f}, cx {camera.cx:.2f}, cy {camera.cy:.2f} pixels"
    )
