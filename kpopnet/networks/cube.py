"""The metric cube around a person: what a network sees, and the coordinates it answers in.

With the cube's centre c and half size h in metres, a point X, Y, Z of the camera frame has the cube coordinates

    u = (c_z X / Z - c_x) / h,   v = (c_z Y / Z - c_y) / h,   d = (Z - c_z) / h

so that u and v are the cube's front view in perspective, -1..1 over the crop, and d is the depth, -1..1 over the cube.
No intrinsics and no data-set statistics enter: joints go there and back exactly for any camera, and the crop is one
affine warp of the depth image. A `View` of the cube may be rotated about the camera's optical axis or mirrored; both
are linear in u and v, so they fold into the same warp and are exact in 3D.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.skeleton import MIRROR

FEWEST_PX = 20
"""A silhouette of fewer pixels counts as empty."""

ENOUGH_POINTS = 2000
"""For a median: beyond this, more points move it by millimetres."""


@dataclass(frozen=True)
class Cube:
    """An axis-aligned cube in the camera frame.

    Attributes:
        centre_m: (3,) float32.
        half_size_m: half the edge.
    """

    centre_m: np.ndarray
    half_size_m: float

    def to_uvd(self, points_camera_m: np.ndarray) -> np.ndarray:
        """(..., 3) points in metres (Z > 0) to cube coordinates u, v, d."""
        x, y, z = np.moveaxis(np.asarray(points_camera_m), -1, 0)
        cx, cy, cz = self.centre_m
        return np.stack([x / z * cz - cx, y / z * cz - cy, z - cz], axis=-1) / np.float32(self.half_size_m)

    def to_metres(self, uvd: np.ndarray) -> np.ndarray:
        """(..., 3) cube coordinates to points in metres: the inverse of `to_uvd`."""
        u, v, d = np.moveaxis(np.asarray(uvd) * np.float32(self.half_size_m), -1, 0)
        cx, cy, cz = self.centre_m
        z = d + cz
        return np.stack([(u + cx) / cz * z, (v + cy) / cz * z, z], axis=-1)

    def camera(self, crop_px: int) -> Camera:
        """The pinhole camera that would take the cube's plain crop, for drawing."""
        cx, cy, cz = (float(value) for value in self.centre_m)
        per_metre = crop_px / (2 * self.half_size_m)
        middle = (crop_px - 1) / 2
        return Camera(per_metre * cz, per_metre * cz, middle - per_metre * cx, middle - per_metre * cy, crop_px, crop_px)


class View(NamedTuple):
    """How the cube is looked at: first mirrored left to right, then turned about the camera's optical axis.

    Attributes:
        rotation_rad: positive turns the picture clockwise (x towards y).
        mirrored: the mirror swaps the person's left and right.
    """

    rotation_rad: float = 0.0
    mirrored: bool = False

    def matrix(self) -> np.ndarray:
        """(2, 2) float64 taking u, v of the plain view to u, v of this view."""
        cos, sin = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        return np.array([[cos, -sin], [sin, cos]]) * [-1.0 if self.mirrored else 1.0, 1.0]

    def joints(self, uvd: np.ndarray) -> np.ndarray:
        """(15, 3) joints in plain cube coordinates as this view has them, left and right swapped if mirrored."""
        seen = np.concatenate([uvd[:, :2] @ self.matrix().T.astype(np.float32), uvd[:, 2:]], axis=1)
        return seen[MIRROR] if self.mirrored else seen


PLAIN_VIEW = View()


def person_centre(depth_m: np.ndarray, camera: Camera) -> np.ndarray | None:
    """(3,) float32: the median of X, of Y and of Z over the silhouette's points; None for an empty silhouette.

    A median shrugs off what clings to an imperfect silhouette: a piece of floor, a flying pixel.
    """
    points = silhouette_points(depth_m, camera.fx, camera.fy, camera.cx, camera.cy)
    if points.shape[1] < FEWEST_PX:
        return None
    return np.median(points, axis=1).astype(np.float32)


def person_cubes(depth_m: np.ndarray, camera: Camera, half_size_m: float) -> dict[int, Cube]:
    """The cube around the person by the number of the frame, of those of (T, H, W) frames that show one."""
    centres_m = ((frame, person_centre(image, camera)) for frame, image in enumerate(depth_m))
    return {frame: Cube(centre_m, half_size_m) for frame, centre_m in centres_m if centre_m is not None}


@njit(cache=True)
def silhouette_points(depth_m, fx, fy, cx, cy):
    """(3, N) X, Y, Z in metres of the pixels with a measurement, or of every n-th such that some thousands remain."""
    every = max(1, np.count_nonzero(depth_m) // ENOUGH_POINTS)
    points = np.empty((3, depth_m.size // every + 1), np.float32)
    seen = kept = 0
    for row in range(depth_m.shape[0]):
        for column in range(depth_m.shape[1]):
            z = depth_m[row, column]
            if z > 0:
                if seen % every == 0:
                    points[0, kept] = (column - cx) * z / fx
                    points[1, kept] = (row - cy) * z / fy
                    points[2, kept] = z
                    kept += 1
                seen += 1
    return points[:, :kept].copy()


def crop(
    depth_m: np.ndarray,
    camera: Camera,
    cube: Cube,
    crop_px: int,
    ridge: np.ndarray | None = None,
    view: View = PLAIN_VIEW,
) -> np.ndarray:
    """What a network sees of a cube.

    Args:
        depth_m: (H, W) float32 of the person alone, 0 elsewhere.
        camera: the camera of exactly these pixels.
        cube: see `person_centre`.
        crop_px: side of the crop.
        ridge: (H, W) float32 ridge probability in 0..1, or None for a crop of depth only.
        view: the view of the cube; `view.joints` takes joints along.

    Returns:
        (1 or 2, crop_px, crop_px) float32. Channel 0 is d by the nearest pixel (interpolation would put points in the
        air between a limb and what lies behind it), clipped to -1..1 and 1 where nothing was measured. Channel 1 is the
        mean ridge probability over the crop pixel's square, so that lines thinner than a crop pixel stay whole.
    """
    cx, cy, cz = (float(value) for value in cube.centre_m)
    # Cube units of this view to X / Z and Y / Z, to image pixels; with crop pixel i at u = (2 i + 1) / crop_px - 1.
    to_pixels = np.diag([camera.fx, camera.fy]) @ np.linalg.inv(view.matrix()) * (cube.half_size_m / cz)
    step = to_pixels * (2 / crop_px)
    first = to_pixels @ np.full(2, 1 / crop_px - 1) + (camera.fx * cx / cz + camera.cx, camera.fy * cy / cz + camera.cy)
    out = np.empty((1 if ridge is None else 2, crop_px, crop_px), np.float32)
    warp_depth(depth_m, step, first, np.float32(cz), np.float32(1 / cube.half_size_m), out[0])
    if ridge is not None:
        warp_mean(ridge, step, first, out[1])
    return out


@njit(cache=True)
def warp_depth(depth_m, step, first, centre_z, per_half_size, out):
    """Fills out (S, S) with d of the pixel nearest to first + step @ (column, row), 1 where there is none."""
    height, width = depth_m.shape
    for row in range(out.shape[0]):
        # Half a pixel on, so that truncation rounds; -1 < x < 0 would truncate to 0 and is ruled out first.
        x = first[0] + step[0, 1] * row + 0.5
        y = first[1] + step[1, 1] * row + 0.5
        for column in range(out.shape[1]):
            d = np.float32(1)
            if 0 <= x < width and 0 <= y < height:
                z = depth_m[np.int32(y), np.int32(x)]
                if z > 0:
                    d = min(max((z - centre_z) * per_half_size, np.float32(-1)), np.float32(1))
            out[row, column] = d
            x += step[0, 0]
            y += step[1, 0]


@njit(cache=True)
def warp_mean(image, step, first, out):
    """Fills out (S, S) with the mean of image over each crop pixel's square, sampled about once an image pixel."""
    height, width = image.shape
    side = max(1, int(np.ceil(np.sqrt(abs(step[0, 0] * step[1, 1] - step[0, 1] * step[1, 0])))))
    right_x, right_y = step[0, 0] / side, step[1, 0] / side
    down_x, down_y = step[0, 1] / side, step[1, 1] / side
    corner = (1 - side) / 2
    out[:] = 0
    for row in range(out.shape[0] * side):
        x = first[0] + corner * (right_x + down_x) + down_x * row + 0.5
        y = first[1] + corner * (right_y + down_y) + down_y * row + 0.5
        for column in range(out.shape[1]):
            total = np.float32(0)
            for _ in range(side):
                if 0 <= x < width and 0 <= y < height:
                    total += image[np.int32(y), np.int32(x)]
                x += right_x
                y += right_y
            out[row // side, column] += total
    out /= side * side
