"""Lenses and mountings are undone: rays that are drawn through a lens come back where a pinhole camera sees them."""

import numpy as np
import pytest

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.sources import open_depth
from kpopnet.sources.lenses import Lens, Optics, View

CAMERA = Camera(250.0, 252.0, 158.0, 121.0, 320, 240)
RATIONAL = (3.13, 2.32, 0.0001, -0.00005, 0.13, 3.46, 3.35, 0.66)
LENSES = {
    "brown": Lens((-0.28, 0.09, 0.001, -0.0005, -0.01)),
    "barrel of Azure Kinect": Lens(RATIONAL),
    "pincushion": Lens((0.1, 0.02)),
    "fisheye": Lens((0.02, -0.01, 0.002, 0.0), True),
}


def bent(lens: Lens, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a lens lets a ray (x, y, 1) arrive, in focal lengths: the models as their papers state them."""
    r2, k = x**2 + y**2, lens.all
    if lens.is_fisheye:
        r, angle = np.sqrt(r2), np.arctan(np.sqrt(r2))
        scale = angle * (1 + k[0] * angle**2 + k[1] * angle**4 + k[2] * angle**6 + k[3] * angle**8) / np.where(r > 0, r, 1)
        return x * scale, y * scale
    k1, k2, p1, p2, k3, k4, k5, k6 = k
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2), y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y


@pytest.mark.parametrize("name", LENSES)
def test_every_pixel_takes_the_nearest_one_of_its_ray_and_the_sides_stay_in_view(name):
    lens = LENSES[name]
    view = Optics(CAMERA, lens).view()
    row, column = np.mgrid[:240, :320]
    pinhole = view.camera
    x, y = bent(lens, (column - pinhole.cx) / pinhole.fx, (row - pinhole.cy) / pinhole.fy)
    u, v = x * CAMERA.fx + CAMERA.cx, y * CAMERA.fy + CAMERA.cy
    taken = view.table >= 0
    assert taken.mean() > 0.85
    np.testing.assert_array_less(np.abs(view.table % 320 - u)[taken], 0.51)
    np.testing.assert_array_less(np.abs(view.table // 320 - v)[taken], 0.51)
    stored = np.zeros((240, 320), np.float32)
    sides = [(121, 1), (121, 318), (1, 158), (238, 158)]
    for number, (line, place) in enumerate(sides, 1):
        stored[line - 1 : line + 2, place - 1 : place + 2] = number
    image = view.image(stored)
    seen = set(np.unique(image))
    assert seen == {0, 1, 2, 3, 4} or name == "pincushion"
    assert set(np.unique(view.image(np.where(stored > 0, 2.0, 5.0)))) <= {0, 2, 5}  # nothing lies between person and wall


def test_a_lens_without_effect_changes_nothing_and_one_that_maps_no_image_is_refused():
    for lens in (None, Lens(()), Lens((0.0,) * 5), Lens((1e-4, 0.0)), Lens((5.5, 5.0, 0.0, 0.0, 0.2, 5.5, 5.0, 0.2))):
        assert Optics(CAMERA, lens).view() == View(CAMERA)
    for lens in (Lens((-1e30,)), Lens((np.nan,)), Lens((1e308, 1e308, 0, 0, 1e308, -1e308))):
        with pytest.raises(InputError, match="it maps no image"):
            Optics(CAMERA, lens).view()


def test_beyond_where_the_model_folds_back_nothing_is_seen():
    strong = Lens((-0.5,))  # turns back at a tangent of 0.82
    view = Optics(Camera.centred(60.0, 320, 240), strong).view()
    row, column = np.mgrid[:240, :320]
    tangent = np.hypot(column - view.camera.cx, row - view.camera.cy) / view.camera.fx
    assert (view.table[tangent > 0.83] == -1).all() and (view.table[tangent < 0.8] >= 0).all()


@pytest.mark.parametrize(("turn", "lens"), [(90, None), (180, None), (270, None), (90, LENSES["brown"])])
def test_a_camera_on_its_side_sees_the_same_points_upright(turn, lens, tmp_path):
    depth_mm = np.full((240, 320), 3000, np.uint16)
    depth_mm[60:64, 200:204] = 1500
    np.savez(tmp_path / "a.npz", depth=depth_mm[None], camera=[250.0, 252.0, 158.0, 121.0, 320, 240])
    optics = Optics(CAMERA, lens)
    flat, turned = (open_depth(tmp_path / "a.npz", lambda *_: optics, rotate_deg=deg) for deg in (0, turn))

    def spot_m(source):
        (image,) = source
        points = source.camera.points(image)
        return np.median(points[(image > 1) & (image < 2)], axis=0)

    x, y, z = spot_m(flat)
    expected = {90: (-y, x, z), 180: (-x, -y, z), 270: (y, -x, z)}[turn]
    np.testing.assert_allclose(spot_m(turned), expected, atol=0.01)
    np.testing.assert_array_equal(*(next(iter(open_depth(tmp_path / "a.npz", rotate_deg=deg))) for deg in (turn, float(turn))))
    with pytest.raises(InputError, match="expected 0, 90, 180 or 270"):
        open_depth(tmp_path / "a.npz", rotate_deg=45)
