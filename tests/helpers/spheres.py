"""Depth images of spheres, the surface of every drawn person: analytic, and independent of the renderers."""

from collections.abc import Iterable

import numpy as np
from numba import njit

from kpopnet.camera import Camera


def row(a: np.ndarray, b: np.ndarray, radius_a: float, radius_b: float, count: int) -> list[tuple[np.ndarray, float]]:
    """Spheres from a to b, whose radii go from one to the other."""
    return [(a + fraction * (b - a), radius_a + fraction * (radius_b - radius_a)) for fraction in np.linspace(0, 1, count)]


def draw_spheres(spheres: Iterable[tuple[np.ndarray, float]], camera: Camera) -> np.ndarray:
    """(H, W) float32 metres of (centre, radius) in metres, 0 elsewhere; rays are parallel within a sphere."""
    depth = np.full((camera.height, camera.width), np.inf)
    _draw(depth, np.array([[*centre, radius] for centre, radius in spheres]), camera.fx, camera.fy, camera.cx, camera.cy)
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)


@njit(cache=True)
def _draw(depth, spheres, fx, fy, cx, cy):
    """Draws (N, 4) x, y, z and radius into an (H, W) depth image wherever they are nearer."""
    height, width = depth.shape
    for x, y, z, radius in spheres:
        reach = 1.1 * max(fx, fy) * radius / z + 1
        u, v = fx * x / z + cx, fy * y / z + cy
        for i in range(max(int(v - reach), 0), min(max(int(v + reach), 0), height)):
            for j in range(max(int(u - reach), 0), min(max(int(u + reach), 0), width)):
                squared = radius**2 - ((j - cx) * z / fx - x) ** 2 - ((i - cy) * z / fy - y) ** 2
                if squared > 0:
                    depth[i, j] = min(depth[i, j], z - np.sqrt(squared))
