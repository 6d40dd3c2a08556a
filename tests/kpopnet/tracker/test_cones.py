"""Round cones against points, the far ends of hands and feet, and the places in the trunk."""

import numpy as np
import pytest
from cone_people import cone_joints
from fitted_people import moved, person  # noqa: F401

from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.tracker.body import (
    LEFT_FINGERS,
    LEFT_TOES,
    OWNERS,
    PARTS,
    PLACE_JOINTS,
    RIGHT_CHEST,
    RIGHT_FINGERS,
    RIGHT_TOES,
)
from kpopnet.tracker.cones import FINGERS_M, TOES_DOWN_M, TOES_M, axes_of, extend, frame_of, nearest_parts, off_surface

NOWHERE = np.zeros((6, 3))


def test_distances_to_a_cone() -> None:
    joints = np.array([(0.0, 0, 2), (0, 1, 2)])
    axes = axes_of(joints, np.array([(0, 1)]), np.array([(0.1, 0.2)]))
    assert off_surface(axes, 0, 0.5, 0.5, 2) == pytest.approx((0.5 - 0.15, 0.5, 0.5), abs=1e-8)
    assert off_surface(axes, 0, 0, 0.25, 2) == pytest.approx((-0.125, 0.25, 0.0), abs=1e-8)
    assert off_surface(axes, 0, 0, -0.3, 2.4) == pytest.approx((0.5 - 0.1, 0.0, 0.5), abs=1e-8)
    assert off_surface(axes, 0, 0, 1.3, 2.4) == pytest.approx((0.5 - 0.2, 1.0, 0.5), abs=1e-8)


@pytest.mark.parametrize("every", [1, 2, 7, 10**6])
def test_the_nearest_parts_are_those_of_a_plain_search(person, every: int) -> None:  # noqa: F811
    joints, body, cells = person
    axes = axes_of(extend(moved(joints, 3), body.places_m), PARTS, body.radii_m)
    part, off, along = nearest_parts(axes, cells.points_m, every)
    points = cells.points_m[::every]
    plain = np.array([[off_surface(axes, k, *point)[:2] for k in range(len(axes))] for point in points])
    own = plain[np.arange(len(points)), part]
    np.testing.assert_allclose(own[:, 0], plain[:, :, 0].min(axis=1), atol=2e-6)
    np.testing.assert_allclose(off, own[:, 0], atol=2e-6)
    np.testing.assert_allclose(along, own[:, 1], atol=2e-5)


def test_fingers_go_on_where_the_forearm_points_and_toes_where_the_person_faces() -> None:
    joints = cone_joints(spread_deg=0)
    rows = extend(joints, NOWHERE)
    np.testing.assert_array_equal(rows[:NUM_JOINTS], joints)
    for hand, elbow, fingers in (
        (Joint.RIGHT_HAND, Joint.RIGHT_ELBOW, RIGHT_FINGERS),
        (Joint.LEFT_HAND, Joint.LEFT_ELBOW, LEFT_FINGERS),
    ):
        forearm = joints[hand] - joints[elbow]
        np.testing.assert_allclose(rows[fingers] - joints[hand], FINGERS_M * forearm / np.linalg.norm(forearm), atol=1e-8)
    for foot, toes in ((Joint.RIGHT_FOOT, RIGHT_TOES), (Joint.LEFT_FOOT, LEFT_TOES)):
        # Who faces the camera points the toes at it, to smaller z.
        np.testing.assert_allclose(rows[toes] - joints[foot], (0, TOES_DOWN_M, -TOES_M), atol=0.015)
    assert OWNERS[[RIGHT_TOES, LEFT_FINGERS]].tolist() == [Joint.RIGHT_FOOT, Joint.LEFT_HAND]


def test_places_in_the_trunk_lie_to_its_right_down_and_front_and_turn_with_it() -> None:
    joints = cone_joints(spread_deg=0)
    ways = np.arange(18.0).reshape(6, 3) / 100
    rows = extend(joints, ways)[RIGHT_CHEST:]
    # Who faces the camera has the right at smaller x and the front at smaller z.
    np.testing.assert_allclose(rows - joints[PLACE_JOINTS], ways * (-1, 1, -1), atol=1e-7)
    quarter = np.array([(0.0, 0, -1), (0, 1, 0), (1, 0, 0)])
    np.testing.assert_allclose(extend(joints @ quarter.T, ways)[RIGHT_CHEST:], rows @ quarter.T, atol=1e-7)
    assert OWNERS[RIGHT_CHEST:].tolist() == PLACE_JOINTS.tolist()


def test_a_mirrored_person_has_mirrored_places(person) -> None:  # noqa: F811
    joints, body, _ = person
    flip = np.array((-1, 1, 1))
    rows = extend(joints, body.places_m)[RIGHT_CHEST:].reshape(3, 2, 3)
    mirrored = extend(joints[MIRROR] * flip, body.places_m)[RIGHT_CHEST:].reshape(3, 2, 3)
    np.testing.assert_allclose(mirrored[:, ::-1] * flip, rows, atol=1e-7)


def test_a_bent_knee_turns_the_foot_its_way() -> None:
    joints = cone_joints(spread_deg=0)
    joints[Joint.RIGHT_KNEE, 0] -= 0.15
    rows = extend(joints, NOWHERE)
    assert rows[RIGHT_TOES, 0] < rows[Joint.RIGHT_FOOT, 0] - 0.05 and abs(rows[LEFT_TOES, 0] - rows[Joint.LEFT_FOOT, 0]) < 0.01


def test_the_frame_turns_with_the_person_and_a_mirrored_person_faces_the_other_way() -> None:
    joints = cone_joints(spread_deg=0)
    np.testing.assert_allclose(frame_of(joints), ((-1, 0, 0), (0, 1, 0), (0, 0, -1)), atol=1e-6)
    np.testing.assert_allclose(frame_of(joints[MIRROR]), ((1, 0, 0), (0, 1, 0), (0, 0, 1)), atol=1e-6)


def test_nothing_has_directions_without_errors() -> None:
    assert np.isfinite(extend(np.zeros((NUM_JOINTS, 3)), NOWHERE)).all()
