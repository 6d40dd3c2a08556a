"""The body of round cones: its planar pose has the model's lengths, its parts are symmetric."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from y_people import y_joints

from kpopnet.geometry.body import (
    body_from_model,
    planar_pose,
)
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint

MODEL = HumanModel.from_joints(y_joints())


def symmetric(shoulders_m: float, hips_m: float, side_m: float, size: float) -> np.ndarray:
    """(15, 3) a planar, symmetric person; the hips are `side_m` below the shoulders."""
    joints = np.zeros((NUM_JOINTS, 3))
    joints[Joint.HEAD], joints[Joint.TORSO] = (0, -0.3 * size, 0), (0, side_m / 2, 0)
    for side, sign in (("RIGHT", -1), ("LEFT", 1)):
        joints[Joint[f"{side}_SHOULDER"]] = sign * shoulders_m / 2, 0, 0
        joints[Joint[f"{side}_HIP"]] = sign * hips_m / 2, side_m, 0
        for name, parent, length in (
            ("ELBOW", "SHOULDER", 0.28), ("HAND", "ELBOW", 0.25), ("KNEE", "HIP", 0.4), ("FOOT", "KNEE", 0.44),
        ):  # fmt: skip
            joints[Joint[f"{side}_{name}"]] = joints[Joint[f"{side}_{parent}"]] + (0, length * size, 0)
    return joints


@given(st.floats(0.2, 0.5), st.floats(0.1, 0.4), st.floats(0.3, 0.7), st.floats(0.5, 1.3))
def test_a_planar_symmetric_pose_is_reproduced(shoulders_m: float, hips_m: float, side_m: float, size: float) -> None:
    joints = symmetric(shoulders_m, hips_m, side_m, size)
    pose = planar_pose(HumanModel.from_joints(joints))
    paper = [joint for joint in Joint if joint != Joint.NECK]
    np.testing.assert_allclose(pose[paper], joints[paper], atol=1e-6)
    assert pose[Joint.HEAD, 1] < pose[Joint.NECK, 1] < 0 and abs(pose[Joint.NECK, 0]) < 1e-9


def test_body_lengths_are_the_models_lengths() -> None:
    body = body_from_model(MODEL)
    lengths = {tuple(pair): length for pair, length in zip(body.pairs.tolist(), body.lengths_m, strict=True)}
    for child, parent in ((Joint.RIGHT_HAND, Joint.RIGHT_ELBOW), (Joint.LEFT_FOOT, Joint.LEFT_KNEE)):
        assert lengths[tuple(sorted((child, parent)))] == pytest.approx(MODEL.limb_m[child])
    assert lengths[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER] == pytest.approx(MODEL.shoulder_to_shoulder_m)
    assert body.limbs_m[0] == pytest.approx([MODEL.right_upper_arm_m, MODEL.right_lower_arm_m])
    assert body.limbs_m[3] == pytest.approx([MODEL.left_upper_leg_m, MODEL.left_lower_leg_m])
    for pair in lengths:
        assert tuple(sorted(int(MIRROR[joint]) for joint in pair)) in lengths
