"""A depth image in cells: the few hundred points that a body is fitted to, and where its silhouette is nearest.

Points are in the camera frame in metres.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.tracker.geodesic import neighbourhood

CELL_PX = 4
"""One point is taken, and the nearest piece of silhouette is kept, for each square of so many pixels."""

FEWEST_CELLS = 20
"""Of a smaller silhouette nothing can be told."""


class Cells(NamedTuple):
    """A depth image at a `CELL_PX`th of its size.

    Attributes:
        points_m: (N, 3) float64, the point seen at the middle of each cell that is measured there.
        index: (h, w) int32 its number in points_m, or -1.
        neighbours: (N, 8) int32 the points beside each, see `kpopnet.tracker.geodesic.neighbourhood`,
        steps_m: (N, 8) float64 and the ways there.
        nearest: (h, w, 2) int32 row and column of the nearest cell that is measured; negative if none is.
        depth_m: (H, W) float32 the image itself.
        intrinsics: (4,) fx, fy, cx, cy.
    """

    points_m: np.ndarray
    index: np.ndarray
    neighbours: np.ndarray
    steps_m: np.ndarray
    nearest: np.ndarray
    depth_m: np.ndarray
    intrinsics: np.ndarray


def cells_of(depth_m: np.ndarray, camera: Camera) -> Cells:
    """(H, W) float32 depth of the person alone as cells."""
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    depth_m = np.ascontiguousarray(depth_m)
    points_m, index = _points(depth_m, intrinsics)
    return Cells(points_m, index, *neighbourhood(points_m, index), _nearest(index), depth_m, intrinsics)


@njit(cache=True)
def _points(depth, intrinsics):
    fx, fy, cx, cy = intrinsics
    height, width = (depth.shape[0] + CELL_PX - 1) // CELL_PX, (depth.shape[1] + CELL_PX - 1) // CELL_PX
    index = np.full((height, width), -1, np.int32)
    points = np.empty((height * width, 3))
    count = 0
    for y in range(height):
        v = min(y * CELL_PX + CELL_PX // 2, depth.shape[0] - 1)
        for x in range(width):
            u = min(x * CELL_PX + CELL_PX // 2, depth.shape[1] - 1)
            z = float(depth[v, u])
            if z > 0:
                points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
                index[y, x] = count
                count += 1
    return points[:count].copy(), index


@njit(cache=True)
def _nearest(index):
    """Each cell's nearest measured cell, handed from neighbour to neighbour in two sweeps: off by a cell at worst."""
    height, width = index.shape
    nearest = np.full((height, width, 2), -(1 << 14), np.int32)
    for y in range(height):
        for x in range(width):
            if index[y, x] >= 0:
                nearest[y, x, 0], nearest[y, x, 1] = y, x
    for sweep in range(2):
        back = -1 if sweep == 0 else 1
        for i in range(height):
            y = i if sweep == 0 else height - 1 - i
            for j in range(width):
                x = j if sweep == 0 else width - 1 - j
                best = (nearest[y, x, 0] - y) ** 2 + (nearest[y, x, 1] - x) ** 2
                if best == 0:
                    continue
                for k in range(4):
                    other_y = y + (0 if k == 0 else back)
                    other_x = x + (back if k == 0 else (0, 0, back, -back)[k])
                    if 0 <= other_y < height and 0 <= other_x < width:
                        row, column = nearest[other_y, other_x, 0], nearest[other_y, other_x, 1]
                        away = (row - y) ** 2 + (column - x) ** 2
                        if away < best:
                            best = away
                            nearest[y, x, 0], nearest[y, x, 1] = row, column
    return nearest
