"""Depth images sampled on a grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.camera import CAMERAS
from kpopnet.geometry.depth_grid import CELL_PX, _nearest, build_depth_grid

CAMERA = CAMERAS["kinect_v1"]


def test_cells_hold_the_point_at_their_middle_pixel() -> None:
    depth = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    depth[40:80, 101:140] = 2.5
    grid = build_depth_grid(depth, CAMERA)
    points = CAMERA.points(depth)[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX]
    assert grid.index.shape == points.shape[:2]
    measured = grid.index >= 0
    np.testing.assert_array_equal(measured, points[..., 2] > 0)
    np.testing.assert_allclose(grid.points_m[grid.index[measured]], points[measured], atol=1e-5)
    assert sorted(grid.index[measured]) == list(range(len(grid.points_m)))


@pytest.mark.parametrize(("height", "width"), [(240, 320), (5, 7), (1, 1), (3, 401)])
def test_images_of_any_size_have_a_grid(height: int, width: int) -> None:
    grid = build_depth_grid(np.full((height, width), 2, np.float32), CAMERA)
    assert grid.index.shape == (-(-height // CELL_PX), -(-width // CELL_PX))
    assert len(grid.points_m) == grid.index.size and (grid.nearest >= 0).all()


def test_an_empty_image_has_no_points() -> None:
    grid = build_depth_grid(np.zeros((240, 320), np.float32), CAMERA)
    assert grid.points_m.shape == (0, 3) and (grid.index < 0).all() and (grid.nearest < 0).all()


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
    brute = np.sqrt(((y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2).min(axis=-1))
    away = np.hypot(nearest[..., 0] - y, nearest[..., 1] - x)
    assert (away - brute <= 1).all() and (away == 0)[measured].all()
