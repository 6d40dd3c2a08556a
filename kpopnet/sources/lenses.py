"""Lens distortion and mounting, undone by a look-up table: each pixel of the pinhole image takes its nearest measured one.

Nothing is interpolated: between a person and the wall behind there is no surface to measure.
"""

from typing import NamedTuple

import cv2
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError

VISIBLE_PX = 0.5
"""A lens that moves no pixel by more than this, pixels, needs no table: the nearest measured pixel is the same one."""

FARTHEST = 2.5
"""Largest tangent of the angle to the optical axis that a pinhole image shows: 136 degrees across."""

STEPS = 5000


class Lens(NamedTuple):
    """How a lens bends rays."""

    # in OpenCV's order. Of Brown-Conrady's model, whose rational form Azure Kinect uses: k1, k2, p1, p2, k3 to k6; of a fisheye
    # lens (Kannala & Brandt 2006) k1 to k4. Those at the end may be missing: 0.
    coefficients: tuple[float, ...]
    is_fisheye: bool = False  # which of the two

    @property
    def all(self) -> list[float]:
        """The coefficients with those that are missing."""
        return [*self.coefficients, *[0.0] * 8][: 4 if self.is_fisheye else 8]

    def radius(self, ray: np.ndarray) -> np.ndarray:
        """The distance from the principal point, in focal lengths, at which rays of these tangents arrive."""
        k = self.all
        if self.is_fisheye:
            angle = np.arctan(ray)
            return angle * (1 + k[0] * angle**2 + k[1] * angle**4 + k[2] * angle**6 + k[3] * angle**8)
        r2 = ray**2
        return ray * (1 + k[0] * r2 + k[1] * r2**2 + k[4] * r2**3) / (1 + k[5] * r2 + k[6] * r2**2 + k[7] * r2**3)


class View(NamedTuple):
    """A pinhole camera and how its image is taken from what the sensor stores."""

    camera: Camera  # the pinhole camera
    # (H, W) index of the stored pixel that each pixel takes, -1 for none; None takes all as they are
    table: np.ndarray | None = None

    def image(self, depth: np.ndarray) -> np.ndarray:
        """The pinhole image, (H, W), of a stored one."""
        if self.table is None:
            return depth
        return np.where(self.table < 0, depth.dtype.type(0), depth.ravel()[self.table])

    def rotated(self, clockwise_deg: int) -> "View":
        """The view of a camera that is mounted on its side or head: images turned by 0, 90, 180 or 270 degrees."""
        if clockwise_deg not in (0, 90, 180, 270):
            raise InputError(f"a rotation by {clockwise_deg} degrees: expected 0, 90, 180 or 270, clockwise")
        camera, table = self.camera, self.table
        if clockwise_deg and table is None:
            table = np.arange(camera.width * camera.height).reshape(camera.height, camera.width)
        for _ in range(int(clockwise_deg) // 90):
            camera, table = camera.turned(), np.rot90(table, -1)
        return View(camera, table if table is None else np.ascontiguousarray(table))


class Optics(NamedTuple):
    """The camera of a recording and its lens, None for a pinhole."""

    camera: Camera
    lens: Lens | None = None

    def view(self) -> View:
        """The pinhole view; the middle of every side of the stored image stays in it. InputError if the lens maps no image."""
        camera, lens = self
        if lens is None or not any(lens.coefficients):
            return View(camera)
        rays = np.linspace(0, FARTHEST, STEPS)
        with np.errstate(all="ignore"):
            radius = lens.radius(rays)
            folds = np.flatnonzero(~(np.diff(radius) > 0))  # beyond it the model folds the image back
        most = int(folds[0]) + 1 if len(folds) else STEPS
        if most < 2:
            raise InputError(f"a lens of coefficients {', '.join(f'{one:g}' for one in lens.coefficients)}: it maps no image")
        across, down = camera.width - 1 - camera.cx, camera.height - 1 - camera.cy
        side = np.array([camera.cx / camera.fx, across / camera.fx, camera.cy / camera.fy, down / camera.fy]).clip(1e-3)
        zoom = min(1.0, float((side / np.interp(side, radius[:most], rays[:most])).min()))
        pinhole = Camera(camera.fx * zoom, camera.fy * zoom, camera.cx, camera.cy, camera.width, camera.height)
        uv = _stored(camera, lens, pinhole)
        there = np.mgrid[: camera.height, : camera.width][::-1]
        if zoom == 1 and np.abs(uv - there).max() <= VISIBLE_PX:
            return View(camera)
        tangent = np.hypot((there[0] - pinhole.cx) / pinhole.fx, (there[1] - pinhole.cy) / pinhole.fy)
        u, v = np.where(np.isfinite(uv), uv, -1).round()
        inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height) & (tangent <= rays[most - 1])
        return View(pinhole, np.where(inside, v * camera.width + u, -1).astype(np.int64))


def _stored(camera: Camera, lens: Lens, pinhole: Camera) -> np.ndarray:
    """(2, H, W) columns and rows of the stored image where the rays of the pinhole image's pixels arrive."""
    matrix, new = (np.array([[one.fx, 0, one.cx], [0, one.fy, one.cy], [0, 0, 1.0]]) for one in (camera, pinhole))
    undo = cv2.fisheye.initUndistortRectifyMap if lens.is_fisheye else cv2.initUndistortRectifyMap
    return np.stack(undo(matrix, np.array(lens.all), np.eye(3), new, (camera.width, camera.height), cv2.CV_32FC1))
