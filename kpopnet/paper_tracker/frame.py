"""One depth image as the points that Algorithm 2 chooses from: ridge data R(I), raw depth I, and ways over the silhouette."""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.geometry.geodesic import neighbour_graph

CELL_M = 0.02
"""Raw depth is sampled once per cell of about this side at the person's depth, in metres: every second pixel of a Kinect v1. In
cells of four pixels three to seven candidates of a joint are left, and their mean is noise."""

MOST_CELLS, MOST_PX = 20_000, 16
"""Greatest number of cells and their greatest side in pixels. Cells grow where more would be measured: of noise and whole
rooms, not of a person."""


class Frame(NamedTuple):
    """One depth image of a person. Points lie on the surface, in the camera frame, in metres.

    Attributes:
        ridge_m: (R, 3) the ridge data, pixel by pixel.
        ridge_cell: (R,) the number of each one's cell, -1 where its cell has no point.
        raw_m: (N, 3) the raw depth: the point in the middle of each measured cell.
        raw_cell: (N,) 0, 1, ..., N - 1: the numbers of these cells.
        neighbours: (N, 8) neighbours of each cell, see `kpopnet.geometry.geodesic.neighbour_graph`.
        edges_m: (N, 8) lengths of the ways to them.
    """

    ridge_m: np.ndarray
    ridge_cell: np.ndarray
    raw_m: np.ndarray
    raw_cell: np.ndarray
    neighbours: np.ndarray
    edges_m: np.ndarray


def frame_of(depth_m: np.ndarray, ridge: np.ndarray, camera: Camera) -> Frame:
    """The points of an image.

    Args:
        depth_m: (H, W) float32 metres of the person, 0 elsewhere.
        ridge: (H, W) bool, the ridge data of the same image.
        camera: the camera of these pixels.
    """
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    person_m = depth_m[depth_m > 0]
    side_px = 1
    if len(person_m):
        side_px = max(CELL_M * camera.fx / float(np.median(person_m)), (len(person_m) / MOST_CELLS) ** 0.5)
        side_px = max(1, round(min(side_px, MOST_PX)))
    raw_m, index = _cells(depth_m, intrinsics, side_px)
    ridge_m, ridge_cell = _ridge_points(*ridge.nonzero(), depth_m, intrinsics, index, side_px)
    return Frame(ridge_m, ridge_cell, raw_m, np.arange(len(raw_m)), *neighbour_graph(raw_m, index))


@njit(cache=True)
def _cells(depth, intrinsics, side_px):
    """(N, 3) point at the middle pixel of each measured cell, and (h, w) its number, -1 where the pixel is not measured."""
    fx, fy, cx, cy = intrinsics
    height, width = (depth.shape[0] + side_px - 1) // side_px, (depth.shape[1] + side_px - 1) // side_px
    index, points, count = np.full((height, width), -1, np.int32), np.empty((height * width, 3)), 0
    for y in range(height):
        v = min(y * side_px + side_px // 2, depth.shape[0] - 1)
        for x in range(width):
            u = min(x * side_px + side_px // 2, depth.shape[1] - 1)
            z = float(depth[v, u])
            if z > 0:
                points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
                index[y, x] = count
                count += 1
    return points[:count].copy(), index


@njit(cache=True)
def _ridge_points(rows, columns, depth, intrinsics, index, side_px):
    """(R, 3) surface points of pixels, and (R,) the numbers of their cells."""
    fx, fy, cx, cy = intrinsics
    points, cell = np.empty((len(rows), 3)), np.empty(len(rows), np.int64)
    for i in range(len(rows)):
        v, u = rows[i], columns[i]
        z = float(depth[v, u])
        points[i, 0], points[i, 1], points[i, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
        cell[i] = index[v // side_px, u // side_px]
    return points, cell
