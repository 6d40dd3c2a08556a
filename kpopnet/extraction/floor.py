"""The floor (Eq. 1 and the first part of Algorithm 1): a plane through the lowest points, fitted until it settles.

What the paper leaves open or gets wrong is settled so:

- In Eq. (1) d stands for each pixel's distance, in Algorithm 1 for what is subtracted from it; here the floor is where
  n.x + d = 0 with n of unit length, upwards, so that n.x + d is the height above it. The equation is solved in the form
  A.X = 1, whose solution is A = -n / d. Each row is divided by its depth, which makes the right side 1/z: what a
  triangulating camera measures, equally well at all distances, so that far points do not weigh more than they tell.
- "Until X_f is changed" must read "until X_f no longer changes".
- X_f takes everything below delta_f. Points far below the floor are none of it (mirror images, wrong measurements): the
  fit takes what is within delta_f on both sides, while the removal takes everything below.
- "The points with the smallest y" is right for a level camera. Cameras look down or up, so the first step is done for a
  fan of pitches, and the plane kept that most of the picture lies on and hardly anything under.
- delta_f follows the noise: it grows with the distance, by as much as the floor's own points scatter about the plane.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.extraction.room import FAR_M

PITCHES_RAD = np.radians(np.arange(-30.0, 61.0, 7.5))
"""How far the camera may look down; what lies between two of them is near enough to either."""

SAMPLES = 2000
"""About so many pixels, evenly spread, are looked at in a fit."""

ROUNDS = 20
FIRST_BAND_M = 0.1
LEAST_SHARE = 0.01
"""A floor has at least this share of the pixels looked at."""

MOST_BELOW = 0.02
"""With a larger share of the measured points under it, a plane is not the floor."""

LEAST_EXTENT_M = 0.4
"""A floor is seen over at least this much, along and across."""

LEAST_HEIGHT_M = 0.2
"""The camera is at least so high above the floor."""

LEAST_UP = math.cos(math.radians(60.0))
SIGMAS = 2.5
LARGEST_SCATTER = 0.012


@dataclass(frozen=True)
class Floor:
    """A floor plane and how well it is measured.

    Attributes:
        plane: (4,) float64 unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame, metres.
        scatter: standard deviation of its points' height, in metres for each metre of distance.
    """

    plane: np.ndarray
    scatter: float

    def delta_f(self, delta_f_m: float) -> tuple[float, float]:
        """The thickness of what counts as floor as a + b z, at distances z in metres."""
        return delta_f_m, SIGMAS * self.scatter


def find_floor(depth_m: np.ndarray, camera: Camera, delta_f_m: float) -> Floor | None:
    """The floor of a picture about which nothing is known yet.

    Args:
        depth_m: (H, W) float32, 0 where nothing was measured.
        camera: its camera.
        delta_f_m: the least thickness of what counts as floor.

    Returns:
        None if none is in view.
    """
    points = _sample(depth_m, camera)
    x, y, z = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2], 1 / points[:, 2]
    best, most = None, max(LEAST_SHARE * _samples_in(depth_m), 10)
    if len(points) < most:
        return None
    for pitch in PITCHES_RAD:
        up = np.array([0.0, -math.cos(pitch), -math.sin(pitch)])
        # The lowest points, but for the odd one that lies under the floor.
        height_m = up[1] * y + up[2] * z
        lowest_m = np.partition(height_m, len(z) // 100)[len(z) // 100]
        plane, inliers, scatter = _settle(points, np.append(up, -lowest_m), FIRST_BAND_M, 0.0)
        if not inliers:
            continue
        floor = Floor(plane, min(scatter, LARGEST_SCATTER))
        plane, inliers, scatter = _settle(points, plane, *floor.delta_f(delta_f_m))
        if inliers > most and _is_floor(plane, x, y, z, delta_f_m, scatter):
            best, most = Floor(plane, min(scatter, LARGEST_SCATTER)), inliers
    return best


def refit_floor(floor: Floor, depth_m: np.ndarray, camera: Camera, delta_f_m: float) -> Floor:
    """The floor in the next picture of a camera that stands still; the same if too little of it is seen."""
    points = _sample(depth_m, camera)
    plane, inliers, scatter = _settle(points, floor.plane, *floor.delta_f(delta_f_m))
    turned = plane[:3] @ floor.plane[:3]
    if inliers < LEAST_SHARE * _samples_in(depth_m) or turned < 0.999 or abs(plane[3] - floor.plane[3]) > 0.05:
        return floor
    return Floor(plane, min(scatter, LARGEST_SCATTER))


def _is_floor(plane: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray, delta_f_m: float, scatter: float) -> bool:
    """Whether it lies under the camera and under nearly everything, and is seen over some length and breadth."""
    if not (plane[1] < -LEAST_UP and plane[3] > LEAST_HEIGHT_M):
        return False
    height_m = plane[0] * x + plane[1] * y + plane[2] * z + plane[3]
    band_m = delta_f_m + SIGMAS * scatter * z
    if np.count_nonzero(height_m < -2 * band_m) > MOST_BELOW * len(z):
        return False
    on_floor = np.abs(height_m) < band_m
    return all(np.ptp(np.percentile(axis[on_floor], [5, 95])) > LEAST_EXTENT_M for axis in (x, z))


def _stride(depth_m: np.ndarray) -> int:
    return max(1, round(math.sqrt(depth_m.size / SAMPLES)))


def _samples_in(depth_m: np.ndarray) -> int:
    stride = _stride(depth_m)
    return -(-depth_m.shape[0] // stride) * -(-depth_m.shape[1] // stride)


def _sample(depth_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(N, 4) measured pixels on a grid: x/z, y/z, 1/z, and how fast 1/z grows with y/z, downwards in the picture."""
    return _measured_on_grid(depth_m, _stride(depth_m), camera.fx, camera.fy, camera.cx, camera.cy)


@njit(cache=True)
def _measured_on_grid(depth, stride, fx, fy, cx, cy):
    height, width = depth.shape
    most = ((height + stride - 1) // stride) * ((width + stride - 1) // stride)
    points = np.empty((most, 4))
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
def _settle(points, plane, band_m, band_per_m):
    """Algorithm 1's loop: least squares over what lies near the plane, until that no longer changes.

    Returns:
        The plane, how many points lie near it, and the scatter of their height for each metre of distance.
    """
    near = np.zeros(len(points), np.bool_)
    found = plane.copy()
    for _ in range(ROUNDS):
        changed = False
        s_xx = s_xy = s_x = s_yy = s_y = s_1 = t_x = t_y = t_1 = squares = 0.0
        # On the plane 1/z grows by so much with y/z, on what stands upright hardly at all.
        least_growth = -0.5 * found[1] / found[3]
        for i in range(len(points)):
            x, y, w = points[i, 0], points[i, 1], points[i, 2]
            # height / z, and the band likewise
            slope = found[0] * x + found[1] * y + found[2] + found[3] * w
            now = abs(slope) < band_m * w + band_per_m and points[i, 3] > least_growth
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
