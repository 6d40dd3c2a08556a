"""The pose cost: people of round cones with known joints, and impossible bodies."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, moved, person  # noqa: F401
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.geometry.body import COLLISION_PAIRS, LIMB_COLLISIONS, LIMBS, PARTS
from kpopnet.geometry.cones import extend_joints, part_segments, torso_frame
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.energy import (
    COLUMN,
    JOINT_PRIOR_WEIGHT,
    JOINT_PRIORS,
    LENGTH_WEIGHT,
    add_joint_priors,
    add_lengths,
    joint_prior,
    joint_prior_shortfall,
    penetration_cost,
)
from kpopnet.tracker.solver import pose_cost


def test_the_true_pose_has_the_lowest_cost(person) -> None:  # noqa: F811
    joints, body, grid = person
    least = pose_cost(joints, grid, body)
    assert least < 2e-4
    for seed in range(20):
        assert pose_cost(moved(joints, seed), grid, body) > least
        assert pose_cost(moved(joints, seed, 0.1, 0.2), grid, body) > 3 * least
    # A single displaced limb raises the cost.
    for _, _, end in LIMBS:
        for offset in np.eye(3):
            wrong = joints.copy()
            wrong[end] += 0.15 * offset
            assert pose_cost(wrong, grid, body) > least


def test_a_displaced_body_has_a_high_cost(person) -> None:  # noqa: F811
    joints, body, grid = person
    for offset in ((0, 0, -0.3), (0.4, 0, 0), (0, 0, 0.5)):
        assert pose_cost(joints + offset, grid, body) > 10 * pose_cost(joints, grid, body)


def prior_cost(joints: np.ndarray) -> float:
    """Cost of all joint priors."""
    return joint_prior(joints, torso_frame(joints)[2], 0, len(JOINT_PRIORS))


def facing(knees_m: float, head_m: float, thighs_m: float = 0.0, hands_m: float = 0.0) -> np.ndarray:
    """Standing, facing the camera; knees, head, thighs and hands in front (to smaller z) by the given metres."""
    joints = cone_joints(abduction_deg=0, elevation_deg=-60)
    for side in ("RIGHT", "LEFT"):
        hip, knee, foot = (Joint[f"{side}_{joint}"] for joint in ("HIP", "KNEE", "FOOT"))
        joints[knee, :2] = (joints[hip] + joints[foot])[:2] / 2
        joints[knee, 2] = joints[hip, 2] - thighs_m
        joints[foot, 2] = 2 * (joints[knee, 2] + knees_m) - joints[hip, 2]
        joints[Joint[f"{side}_HAND"], 2] = joints[Joint[f"{side}_SHOULDER"], 2] - hands_m
    joints[Joint.HEAD, 2] = joints[Joint.NECK, 2] - head_m
    return joints


@given(st.floats(0, 0.2), st.floats(0.04, 0.1), st.floats(0, 0.3), st.floats(0, 0.4), st.floats(-np.pi, np.pi))
@settings(deadline=None)
def test_plausible_poses_have_no_prior_cost_at_any_heading(knees, head, thighs, hands, yaw) -> None:
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    assert prior_cost(facing(knees, head, thighs, hands) @ turn.T) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("joints", "joint", "short_m", "both"),
    [
        (facing(-0.1, 0.05, thighs_m=0.1), Joint.RIGHT_KNEE, 0.1, True),
        (facing(0.0, -0.02), Joint.HEAD, 0.06, False),
        (facing(0.05, 0.05, thighs_m=0.05, hands_m=-0.2), Joint.RIGHT_HAND, 0.2, True),
    ],
)
def test_prior_cost_is_the_weighted_squared_shortfall(joints, joint: Joint, short_m: float, both: bool) -> None:
    weight = JOINT_PRIOR_WEIGHT[np.flatnonzero(JOINT_PRIORS[:, 0] == joint)[0]]
    assert prior_cost(joints) == pytest.approx((2 if both else 1) * weight * short_m**2, rel=0.05)


def test_a_mirrored_pose_has_a_higher_prior_cost() -> None:
    assert prior_cost(facing(0.1, 0.06, 0.1, 0.2)) < 1e-9 < 1e-4 < prior_cost(facing(0.1, 0.06, 0.1, 0.2)[MIRROR])


def test_a_hand_in_the_trunk_has_a_penetration_cost() -> None:
    for elevation_deg in (-75, 0, 60):
        joints = cone_joints(elevation_deg=elevation_deg)
        body = cone_body(joints)
        assert (
            penetration_cost(
                part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m), 0, len(COLLISION_PAIRS), np.inf
            )
            < 1e-6
        )
        folded = joints.copy()
        folded[Joint.LEFT_HAND] = joints[Joint.TORSO]
        segments = part_segments(extend_joints(folded, body.trunk_offsets_m), PARTS, body.radii_m)
        everywhere = penetration_cost(segments, 0, len(COLLISION_PAIRS), np.inf)
        assert everywhere > 1e-4
        assert (
            penetration_cost(segments, *LIMB_COLLISIONS[1], np.inf) == pytest.approx(everywhere)
            and penetration_cost(segments, *LIMB_COLLISIONS[0], np.inf) < 1e-6
        )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("term", ["lengths", "joint priors"])
def test_the_step_of_a_term_is_down_the_slope_of_its_energy(person, term: str, seed: int) -> None:  # noqa: F811
    """The right-hand side is -1/2 of the numerical gradient, with the torso's axes held as the linearisation holds them."""
    joints, body, _ = person
    body = body._replace(elevation_gain_m=0 * body.elevation_gain_m)
    joints = moved(joints, seed, 0.1, 0.2)
    frame, pairs = torso_frame(joints), np.flatnonzero(JOINT_PRIORS[:, 1] == JOINT_PRIORS[:, 2])  # of two joints

    def energy(at: np.ndarray) -> float:
        if term == "lengths":
            lengths_m = np.linalg.norm(at[body.pairs[:, 1]] - at[body.pairs[:, 0]], axis=1)
            return LENGTH_WEIGHT * np.mean(body.stiffness * (lengths_m - body.lengths_m) ** 2)
        return sum(JOINT_PRIOR_WEIGHT[k] * max(joint_prior_shortfall(at, k, frame[2]), 0) ** 2 for k in pairs)

    matrix, rhs, gradient = np.zeros((45, 45)), np.zeros(45), np.zeros((15, 3))
    if term == "lengths":
        add_lengths(matrix, rhs, joints, frame, body)
    else:
        add_joint_priors(matrix, rhs, joints, frame[2])
    for joint, axis in np.ndindex(15, 3):
        step = np.zeros((15, 3))
        step[joint, axis] = 1e-5
        gradient[joint, axis] = (energy(joints + step) - energy(joints - step)) / 2e-5
    compared = np.arange(15)
    if term == "joint priors":  # a knee against hip and foot moves the foot alone, by choice
        compared = np.setdiff1d(compared, [Joint.RIGHT_KNEE, Joint.LEFT_KNEE, Joint.RIGHT_FOOT, Joint.LEFT_FOOT])
    np.testing.assert_allclose(rhs[COLUMN[:15, None] + np.arange(3)][compared], -gradient[compared] / 2, atol=1e-7)
