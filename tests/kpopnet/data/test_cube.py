"""Cube coordinates are exactly invertible, and agree with the positions in the crop."""

import numpy as np
import pytest
from capsule_people import CAMERA, draw_depth, draw_joints
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.camera import Camera
from kpopnet.data.cube import Cube, View, crop, person_centre
from kpopnet.errors import InputError
from kpopnet.skeleton import MIRROR

NUMBERS = st.floats(-1, 1, width=32)


@st.composite
def cubes(draw):
    centre = np.array([draw(NUMBERS), draw(NUMBERS), 3 + draw(NUMBERS)], np.float32)
    return Cube(centre, 1.15 + 0.3 * draw(NUMBERS))


def person(seed=0):
    joints = draw_joints(np.random.default_rng(seed))
    depth = draw_depth(joints)
    return joints, depth, Cube(person_centre(depth, CAMERA), 1.15)


@settings(deadline=None)
@given(cubes(), st.integers(0, 2**32 - 1))
def test_joints_convert_to_cube_coordinates_and_back(cube, seed):
    joints = np.random.default_rng(seed).uniform(-1, 1, (4, 15, 3)).astype(np.float32) + cube.centre_m
    uvd = cube.to_uvd(joints)
    assert uvd.dtype == np.float32
    np.testing.assert_allclose(cube.to_metres(uvd), joints, atol=2e-6)


def test_the_centre_is_the_origin_and_the_front_view_is_in_perspective():
    cube = Cube(np.array([0.5, -0.2, 2.0], np.float32), 1.0)
    np.testing.assert_allclose(cube.to_uvd(np.array([0.5, -0.2, 2.0])), 0, atol=1e-7)
    # In the centre's plane a metre is 1 / h; half a metre in front of it, offsets are larger by 2 / 1.5.
    np.testing.assert_allclose(cube.to_uvd(np.array([0.75, 0.8, 2.0])), [0.25, 1, 0], atol=1e-6)
    np.testing.assert_allclose(cube.to_uvd(np.array([0.75, 0.0, 1.5])), [0.5, 0.2, -0.5], atol=1e-6)


@settings(deadline=None)
@given(cubes(), st.floats(-np.pi, np.pi), st.booleans(), st.integers(0, 2**32 - 1))
def test_a_view_equals_the_plain_view_of_a_transformed_person(cube, rotation, mirrored, seed):
    """Mirroring the scene and rotating it about the optical axis in 3D gives the joints of the view."""
    joints = np.random.default_rng(seed).uniform(-0.9, 0.9, (15, 3)).astype(np.float32) + cube.centre_m
    cos, sin = np.cos(rotation), np.sin(rotation)
    move = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ np.diag([-1 if mirrored else 1, 1, 1])
    moved_cube = Cube((move @ cube.centre_m).astype(np.float32), cube.half_size_m)
    moved = (joints @ move.T)[MIRROR] if mirrored else joints @ move.T
    np.testing.assert_allclose(View(rotation, mirrored).joints(cube.to_uvd(joints)), moved_cube.to_uvd(moved), atol=1e-5)


def reference_crop(depth_m, camera, cube, crop_px, view=None):
    """Reference: transforms every crop pixel's ray to the plain view and reads the image there."""
    view = view or View()
    out = np.ones((crop_px, crop_px), np.float32)
    for row, column in np.ndindex(out.shape):
        viewed = np.array([2 * column + 1, 2 * row + 1]) / crop_px - 1
        uvd = np.array([*(np.linalg.inv(view.matrix()) @ viewed), 0.0])
        u, v, _ = camera.project(cube.to_metres(uvd))
        x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
        if 0 <= x < camera.width and 0 <= y < camera.height and depth_m[y, x] > 0:
            out[row, column] = np.clip((depth_m[y, x] - cube.centre_m[2]) / cube.half_size_m, -1, 1)
    return out


@pytest.mark.parametrize(("rotation", "mirrored"), [(0.0, False), (0.6, False), (-0.3, True)])
def test_crop_equals_the_reference(rotation, mirrored):
    _, depth, cube = person(1)
    view, px = View(rotation, mirrored), 32
    fast, expected = crop(depth, CAMERA, cube, px, view=view)[0], reference_crop(depth, CAMERA, cube, px, view)
    # A pixel whose ray falls on the border of two image pixels may take either.
    assert (np.abs(fast - expected) > 1e-5).mean() < 0.01
    assert (fast < 1).mean() > 0.05


def test_holes_background_and_pixels_outside_the_image_are_far_and_depth_is_clipped():
    camera = Camera.centred(50, 40, 40)
    depth = np.full((40, 40), 2.0, np.float32)
    depth[:, :10], depth[:, 10:20], depth[15:18, 25:28] = 0.5, 9.0, 0
    image = crop(depth, camera, Cube(np.array([0, 0, 2], np.float32), 1.2), 96)[0]
    assert set(np.unique(image)) == {-1, 0, 1}
    assert image[0].tolist() == [1] * 96  # above the image
    assert (image[40:50, 60:70] == 1).any()


def test_thin_ridges_are_preserved_with_their_mass():
    camera = Camera.centred(285.6, 320, 240)
    ridge = np.zeros((240, 320), np.float32)
    ridge[40:200, 150] = 1
    cube = Cube(np.array([0, 0, 2.0], np.float32), 1.15)
    for view in (View(), View(0.3), View(-0.2, True)):
        channel = crop(np.zeros_like(ridge), camera, cube, 96, ridge, view)[1]
        assert (channel.max(axis=1) > 0.1).sum() > 35  # one pixel wide, without gaps
        per_crop_px = (2 * 1.15 * 285.6 / 2.0 / 96) ** 2
        np.testing.assert_allclose(channel.sum() * per_crop_px, ridge.sum(), rtol=0.2)


def test_a_crop_of_millions_of_pixels_is_sampled():
    """A focal length or a unit that is wrong by a thousand: sampled about once per pixel it would take hours."""
    camera, depth = Camera.centred(1e6, 64, 48), np.full((48, 64), 2.0, np.float32)
    cropped = crop(depth, camera, Cube(np.array([0, 0, 2], np.float32), 1.15), 96, ridge=np.ones_like(depth))
    assert cropped.shape == (2, 96, 96) and np.isfinite(cropped).all()


def test_the_centre_is_the_median_of_the_points():
    _, depth, _ = person(2)
    points = CAMERA.points(depth)[depth > 0]
    np.testing.assert_allclose(person_centre(depth, CAMERA), np.median(points, axis=0), atol=0.01)

    few = np.zeros_like(depth)
    few.flat[:5] = 2
    assert person_centre(few, CAMERA) is None


def test_the_crops_camera_projects_to_the_crop():
    joints, _, cube = person(4)
    u, v, _ = np.moveaxis(cube.camera(96).project(joints), -1, 0)
    expected = (cube.to_uvd(joints)[:, :2] + 1) * 48 - 0.5
    np.testing.assert_allclose(np.stack([u, v], -1), expected, atol=1e-3)


def test_images_of_another_size_than_the_cameras_are_refused():
    depth_m, cube = np.ones((CAMERA.height, CAMERA.width), np.float32), Cube(np.array([0, 0, 3], np.float32), 1.0)
    for refused in (lambda: person_centre(depth_m.T, CAMERA), lambda: crop(depth_m, CAMERA, cube, 8, ridge=depth_m[:-1])):
        with pytest.raises(InputError, match=r"an image of shape .*, expected the camera's"):
            refused()


def test_pixels_need_not_be_square():
    camera = Camera(200.0, 400.0, 10.0, 20.0, 64, 48)
    depth_m = np.zeros((48, 64), np.float32)
    depth_m[28:33, 28:33] = 2.0
    np.testing.assert_allclose(person_centre(depth_m, camera), [0.2, 0.05, 2.0], atol=1e-6)
