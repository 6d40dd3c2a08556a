"""One depth image as the points that Algorithm 2 chooses from: ridge data R(I), raw depth I, and ways over the silhouette."""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.geometry.depth_grid import cell_points, neighbour_graph

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
        neighbours: (N, 8) neighbours of each cell, see `kpopnet.geometry.depth_grid.neighbour_graph`.
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
    person_m = depth_m[depth_m > 0]
    side_px = 1
    if len(person_m):
        side_px = max(CELL_M * camera.fx / float(np.median(person_m)), (len(person_m) / MOST_CELLS) ** 0.5)
        side_px = max(1, round(min(side_px, MOST_PX)))
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy, side_px])
    raw_m, index = cell_points(depth_m, intrinsics)
    ridge_m, ridge_cell = _ridge_points(*ridge.nonzero(), depth_m, intrinsics, index)
    return Frame(ridge_m, ridge_cell, raw_m, np.arange(len(raw_m)), *neighbour_graph(raw_m, index))


@njit(cache=True)
def _ridge_points(rows, columns, depth, intrinsics, index):
    """(R, 3) surface points of pixels, and (R,) the numbers of their cells."""
    fx, fy, cx, cy, side_px = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], int(intrinsics[4])
    points, cell = np.empty((len(rows), 3)), np.empty(len(rows), np.int64)
    for i in range(len(rows)):
        v, u = rows[i], columns[i]
        z = float(depth[v, u])
        points[i, 0], points[i, 1], points[i, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
        cell[i] = index[v // side_px, u // side_px]
    return points, cell
