"""A depth image sampled on a coarse grid: the few hundred points that a body is fitted to, and the nearest silhouette cell.

Points are in the camera frame in metres.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.geometry.geodesic import neighbour_graph

CELL_PX = 4
"""Side of a grid cell in pixels. Each cell contributes one point."""

MIN_POINTS = 20
"""Smallest number of measured cells from which a pose is estimated."""


class DepthGrid(NamedTuple):
    """A depth image sampled once per cell of `CELL_PX` x `CELL_PX` pixels.

    Attributes:
        points_m: (N, 3) float64, the point at the middle pixel of each measured cell, in the camera frame in metres.
        index: (h, w) int32 number of each cell's point in points_m, or -1.
        neighbours: (N, 8) int32 neighbours of each point, see `kpopnet.geometry.geodesic.neighbour_graph`.
        edge_lengths_m: (N, 8) float64 lengths of the edges to the neighbours in metres.
        nearest: (h, w, 2) int32 row and column of the nearest measured cell; negative if no cell is measured.
        depth_m: (H, W) float32 the depth image in metres.
        intrinsics: (4,) fx, fy, cx, cy in pixels.
    """

    points_m: np.ndarray
    index: np.ndarray
    neighbours: np.ndarray
    edge_lengths_m: np.ndarray
    nearest: np.ndarray
    depth_m: np.ndarray
    intrinsics: np.ndarray


def build_depth_grid(depth_m: np.ndarray, camera: Camera) -> DepthGrid:
    """Samples an (H, W) float32 depth image in metres, which shows only the person, on the grid."""
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    depth_m = np.ascontiguousarray(depth_m)
    points_m, index = _points(depth_m, intrinsics)
    return DepthGrid(points_m, index, *neighbour_graph(points_m, index), _nearest(index), depth_m, intrinsics)


@njit(cache=True)
def _points(depth, intrinsics):
    """Back-projects the middle pixel of each cell: (N, 3) points in metres and the (h, w) index of the cells."""
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
    """(h, w, 2) row and column of the nearest measured cell, propagated between neighbours in two sweeps.

    The distance is at most one cell larger than the true minimum.
    """
    height, width = index.shape
    nearest = np.full((height, width, 2), -(1 << 14), np.int32)
    for y in range(height):
        for x in range(width):
            if index[y, x] >= 0:
                nearest[y, x, 0], nearest[y, x, 1] = y, x
    for sweep in range(2):
        step = -1 if sweep == 0 else 1
        for i in range(height):
            y = i if sweep == 0 else height - 1 - i
            for j in range(width):
                x = j if sweep == 0 else width - 1 - j
                best = (nearest[y, x, 0] - y) ** 2 + (nearest[y, x, 1] - x) ** 2
                if best == 0:
                    continue
                for k in range(4):
                    from_y = y + (0 if k == 0 else step)
                    from_x = x + (step if k == 0 else (0, 0, step, -step)[k])
                    if 0 <= from_y < height and 0 <= from_x < width:
                        row, column = nearest[from_y, from_x, 0], nearest[from_y, from_x, 1]
                        distance = (row - y) ** 2 + (column - x) ** 2
                        if distance < best:
                            best = distance
                            nearest[y, x, 0], nearest[y, x, 1] = row, column
    return nearest
