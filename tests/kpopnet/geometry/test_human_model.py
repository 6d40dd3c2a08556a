"""The human model: lengths of a constructed pose, files, and invalid lengths."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from damaged_files import survives_damage, survives_hostile_json
from hypothesis import given
from hypothesis import strategies as st

from kpopnet.errors import InputError
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel, distance_to_line
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.y_pose.initial_pose import find_initial_pose
from synth.simulated.eval_sim import EvalSim, EvalSimConfig, EvalSimSet


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
    expected = {
        "head_to_shoulder_line_m": 0.2,
        "shoulder_to_shoulder_m": 0.6,
        "head_to_torso_m": 0.6,
        "left_shoulder_to_torso_m": 0.5,
        "right_shoulder_to_torso_m": 0.5,
        "torso_to_hip_line_m": 0.4,
        "left_shoulder_to_left_hip_m": 0.8,
        "left_shoulder_to_right_hip_m": 1.0,
        "right_shoulder_to_left_hip_m": 1.0,
        "right_shoulder_to_right_hip_m": 0.8,
        "left_shoulder_angle_rad": np.arctan2(0.3, 0.4),
        "right_shoulder_angle_rad": np.arctan2(0.3, 0.4),
        "right_upper_arm_m": 0.3,
        "left_upper_arm_m": 0.31,
        "right_lower_arm_m": 0.25,
        "left_lower_arm_m": 0.26,
        "right_upper_leg_m": 0.4,
        "left_upper_leg_m": 0.41,
        "right_lower_leg_m": 0.42,
        "left_lower_leg_m": 0.43,
        "arms_raised": 0.0,
    }
    assert asdict(model) == pytest.approx(expected)
    named = [f"{child.name} {parent.name}" for child, parent in LIMB_PARENTS.items()]
    assert named[:3] == ["RIGHT_ELBOW RIGHT_SHOULDER", "LEFT_ELBOW LEFT_SHOULDER", "RIGHT_HAND RIGHT_ELBOW"]
    assert model.limb_m[Joint.LEFT_HAND] == pytest.approx(0.26) and model.limb_m[Joint.RIGHT_FOOT] == pytest.approx(0.42)


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3), st.floats(-np.pi, np.pi))
def test_a_model_is_invariant_to_position_and_heading(place_m: tuple, yaw: float) -> None:
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    moved = HumanModel.from_joints(pose() @ turn.T + place_m)
    assert asdict(moved) == pytest.approx(asdict(HumanModel.from_joints(pose())), abs=1e-6)


def test_mirroring_swaps_left_and_right() -> None:
    model = asdict(HumanModel.from_joints(pose()))
    mirrored = asdict(HumanModel.from_joints((pose() * (-1, 1, 1))[MIRROR]))
    swap = {"left": "right", "right": "left"}
    swapped = {"_".join(swap.get(word, word) for word in name.split("_")): value for name, value in mirrored.items()}
    assert model == pytest.approx(swapped)


def test_joints_of_another_shape_or_with_gaps_are_refused() -> None:
    with pytest.raises(InputError, match=r"expected \(15, 3\) joints, found \(14, 3\)"):
        HumanModel.from_joints(pose()[1:])
    joints = pose()
    joints[Joint.LEFT_HAND], joints[Joint.TORSO, 1] = np.nan, np.inf
    with pytest.raises(InputError, match="missing joints: left_hand, torso"):
        HumanModel.from_joints(joints)


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf, 4, True, "0.3", None])
def test_impossible_lengths_are_refused(value) -> None:
    with pytest.raises(InputError, match="left_upper_arm_m"):
        replace(HumanModel.from_joints(pose()), left_upper_arm_m=value)


def test_a_saved_model_is_loaded_unchanged(tmp_path) -> None:
    model = HumanModel.from_joints(pose())
    model.save(tmp_path / "person.json")
    assert HumanModel.load(tmp_path / "person.json") == model


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "not valid JSON"),
        (b"\xff\xfe\x00", "not UTF-8"),
        (b"[1, 2]", r"expected an object of head_to_shoulder_line_m, .*, found \[1, 2\]"),
        (b"null", "found None"),
        (b"{}", "lacks head_to_shoulder_line_m"),
    ],
)
def test_other_files_are_refused_with_their_path(tmp_path, content: bytes, complaint: str) -> None:
    path = tmp_path / "person.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=complaint) as error:
        HumanModel.load(path)
    assert "person.json" in str(error.value)


def test_a_wrong_field_is_named(tmp_path) -> None:
    path = tmp_path / "person.json"
    values = asdict(HumanModel.from_joints(pose()))
    path.write_text(json.dumps(values | {"tail_m": 0.4}))
    with pytest.raises(InputError, match="tail_m"):
        HumanModel.load(path)
    path.write_text(json.dumps(values | {"head_to_torso_m": "tall"}))
    with pytest.raises(InputError, match="head_to_torso_m is 'tall', expected float"):
        HumanModel.load(path)
    path.write_text(json.dumps(values | {"head_to_torso_m": 1e999}))
    with pytest.raises(InputError, match="not valid JSON"):
        HumanModel.load(path)
    with pytest.raises(InputError, match=r"missing\.json"):
        HumanModel.load(tmp_path / "missing.json")


def test_hostile_and_damaged_files_are_refused_in_one_line(tmp_path) -> None:
    path = tmp_path / "person.json"
    HumanModel.from_joints(pose()).save(path)
    survives_hostile_json(path, lambda: HumanModel.load(path))
    assert survives_damage(path, lambda: HumanModel.load(path)) > 100


def test_distance_to_a_line() -> None:
    assert distance_to_line(np.array((0.0, 3, 0)), np.array((-1.0, 0, 4)), np.array((5.0, 0, 4))) == pytest.approx(5)
    # Two equal points define no line: the distance to the point.
    assert distance_to_line(np.array((0.0, 3, 0)), np.array((0.0, 0, 4)), np.array((0.0, 0, 4))) == pytest.approx(5)


LENGTHS = [name for name in asdict(HumanModel.from_joints(pose())) if name.endswith("_m")]


def test_regularised_lengths_are_symmetric_and_scale_with_the_person() -> None:
    model = HumanModel.from_joints(pose())
    regularised = model.regularised()
    for name in LENGTHS:
        other = name.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")
        assert getattr(regularised, name) == pytest.approx(getattr(regularised, other))
    larger = replace(model, **{name: 1.1 * getattr(model, name) for name in LENGTHS}).regularised()
    for name in LENGTHS:
        assert getattr(larger, name) == pytest.approx(1.1 * getattr(regularised, name))
    for name in ("left_shoulder_angle_rad", "right_shoulder_angle_rad", "arms_raised"):
        assert getattr(regularised, name) == getattr(model, name)


def test_regularisation_reduces_the_variance_between_frames() -> None:
    rng, model = np.random.default_rng(0), HumanModel.from_joints(pose())
    measured = [replace(model, **{name: getattr(model, name) + rng.normal(0, 0.025) for name in LENGTHS}) for _ in range(200)]
    deviation, regularised_deviation = (
        np.std([[getattr(one, name) for name in LENGTHS] for one in models], axis=0)
        for models in (measured, [one.regularised() for one in measured])
    )
    assert (regularised_deviation < 0.5 * deviation).all()


def test_regularisation_reduces_the_length_error_in_the_y_pose() -> None:
    """Simulated people with another seed than those of the least squares, none of them in a benchmark."""
    simulator = EvalSim(EvalSimSet(EvalSimConfig(seed=200)))
    measured_error, regularised_error = [], []
    for index in range(3):
        film = simulator.film(index, 2)
        truth = HumanModel.from_joints(film.joints_camera_m[0].astype(float))
        model = HumanModel.from_joints(find_initial_pose(film.depth_m[0] * film.person[0], film.camera).joints_camera_m)
        for found, off in ((model, measured_error), (model.regularised(), regularised_error)):
            off.append([getattr(found, name) - getattr(truth, name) for name in LENGTHS])
    assert np.square(regularised_error).mean() < 0.6 * np.square(measured_error).mean()
