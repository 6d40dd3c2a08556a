"""Crops of people for pictures."""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.viz.drawing import person_view


def test_a_person_at_the_border_of_a_larger_image_is_cropped_as_in_it():
    """A recording of a person may be cut out of a sensor's image: its principal point then lies outside."""
    camera = Camera(365.0, 365.0, 255.5, 211.5, 512, 424)
    depth_m = np.zeros((camera.height, camera.width), np.float32)
    depth_m[100:300, 410:470] = 3.0
    expected, whole = person_view(depth_m, camera)
    view, cropped = person_view(depth_m[90:310, 400:480], camera.cropped(400, 90, 80, 220))
    np.testing.assert_array_equal(view, expected)
    assert view.shape[0] > 200 and (cropped.cx, cropped.cy) == (whole.cx, whole.cy)


def test_joints_far_outside_the_image_are_not_shown():
    camera = Camera(365.0, 365.0, 255.5, 211.5, 512, 424)
    depth_m = np.zeros((camera.height, camera.width), np.float32)
    depth_m[100:300, 200:300] = 3.0
    lost_m = np.tile([50.0, 0.0, 3.0], (15, 1))
    np.testing.assert_array_equal(person_view(depth_m, camera, (lost_m,))[0], person_view(depth_m, camera)[0])
