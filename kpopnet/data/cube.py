"""The metric cube around a person: the input crop of the networks and the coordinates of their output.

For a cube with centre c and half size h in metres, a point X, Y, Z of the camera frame has the cube coordinates

    u = (c_z X / Z - c_x) / h,   v = (c_z Y / Z - c_y) / h,   d = (Z - c_z) / h

u and v are the perspective front view of the cube, -1..1 over the crop; d is the depth, -1..1 over the cube. The
coordinates depend neither on intrinsics nor on statistics of a data set: joints convert to them and back exactly for any
camera, and the crop is one affine warp of the depth image. A `View` of the cube may be mirrored or rotated about the
camera's optical axis. Both are linear in u and v, so they are part of the same warp and exact in 3D.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera, check_images
from kpopnet.errors import InputError
from kpopnet.skeleton import MIRROR

INPUTS = {"depth": 1, "depth_ridge": 2}
"""Number of channels of the crop, by the name of the input."""

MIN_SILHOUETTE_PX = 20
"""A silhouette with fewer pixels counts as empty."""

MEDIAN_POINTS = 2000
"""The median over a silhouette uses at least this many points, if it has them; more change it by millimetres."""

MAX_CROP_PX, CROP_STEP_PX = 256, 16
"""Largest side of a crop, which a checkpoint's description chooses, and the largest stride of a network's encoder."""

MOST_SIDE = 64
"""Most samples along the side of a crop's pixel: as many as a person half a metre before a camera of 1280 pixels has."""


def check_crop_px(name: str, side: int) -> None:
    """Raises InputError unless a crop can have this side, in pixels."""
    if not 32 <= side <= MAX_CROP_PX or side % CROP_STEP_PX:
        raise InputError(f"{name}={side}: expected a multiple of {CROP_STEP_PX}, 32 to {MAX_CROP_PX}")


@dataclass(frozen=True)
class Cube:
    """An axis-aligned cube: its (3,) float32 centre in the camera frame and half its edge, in metres."""

    centre_m: np.ndarray
    half_size_m: float

    def to_uvd(self, points_camera_m: np.ndarray) -> np.ndarray:
        """Converts (..., 3) points in metres (Z > 0) to cube coordinates u, v, d."""
        x, y, z = np.moveaxis(np.asarray(points_camera_m), -1, 0)
        cx, cy, cz = self.centre_m
        return np.stack([x / z * cz - cx, y / z * cz - cy, z - cz], axis=-1) / np.float32(self.half_size_m)

    def to_metres(self, uvd: np.ndarray) -> np.ndarray:
        """Converts (..., 3) cube coordinates to points in metres: the inverse of `to_uvd`."""
        u, v, d = np.moveaxis(np.asarray(uvd) * np.float32(self.half_size_m), -1, 0)
        cx, cy, cz = self.centre_m
        z = d + cz
        return np.stack([(u + cx) / cz * z, (v + cy) / cz * z, z], axis=-1)

    def camera(self, crop_px: int) -> Camera:
        """The pinhole camera whose image is the crop without augmentation, for drawing."""
        cx, cy, cz = (float(value) for value in self.centre_m)
        per_metre = crop_px / (2 * self.half_size_m)
        middle = (crop_px - 1) / 2
        return Camera(per_metre * cz, per_metre * cz, middle - per_metre * cx, middle - per_metre * cy, crop_px, crop_px)


class View(NamedTuple):
    """An augmented view of the cube: first mirrored left to right, then rotated about the camera's optical axis."""

    rotation_rad: float = 0.0  # positive rotates the image clockwise (x towards y)
    mirrored: bool = False  # the image is mirrored, which swaps the person's left and right

    def matrix(self) -> np.ndarray:
        """(2, 2) float64 matrix from u, v of the plain view to u, v of this view."""
        cos, sin = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        return np.array([[cos, -sin], [sin, cos]]) * [-1.0 if self.mirrored else 1.0, 1.0]

    def joints(self, uvd: np.ndarray) -> np.ndarray:
        """Converts (15, 3) joints from plain cube coordinates to this view; left and right are swapped if mirrored."""
        viewed = np.concatenate([uvd[:, :2] @ self.matrix().T.astype(np.float32), uvd[:, 2:]], axis=1)
        return viewed[MIRROR] if self.mirrored else viewed


PLAIN_VIEW = View()


def person_centre(depth_m: np.ndarray, camera: Camera) -> np.ndarray | None:
    """(3,) float32 metres: the median of X, of Y and of Z over the silhouette's points; None for an empty silhouette.

    A median is robust against outliers of an imperfect silhouette: a piece of floor, flying pixels. Raises InputError if the
    (H, W) depth is not of the camera's size.
    """
    check_images("depth image", camera, depth_m)
    measured = np.flatnonzero(depth_m > 0)
    if len(measured) < MIN_SILHOUETTE_PX:
        return None
    measured = measured[:: max(1, len(measured) // MEDIAN_POINTS)]
    (rows, columns), z = np.divmod(measured, camera.width), depth_m.take(measured)
    points = np.stack([(columns - camera.cx) * z / camera.fx, (rows - camera.cy) * z / camera.fy, z])
    return np.median(points.astype(np.float32), axis=1)


def person_cubes(depth_m: np.ndarray, camera: Camera, half_size_m: float) -> dict[int, Cube]:
    """The cube around the person, by frame index, for the (T, H, W) depth frames in metres that show a person."""
    centres_m = ((frame, person_centre(image, camera)) for frame, image in enumerate(depth_m))
    return {frame: Cube(centre_m, half_size_m) for frame, centre_m in centres_m if centre_m is not None}


def crop(
    depth_m: np.ndarray, camera: Camera, cube: Cube, crop_px: int, ridge: np.ndarray | None = None, view: View = PLAIN_VIEW
) -> np.ndarray:
    """Crops a cube from (H, W) float32 segmented depth in metres, 0 outside the person, as the input of a network.

    Returns (1 or 2, crop_px, crop_px) float32. Channel 0 is d of the nearest pixel, clipped to -1..1, and 1 where nothing was
    measured. (Interpolation would create points between a limb and the surface behind it.) Channel 1, of the (H, W) float32
    `ridge` in 0..1 if given, is its mean over the crop pixel's square, so that lines thinner than a crop pixel are preserved.
    `view.joints` transforms joints as `view` does the cube. Raises InputError if an image is not of the camera's size.
    """
    check_images("depth and ridge image", camera, depth_m, *(() if ridge is None else (ridge,)))
    step, first = crop_pixels(camera, cube, crop_px, view)
    out = np.empty((1 if ridge is None else 2, crop_px, crop_px), np.float32)
    warp_depth(depth_m, step, first, np.float32(cube.centre_m[2]), np.float32(1 / cube.half_size_m), out[0])
    if ridge is not None:
        warp_mean(ridge, step, first, out[1])
    return out


def crop_pixels(camera: Camera, cube: Cube, crop_px: int, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Where a crop's pixels lie in the image: (2, 2) step and (2,) first, float64, of pixel first + step @ (column, row)."""
    cx, cy, cz = (float(value) for value in cube.centre_m)
    # From cube units of this view to X / Z and Y / Z to image pixels; crop pixel i lies at u = (2 i + 1) / crop_px - 1.
    # The view's matrix is orthogonal: its inverse is its transpose.
    to_pixels = np.array([[camera.fx], [camera.fy]]) * view.matrix().T * (cube.half_size_m / cz)
    first = to_pixels @ np.full(2, 1 / crop_px - 1) + (camera.fx * cx / cz + camera.cx, camera.fy * cy / cz + camera.cy)
    return to_pixels * (2 / crop_px), first


@njit(cache=True)
def warp_depth(depth_m, step, first, centre_z, per_half_size, out):
    """Fills `out` (S, S) with d of the pixel nearest to first + step @ (column, row), 1 where nothing was measured."""
    height, width = depth_m.shape
    for row in range(out.shape[0]):
        # Half a pixel is added, so that truncation rounds; -1 < x < 0 would truncate to 0 and is excluded first.
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
    """Fills `out` (S, S) with the mean of `image` over each crop pixel's square, sampled about once per image pixel.

    Squares of more than MOST_SIDE pixels, which only a wrong unit or camera makes, are sampled less often.
    """
    height, width = image.shape
    side = max(1.0, np.ceil(np.sqrt(abs(step[0, 0] * step[1, 1] - step[0, 1] * step[1, 0]))))
    side = int(min(side, MOST_SIDE))
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
