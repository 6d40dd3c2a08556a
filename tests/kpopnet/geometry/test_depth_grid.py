"""Depth images sampled on a grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.camera import CAMERAS, Camera
from kpopnet.geometry.depth_grid import CELL_M, LEAST_CELLS, MOST_CELLS, _nearest, build_depth_grid

CAMERA = CAMERAS["kinect_v1"]


def test_cells_hold_the_point_at_their_middle_pixel() -> None:
    depth = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    depth[40:80, 101:140] = 2.5
    grid = build_depth_grid(depth, CAMERA)
    side_px = int(grid.intrinsics[4])
    points = CAMERA.points(depth)[side_px // 2 :: side_px, side_px // 2 :: side_px]
    assert grid.index.shape == points.shape[:2]
    measured = grid.index >= 0
    np.testing.assert_array_equal(measured, points[..., 2] > 0)
    np.testing.assert_allclose(grid.points_m[grid.index[measured]], points[measured], atol=1e-5)
    assert sorted(grid.index[measured]) == list(range(len(grid.points_m)))


@pytest.mark.parametrize("z_m", [1.0, 2.0, 3.5])
@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_cells_have_the_same_size_at_any_distance_and_resolution(z_m: float, scale: float) -> None:
    camera = Camera.centred(scale * CAMERA.fx, round(scale * CAMERA.width), round(scale * CAMERA.height))
    depth = np.zeros((camera.height, camera.width), np.float32)
    half_px = round(0.5 * camera.fx / z_m / 2)
    row, column = camera.height // 2, camera.width // 2
    depth[row - half_px : row + half_px, column - half_px : column + half_px] = z_m
    grid = build_depth_grid(depth, camera)
    side_px = grid.intrinsics[4]
    assert abs(side_px - max(CELL_M * camera.fx / z_m, 1)) <= 0.5
    assert len(grid.points_m) == pytest.approx((0.5 / (side_px * z_m / camera.fx)) ** 2, rel=0.2)


@pytest.mark.parametrize(("z_m", "cells"), [(0.001, LEAST_CELLS), (65.0, MOST_CELLS)])
def test_the_number_of_cells_is_limited_in_rooms_and_noise(z_m: float, cells: int) -> None:
    assert len(build_depth_grid(np.full((480, 640), z_m, np.float32), CAMERA).points_m) == pytest.approx(cells, rel=0.2)


@given(arrays(bool, st.tuples(st.integers(1, 24), st.integers(1, 24)), elements=st.sampled_from([False] * 9 + [True])))
@settings(deadline=None)
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
