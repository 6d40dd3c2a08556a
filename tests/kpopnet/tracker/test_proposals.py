"""Other poses worth trying: tips of silhouettes, limbs laid along them, turned bodies."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.body import LIMBS
from kpopnet.tracker.cells import cells_of
from kpopnet.tracker.geodesic import NOWHERE_M, shortest_ways
from kpopnet.tracker.misfit import misfit
from kpopnet.tracker.proposals import (
    CONTINUITY,
    FARTHEST_M,
    LIMB_KINDS,
    LIMB_POSES,
    MOST_TIPS,
    TIP_APART_M,
    TIP_LEAST_M,
    _tips,
    _torso_cells,
    _way,
    _with_lengths,
    bent,
    relay_limbs,
    turned,
    uncrossed,
)

CAMERA = CAMERAS["kinect_v1"]
ROUND_M = 1e-6


def seen(joints: np.ndarray):
    body = cone_body(joints)
    return body, cells_of(draw_cones(joints, body, CAMERA), CAMERA)


def lengths_m(joints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(joints[:, None] - joints[None], axis=-1)


# --- tips ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rays", [3, 5, 7])
def test_a_star_has_a_tip_at_every_ray(rays: int) -> None:
    v, u = np.mgrid[:240, :320]
    aside, below = u - 160, v - 120
    star = np.hypot(aside, below) < 18
    angles = 0.3 + 2 * np.pi * np.arange(rays) / rays
    ends = []
    for angle in angles:
        along = aside * np.cos(angle) + below * np.sin(angle)
        across = -aside * np.sin(angle) + below * np.cos(angle)
        star |= (along > 0) & (along < 90) & (np.abs(across) < 6)
        ends.append((160 + 90 * np.cos(angle), 120 + 90 * np.sin(angle), 2.5))
    cells = cells_of(np.where(star, np.float32(2.5), np.float32(0)), CAMERA)
    centre = CAMERA.back_project(np.array((160, 120, 2.5)))
    source = np.linalg.norm(cells.points_m - centre, axis=1) < 0.1
    length, _ = shortest_ways(cells.neighbours, cells.steps_m, source, NOWHERE_M)
    tips = cells.points_m[_tips(cells.points_m, cells.neighbours, cells.steps_m, length)]
    assert len(tips) == rays
    away = np.linalg.norm(tips[:, None] - CAMERA.back_project(np.array(ends)), axis=-1)
    assert sorted(away.argmin(1)) == list(range(rays)) and away.min(1).max() < 0.1


def test_tips_keep_apart_and_count_only_what_can_be_reached() -> None:
    joints = cone_joints(elevation_deg=20)
    body, cells = seen(joints)
    source = _torso_cells(joints, cells.points_m, body)
    length, _ = shortest_ways(cells.neighbours, cells.steps_m, source, NOWHERE_M)
    tips = _tips(cells.points_m, cells.neighbours, cells.steps_m, length)
    points = cells.points_m[tips]
    apart = lengths_m(points) + np.eye(len(points))
    assert apart.min() >= TIP_APART_M
    for end in (Joint.RIGHT_HAND, Joint.LEFT_HAND, Joint.RIGHT_FOOT, Joint.LEFT_FOOT):
        assert np.linalg.norm(points - joints[end], axis=1).min() < 0.15
    alone = np.where(np.arange(len(length)) == tips[0], 1e9, length)
    assert tips[0] not in _tips(cells.points_m, cells.neighbours, cells.steps_m, alone)
    assert len(_tips(cells.points_m, cells.neighbours, cells.steps_m, np.full(len(length), 1e9))) == 0


def test_torso_cells_lie_on_torso_and_head() -> None:
    joints = cone_joints(elevation_deg=20)
    body, cells = seen(joints)
    on = cells.points_m[_torso_cells(joints, cells.points_m, body)]
    assert len(on) > 20
    for end in LIMBS[:, 1:].ravel():
        assert np.linalg.norm(on - joints[end], axis=1).min() > 0.08
    for joint in (Joint.HEAD, Joint.TORSO):
        u, v, _ = CAMERA.project(joints[joint])
        pixels = CAMERA.project(on)[:, :2]
        assert np.linalg.norm(pixels - (u, v), axis=1).min() < 4


# --- limbs --------------------------------------------------------------------------------------------------------


def swung(joints: np.ndarray, limb: int, angle_deg: float) -> np.ndarray:
    """A whole limb turned about its root, in the picture's plane."""
    joints = joints.copy()
    root, *others = LIMBS[limb]
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    turn = np.array([(cos, -sin, 0), (sin, cos, 0), (0, 0, 1)])
    joints[others] = (joints[others] - joints[root]) @ turn.T + joints[root]
    return joints


@pytest.mark.parametrize("limb", [0, 1])
@pytest.mark.parametrize("elbow_deg", [0, 60])
@pytest.mark.parametrize("angle_deg", [-100, -60, 60])
def test_a_lost_arm_is_found(limb: int, elbow_deg: float, angle_deg: float) -> None:
    joints = cone_joints(elevation_deg=15, elbow_deg=elbow_deg)
    body, cells = seen(joints)
    wrong = swung(joints, limb, angle_deg)
    arm = LIMBS[limb, 1:]
    assert np.linalg.norm(wrong - joints, axis=1)[arm].min() > 0.2
    found, changes = relay_limbs(wrong, joints, cells, body)
    assert changes >= 1
    assert np.linalg.norm(found - joints, axis=1)[arm].max() < 0.1
    assert misfit(found, cells, body) < misfit(wrong, cells, body)


@pytest.mark.parametrize(("limb", "angle_deg"), [(2, 50), (3, -50)])
def test_a_lost_leg_is_found(limb: int, angle_deg: float) -> None:
    joints = cone_joints(spread_deg=12)
    body, cells = seen(joints)
    wrong = swung(joints, limb, angle_deg)
    found, changes = relay_limbs(wrong, joints, cells, body)
    assert changes >= 1
    # Laid roughly: a silhouette says little of where a knee is along the way. Fitting does the rest.
    knee, foot = np.linalg.norm(found - joints, axis=1)[LIMBS[limb, 1:]]
    assert knee < 0.2 and foot < 0.12


def test_the_end_of_a_limb_pays_for_the_square_of_its_way_up_to_a_limit() -> None:
    before = cone_joints()
    for way_m, counts_m in ((0.0, 0.0), (0.2, 0.2), (FARTHEST_M, FARTHEST_M), (3.0, FARTHEST_M)):
        joints = before.copy()
        joints[Joint.LEFT_HAND, 0] += way_m
        assert _way(joints, before, int(Joint.LEFT_HAND)) == pytest.approx(CONTINUITY * counts_m**2)
        assert _way(joints, before, int(Joint.RIGHT_HAND)) == 0


def test_what_is_right_is_left_alone() -> None:
    for pose in ({}, {"elevation_deg": 10, "elbow_deg": 60}, {"elevation_deg": -40, "yaw_deg": 25}):
        joints = cone_joints(**pose)
        body, cells = seen(joints)
        found, changes = relay_limbs(joints, joints, cells, body)
        assert changes == 0
        np.testing.assert_array_equal(found, joints)


def test_limbs_that_are_laid_keep_their_lengths_and_their_roots() -> None:
    joints = cone_joints(elevation_deg=15, elbow_deg=40)
    body, cells = seen(joints)
    wrong = swung(swung(joints, 0, -90), 1, 80)
    found, changes = relay_limbs(wrong, joints, cells, body)
    assert changes >= 2
    torso = [joint for joint in Joint if joint not in LIMBS[:, 1:]]
    np.testing.assert_array_equal(found[torso], wrong[torso])
    for (root, middle, end), (upper_m, lower_m) in zip(LIMBS, body.limbs_m, strict=True):
        assert np.linalg.norm(found[middle] - found[root]) == pytest.approx(upper_m, abs=ROUND_M)
        assert np.linalg.norm(found[end] - found[middle]) == pytest.approx(lower_m, abs=ROUND_M)


def test_nobody_to_lay_limbs_along() -> None:
    joints = cone_joints()
    cells = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    found, changes = relay_limbs(joints, joints, cells, cone_body(joints))
    assert changes == 0
    np.testing.assert_array_equal(found, joints)


@given(*[st.tuples(*[st.floats(-1, 1)] * 3)] * 3, st.floats(0.15, 0.5), st.floats(0.15, 0.5))
@settings(deadline=None)
def test_two_lengths_from_any_hint(root: tuple, middle: tuple, end: tuple, upper_m: float, lower_m: float) -> None:
    fixed, moved, far = np.array(root), np.array(middle), np.array(end)
    _with_lengths(fixed, moved, far, upper_m, lower_m)
    np.testing.assert_array_equal(fixed, root)
    assert np.isfinite(moved).all() and np.isfinite(far).all()
    # No longer than asked for; and just that, unless root, middle and end fell into one on the way.
    assert np.linalg.norm(moved - fixed) <= upper_m + ROUND_M
    assert np.linalg.norm(far - moved) <= lower_m + ROUND_M


def test_a_hint_that_is_right_stays() -> None:
    root, middle, end = np.array((0.0, 0, 3)), np.array((0.3, 0, 3)), np.array((0.3, 0.25, 3))
    _with_lengths(root, middle, end, 0.3, 0.25)
    np.testing.assert_allclose((root, middle, end), [(0, 0, 3), (0.3, 0, 3), (0.3, 0.25, 3)], atol=1e-6)


def test_known_poses_are_directions_and_legs_bend_one_way() -> None:
    np.testing.assert_allclose(np.linalg.norm(LIMB_POSES, axis=-1), 1, atol=1e-9)
    assert LIMB_KINDS[0].tolist() == LIMB_KINDS[1].tolist() and LIMB_KINDS[2].tolist() == LIMB_KINDS[3].tolist()
    assert LIMB_KINDS[0, 0] == 0 and LIMB_KINDS[0, 1] == LIMB_KINDS[2, 0] and LIMB_KINDS[2, 1] == len(LIMB_POSES)
    upper, lower = np.moveaxis(LIMB_POSES[slice(*LIMB_KINDS[2])], 1, 0)
    knee_before_line = (upper - lower)[:, 2] / 2
    assert (knee_before_line[upper[:, 2] > -1e-9] > -1e-9).all()


# --- the whole body turned ----------------------------------------------------------------------------------------


@given(st.floats(-np.pi, np.pi), st.floats(-40, 40))
@settings(deadline=None)
def test_turning_and_bending_keep_all_distances_and_can_be_undone(angle: float, yaw_deg: float) -> None:
    joints = cone_joints(elevation_deg=30, elbow_deg=20, yaw_deg=yaw_deg)
    for way in (turned, bent):
        np.testing.assert_allclose(lengths_m(way(joints, angle)), lengths_m(joints), atol=1e-6)
        np.testing.assert_allclose(way(way(joints, angle), -angle), joints, atol=1e-6)
    np.testing.assert_allclose(turned(joints, 0.0), joints, atol=1e-12)


def test_turning_is_to_the_persons_left_and_bending_forwards() -> None:
    joints = cone_joints()
    left = turned(joints, np.radians(30))
    # Their left turned away from the camera, as the heading of `y_joints` turns it.
    np.testing.assert_allclose(left, cone_joints(yaw_deg=30), atol=0.02)
    bow = bent(joints, np.radians(30))
    assert bow[Joint.HEAD, 2] < joints[Joint.HEAD, 2] - 0.1 and bow[Joint.RIGHT_FOOT, 2] > joints[Joint.RIGHT_FOOT, 2] + 0.1


def test_a_person_turned_round_looks_away() -> None:
    joints = cone_joints(elevation_deg=30)
    back = turned(joints, np.pi)
    assert back[Joint.RIGHT_SHOULDER, 0] > 0 > joints[Joint.RIGHT_SHOULDER, 0]
    np.testing.assert_allclose(back[Joint.HEAD], joints[Joint.HEAD], atol=0.02)


@pytest.mark.parametrize("elevation_deg", [-40, 10, 50])
def test_tips_are_those_of_a_plain_search(elevation_deg: float) -> None:
    joints = cone_joints(elevation_deg=elevation_deg, yaw_deg=15)
    body, cells = seen(joints)
    source = _torso_cells(joints, cells.points_m, body)
    length, _ = shortest_ways(cells.neighbours, cells.steps_m, source, NOWHERE_M)
    apart = np.linalg.norm(cells.points_m[:, None] - cells.points_m[None], axis=-1)
    reached = length < 1e8
    plain = [
        i
        for i in np.flatnonzero(reached & (length >= TIP_LEAST_M))
        if not ((apart[i] < TIP_APART_M) & reached & (length > length[i])).any()
        and not ((apart[i] < TIP_APART_M) & (length == length[i]))[:i].any()
    ]
    assert len(plain) >= 3
    np.testing.assert_array_equal(_tips(cells.points_m, cells.neighbours, cells.steps_m, length), plain[:MOST_TIPS])


# --- crossed limbs ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lower", [Joint.RIGHT_HAND, Joint.RIGHT_FOOT])
@pytest.mark.parametrize("whole", [False, True])
def test_limbs_that_cross_exchange_their_ends_or_all_but_their_roots(lower: Joint, whole: bool) -> None:
    joints = cone_joints()
    assert uncrossed(joints) == []
    crossed = joints.copy()
    exchanged = [lower, lower + 1, *((lower - 2, lower - 1) if whole else ())]
    crossed[exchanged] = joints[MIRROR[exchanged]]
    found = uncrossed(crossed)
    assert len(found) == 2
    np.testing.assert_array_equal(found[whole], joints)
