"""The fitted body: people of round cones, whose truth is known, and the equations on the way there."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints
from fitted_people import CAMERA, moved, person  # noqa: F401
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.body import LIMBS, PLACE_JOINTS, RIGHT_CHEST, TORSO_JOINTS
from kpopnet.tracker.cells import cells_of
from kpopnet.tracker.cones import frame_of
from kpopnet.tracker.fitting import COLUMN, fit, solve
from kpopnet.tracker.misfit import HABITS, misfit, unusual
from kpopnet.tracker.model import LIMB_PARENTS, HumanModel
from kpopnet.tracker.proposals import turned


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.floats(0, 0.9))
@settings(deadline=None)
def test_systems_with_and_without_zeros_are_solved(seed: int, size: int, zeros: float) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(size + 5, size)) * (rng.random((size + 5, size)) > zeros)
    matrix, right = rows.T @ rows + 0.1 * np.eye(size), rng.normal(size=size)
    solution = right.copy()
    solve(matrix.copy(), solution)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-9)


def test_every_joint_has_unknowns_of_its_own() -> None:
    assert sorted(COLUMN[:NUM_JOINTS].tolist()) == list(range(0, 3 * NUM_JOINTS, 3))
    assert COLUMN[NUM_JOINTS:RIGHT_CHEST].tolist() == [
        COLUMN[joint] for joint in (Joint.RIGHT_FOOT, Joint.LEFT_FOOT, Joint.RIGHT_HAND, Joint.LEFT_HAND)
    ]
    assert COLUMN[RIGHT_CHEST:].tolist() == COLUMN[PLACE_JOINTS].tolist()


@pytest.mark.parametrize("seed", range(4))
def test_who_starts_a_little_off_comes_back(person, seed: int) -> None:  # noqa: F811
    joints, body, cells = person
    start = moved(joints, seed)
    found = fit(start, cells, body, steps=15)
    error = np.linalg.norm(found - joints, axis=1)
    assert error.mean() < 0.02 < 0.03 < np.linalg.norm(start - joints, axis=1).min()
    assert misfit(found, cells, body) < misfit(start, cells, body)


@pytest.mark.parametrize(("aside_m", "turned_deg"), [(0.03, 0), (-0.03, 0), (0, 12), (0, -12)])
def test_a_trunk_that_is_a_little_beside_comes_back(person, aside_m: float, turned_deg: float) -> None:  # noqa: F811
    joints, body, cells = person
    start, trunk = joints.copy(), list(TORSO_JOINTS)
    start[trunk] = turned(joints, np.radians(turned_deg))[trunk] + (aside_m, 0, 0)
    found = fit(start, cells, body, steps=15)
    beside = np.linalg.norm((start - joints)[trunk], axis=1).mean()
    assert np.linalg.norm((found - joints)[trunk], axis=1).mean() < 0.4 * beside


def test_the_truth_is_a_place_to_stay(person) -> None:  # noqa: F811
    joints, body, cells = person
    assert np.linalg.norm(fit(joints, cells, body, steps=30) - joints, axis=1).mean() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_limbs_keep_their_lengths(person, seed: int) -> None:  # noqa: F811
    joints, body, cells = person
    found = fit(moved(joints, seed, 0.05, 0.15), cells, body, steps=15)
    for child, parent in LIMB_PARENTS.items():
        true = np.linalg.norm(joints[child] - joints[parent])
        assert np.linalg.norm(found[child] - found[parent]) == pytest.approx(true, abs=0.02)


def test_every_so_many_points_say_about_the_same(person) -> None:  # noqa: F811
    joints, body, cells = person
    wrong = moved(joints, 1, 0.1, 0.1)
    assert misfit(wrong, cells, body, every=3) == pytest.approx(misfit(wrong, cells, body), rel=0.2)
    few = fit(moved(joints, 1), cells, body, steps=15, every=3)
    assert np.linalg.norm(few - joints, axis=1).mean() < 0.025


def test_no_points_pull_at_nothing() -> None:
    joints = cone_joints()
    body = cone_body(joints)
    cells = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    assert np.isfinite(fit(joints, cells, body, steps=10)).all()
    assert misfit(joints, cells, body) == pytest.approx(unusual(joints, frame_of(joints)[2], 0, len(HABITS)), abs=1e-9)


def test_a_body_beside_behind_and_beyond_the_camera_is_no_error(person) -> None:  # noqa: F811
    joints, body, cells = person
    for way in ((9, 0, 0), (0, -9, 0), (0, 0, -3.2), (0, 0, -9), (0, 0, 90)):
        assert np.isfinite(fit(joints + way, cells, body, steps=4)).all()
        assert np.isfinite(misfit(joints + way, cells, body))
    one = np.zeros((NUM_JOINTS, 3))
    assert np.isfinite(fit(one, cells, body, steps=4)).all() and np.isfinite(misfit(one, cells, body))


def test_the_start_is_not_written_to(person) -> None:  # noqa: F811
    joints, body, cells = person
    start = joints.copy()
    fit(start, cells, body, steps=3)
    np.testing.assert_array_equal(start, joints)


@pytest.mark.parametrize("angle_deg", [-20, 20])
def test_a_turn_of_the_whole_body_is_found(person, angle_deg: float) -> None:  # noqa: F811
    joints, body, cells = person
    angle, middle = np.radians(angle_deg), joints[Joint.TORSO]
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    start = (joints - middle) @ turn.T + middle
    found = fit(start, cells, body, steps=20)
    away = np.linalg.norm(found - joints, axis=1)
    assert away.mean() < 0.025 < 0.06 < np.linalg.norm(start - joints, axis=1)[LIMBS[:2, 2]].min()


def test_shoulders_sink_with_the_arms() -> None:
    """Only lengths pull where nothing is seen: those from the hips to the shoulders are shorter once the arms hang."""
    joints = cone_joints(elevation_deg=40)
    body = cone_body(joints)
    nothing = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    # All but the head, which habit draws forwards.
    stayed = np.linalg.norm(fit(joints, nothing, body, steps=20) - joints, axis=1)
    assert np.delete(stayed, [Joint.HEAD, Joint.TORSO]).max() < 0.01
    hanging = cone_joints(elevation_deg=-80)
    found = fit(hanging, nothing, body, steps=20)
    assert HumanModel.from_joints(hanging).arms_raised < -0.9
    for shoulder, hip in ((Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP), (Joint.LEFT_SHOULDER, Joint.LEFT_HIP)):
        shorter = np.linalg.norm(hanging[shoulder] - hanging[hip]) - np.linalg.norm(found[shoulder] - found[hip])
        assert 0.02 < shorter < 0.08


def test_a_forearm_in_the_belly_is_pushed_out() -> None:
    joints = cone_joints(elevation_deg=-60)
    body = cone_body(joints)
    nothing = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    wrong = joints.copy()
    wrong[Joint.RIGHT_HAND] = joints[Joint.TORSO] + (-0.05, 0.05, 0)
    found = fit(wrong, nothing, body, steps=30)
    assert misfit(found, nothing, body) < 0.3 * misfit(wrong, nothing, body)
