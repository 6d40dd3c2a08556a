import numpy as np
import pytest
from cone_people import cone_joints
from films import Films, Off
from scipy.spatial.transform import Rotation

from kpopnet.errors import InputError
from kpopnet.evaluation.poses.definition import fit_offsets, in_label_definition, joint_axes, moved
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.evaluation.poses.tables import confidence_table, definition_tables
from kpopnet.geometry.cones import torso_frame
from kpopnet.skeleton import MIRROR, Joint

MIDDLE = [Joint.HEAD, Joint.NECK, Joint.TORSO]
LIMBS = [joint for joint in Joint if joint.name.endswith(("ELBOW", "HAND", "KNEE", "FOOT"))]


def skeletons(frames: int, seed: int) -> np.ndarray:
    """(N, 15, 3) metres: turned and displaced people whose limbs have directions of their own."""
    rng = np.random.default_rng(seed)
    joints = np.repeat(cone_joints()[None], frames, axis=0)
    joints[:, LIMBS] += 0.08 * rng.normal(size=(frames, len(LIMBS), 3))
    turns = Rotation.random(frames, rng=rng).as_matrix()
    return np.einsum("nij,nkj->nki", turns, joints) + rng.normal(size=(frames, 1, 3))


def symmetric_offsets(seed: int) -> np.ndarray:
    """(15, 3) offsets of up to about 10 cm, equal on both sides, in the body's plane for joints in the middle."""
    offsets = 0.05 * np.random.default_rng(seed).normal(size=(15, 3))
    offsets = (offsets + offsets[MIRROR]) / 2
    offsets[MIDDLE, 0] = 0
    return offsets


def labels_of(estimate: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    return estimate + np.einsum("njab,ja->njb", joint_axes(estimate), offsets)


def test_axes_are_orthonormal_those_of_the_torso_the_trackers_and_limbs_carry_theirs():
    estimate = skeletons(100, 0)
    axes = joint_axes(estimate)
    np.testing.assert_allclose(axes @ axes.swapaxes(-1, -2), np.broadcast_to(np.eye(3), axes.shape), atol=1e-12)
    for joints, own in zip(estimate, axes, strict=True):
        np.testing.assert_allclose(own[Joint.RIGHT_HIP], torso_frame(joints), atol=1e-6)
        np.testing.assert_allclose(own[Joint.LEFT_HIP], torso_frame(joints) * [[-1], [1], [1]], atol=1e-6)
    for joint, start in ((Joint.LEFT_HAND, Joint.LEFT_ELBOW), (Joint.RIGHT_FOOT, Joint.RIGHT_KNEE)):
        along = np.einsum("nab,nb->na", axes[:, joint], estimate[:, joint] - estimate[:, start])
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        np.testing.assert_allclose(along, np.broadcast_to(along[0], along.shape), atol=1e-12)


def test_constant_offsets_in_the_bodys_axes_are_recovered_from_one_side_and_despite_some_gross_errors():
    offsets, others, judged = symmetric_offsets(0), skeletons(60, 0), skeletons(40, 100)
    truth = labels_of(others, offsets)
    truth[:, [joint for joint in Joint if joint.name.startswith("LEFT")]] = np.nan
    truth[:20] += 1.0
    fitted = fit_offsets(truth, others)
    np.testing.assert_allclose(fitted, offsets, atol=1e-12)
    np.testing.assert_allclose(moved(judged, fitted), labels_of(judged, offsets), atol=1e-12)


def test_nobodys_own_labels_move_them():
    person, estimate = np.repeat(["ann", "bob", "cec"], 30), skeletons(90, 6)
    truth = labels_of(estimate, symmetric_offsets(6)) + 0.01 * np.random.default_rng(6).normal(size=estimate.shape)
    found = in_label_definition(truth, estimate, person)
    for one in np.unique(person):
        own = person == one
        np.testing.assert_array_equal(found[own], moved(estimate[own], fit_offsets(truth[~own], estimate[~own])))


@pytest.mark.parametrize("person", [["ann"] * 4, ["ann", "bo"], None])
def test_one_person_alone_has_no_others_to_be_fitted_on(person):
    joints_m = np.repeat(cone_joints()[None], 4, axis=0)
    with pytest.raises(InputError, match="expected a name a frame, of two people or more"):
        in_label_definition(joints_m, joints_m, person)


def test_missing_joints_stay_missing_and_a_joint_without_axes_stays_where_it_is():
    offsets, estimate = symmetric_offsets(7), skeletons(4, 7)
    estimate[0, Joint.RIGHT_HAND] = np.nan
    estimate[1, Joint.NECK] = np.nan
    found = moved(estimate, offsets)
    assert (np.isnan(found) == np.isnan(estimate)).all()
    np.testing.assert_array_equal(found[1], estimate[1])
    np.testing.assert_allclose(found[2:], labels_of(estimate, offsets)[2:])
    assert (fit_offsets(np.full_like(estimate, np.nan), estimate) == 0).all()
    straight_up = estimate[2:3].copy()  # a leg through the trunk: the axes are undefined, the joint still finite
    down = joint_axes(straight_up)[0, Joint.NECK, 1]
    straight_up[0, Joint.RIGHT_KNEE] = straight_up[0, Joint.RIGHT_HIP] - 0.4 * down
    assert np.isfinite(moved(straight_up, offsets)).all()


def test_reports_judge_in_the_labels_definition_where_the_benchmark_has_one_and_two_people():
    for people, definition in ((("ann", "bob", "bob"), "Kinect SDK"), (("ann", "bob"), None), (("ann", "ann"), "Kinect SDK")):
        benchmark = Films()
        benchmark.identities = dict(zip(benchmark.sequence_names(), people, strict=False))
        benchmark.label_definition = definition
        metrics = run_benchmark(benchmark, {"off": Off()}).metrics
        defined = definition == "Kinect SDK" and len(set(people)) > 1
        assert ("in_label_definition" in metrics["off"]) is bool(definition_tables(metrics)) is defined
        assert ("off, in the labels' definition" in confidence_table(metrics).header) is defined
