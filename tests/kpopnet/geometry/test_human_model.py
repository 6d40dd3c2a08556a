"""The human model: lengths of a constructed pose, files, and invalid lengths."""

import itertools
from dataclasses import asdict, astuple, replace

import numpy as np
import pytest
from damaged_files import survives_hostile_json
from scipy.spatial.transform import Rotation

from kpopnet.errors import InputError
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint


def pose() -> np.ndarray:
    """(15, 3) metres whose lengths are whole centimetres (Pythagorean triangles)."""
    joints = np.zeros((NUM_JOINTS, 3))
    joints[Joint.HEAD] = 0, -0.2, 0
    joints[Joint.NECK] = np.nan
    joints[Joint.RIGHT_SHOULDER], joints[Joint.LEFT_SHOULDER] = (-0.3, 0, 0), (0.3, 0, 0)
    joints[Joint.TORSO] = 0, 0.4, 0
    joints[Joint.RIGHT_HIP], joints[Joint.LEFT_HIP] = (-0.3, 0.8, 0), (0.3, 0.8, 0)
    joints[Joint.RIGHT_ELBOW], joints[Joint.LEFT_ELBOW] = (-0.6, 0, 0), (0.3, 0, -0.31)
    joints[Joint.RIGHT_HAND], joints[Joint.LEFT_HAND] = (-0.6, -0.25, 0), (0.3, 0.26, -0.31)
    joints[Joint.RIGHT_KNEE], joints[Joint.LEFT_KNEE] = (-0.3, 1.2, 0), (0.3, 1.21, 0)
    joints[Joint.RIGHT_FOOT], joints[Joint.LEFT_FOOT] = (-0.3, 1.62, 0), (0.3, 1.21, 0.43)
    return joints


def test_lengths_of_a_constructed_pose() -> None:
    model = HumanModel.from_joints(pose())
    structure = 0.2, 0.6, 0.6, 0.5, 0.5, 0.4, 0.8, 1.0, 1.0, 0.8, *[np.arctan2(0.3, 0.4)] * 2  # in the order of the fields
    limbs = 0.3, 0.31, 0.25, 0.26, 0.4, 0.41, 0.42, 0.43
    assert astuple(model) == pytest.approx((*structure, *limbs, 0.0))
    assert model.limb_m[Joint.LEFT_HAND] == pytest.approx(0.26) and model.limb_m[Joint.RIGHT_FOOT] == pytest.approx(0.42)


def test_arms_beside_the_trunk_are_no_impossible_cosine() -> None:
    hanging = pose()
    for side in ("LEFT", "RIGHT"):
        hanging[Joint[f"{side}_ELBOW"]] = hanging[Joint[f"{side}_SHOULDER"]] + [0, 0.3, 0]
    turns = Rotation.random(100, rng=np.random.default_rng(0))
    raised = [HumanModel.from_joints(turn.apply(hanging)).arms_raised for turn in turns]
    np.testing.assert_allclose(raised, -1, atol=1e-9)


def test_joints_of_another_shape_or_with_gaps_are_refused() -> None:
    with pytest.raises(InputError, match=r"expected \(15, 3\) joints, found \(14, 3\)"):
        HumanModel.from_joints(pose()[1:])
    joints = pose()
    joints[Joint.LEFT_HAND], joints[Joint.TORSO, 1] = np.nan, np.inf
    with pytest.raises(InputError, match="missing joints: left_hand, torso"):
        HumanModel.from_joints(joints)
    with pytest.raises(InputError, match=r"human model: expected \(15, 3\) joints, found 'standing'"):
        HumanModel.from_joints("standing")


def test_a_path_that_is_none_is_refused() -> None:
    for mistaken in (HumanModel.load, HumanModel.from_joints(pose()).save):
        with pytest.raises(InputError, match="expected the path of a file or folder, got None"):
            mistaken(None)


@pytest.mark.parametrize("value", [-0.1, np.nan, "0.3"])
def test_impossible_lengths_are_refused(value) -> None:
    with pytest.raises(InputError, match="left_upper_arm_m"):
        replace(HumanModel.from_joints(pose()), left_upper_arm_m=value)


def test_a_saved_model_is_loaded_unchanged_and_damaged_files_are_refused_in_one_line(tmp_path) -> None:
    path, model = tmp_path / "person.json", HumanModel.from_joints(pose())
    model.save(path)
    assert HumanModel.load(path) == model
    survives_hostile_json(path, lambda: HumanModel.load(path))


LENGTHS = [name for name in asdict(HumanModel.from_joints(pose())) if name.endswith("_m")]


def test_regularised_lengths_are_symmetric_and_scale_with_the_person() -> None:
    model = HumanModel.from_joints(pose())
    regularised = model.regularised()
    for even, name in itertools.product((regularised, model.symmetric()), LENGTHS):
        other = name.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")
        assert getattr(even, name) == pytest.approx(getattr(even, other))
    assert model.symmetric().left_upper_arm_m == pytest.approx(0.305)
    larger = replace(model, **{name: 1.1 * getattr(model, name) for name in LENGTHS}).regularised()
    for name in LENGTHS:
        assert getattr(larger, name) == pytest.approx(1.1 * getattr(regularised, name))
    for name in ("left_shoulder_angle_rad", "right_shoulder_angle_rad", "arms_raised"):
        assert getattr(regularised, name) == getattr(model, name)
