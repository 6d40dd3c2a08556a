"""Images of any size reduced to the finder's canvas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kpopnet.camera import Camera
from kpopnet.data.canvas import CANVAS, reduced


@pytest.mark.parametrize(("width", "height"), [(320, 240), (640, 576), (848, 480), (120, 160)])
def test_every_pixel_of_the_canvas_lies_on_the_ray_of_a_pixel_beside_it(width, height):
    camera = Camera(300.0, 310.0, 0.4 * width, 0.55 * height, width, height)
    wall_m = np.full((height, width), 2.0, np.float32)
    # The depth tells which pixel it was.
    wall_m += np.arange(width, dtype=np.float32) * 1e-3 + np.arange(height, dtype=np.float32)[:, None] * 2e-6
    canvas = reduced(wall_m, camera)
    v, u = np.nonzero(canvas.depth_m)
    assert max((u.max() + 1) / CANVAS[0], (v.max() + 1) / CANVAS[1]) == 1
    column = (canvas.depth_m[v, u].astype(float) - 2.0) / 1e-3
    fx, _, cx, _ = canvas.intrinsics
    slope, taken = (u - cx) / fx, (column - camera.cx) / camera.fx
    assert np.abs(slope - taken).max() <= 0.51 * max(1, canvas.reduction) / camera.fx + 1e-3


@given(st.integers(8, 1000), st.integers(8, 1000))
def test_an_image_of_any_size_fits(width, height):
    canvas = reduced(np.ones((height, width), np.float32), Camera.centred(200.0, width, height))
    assert canvas.depth_m.shape == CANVAS[::-1] and canvas.depth_m.any() and np.isfinite(canvas.intrinsics).all()
