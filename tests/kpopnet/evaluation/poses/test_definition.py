import numpy as np
from films import Films, Off
from scipy.spatial.transform import Rotation

from kpopnet.evaluation.poses.definition import fit_offsets, in_label_definition, joint_axes, moved
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.evaluation.poses.tables import confidence_table, definition_tables
from kpopnet.geometry.cones import torso_frame
from kpopnet.skeleton import MIRROR, Joint

MIDDLE = [Joint.HEAD, Joint.NECK, Joint.TORSO]


def skeletons(frames: int, seed: int) -> np.ndarray:
    """(N, 15, 3) metres: turned and displaced people, limbs in any direction but the ones that no limb reaches."""
    rng = np.random.default_rng(seed)
    joints = np.zeros((frames, 15, 3))  # the person's right is -x, front is -z
    at = {"HEAD": (0, -0.6, 0), "NECK": (0, -0.4, 0), "TORSO": (0, -0.1, 0), "RIGHT_SHOULDER": (-0.2, -0.35, 0)}
    for name, place in (at | {"RIGHT_HIP": (-0.11, 0.1, 0)}).items():
        joints[:, Joint[name]] = place
        joints[:, MIRROR[Joint[name]]] = np.multiply(place, (1 if name in ("HEAD", "NECK", "TORSO") else -1, 1, 1))
    for side, outward in (("RIGHT", -1), ("LEFT", 1)):
        for start, end, centre in (
            *(("SHOULDER", "ELBOW", (1, 1, -1)), ("ELBOW", "HAND", (1, 1, -1))),
            *(("HIP", "KNEE", (0, 1, 0)), ("KNEE", "FOOT", (0, 1, 0))),
        ):
            direction = rng.normal(size=(frames, 3))
            direction += 1.2 * np.linalg.norm(direction, axis=1, keepdims=True) * np.array(centre) / np.linalg.norm(centre)
            direction *= 0.3 / np.linalg.norm(direction, axis=1, keepdims=True) * (outward, 1, 1)
            joints[:, Joint[f"{side}_{end}"]] = joints[:, Joint[f"{side}_{start}"]] + direction
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
        np.testing.assert_allclose(along, np.broadcast_to(along[0], along.shape), atol=1e-12)


def test_a_constant_offset_in_the_bodys_axes_is_recovered_exactly():
    offsets, others, judged = symmetric_offsets(0), skeletons(60, 0), skeletons(40, 100)
    fitted = fit_offsets(labels_of(others, offsets), others)
    np.testing.assert_allclose(fitted, offsets, atol=1e-12)
    np.testing.assert_allclose(moved(judged, fitted), labels_of(judged, offsets), atol=1e-12)


def test_one_side_tells_the_offset_of_both_and_gross_errors_of_a_few_frames_do_not_decide():
    offsets, estimate = symmetric_offsets(4), skeletons(60, 4)
    truth = labels_of(estimate, offsets)
    truth[:, [joint for joint in Joint if joint.name.startswith("LEFT")]] = np.nan
    truth[:20] += 1.0
    np.testing.assert_allclose(fit_offsets(truth, estimate), offsets, atol=1e-12)


def test_nobodys_own_labels_move_them():
    person = np.repeat(["ann", "bob", "cec"], 30)
    estimate, rng = skeletons(90, 6), np.random.default_rng(6)
    truth = labels_of(estimate, symmetric_offsets(6)) + 0.01 * rng.normal(size=estimate.shape)
    first = in_label_definition(truth, estimate, person)
    own, changed = person == "bob", truth.copy()
    changed[own] += 0.5 * rng.normal(size=(30, 15, 3))
    second = in_label_definition(changed, estimate, person)
    np.testing.assert_array_equal(first[own], second[own])
    assert (np.abs(first - second)[~own] > 1e-6).any()
    np.testing.assert_array_equal(first[own], moved(estimate[own], fit_offsets(truth[~own], estimate[~own])))


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
        benchmark.identities, benchmark.label_definition = (
            dict(zip(benchmark.sequence_names(), people, strict=False)),
            definition,
        )
        metrics = run_benchmark(benchmark, {"off": Off()}).metrics
        defined = definition == "Kinect SDK" and len(set(people)) > 1
        assert ("in_label_definition" in metrics["off"]) is bool(definition_tables(metrics)) is defined
        assert ("off, in the labels' definition" in confidence_table(metrics).header) is defined
