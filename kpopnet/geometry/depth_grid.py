"""A depth image sampled on a coarse grid: the few hundred points that a body is fitted to, and the nearest silhouette cell.

Points are in the camera frame in metres.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.geometry.denoising import denoised
from kpopnet.geometry.geodesic import neighbour_graph

CELL_M = 0.025
"""Side of a grid cell at the person's depth in metres, rounded to whole pixels. Each cell contributes one point."""

LEAST_CELLS, MOST_CELLS = 100, 6000
"""Cells shrink or grow where a person would fill fewer or more than about so many: nobody does, but noise and whole rooms
would."""

SAMPLING_PX = 4
"""The person's depth is the mean over every fourth pixel of every fourth row."""

MIN_POINTS = 20
"""Smallest number of measured cells from which a pose is estimated."""


class DepthGrid(NamedTuple):
    """A depth image sampled once per cell of about `CELL_M` x `CELL_M` at the person's depth.

    Attributes:
        points_m: (N, 3) float64, the point at the middle pixel of each measured cell, in the camera frame in metres.
        index: (h, w) int32 number of each cell's point in points_m, or -1.
        neighbours: (N, 8) int32 neighbours of each point, see `kpopnet.geometry.geodesic.neighbour_graph`.
        edge_lengths_m: (N, 8) float64 lengths of the edges to the neighbours in metres.
        nearest: (h, w, 2) int32 row and column of the nearest measured cell; negative if no cell is measured.
        depth_m: (H, W) float32 the depth image in metres, `denoised`.
        intrinsics: (5,) fx, fy, cx, cy and the side of a cell, in pixels.
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
    depth_m = denoised(np.ascontiguousarray(depth_m))
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy, _cell_side_px(depth_m, camera.fx)])
    points_m, index = cell_points(depth_m, intrinsics)
    return DepthGrid(points_m, index, *neighbour_graph(points_m, index), _nearest(index), depth_m, intrinsics)


def _cell_side_px(depth_m: np.ndarray, fx: float) -> int:
    """Side in pixels of a cell of `CELL_M` at the mean depth, within the limits that `LEAST_CELLS` and `MOST_CELLS` set."""
    total_m, count = _sampled_depth(depth_m)
    if not count:
        return SAMPLING_PX
    least_px, most_px = (SAMPLING_PX * math.sqrt(count / cells) for cells in (MOST_CELLS, LEAST_CELLS))
    return max(1, round(min(max(CELL_M * fx * count / total_m, least_px), most_px)))


@njit(cache=True)
def _sampled_depth(depth):
    """Sum in metres and number of the measured pixels among those of `SAMPLING_PX`."""
    total, count = 0.0, 0
    for v in range(0, depth.shape[0], SAMPLING_PX):
        for u in range(0, depth.shape[1], SAMPLING_PX):
            if depth[v, u] > 0:
                total += depth[v, u]
                count += 1
    return total, count


@njit(cache=True)
def cell_points(depth, intrinsics):
    """Back-projects the middle pixel of each cell.

    Args:
        depth: (H, W) metres, 0 where nothing was measured.
        intrinsics: (5,) fx, fy, cx, cy and the side of a cell, in pixels.

    Returns:
        (N, 3) points in the camera frame in metres, and the (h, w) int32 number of each cell's point, -1 without one.
    """
    fx, fy, cx, cy, cell_px = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], int(intrinsics[4])
    height, width = (depth.shape[0] + cell_px - 1) // cell_px, (depth.shape[1] + cell_px - 1) // cell_px
    index = np.full((height, width), -1, np.int32)
    points = np.empty((height * width, 3))
    count = 0
    for y in range(height):
        v = min(y * cell_px + cell_px // 2, depth.shape[0] - 1)
        for x in range(width):
            u = min(x * cell_px + cell_px // 2, depth.shape[1] - 1)
            z = float(depth[v, u])
            if z > 0:
                points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
                index[y, x] = count
                count += 1
    return points[:count].copy(), index


@njit(cache=True)
def _nearest(index):
    """(h, w, 2) row and column of the nearest measured cell; negative if no cell is measured.

    Propagated between neighbours in two sweeps of the measured cells' bounding box: the distance is at most one cell larger
    than the true minimum. Cells outside the box, most of an image, take the nearest of the box's cell next to them.
    """
    height, width = index.shape
    nearest = np.full((height, width, 2), -(1 << 14), np.int32)
    top, bottom, left, right = height, -1, width, -1
    for y in range(height):
        for x in range(width):
            if index[y, x] >= 0:
                nearest[y, x, 0], nearest[y, x, 1] = y, x
                top, bottom, left, right = min(top, y), y, min(left, x), max(right, x)
    if bottom < 0:
        return nearest
    for step in (1, -1):
        for y in range(top, bottom + 1) if step > 0 else range(bottom, top - 1, -1):
            for x in range(left, right + 1) if step > 0 else range(right, left - 1, -1):
                if index[y, x] < 0:
                    _take_nearer(nearest, y, x, step)
    for y in range(height):
        for x in range(width):
            if not (top <= y <= bottom and left <= x <= right):
                row, column = min(max(y, top), bottom), min(max(x, left), right)
                nearest[y, x, 0], nearest[y, x, 1] = nearest[row, column, 0], nearest[row, column, 1]
    return nearest


@njit(cache=True)
def _take_nearer(nearest, y, x, step):
    """Gives a cell the nearest measured cell of the four neighbours before it in a sweep, if that is nearer than its own."""
    height, width, _ = nearest.shape
    best = (nearest[y, x, 0] - y) ** 2 + (nearest[y, x, 1] - x) ** 2
    for dy, dx in ((0, step), (step, 0), (step, 1), (step, -1)):
        if 0 <= y - dy < height and 0 <= x - dx < width:
            row, column = nearest[y - dy, x - dx, 0], nearest[y - dy, x - dx, 1]
            distance = (row - y) ** 2 + (column - x) ** 2
            if distance < best:
                best = distance
                nearest[y, x, 0], nearest[y, x, 1] = row, column
