"""Depth images sampled on a grid: its cells, the nearest cells, geodesic distances, and the smoothing of noisy depth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse.csgraph import dijkstra

from kpopnet.camera import CAMERAS, Camera
from kpopnet.geometry import depth_grid as constants
from kpopnet.geometry.depth_grid import (
    UNREACHABLE_M,
    _nearest,
    build_depth_grid,
    cell_points,
    denoised,
    geodesic_distances,
    neighbour_graph,
)

CAMERA = CAMERAS["kinect_v1"]


def test_cells_hold_the_point_at_their_middle_pixel() -> None:
    depth = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    depth[40:80, 101:140] = 2.5
    grid = build_depth_grid(depth, CAMERA)
    side_px = int(grid.intrinsics[4])
    points = CAMERA.points(depth)[side_px // 2 :: side_px, side_px // 2 :: side_px]
    points_m, index = cell_points(depth, grid.intrinsics)
    assert index.shape == points.shape[:2]
    measured = index >= 0
    np.testing.assert_array_equal(measured, points[..., 2] > 0)
    np.testing.assert_allclose(points_m[index[measured]], points[measured], atol=1e-5)
    assert sorted(index[measured]) == list(range(len(points_m))) and np.array_equal(points_m, grid.points_m)


@pytest.mark.parametrize(("z_m", "scale"), [(1.0, 1.0), (3.5, 0.5), (3.5, 2.0)])
def test_cells_have_the_same_size_at_any_distance_and_resolution(z_m: float, scale: float) -> None:
    camera = Camera.centred(scale * CAMERA.fx, round(scale * CAMERA.width), round(scale * CAMERA.height))
    depth = np.zeros((camera.height, camera.width), np.float32)
    half_px = round(0.5 * camera.fx / z_m / 2)
    row, column = camera.height // 2, camera.width // 2
    depth[row - half_px : row + half_px, column - half_px : column + half_px] = z_m
    grid = build_depth_grid(depth, camera)
    side_px = grid.intrinsics[4]
    assert abs(side_px - max(constants.CELL_M * camera.fx / z_m, 1)) <= 0.5
    assert len(grid.points_m) == pytest.approx((0.5 / (side_px * z_m / camera.fx)) ** 2, rel=0.2)


@pytest.mark.parametrize(("z_m", "cells"), [(0.001, constants.LEAST_CELLS), (65.0, constants.MOST_CELLS)])
def test_the_number_of_cells_is_limited_in_rooms_and_noise(z_m: float, cells: int) -> None:
    assert len(build_depth_grid(np.full((480, 640), z_m, np.float32), CAMERA).points_m) == pytest.approx(cells, rel=0.2)


@given(arrays(bool, st.tuples(st.integers(1, 24), st.integers(1, 24)), elements=st.sampled_from([False] * 9 + [True])))
@settings(deadline=None, max_examples=40)
def test_the_nearest_cell_is_within_one_cell_of_the_optimum(measured: np.ndarray) -> None:
    nearest = _nearest(np.where(measured, 0, -1).astype(np.int32))
    rows, columns = measured.nonzero()
    if not len(rows):
        assert (nearest < 0).all()
        return
    assert measured[nearest[..., 0], nearest[..., 1]].all()
    y, x = np.mgrid[: measured.shape[0], : measured.shape[1]]
    inside = y.clip(rows.min(), rows.max()), x.clip(columns.min(), columns.max())
    np.testing.assert_array_equal(nearest, nearest[inside])
    y, x = inside
    brute = np.sqrt(((y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2).min(axis=-1))
    away = np.hypot(nearest[..., 0] - y, nearest[..., 1] - x)
    assert (away - brute <= 1).all() and (away == 0)[measured].all()


# --- geodesic distances -------------------------------------------------------------------------------------------


def slow_distances(points: np.ndarray, index: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The geodesic distances by Dijkstra's algorithm between all pairs of neighbouring cells."""
    cells, lengths = np.argwhere(index >= 0), np.linalg.norm(points[:, None] - points, axis=-1)
    lengths[np.abs(points[:, None, 2] - points[:, 2]) > constants.DEPTH_JUMP_M] *= constants.JUMP_FACTOR
    lengths[np.abs(cells[:, None] - cells).max(axis=-1) > 1] = 0  # no edge
    ways = dijkstra(lengths, indices=np.flatnonzero(source), min_only=True) if source.any() else np.full(len(source), np.inf)
    return np.minimum(ways, UNREACHABLE_M)


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
@settings(deadline=None, max_examples=40)
def test_geodesic_distances_agree_with_dijkstra(depth: np.ndarray, sources: list[int]) -> None:
    points, index = grid_of_pixels(depth)
    source = np.zeros(len(points), bool)
    source[[k for k in sources if k < len(points)]] = True
    length, predecessor = geodesic_distances(*neighbour_graph(points, index), source, UNREACHABLE_M)
    np.testing.assert_allclose(length, slow_distances(points, index, source), atol=1e-6)
    # Every path leads to a source with decreasing distance.
    for k in range(len(points)):
        if source[k] or length[k] > 1e8:
            assert predecessor[k] == -1
        else:
            assert 0 <= predecessor[k] < len(points) and length[predecessor[k]] < length[k]


# --- noisy depth --------------------------------------------------------------------------------------------------


def test_depth_of_a_time_of_flight_camera_is_the_median_of_what_is_measured_around() -> None:
    rng = np.random.default_rng(0)
    depth_m = rng.normal(3.0, 0.06, (60, 50)).astype(np.float32)
    depth_m[rng.random(depth_m.shape) < 0.02] = 0
    depth_m[:5], depth_m[:, :5] = 0, 0
    before, known = depth_m.copy(), np.where(depth_m > 0, depth_m, np.nan)
    smooth_m = denoised(depth_m)
    assert np.array_equal(depth_m, before) and smooth_m.dtype == np.float32 and (smooth_m[depth_m == 0] == 0).all()
    reach = constants.WINDOW // 2
    for y, x in np.argwhere(depth_m > 0):
        expected_m = np.nanmedian(known[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1])
        assert smooth_m[y, x] == pytest.approx(expected_m, rel=1e-6)


def test_depth_of_structured_light_stays_as_it_is() -> None:
    depth_m = np.random.default_rng(0).normal(3.0, 0.01, (60, 50)).astype(np.float32)
    assert denoised(depth_m) is depth_m
