"""The fitted body: people of round cones with known joints, and the normal equations."""

import numpy as np
import pytest
from cone_people import CAMERA, cone_body, cone_joints, moved, person  # noqa: F401
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.geometry.body import LIMBS, TORSO_JOINTS
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.solver import fit, pose_cost, solve


def turned(joints: np.ndarray, angle_deg: float) -> np.ndarray:
    """The pose rotated about the camera's vertical through its torso."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return joints[Joint.TORSO] + (joints - joints[Joint.TORSO]) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.floats(0, 0.9))
@settings(deadline=None)
def test_dense_and_sparse_systems_are_solved(seed: int, size: int, zeros: float) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(size + 5, size)) * (rng.random((size + 5, size)) > zeros)
    matrix, right = rows.T @ rows + 0.1 * np.eye(size), rng.normal(size=size)
    solution = right.copy()
    solve(matrix.copy(), solution)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_fit_converges_from_a_small_displacement(person, seed: int) -> None:  # noqa: F811
    joints, body, grid = person
    start = moved(joints, seed)
    found = fit(start, grid, body, iterations=15)
    error = np.linalg.norm(found - joints, axis=1)
    assert error.mean() < 0.02 < 0.03 < np.linalg.norm(start - joints, axis=1).min()
    assert pose_cost(found, grid, body) < pose_cost(start, grid, body)


@pytest.mark.parametrize(("aside_m", "turned_deg"), [(0.03, 0), (-0.03, 0), (0, 12), (0, -12)])
def test_a_displaced_trunk_is_corrected(person, aside_m: float, turned_deg: float) -> None:  # noqa: F811
    joints, body, grid = person
    start, trunk = joints.copy(), list(TORSO_JOINTS)
    start[trunk] = turned(joints, turned_deg)[trunk] + (aside_m, 0, 0)
    found = fit(start, grid, body, iterations=15)
    initial_error = np.linalg.norm((start - joints)[trunk], axis=1).mean()
    assert np.linalg.norm((found - joints)[trunk], axis=1).mean() < 0.4 * initial_error


def test_the_true_pose_is_a_fixed_point(person) -> None:  # noqa: F811
    joints, body, grid = person
    assert np.linalg.norm(fit(joints, grid, body, iterations=30) - joints, axis=1).mean() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_limbs_keep_their_lengths(person, seed: int) -> None:  # noqa: F811
    joints, body, grid = person
    found = fit(moved(joints, seed, 0.05, 0.15), grid, body, iterations=15)
    for child, parent in LIMB_PARENTS.items():
        true = np.linalg.norm(joints[child] - joints[parent])
        assert np.linalg.norm(found[child] - found[parent]) == pytest.approx(true, abs=0.02)


def test_bodies_outside_the_view_are_no_error(person) -> None:  # noqa: F811
    joints, body, grid = person
    for offset in ((9, 0, 0), (0, -9, 0), (0, 0, -3.2), (0, 0, -9), (0, 0, 90)):
        assert np.isfinite(fit(joints + offset, grid, body, iterations=4)).all()
        assert np.isfinite(pose_cost(joints + offset, grid, body))
    one = np.zeros((NUM_JOINTS, 3))
    assert np.isfinite(fit(one, grid, body, iterations=4)).all() and np.isfinite(pose_cost(one, grid, body))


@pytest.mark.parametrize("angle_deg", [-20, 20])
def test_a_rotation_of_the_whole_body_is_recovered(person, angle_deg: float) -> None:  # noqa: F811
    joints, body, grid = person
    angle, middle = np.radians(angle_deg), joints[Joint.TORSO]
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    start = (joints - middle) @ turn.T + middle
    found = fit(start, grid, body, iterations=20)
    away = np.linalg.norm(found - joints, axis=1)
    assert away.mean() < 0.025 < 0.06 < np.linalg.norm(start - joints, axis=1)[LIMBS[:2, 2]].min()


def test_shoulders_sink_with_the_arms() -> None:
    """Without points only the lengths act: the distances from hips to shoulders decrease when the arms hang."""
    joints = cone_joints(elevation_deg=40)
    body = cone_body(joints)
    nothing = build_depth_grid(np.zeros((240, 320), np.float32), CAMERA)
    # All but the head, which its prior moves forwards.
    stayed = np.linalg.norm(fit(joints, nothing, body, iterations=20) - joints, axis=1)
    assert np.delete(stayed, [Joint.HEAD, Joint.TORSO]).max() < 0.01
    hanging = cone_joints(elevation_deg=-80)
    found = fit(hanging, nothing, body, iterations=20)
    assert HumanModel.from_joints(hanging).arms_raised < -0.9
    for shoulder, hip in ((Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP), (Joint.LEFT_SHOULDER, Joint.LEFT_HIP)):
        shorter = np.linalg.norm(hanging[shoulder] - hanging[hip]) - np.linalg.norm(found[shoulder] - found[hip])
        assert 0.02 < shorter < 0.08


def test_a_forearm_in_the_trunk_is_pushed_out() -> None:
    joints = cone_joints(elevation_deg=-60)
    body = cone_body(joints)
    nothing = build_depth_grid(np.zeros((240, 320), np.float32), CAMERA)
    wrong = joints.copy()
    wrong[Joint.RIGHT_HAND] = joints[Joint.TORSO] + (-0.05, 0.05, 0)
    found = fit(wrong, nothing, body, iterations=30)
    assert pose_cost(found, nothing, body) < 0.3 * pose_cost(wrong, nothing, body)
