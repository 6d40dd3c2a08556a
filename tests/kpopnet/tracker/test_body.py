"""The body of round cones: its figure has the model's lengths, its parts come in pairs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from y_people import y_joints

from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.tracker.body import KIND_OF_PART, LIMB_PARTS, LIMBS, OWNERS, PARTS, RADII_M, body_of, plane_figure, size_m
from kpopnet.tracker.model import HumanModel

MODEL = HumanModel.from_joints(y_joints())


def symmetric(shoulders_m: float, hips_m: float, side_m: float, size: float) -> np.ndarray:
    """(15, 3) a person in a plane, the same on both sides; `side_m` is how far the hips are below the shoulders."""
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
def test_a_symmetric_figure_in_a_plane_is_had_back(shoulders_m: float, hips_m: float, side_m: float, size: float) -> None:
    joints = symmetric(shoulders_m, hips_m, side_m, size)
    figure = plane_figure(HumanModel.from_joints(joints))
    paper = [joint for joint in Joint if joint != Joint.NECK]
    np.testing.assert_allclose(figure[paper], joints[paper], atol=1e-6)
    assert figure[Joint.HEAD, 1] < figure[Joint.NECK, 1] < 0 and abs(figure[Joint.NECK, 0]) < 1e-9


def test_what_a_plane_figure_cannot_have_is_shared_between_both_sides() -> None:
    lopsided = replace(MODEL, left_shoulder_to_left_hip_m=MODEL.right_shoulder_to_right_hip_m + 0.04)
    figure = plane_figure(lopsided)
    np.testing.assert_allclose((figure * (-1, 1, 1))[MIRROR][:, :2], figure[:, :2], atol=1e-12)
    same = np.linalg.norm(figure[Joint.LEFT_SHOULDER] - figure[Joint.LEFT_HIP])
    assert same == pytest.approx(MODEL.right_shoulder_to_right_hip_m + 0.02)


def test_lengths_that_no_figure_has_still_give_a_figure() -> None:
    none = replace(MODEL, shoulder_to_shoulder_m=0.0, head_to_torso_m=0.0)
    far = replace(MODEL, left_shoulder_to_right_hip_m=3.0, right_shoulder_to_left_hip_m=3.0, left_shoulder_to_torso_m=0.0)
    for model in (none, far):
        assert np.isfinite(plane_figure(model)).all() and np.isfinite(body_of(model).lengths_m).all()


def test_a_body_keeps_the_models_lengths_between_its_joints() -> None:
    body = body_of(MODEL)
    kept = {tuple(pair): length for pair, length in zip(body.pairs.tolist(), body.lengths_m, strict=True)}
    for child, parent in ((Joint.RIGHT_HAND, Joint.RIGHT_ELBOW), (Joint.LEFT_FOOT, Joint.LEFT_KNEE)):
        assert kept[tuple(sorted((child, parent)))] == pytest.approx(MODEL.limb_m[child])
    assert kept[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER] == pytest.approx(MODEL.shoulder_to_shoulder_m)
    assert body.limbs_m[0] == pytest.approx([MODEL.right_upper_arm_m, MODEL.right_lower_arm_m])
    assert body.limbs_m[3] == pytest.approx([MODEL.left_upper_leg_m, MODEL.left_lower_leg_m])
    for pair in kept:
        assert tuple(sorted(int(MIRROR[joint]) for joint in pair)) in kept


def test_every_part_has_its_mirror_image_of_the_same_thickness() -> None:
    radii = body_of(MODEL).radii_m
    for pair in (np.flatnonzero(kind == KIND_OF_PART) for kind in range(len(RADII_M))):
        assert len(pair) in (1, 2)
        first, last = PARTS[pair[0]], PARTS[pair[-1]]
        assert {*MIRROR[OWNERS[first]].tolist()} == {*OWNERS[last].tolist()}
        np.testing.assert_array_equal(radii[pair[0]], radii[pair[-1]])
    for limb, (upper, lower, beyond) in zip(LIMBS, LIMB_PARTS, strict=True):
        assert PARTS[upper].tolist() == limb[:2].tolist() and PARTS[lower].tolist() == limb[1:].tolist()
        assert PARTS[beyond, 0] == limb[2] == OWNERS[PARTS[beyond, 1]] and PARTS[beyond, 1] >= NUM_JOINTS


def test_thickness_grows_with_the_person() -> None:
    large = HumanModel.from_joints(1.2 * y_joints(place_m=(0, 0, 0)))
    assert size_m(large) == pytest.approx(1.2 * size_m(MODEL))
    np.testing.assert_allclose(body_of(large).radii_m, 1.2 * body_of(MODEL).radii_m)
