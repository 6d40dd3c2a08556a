"""Elliptic holes in depth images: connected regions that the camera or the segmentation loses."""

import math

import numpy as np
from numba import njit

from kpopnet.camera import Camera


def spherical_hole(centre_camera_m: np.ndarray, radius_m: float, depth_reach_m: float, camera: Camera) -> np.ndarray:
    """The hole around a point, for `erase_ellipses`.

    Args:
        centre_camera_m: (3,) centre, camera frame.
        radius_m: radius in the image plane at the centre's depth.
        depth_reach_m: largest difference in depth from the centre that is erased.
        camera: the camera of the image.

    Returns:
        (1, 7) ellipse; (0, 7) if the point is NaN, behind the camera or nearer than 5 cm.
    """
    u, v, z = camera.project(centre_camera_m)
    if not z > 0.05:
        return np.zeros((0, 7))
    radii_px = radius_m * camera.fx / z, radius_m * camera.fy / z
    return np.array([[u, v, *radii_px, 0, z - depth_reach_m, z + depth_reach_m]])


@njit(cache=True)
def erase_ellipses(depth, ellipses):
    """Sets depth to 0, in place, inside ellipses.

    Args:
        depth: (h, w) float32 metres.
        ellipses: (N, 7) float32: centre u, v and the two semi-axes in pixels, the angle of the first axis in radians,
            nearest and farthest depth in metres that is erased.
    """
    height, width = depth.shape
    for u, v, a, b, angle, near, far in ellipses:
        reach = max(a, b)
        cos, sin = math.cos(angle), math.sin(angle)
        for y in range(max(int(v - reach), 0), min(int(v + reach) + 2, height)):
            for x in range(max(int(u - reach), 0), min(int(u + reach) + 2, width)):
                along = ((x - u) * cos + (y - v) * sin) / a
                across = ((y - v) * cos - (x - u) * sin) / b
                if along * along + across * across <= 1 and near <= depth[y, x] <= far:
                    depth[y, x] = 0
