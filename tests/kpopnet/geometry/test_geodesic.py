"""Geodesic distances agree with Dijkstra's algorithm."""

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS
from kpopnet.geometry.depth_grid import (
    DEPTH_JUMP_M,
    JUMP_FACTOR,
    UNREACHABLE_M,
    build_depth_grid,
    geodesic_distances,
    neighbour_graph,
)

CAMERA = CAMERAS["kinect_v1"]


def dijkstra(points: np.ndarray, index: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The same distances by Dijkstra's algorithm."""
    length = np.where(source, 0.0, 1e9)
    cell = {int(index[y, x]): (y, x) for y, x in np.argwhere(index >= 0)}
    heap = [(0.0, int(k)) for k in np.flatnonzero(source)]
    while heap:
        distance, k = heapq.heappop(heap)
        if distance > length[k]:
            continue
        y, x = cell[k]
        for other in index[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].ravel():
            if other < 0:
                continue
            step = np.linalg.norm(points[k] - points[other])
            if abs(points[k, 2] - points[other, 2]) > DEPTH_JUMP_M:
                step *= JUMP_FACTOR
            if distance + step < length[other]:
                length[other] = distance + step
                heapq.heappush(heap, (distance + step, int(other)))
    return length


def grid_of_pixels(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and their numbers, one cell per pixel."""
    index = np.full(depth.shape, -1, np.int32)
    index[depth > 0] = np.arange((depth > 0).sum())
    y, x = (depth > 0).nonzero()
    z = depth[y, x].astype(float)
    return np.stack([0.01 * x * z, 0.01 * y * z, z], axis=1), index


@given(
    arrays(np.float32, (9, 12), elements=st.sampled_from([0.0, 0.0, 2.0, 2.03, 2.07, 2.3])),
    st.lists(st.integers(0, 107), min_size=1, max_size=3),
)
@settings(deadline=None)
def test_geodesic_distances_agree_with_dijkstra(depth: np.ndarray, sources: list[int]) -> None:
    points, index = grid_of_pixels(depth)
    source = np.zeros(len(points), bool)
    source[[k for k in sources if k < len(points)]] = True
    length, predecessor = geodesic_distances(*neighbour_graph(points, index), source, UNREACHABLE_M)
    np.testing.assert_allclose(length, dijkstra(points, index, source), atol=1e-6)
    # Every path leads to a source with decreasing distance.
    for k in range(len(points)):
        if source[k] or length[k] > 1e8:
            assert predecessor[k] == -1
        else:
            assert 0 <= predecessor[k] < len(points) and length[predecessor[k]] < length[k]


@pytest.mark.parametrize("elbow_deg", [0, 80])
def test_geodesic_distances_on_a_person_agree_with_dijkstra(elbow_deg: float) -> None:
    grid = build_depth_grid(draw_y(y_joints(20, elbow_deg=elbow_deg), CAMERA), CAMERA)
    source = np.linalg.norm(grid.points_m - grid.points_m.mean(0), axis=1) < 0.2
    expected = dijkstra(grid.points_m, grid.index, source)
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    np.testing.assert_allclose(length, expected, atol=1e-6)
