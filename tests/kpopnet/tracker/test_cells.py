"""Depth images in cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.camera import CAMERAS
from kpopnet.tracker.cells import CELL_PX, _nearest, cells_of

CAMERA = CAMERAS["kinect_v1"]


def test_cells_hold_what_is_seen_at_their_middles() -> None:
    depth = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    depth[40:80, 101:140] = 2.5
    cells = cells_of(depth, CAMERA)
    points = CAMERA.points(depth)[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX]
    assert cells.index.shape == points.shape[:2]
    measured = cells.index >= 0
    np.testing.assert_array_equal(measured, points[..., 2] > 0)
    np.testing.assert_allclose(cells.points_m[cells.index[measured]], points[measured], atol=1e-5)
    assert sorted(cells.index[measured]) == list(range(len(cells.points_m)))


@pytest.mark.parametrize(("height", "width"), [(240, 320), (5, 7), (1, 1), (3, 401)])
def test_images_of_any_size_have_cells(height: int, width: int) -> None:
    cells = cells_of(np.full((height, width), 2, np.float32), CAMERA)
    assert cells.index.shape == (-(-height // CELL_PX), -(-width // CELL_PX))
    assert len(cells.points_m) == cells.index.size and (cells.nearest >= 0).all()


def test_an_empty_image_has_no_points() -> None:
    cells = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    assert cells.points_m.shape == (0, 3) and (cells.index < 0).all() and (cells.nearest < 0).all()


@given(arrays(bool, st.tuples(st.integers(1, 24), st.integers(1, 24)), elements=st.sampled_from([False] * 9 + [True])))
@settings(deadline=None)
def test_the_nearest_cell_is_off_by_a_cell_at_worst(measured: np.ndarray) -> None:
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
