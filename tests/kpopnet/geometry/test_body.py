"""The body of round cones: its planar pose has the model's lengths, its parts are symmetric."""

import numpy as np
import pytest
from y_people import y_joints

from kpopnet.geometry.body import body_from_model, planar_pose
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import MIRROR, PAPER_JOINTS, Joint

MODEL = HumanModel.from_joints(y_joints())


@pytest.mark.parametrize("size", [0.5, 1.0, 1.3])
def test_a_planar_symmetric_pose_is_reproduced(size: float) -> None:
    joints = size * y_joints(-90, 0, place_m=(0, 0.5, 0))  # limbs straight down, the shoulders' middle at the origin
    pose = planar_pose(HumanModel.from_joints(joints))
    np.testing.assert_allclose(pose[list(PAPER_JOINTS)], joints[list(PAPER_JOINTS)], atol=1e-6)
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
