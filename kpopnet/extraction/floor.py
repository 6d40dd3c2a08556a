"""The floor (Eq. 1 and the first part of Algorithm 1): a plane fitted iteratively to the lowest points.

Assumptions, where the paper is silent or wrong:

- In Eq. (1) d stands for each pixel's distance, in Algorithm 1 for what is subtracted from it. Here the floor is the
  plane n.x + d = 0 with a unit normal n that points upwards, so that n.x + d is the height above it. The equation is
  solved in the form A.X = 1, whose solution is A = -n / d. Each row is divided by its depth, so the right side is 1/z.
  A triangulating camera measures 1/z with the same accuracy at all distances, so far points are not overweighted.
- "Until X_f is changed" must read "until X_f no longer changes".
- X_f takes everything below delta_f. Points far below the floor do not belong to it (mirror images, wrong measurements):
  the fit uses the points within delta_f on both sides, the removal takes everything below.
- "The points with the smallest y" is right for a level camera. Cameras look down or up, so the first step is repeated
  for a set of pitches. The plane with the most points on it and hardly any below is kept.
- delta_f follows the noise: it grows with the distance, in proportion to the scatter of the floor's points.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.extraction.background import FAR_M

PITCHES_RAD = np.radians(np.arange(-30.0, 61.0, 7.5))
"""Tried pitches of the camera, positive downwards. The fit converges from the nearest of them."""

SAMPLES = 2000
"""Approximate number of pixels in a fit, on a regular grid."""

MAX_ITERATIONS = 20
FIRST_BAND_M = 0.1
"""Half the thickness of the band of points in the first fit."""

MIN_SHARE = 0.01
"""Smallest share of the sampled pixels that lie on the floor."""

MAX_SHARE_BELOW = 0.02
"""Largest share of the measured points below the floor."""

MIN_EXTENT_M = 0.4
"""Smallest visible extent of the floor in x and in z."""

MIN_CAMERA_HEIGHT_M = 0.2
"""Smallest height of the camera above the floor."""

MIN_UP = math.cos(math.radians(60.0))
"""Smallest component of the floor's normal along the image's upward axis."""

BAND_SIGMAS = 2.5
"""Half the thickness of the floor's band, in standard deviations of the height of its points."""

MAX_SCATTER = 0.012
"""Upper limit of `Floor.scatter`."""


@dataclass(frozen=True)
class Floor:
    """A floor plane and the scatter of its points.

    Attributes:
        plane: (4,) float64 unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame, metres.
        scatter: standard deviation of the height of its points, in metres per metre of distance.
    """

    plane: np.ndarray
    scatter: float

    def delta_f(self, delta_f_m: float) -> tuple[float, float]:
        """a, b: points less than a + b z above the plane are floor, at depth z in metres."""
        return delta_f_m, BAND_SIGMAS * self.scatter


def find_floor(depth_m: np.ndarray, camera: Camera, delta_f_m: float) -> Floor | None:
    """Finds the floor of an image without prior knowledge.

    Args:
        depth_m: (H, W) float32, 0 where nothing was measured.
        camera: its camera.
        delta_f_m: smallest thickness of the floor's band, metres.

    Returns:
        The floor, None if none is in view.
    """
    points = _sample(depth_m, camera)
    x, y, z = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2], 1 / points[:, 2]
    best, most_inliers = None, max(MIN_SHARE * _num_samples(depth_m), 10)
    if len(points) < most_inliers:
        return None
    for pitch in PITCHES_RAD:
        up = np.array([0.0, -math.cos(pitch), -math.sin(pitch)])
        # The lowest points; the lowest 1 % are skipped as outliers below the floor.
        height_m = up[1] * y + up[2] * z
        lowest_m = np.partition(height_m, len(z) // 100)[len(z) // 100]
        plane, inliers, scatter = _fit_plane(points, np.append(up, -lowest_m), FIRST_BAND_M, 0.0)
        if not inliers:
            continue
        floor = Floor(plane, min(scatter, MAX_SCATTER))
        plane, inliers, scatter = _fit_plane(points, plane, *floor.delta_f(delta_f_m))
        if inliers > most_inliers and _is_floor(plane, x, y, z, delta_f_m, scatter):
            best, most_inliers = Floor(plane, min(scatter, MAX_SCATTER)), inliers
    return best


def refit_floor(floor: Floor, depth_m: np.ndarray, camera: Camera, delta_f_m: float) -> Floor:
    """Refits the floor to the next image of a static camera; returns the given floor if too little of it is visible."""
    points = _sample(depth_m, camera)
    plane, inliers, scatter = _fit_plane(points, floor.plane, *floor.delta_f(delta_f_m))
    cosine = plane[:3] @ floor.plane[:3]
    if inliers < MIN_SHARE * _num_samples(depth_m) or cosine < 0.999 or abs(plane[3] - floor.plane[3]) > 0.05:
        return floor
    return Floor(plane, min(scatter, MAX_SCATTER))


def _is_floor(plane: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray, delta_f_m: float, scatter: float) -> bool:
    """Whether a plane lies below the camera and below nearly all points, and is visible over a sufficient extent."""
    if not (plane[1] < -MIN_UP and plane[3] > MIN_CAMERA_HEIGHT_M):
        return False
    height_m = plane[0] * x + plane[1] * y + plane[2] * z + plane[3]
    band_m = delta_f_m + BAND_SIGMAS * scatter * z
    if np.count_nonzero(height_m < -2 * band_m) > MAX_SHARE_BELOW * len(z):
        return False
    on_floor = np.abs(height_m) < band_m
    return all(np.ptp(np.percentile(axis[on_floor], [5, 95])) > MIN_EXTENT_M for axis in (x, z))


def _stride(depth_m: np.ndarray) -> int:
    return max(1, round(math.sqrt(depth_m.size / SAMPLES)))


def _num_samples(depth_m: np.ndarray) -> int:
    stride = _stride(depth_m)
    return -(-depth_m.shape[0] // stride) * -(-depth_m.shape[1] // stride)


def _sample(depth_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(N, 4) measured pixels on a grid: x/z, y/z, 1/z, and the derivative of 1/z by y/z, downwards in the image."""
    return _measured_on_grid(depth_m, _stride(depth_m), camera.fx, camera.fy, camera.cx, camera.cy)


@njit(cache=True)
def _measured_on_grid(depth, stride, fx, fy, cx, cy):
    height, width = depth.shape
    capacity = ((height + stride - 1) // stride) * ((width + stride - 1) // stride)
    points = np.empty((capacity, 4))
    count = 0
    for y in range(0, height, stride):
        above, below = max(y - stride, 0), min(y + stride, height - 1)
        for x in range(0, width, stride):
            z, z_above, z_below = depth[y, x], depth[above, x], depth[below, x]
            if 0 < z < FAR_M and 0 < z_above < FAR_M and 0 < z_below < FAR_M and below > above:
                points[count, 0] = (x - cx) / fx
                points[count, 1] = (y - cy) / fy
                points[count, 2] = 1.0 / z
                points[count, 3] = (1.0 / z_below - 1.0 / z_above) * fy / (below - above)
                count += 1
    return points[:count]


@njit(cache=True)
def _fit_plane(points, plane, band_m, band_per_m):
    """Algorithm 1's loop: least squares over the points near the plane, until this set no longer changes.

    Args:
        points: (N, 4) from `_sample`.
        plane: (4,) the initial plane.
        band_m: points within band_m + band_per_m z of the plane are near it, at depth z.
        band_per_m: see band_m.

    Returns:
        The plane, the number of points near it, and the standard deviation of their height per metre of distance. The
        initial plane with 0 points if the fit is degenerate.
    """
    near = np.zeros(len(points), np.bool_)
    found = plane.copy()
    for _ in range(MAX_ITERATIONS):
        changed = False
        s_xx = s_xy = s_x = s_yy = s_y = s_1 = t_x = t_y = t_1 = squares = 0.0
        # On the plane, 1/z grows with y/z by -n_y / d; on upright surfaces hardly at all. Half of it is required.
        min_growth = -0.5 * found[1] / found[3]
        for i in range(len(points)):
            x, y, w = points[i, 0], points[i, 1], points[i, 2]
            # Height and band, both divided by z
            slope = found[0] * x + found[1] * y + found[2] + found[3] * w
            now = abs(slope) < band_m * w + band_per_m and points[i, 3] > min_growth
            changed |= now != near[i]
            near[i] = now
            if now:
                s_xx += x * x
                s_xy += x * y
                s_x += x
                s_yy += y * y
                s_y += y
                s_1 += 1.0
                t_x += x * w
                t_y += y * w
                t_1 += w
                squares += slope * slope
        if not changed:
            break
        # Eq. (1): A = (X^T X)^-1 X^T d with rows X / z and d = 1 / z, by Cramer's rule
        c_xx, c_xy, c_x1 = s_yy * s_1 - s_y * s_y, s_y * s_x - s_xy * s_1, s_xy * s_y - s_yy * s_x
        determinant = s_xx * c_xx + s_xy * c_xy + s_x * c_x1
        if s_1 < 3 or not abs(determinant) > 1e-9 * s_1 * s_1 * s_1:
            return plane, 0, 0.0
        c_yy, c_y1, c_11 = s_xx * s_1 - s_x * s_x, s_xy * s_x - s_xx * s_y, s_xx * s_yy - s_xy * s_xy
        a = (c_xx * t_x + c_xy * t_y + c_x1 * t_1) / determinant
        b = (c_xy * t_x + c_yy * t_y + c_y1 * t_1) / determinant
        c = (c_x1 * t_x + c_y1 * t_y + c_11 * t_1) / determinant
        length = math.sqrt(a * a + b * b + c * c)
        if not length > 0:
            return plane, 0, 0.0
        found[0], found[1], found[2], found[3] = -a / length, -b / length, -c / length, 1 / length
    return found, int(s_1), math.sqrt(squares / max(s_1, 1.0))
