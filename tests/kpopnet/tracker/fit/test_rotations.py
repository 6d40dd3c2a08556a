"""Rotations of a whole pose."""

import numpy as np
from cone_people import cone_joints
from hypothesis import given, settings
from hypothesis import strategies as st
from seen_people import lengths_m

from kpopnet.skeleton import Joint
from kpopnet.tracker.fit.rotations import rotate_about_shoulders, rotate_about_spine


@given(st.floats(-np.pi, np.pi), st.floats(-40, 40))
@settings(deadline=None)
def test_rotations_keep_all_distances_and_are_invertible(angle: float, yaw_deg: float) -> None:
    joints = cone_joints(elevation_deg=30, elbow_deg=20, yaw_deg=yaw_deg)
    for rotate in (rotate_about_spine, rotate_about_shoulders):
        np.testing.assert_allclose(lengths_m(rotate(joints, angle)), lengths_m(joints), atol=1e-6)
        np.testing.assert_allclose(rotate(rotate(joints, angle), -angle), joints, atol=1e-6)
    np.testing.assert_allclose(rotate_about_spine(joints, 0.0), joints, atol=1e-12)


def test_positive_rotations_are_to_the_left_and_forwards() -> None:
    joints = cone_joints()
    left = rotate_about_spine(joints, np.radians(30))
    # The same direction as the heading of `y_joints`.
    np.testing.assert_allclose(left, cone_joints(yaw_deg=30), atol=0.02)
    bow = rotate_about_shoulders(joints, np.radians(30))
    assert bow[Joint.HEAD, 2] < joints[Joint.HEAD, 2] - 0.1 and bow[Joint.RIGHT_FOOT, 2] > joints[Joint.RIGHT_FOOT, 2] + 0.1


def test_half_a_turn_about_the_spine_faces_away() -> None:
    joints = cone_joints(elevation_deg=30)
    back = rotate_about_spine(joints, np.pi)
    assert back[Joint.RIGHT_SHOULDER, 0] > 0 > joints[Joint.RIGHT_SHOULDER, 0]
    np.testing.assert_allclose(back[Joint.HEAD], joints[Joint.HEAD], atol=0.02)
