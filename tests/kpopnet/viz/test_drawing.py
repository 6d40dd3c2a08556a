"""Skeletons and depth in images, and crops of people."""

import numpy as np
import pytest

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint
from kpopnet.viz.drawing import (
    BACKGROUND,
    ESTIMATED,
    TRUE,
    depth_rgb,
    draw_skeleton,
    person_view,
    save_png,
    sheet,
    with_captions,
)

CAMERA = Camera.centred(100.0, 80, 60)


@pytest.mark.parametrize("scale", [1, 4])
def test_a_joint_is_drawn_at_its_projection_in_the_colour_of_its_side(scale):
    at = CAMERA.back_project(np.array([61, 22, 2.0]))
    for joint, colour in ((Joint.RIGHT_HAND, ESTIMATED.right), (Joint.LEFT_FOOT, ESTIMATED.left), (8, ESTIMATED.middle)):
        image, joints = np.zeros((60 * scale, 80 * scale, 3), np.uint8), np.full((15, 3), np.nan)
        joints[joint] = at
        draw_skeleton(image, joints, CAMERA, ESTIMATED)
        rows, columns = np.nonzero(image.any(axis=-1))
        assert (rows.mean(), columns.mean()) == pytest.approx(((22.5) * scale - 0.5, (61.5) * scale - 0.5), abs=0.6)
        assert tuple(image[round(rows.mean()), round(columns.mean())]) == colour


@pytest.mark.parametrize("width_px", [150, 330, 1300])
def test_a_legend_shows_all_colours_at_any_width(width_px):
    drawn = sheet([("", [np.zeros((40, width_px, 3), np.uint8)])], (ESTIMATED, TRUE))
    for style in (ESTIMATED, TRUE):
        for colour in (style.right, style.left, style.middle):
            assert (drawn == colour).all(axis=-1).any(), colour


def test_an_image_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    for path, named in ((tmp_path / "file" / "a.png", "file"), (tmp_path / "folder.png", "folder.png")):
        with pytest.raises(OSError, match=str(tmp_path / named)):
            save_png(path, np.zeros((4, 4, 3), np.uint8))
    save_png(tmp_path / "new" / "a.png", np.zeros((4, 4, 3), np.uint8))
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.png", "file", "folder.png", "new"]


def test_near_depth_is_lighter_than_far_and_missing_depth_is_background():
    depth = np.zeros((4, 6), np.float32)
    depth[1, 1:5] = 2.0, 2.2, 2.4, 2.6
    greys = depth_rgb(depth)
    assert tuple(greys[0, 0]) == BACKGROUND
    assert (np.diff(greys[1, 1:5, 0].astype(int)) < 0).all() and greys[1, 4, 0] > BACKGROUND[0]
    wall = depth_rgb(np.array([[2.0, 2.01]]))[0, :, 0].astype(int)
    assert 0 < wall[0] - wall[1] < 10  # the noise of a wall is no relief


def test_who_is_behind_the_camera_is_not_drawn():
    image = np.zeros((60, 80, 3), np.uint8)
    draw_skeleton(image, np.full((15, 3), [0.1, 0.1, -2.0]), CAMERA, ESTIMATED)
    assert not image.any()


def test_a_caption_that_is_too_long_is_written_smaller():
    strip = with_captions(np.zeros((1, 100, 3), np.uint8), ("image 120, 4.00 s, mean error",))[1:]
    columns = np.flatnonzero((strip != BACKGROUND).any(axis=(0, 2)))
    assert columns[0] >= 4 and columns[-1] < 98


def test_person_view_has_a_consistent_camera_even_across_the_image_border():
    depth = np.zeros((60, 80), np.float32)
    depth[0:40, 60:80] = 2.0
    view, camera = person_view(depth, CAMERA)
    assert view.shape[0] == view.shape[1] == camera.width == camera.height
    np.testing.assert_allclose(camera.points(view)[view > 0], CAMERA.points(depth)[depth > 0], atol=1e-6)
    assert not person_view(np.zeros((60, 80), np.float32), CAMERA, (np.full((15, 3), np.nan),))[0].any()
