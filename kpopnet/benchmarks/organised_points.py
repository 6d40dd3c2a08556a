"""Organised points, a point for every pixel, as EVAL and SMMC-10 store them: x right, y up, z negative before the camera."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError

FROM_OPENGL = np.array([1, -1, -1], np.float32)
"""Turns these axes into the camera frame's (x right, y down, z forward), and back."""

FIT_PX = 0.5
"""How far, root mean square, points may lie from the pixels of the pinhole camera fitted to them."""


@dataclass(frozen=True)
class PointSequence:
    """What a file of frames with organised points holds, in the camera frame.

    Attributes:
        camera: fitted to the points.
        depth_m: (T, H, W) float32, 0 where nothing was measured.
        joints_camera_m: (T, 15, 3) float32, NaN where the joint, or one of its markers, is absent or not in the map.
        markers_camera_m: (T, 3) float32 by the marker's name or id, NaN where it is absent or not visible.
        skipped: what was left out: how often, by what it was.
    """

    camera: Camera
    depth_m: np.ndarray
    joints_camera_m: np.ndarray
    markers_camera_m: dict[str, np.ndarray] | dict[int, np.ndarray]
    skipped: Counter[str]


def depth_of_points(xyz_opengl_m: np.ndarray, skipped: Counter[str]) -> np.ndarray:
    """(..., H, W, 3) organised points to (..., H, W) float32 metres, 0 where nothing was measured.

    What is no measurement, but not marked as none by z = 0 either, is counted in `skipped`.
    """
    finite = np.isfinite(xyz_opengl_m).all(axis=-1)
    z = xyz_opengl_m[..., 2]
    skipped["points that are not finite"] += int((~finite).sum())
    skipped["points behind the camera"] += int((finite & (z > 0)).sum())
    return np.where(finite & (z < 0), -z, 0).astype(np.float32)


def fit_camera(xyz_opengl_m: np.ndarray, where: str) -> Camera:
    """The pinhole camera that took organised points, by least squares: u = cx + fx X/(-Z), v = cy - fy Y/(-Z).

    Args:
        xyz_opengl_m: (..., H, W, 3) metres; points that are not finite or not before the camera are left out.
        where: file, for messages.

    Raises:
        InputError: the points do not lie on the rays of one camera's pixels.
    """
    height, width = xyz_opengl_m.shape[-3:-1]
    v, u = np.broadcast_arrays(*np.mgrid[:height, :width], np.empty(xyz_opengl_m.shape[:-1]))[:2]
    usable = np.isfinite(xyz_opengl_m).all(axis=-1) & (xyz_opengl_m[..., 2] < 0)
    x, y, z = np.moveaxis(xyz_opengl_m[usable].astype(np.float64), -1, 0)
    intrinsics, away_px = [], []
    for pixel, slope in ((u[usable], x / -z), (v[usable], -y / -z)):
        if not slope.size or np.ptp(slope) < 1e-6:
            raise InputError(f"{where}: too few points are measured to fit a camera to them; fetch it again")
        matrix = np.stack([slope, np.ones_like(slope)], axis=1)
        (focal_px, centre_px), *_ = np.linalg.lstsq(matrix, pixel.astype(np.float64), rcond=None)
        intrinsics.append((float(focal_px), float(centre_px)))
        away_px.append(float(np.sqrt(np.mean((matrix @ [focal_px, centre_px] - pixel) ** 2))))
    (fx, cx), (fy, cy) = intrinsics
    if max(away_px) > FIT_PX or min(fx, fy) <= 0:
        raise InputError(
            f"{where}: its points lie {max(away_px):.2f} pixels from those of the camera that fits best (fx {fx:.1f}, "
            f"fy {fy:.1f}); expected {width}x{height} organised points, x right, y up, z negative before the camera"
        )
    return Camera(fx, fy, cx, cy, width, height)


def describe_camera(camera: Camera) -> str:
    return (
        f"{camera.width}x{camera.height}, fx {camera.fx:.2f}, fy {camera.fy:.2f}, cx {camera.cx:.2f}, cy {camera.cy:.2f} pixels"
    )
