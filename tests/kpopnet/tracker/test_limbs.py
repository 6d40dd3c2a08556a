"""Limbs laid anew along the silhouette."""

import numpy as np
import pytest
from cone_people import cone_joints, seen

from kpopnet.geometry.body import LIMBS
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.limbs import (
    LIMB_POSE_RANGES,
    LIMB_POSES,
    refit_limbs,
    swap_crossed_limbs,
)
from kpopnet.tracker.solver import pose_cost

ROUND_M = 1e-6


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
