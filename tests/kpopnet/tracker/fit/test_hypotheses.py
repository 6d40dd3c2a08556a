"""Pose hypotheses: tips of silhouettes, refitted limbs, rotated bodies, exchanged limbs."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.camera import CAMERAS
from kpopnet.geometry.body import LIMBS
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.geometry.geodesic import UNREACHABLE_M, geodesic_distances
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.fit.hypotheses import (
    CONTINUITY_WEIGHT,
    LIMB_POSE_RANGES,
    LIMB_POSES,
    MAX_END_STEP_M,
    MAX_TIPS,
    MIN_TIP_DISTANCE_M,
    MIN_TIP_SEPARATION_M,
    _continuity_cost,
    _enforce_lengths,
    _limb_tips,
    _torso_points,
    refit_limbs,
    rotate_about_shoulders,
    rotate_about_spine,
    swap_crossed_limbs,
)
from kpopnet.tracker.fit.objective import pose_cost

CAMERA = CAMERAS["kinect_v1"]
ROUND_M = 1e-6


def seen(joints: np.ndarray):
    body = cone_body(joints)
    return body, build_depth_grid(draw_cones(joints, body, CAMERA), CAMERA)


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
    grid = build_depth_grid(np.where(star, np.float32(2.5), np.float32(0)), CAMERA)
    centre = CAMERA.back_project(np.array((160, 120, 2.5)))
    source = np.linalg.norm(grid.points_m - centre, axis=1) < 0.1
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = grid.points_m[_limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, length)]
    assert len(tips) == rays
    away = np.linalg.norm(tips[:, None] - CAMERA.back_project(np.array(ends)), axis=-1)
    assert sorted(away.argmin(1)) == list(range(rays)) and away.min(1).max() < 0.1


def test_tips_are_separated_and_reachable() -> None:
    joints = cone_joints(elevation_deg=20)
    body, grid = seen(joints)
    source = _torso_points(joints, grid.points_m, body)
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = _limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, length)
    points = grid.points_m[tips]
    apart = lengths_m(points) + np.eye(len(points))
    assert apart.min() >= MIN_TIP_SEPARATION_M
    for end in (Joint.RIGHT_HAND, Joint.LEFT_HAND, Joint.RIGHT_FOOT, Joint.LEFT_FOOT):
        assert np.linalg.norm(points - joints[end], axis=1).min() < 0.15
    isolated = np.where(np.arange(len(length)) == tips[0], 1e9, length)
    assert tips[0] not in _limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, isolated)
    assert len(_limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, np.full(len(length), 1e9))) == 0


def test_torso_points_lie_on_torso_and_head() -> None:
    joints = cone_joints(elevation_deg=20)
    body, grid = seen(joints)
    on = grid.points_m[_torso_points(joints, grid.points_m, body)]
    assert len(on) > 20
    for end in LIMBS[:, 1:].ravel():
        assert np.linalg.norm(on - joints[end], axis=1).min() > 0.08
    for joint in (Joint.HEAD, Joint.TORSO):
        u, v, _ = CAMERA.project(joints[joint])
        pixels = CAMERA.project(on)[:, :2]
        assert np.linalg.norm(pixels - (u, v), axis=1).min() < 4


# --- limbs --------------------------------------------------------------------------------------------------------


def swung(joints: np.ndarray, limb: int, angle_deg: float) -> np.ndarray:
    """A whole limb rotated about its root in the image plane."""
    joints = joints.copy()
    root, *others = LIMBS[limb]
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    turn = np.array([(cos, -sin, 0), (sin, cos, 0), (0, 0, 1)])
    joints[others] = (joints[others] - joints[root]) @ turn.T + joints[root]
    return joints


@pytest.mark.parametrize("limb", [0, 1])
@pytest.mark.parametrize("elbow_deg", [0, 60])
@pytest.mark.parametrize("angle_deg", [-100, -60, 60])
def test_a_lost_arm_is_recovered(limb: int, elbow_deg: float, angle_deg: float) -> None:
    joints = cone_joints(elevation_deg=15, elbow_deg=elbow_deg)
    body, grid = seen(joints)
    wrong = swung(joints, limb, angle_deg)
    arm = LIMBS[limb, 1:]
    assert np.linalg.norm(wrong - joints, axis=1)[arm].min() > 0.2
    found, changes = refit_limbs(wrong, joints, grid, body)
    assert changes >= 1
    assert np.linalg.norm(found - joints, axis=1)[arm].max() < 0.1
    assert pose_cost(found, grid, body) < pose_cost(wrong, grid, body)


@pytest.mark.parametrize(("limb", "angle_deg"), [(2, 50), (3, -50)])
def test_a_lost_leg_is_recovered(limb: int, angle_deg: float) -> None:
    joints = cone_joints(abduction_deg=12)
    body, grid = seen(joints)
    wrong = swung(joints, limb, angle_deg)
    found, changes = refit_limbs(wrong, joints, grid, body)
    assert changes >= 1
    # Approximate: a silhouette hardly constrains the knee along the leg. The fit corrects it.
    knee, foot = np.linalg.norm(found - joints, axis=1)[LIMBS[limb, 1:]]
    assert knee < 0.2 and foot < 0.12


def test_continuity_cost_is_quadratic_and_clipped() -> None:
    before = cone_joints()
    for way_m, counts_m in ((0.0, 0.0), (0.2, 0.2), (MAX_END_STEP_M, MAX_END_STEP_M), (3.0, MAX_END_STEP_M)):
        joints = before.copy()
        joints[Joint.LEFT_HAND, 0] += way_m
        assert _continuity_cost(joints, before, int(Joint.LEFT_HAND)) == pytest.approx(CONTINUITY_WEIGHT * counts_m**2)
        assert _continuity_cost(joints, before, int(Joint.RIGHT_HAND)) == 0


def test_a_correct_pose_is_kept() -> None:
    for pose in ({}, {"elevation_deg": 10, "elbow_deg": 60}, {"elevation_deg": -40, "yaw_deg": 25}):
        joints = cone_joints(**pose)
        body, grid = seen(joints)
        found, changes = refit_limbs(joints, joints, grid, body)
        assert changes == 0
        np.testing.assert_array_equal(found, joints)


def test_refitted_limbs_keep_lengths_and_roots() -> None:
    joints = cone_joints(elevation_deg=15, elbow_deg=40)
    body, grid = seen(joints)
    wrong = swung(swung(joints, 0, -90), 1, 80)
    found, changes = refit_limbs(wrong, joints, grid, body)
    assert changes >= 2
    torso = [joint for joint in Joint if joint not in LIMBS[:, 1:]]
    np.testing.assert_array_equal(found[torso], wrong[torso])
    for (root, middle, end), (upper_m, lower_m) in zip(LIMBS, body.limbs_m, strict=True):
        assert np.linalg.norm(found[middle] - found[root]) == pytest.approx(upper_m, abs=ROUND_M)
        assert np.linalg.norm(found[end] - found[middle]) == pytest.approx(lower_m, abs=ROUND_M)


def test_an_empty_image_refits_no_limb() -> None:
    joints = cone_joints()
    grid = build_depth_grid(np.zeros((240, 320), np.float32), CAMERA)
    found, changes = refit_limbs(joints, joints, grid, cone_body(joints))
    assert changes == 0
    np.testing.assert_array_equal(found, joints)


@given(*[st.tuples(*[st.floats(-1, 1)] * 3)] * 3, st.floats(0.15, 0.5), st.floats(0.15, 0.5))
@settings(deadline=None)
def test_lengths_are_enforced_from_any_start(root: tuple, middle: tuple, end: tuple, upper_m: float, lower_m: float) -> None:
    fixed, moved, far = np.array(root), np.array(middle), np.array(end)
    _enforce_lengths(fixed, moved, far, upper_m, lower_m)
    np.testing.assert_array_equal(fixed, root)
    assert np.isfinite(moved).all() and np.isfinite(far).all()
    # At most the given lengths; shorter only if root, middle and end coincided in an iteration.
    assert np.linalg.norm(moved - fixed) <= upper_m + ROUND_M
    assert np.linalg.norm(far - moved) <= lower_m + ROUND_M


def test_correct_lengths_change_nothing() -> None:
    root, middle, end = np.array((0.0, 0, 3)), np.array((0.3, 0, 3)), np.array((0.3, 0.25, 3))
    _enforce_lengths(root, middle, end, 0.3, 0.25)
    np.testing.assert_allclose((root, middle, end), [(0, 0, 3), (0.3, 0, 3), (0.3, 0.25, 3)], atol=1e-6)


def test_limb_poses_are_unit_vectors_and_knees_bend_backwards() -> None:
    np.testing.assert_allclose(np.linalg.norm(LIMB_POSES, axis=-1), 1, atol=1e-9)
    assert (
        LIMB_POSE_RANGES[0].tolist() == LIMB_POSE_RANGES[1].tolist()
        and LIMB_POSE_RANGES[2].tolist() == LIMB_POSE_RANGES[3].tolist()
    )
    assert (
        LIMB_POSE_RANGES[0, 0] == 0
        and LIMB_POSE_RANGES[0, 1] == LIMB_POSE_RANGES[2, 0]
        and LIMB_POSE_RANGES[2, 1] == len(LIMB_POSES)
    )
    upper, lower = np.moveaxis(LIMB_POSES[slice(*LIMB_POSE_RANGES[2])], 1, 0)
    knee_before_line = (upper - lower)[:, 2] / 2
    assert (knee_before_line[upper[:, 2] > -1e-9] > -1e-9).all()


# --- rotations of the whole body ----------------------------------------------------------------------------------


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


@pytest.mark.parametrize("elevation_deg", [-40, 10, 50])
def test_tips_agree_with_brute_force(elevation_deg: float) -> None:
    joints = cone_joints(elevation_deg=elevation_deg, yaw_deg=15)
    body, grid = seen(joints)
    source = _torso_points(joints, grid.points_m, body)
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    apart = np.linalg.norm(grid.points_m[:, None] - grid.points_m[None], axis=-1)
    reached = length < 1e8
    expected = [
        i
        for i in np.flatnonzero(reached & (length >= MIN_TIP_DISTANCE_M))
        if not ((apart[i] < MIN_TIP_SEPARATION_M) & reached & (length > length[i])).any()
        and not ((apart[i] < MIN_TIP_SEPARATION_M) & (length == length[i]))[:i].any()
    ]
    assert len(expected) >= 3
    np.testing.assert_array_equal(_limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, length), expected[:MAX_TIPS])


# --- crossed limbs ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lower", [Joint.RIGHT_HAND, Joint.RIGHT_FOOT])
@pytest.mark.parametrize("whole", [False, True])
def test_crossed_limbs_exchange_ends_or_middles_and_ends(lower: Joint, whole: bool) -> None:
    joints = cone_joints()
    assert swap_crossed_limbs(joints) == []
    crossed = joints.copy()
    exchanged = [lower, lower + 1, *((lower - 2, lower - 1) if whole else ())]
    crossed[exchanged] = joints[MIRROR[exchanged]]
    found = swap_crossed_limbs(crossed)
    assert len(found) == 2
    np.testing.assert_array_equal(found[whole], joints)
