"""Distances of points to round cones, toes and fingers, and trunk points."""

import numpy as np
import pytest
from cone_people import cone_joints, moved, person  # noqa: F401

from kpopnet.geometry import cones
from kpopnet.geometry.body import (
    LEFT_FINGERS,
    LEFT_TOES,
    PARTS,
    RIGHT_CHEST,
    RIGHT_FINGERS,
    RIGHT_TOES,
    ROW_TO_JOINT,
    TRUNK_POINT_JOINTS,
)
from kpopnet.geometry.cones import body_segments, extend_joints, nearest_parts, signed_distance
from kpopnet.skeleton import NUM_JOINTS, Joint

NOWHERE = np.zeros((6, 3))


def test_distances_to_a_cone() -> None:
    segments = np.array([(0.0, 0, 2, 0, 1, 0, 1, 0.1, 0.1)])  # from (0, 0, 2) to (0, 1, 2), radii 0.1 and 0.2
    assert signed_distance(segments, 0, 0.5, 0.5, 2.0) == pytest.approx((0.5 - 0.15, 0.5, 0.5), abs=1e-8)
    assert signed_distance(segments, 0, 0.0, 0.25, 2.0) == pytest.approx((-0.125, 0.25, 0.0), abs=1e-8)
    assert signed_distance(segments, 0, 0.0, -0.3, 2.4) == pytest.approx((0.5 - 0.1, 0.0, 0.5), abs=1e-8)
    assert signed_distance(segments, 0, 0.0, 1.3, 2.4) == pytest.approx((0.5 - 0.2, 1.0, 0.5), abs=1e-8)


@pytest.mark.parametrize("stride", [1, 7])
def test_nearest_parts_agree_with_brute_force(person, stride: int) -> None:  # noqa: F811
    joints, body, grid = person
    rows = extend_joints(moved(joints, 3), body.trunk_offsets_m)
    segments = body_segments(moved(joints, 3), body)
    np.testing.assert_allclose(segments[:, :6], np.hstack([rows[PARTS[:, 0]], rows[PARTS[:, 1]] - rows[PARTS[:, 0]]]))
    np.testing.assert_allclose(segments[:, 7:], np.diff(body.radii_m, prepend=0))
    part, off, along = nearest_parts(segments, grid.points_m, stride)
    points = grid.points_m[::stride]
    plain = np.array([[signed_distance(segments, k, *point)[:2] for k in range(len(segments))] for point in points])
    own = plain[np.arange(len(points)), part]
    np.testing.assert_allclose(own[:, 0], plain[:, :, 0].min(axis=1), atol=2e-6)
    np.testing.assert_allclose(off, own[:, 0], atol=2e-6)
    np.testing.assert_allclose(along, own[:, 1], atol=2e-5)


def test_fingers_extend_the_forearm_and_toes_point_forwards() -> None:
    joints = cone_joints(abduction_deg=0)
    rows = extend_joints(joints, NOWHERE)
    np.testing.assert_array_equal(rows[:NUM_JOINTS], joints)
    hands, fingers = [Joint.RIGHT_HAND, Joint.LEFT_HAND], [RIGHT_FINGERS, LEFT_FINGERS]
    forearms = joints[hands] - joints[[Joint.RIGHT_ELBOW, Joint.LEFT_ELBOW]]
    forearms /= np.linalg.norm(forearms, axis=1, keepdims=True)
    np.testing.assert_allclose(rows[fingers] - joints[hands], cones.FINGERS_M * forearms, atol=1e-8)
    # A person who faces the camera has toes at smaller z.
    feet, toes = [Joint.RIGHT_FOOT, Joint.LEFT_FOOT], [RIGHT_TOES, LEFT_TOES]
    np.testing.assert_allclose(rows[toes] - joints[feet], [(0, cones.TOES_DOWN_M, -cones.TOES_M)] * 2, atol=0.015)
    assert ROW_TO_JOINT[[*toes, *fingers]].tolist() == [*feet, *hands]


def test_trunk_points_follow_the_torso_frame() -> None:
    joints = cone_joints(abduction_deg=0)
    offsets = np.arange(18.0).reshape(6, 3) / 100
    rows = extend_joints(joints, offsets)[RIGHT_CHEST:]
    # A person who faces the camera has their right at smaller x and their front at smaller z.
    np.testing.assert_allclose(rows - joints[TRUNK_POINT_JOINTS], offsets * (-1, 1, -1), atol=1e-7)
    quarter = np.array([(0.0, 0, -1), (0, 1, 0), (1, 0, 0)])
    np.testing.assert_allclose(extend_joints(joints @ quarter.T, offsets)[RIGHT_CHEST:], rows @ quarter.T, atol=1e-7)
    assert ROW_TO_JOINT[RIGHT_CHEST:].tolist() == TRUNK_POINT_JOINTS.tolist()
