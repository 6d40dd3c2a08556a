from dataclasses import replace

import numpy as np
import pytest
from capsule_people import draw_joints
from pose_results import pose_results
from real_data import ITOP_SKELETONS
from scipy.spatial.transform import Rotation

from kpopnet.errors import InputError
from kpopnet.evaluation.poses.metrics import (
    area_under_curve,
    average_pose_error_m,
    difference,
    evaluate,
    fraction_within,
    joint_errors_m,
    mean_error_m,
    moving_joints,
    summary,
    without_offsets,
    yaw_octants,
)
from kpopnet.skeleton import Joint

NAN, INF = np.nan, np.inf


def displaced(rng, lengths_m):
    """True joints, and estimates at exactly these distances (N, 15) from them, in random directions."""
    truth = rng.normal(size=(*lengths_m.shape, 3))
    direction = rng.normal(size=truth.shape)
    return truth, truth + lengths_m[..., None] * direction / np.linalg.norm(direction, axis=-1, keepdims=True)


@pytest.mark.parametrize(
    ("errors", "fraction"),
    [
        ([0.1], 0),  # strictly below the threshold
        ([np.nextafter(0.1, 0)], 1),
        ([0.05, 0.2], 0.5),
        ([0.05, INF], 0.5),  # a missing joint is above every threshold
        ([0.05, NAN], 1),  # a joint without truth is not counted
        ([NAN], NAN),
    ],
)
def test_fraction_within_ten_centimetres(errors, fraction):
    assert fraction_within(np.array([errors]), 0.1) == pytest.approx(fraction, nan_ok=True)


def test_area_equals_the_integral_of_the_sampled_curve():
    rng = np.random.default_rng(1)
    errors = np.concatenate([rng.uniform(0, 0.4, 300), [INF, NAN, 0]])[None]
    thresholds = np.linspace(0, 0.2, 20001)[1:]
    assert area_under_curve(errors) == pytest.approx(np.mean([fraction_within(errors, t) for t in thresholds]), abs=1e-4)
    assert area_under_curve(np.zeros((1, 15))) == 1


def test_average_pose_error_is_equation_16_by_hand():
    rng = np.random.default_rng(2)
    truth, estimate = displaced(rng, rng.uniform(0, 0.3, (6, 15)))
    visible = rng.random((6, 15)) < 0.5
    terms = [np.linalg.norm(truth[i, k] - estimate[i, k]) for i in range(6) for k in range(15) if visible[i, k]]
    errors = joint_errors_m(truth, estimate)
    assert average_pose_error_m(errors, visible) == pytest.approx(sum(terms) / len(terms))
    assert average_pose_error_m(errors, visible) != pytest.approx(mean_error_m(errors))


def test_constant_offsets_are_subtracted_per_joint():
    rng = np.random.default_rng(3)
    truth = rng.normal(size=(20, 15, 3))
    estimate = truth + rng.normal(size=(15, 3))
    assert mean_error_m(without_offsets(pose_results(truth, estimate))) == pytest.approx(0, abs=1e-12)
    estimate[0], estimate[1] = NAN, estimate[1] + 9  # missing joints and hidden ones tell nothing of the offset
    errors = without_offsets(pose_results(truth, estimate, visible=np.arange(20)[:, None] != np.full(15, 1)))
    assert np.isinf(errors[0]).all() and (errors[1] > 9).all() and errors[2:] == pytest.approx(0)
    # One joint is off by 0.2 m in one of two frames: the mean offset is 0.1 m, so 0.1 m remains in each frame.
    estimate = truth[:2].copy()
    estimate[1, 4] += 0, 0.2, 0
    errors = without_offsets(pose_results(truth[:2], estimate))
    assert errors[:, 4] == pytest.approx([0.1, 0.1]) and errors.sum() == pytest.approx(0.2)


def test_every_breakdown_sums_to_the_total():
    rng = np.random.default_rng(4)
    lengths = rng.uniform(0, 0.3, (40, 15))
    truth, estimate = displaced(rng, lengths)
    estimate[rng.random((40, 15)) < 0.1] = NAN
    truth[rng.random((40, 15)) < 0.1] = NAN
    truth[7] = NAN  # a frame without any label is not evaluated
    result = evaluate(pose_results(truth, estimate, sequence=np.repeat([0, 1, 2, 3], 10), yaw_rad=rng.uniform(-9, 9, 40)))
    assert result["images"] == 39
    labelled = np.isfinite(truth).all(-1)
    missing = labelled & np.isnan(estimate).any(-1)
    assert result["missing"]["joints"] == missing.sum() and result["missing"]["of_labelled_joints"] == labelled.sum()
    hits = (labelled & ~missing & (lengths < 0.1)).sum()
    assert result["map_10cm"] == pytest.approx(hits / labelled.sum())
    assert result["pck"]["10cm"] == result["map_10cm"]
    for part in ("per_joint", "per_group", "per_sequence", "by_yaw"):
        pieces = result[part].values()
        assert sum(p["labelled_joints"] for p in pieces) == labelled.sum()
        assert sum(p["map_10cm"] * p["labelled_joints"] for p in pieces) == pytest.approx(hits)
    assert sum(p["images"] for p in result["per_sequence"].values()) == 39
    left_foot = labelled[:, 14] & ~missing[:, 14]
    assert result["per_joint"]["left_foot"]["mean_error_cm"] == pytest.approx(100 * lengths[left_foot, 14].mean())
    deviation = 100 * lengths[:10][labelled[:10] & ~missing[:10]].std()
    assert result["per_sequence"]["s0"]["pose_error_deviation_cm"] == pytest.approx(deviation)


def test_intervals_contain_their_metrics():
    rng = np.random.default_rng(5)
    truth, estimate = displaced(rng, rng.uniform(0, 0.2, (60, 15)))
    people = np.repeat(np.arange(12).astype(str), 5)
    result = evaluate(pose_results(truth, estimate, unit=people, person=people), seed=7)
    assert set(result["interval"]) == {"map_10cm", "moving_10cm", "map_14", "mean_error_cm", "average_pose_error_cm"}
    assert all(low < result[name] < high for name, (low, high) in result["interval"].items())


def test_moving_joints_are_those_far_from_where_the_rest_pose_of_the_person_has_them():
    """Two people who turn and walk; one raises a hand in a fifth of the frames, the other holds it up in all but a fifth."""
    rest = draw_joints(np.random.default_rng(2)).astype(float)
    rest -= rest[Joint.TORSO]
    poses = np.repeat(rest[None], 20, axis=0)
    poses[::5, Joint.LEFT_HAND] += (0.0, -0.5, 0.0)
    other = np.repeat(rest[None], 20, axis=0)
    other[np.arange(20) % 5 > 0, Joint.LEFT_HAND] += (0.0, -0.5, 0.0)
    turn = Rotation.from_euler("y", np.linspace(0, 360, 20)[:, None], degrees=True).as_matrix()
    way_m = np.linspace(0, 2, 20)[:, None, None] * (1.0, 0.0, 1.0)
    truth = np.concatenate([np.einsum("tij,tkj->tki", turn, one) + way_m for one in (poses, other)])
    found = moving_joints(truth, np.repeat(["a", "b"], 20))
    expected = np.zeros((40, 15), bool)
    expected[np.arange(0, 40, 5), Joint.LEFT_HAND] = True
    np.testing.assert_array_equal(found, expected)
    result = evaluate(pose_results(truth, truth + (0.0, 0.0, 0.11) * found[..., None], person=np.repeat(["a", "b"], 20)))
    assert (result["moving_10cm"], result["moving_joints"]) == (0, 8) and result["map_10cm"] == 1 - 8 / 600
    assert {name: one["moving_joints"] for name, one in result["per_person"].items()} == {"a": 4, "b": 4}
    truth[np.arange(40) % 5 < 4, Joint.RIGHT_FOOT] = np.nan  # most labels have a gap, the rest of the pose moves as before
    truth[:, Joint.LEFT_FOOT] = np.nan
    np.testing.assert_array_equal(moving_joints(truth, np.repeat(["a", "b"], 20)), expected)
    assert not moving_joints(truth, np.repeat("", 40)).any()  # it is not known whose rest pose it would be


def test_a_frame_whose_label_was_given_is_not_scored():
    rng = np.random.default_rng(6)
    truth, estimate = displaced(rng, rng.uniform(0, 0.2, (12, 15)))
    sequence, yaw = np.repeat([0, 1, 2, 3], [4, 4, 3, 1]), np.r_[np.zeros(11), 3]
    given = np.isin(np.arange(12), (0, 4, 8, 11))
    flattered = estimate.copy()
    flattered[given] = truth[given]
    found = evaluate(pose_results(truth, flattered, sequence=sequence, yaw_rad=yaw, given=given))
    expected = evaluate(pose_results(truth[~given], estimate[~given], sequence=sequence[~given], yaw_rad=yaw[~given]))
    for part in ("per_sequence", "by_yaw"):  # sequence 3 and its heading have no scored frame, and stay listed
        (last,) = set(found[part]) - set(expected[part])
        gone = found[part].pop(last)
        assert gone["images"] == gone["labelled_joints"] == 0 and gone["map_10cm"] is gone["mean_error_cm"] is None
    assert found == expected and found["images"] == 8


def test_paired_intervals_are_narrower_where_estimators_share_their_errors():
    """Two estimators in 20 rooms: the second one's errors are 1 cm larger, and both are larger in hard rooms."""
    rng, room = np.random.default_rng(8), np.repeat(np.arange(20), 5)
    hard_m = 0.05 + 0.1 * rng.random(20)[room, None]
    lengths_m = [hard_m + extra_m + 0.01 * rng.random((100, 15)) for extra_m in (0.0, 0.01)]
    truth = np.zeros((100, 15, 3))
    near, far = (pose_results(truth, length_m[..., None] * (1.0, 0, 0), unit=room) for length_m in lengths_m)
    found = difference(far, near)
    low, high = found["mean_error_cm"]["interval"]
    assert found["mean_error_cm"]["value"] == pytest.approx(1, abs=0.05) and low < 1.02 and high > 0.98
    unpaired = np.hypot(*(np.diff(evaluate(one)["interval"]["mean_error_cm"])[0] for one in (near, far)))
    assert high - low < unpaired / 10
    points = found["within_10cm_points"]
    unpaired = 100 * np.hypot(*(np.diff(evaluate(one)["interval"]["map_10cm"])[0] for one in (near, far)))
    assert points["interval"][1] < 0 and np.diff(points["interval"])[0] < unpaired / 2
    assert points["value"] == pytest.approx(100 * (evaluate(far)["map_10cm"] - evaluate(near)["map_10cm"]))


def test_differences_are_of_frames_scored_for_both_and_distances_of_joints_found_by_both():
    truth = np.zeros((4, 15, 3))
    near, far = (truth + np.array([off_m, 0, 0]) for off_m in (0.02, 0.03))
    near[0] = 9  # this frame was given to the other
    far[1, :5] = NAN
    near[1, :5] = 0.6
    given = np.array([True, False, False, False])
    found = difference(pose_results(truth, far, given=given), pose_results(truth, near))
    assert found["mean_error_cm"]["value"] == pytest.approx(1)
    assert found["within_10cm_points"]["value"] == pytest.approx(0)  # those five joints are right for neither
    itself = difference(pose_results(truth, near), pose_results(truth, near))
    assert itself["mean_error_cm"]["value"] == itself["within_10cm_points"]["value"] == 0


@pytest.mark.skipif(not ITOP_SKELETONS.exists(), reason="needs ITOP's test poses with A2J's published predictions")
def test_metrics_of_published_predictions_equal_the_published_values():
    stored = np.load(ITOP_SKELETONS)
    u, v, z = np.moveaxis(stored["a2j_side_pred_uvd"].astype(float), -1, 0)
    estimate = np.stack([(u - 160) * z * 0.0035, (120 - v) * z * 0.0035, z], axis=-1)
    result = evaluate(pose_results(stored["side_m"].astype(float), estimate))
    assert result["images"] == 4863
    assert 100 * result["map_10cm"] == pytest.approx(88.02, abs=0.005)
    assert result["mean_error_cm"] == pytest.approx(5.85, abs=0.005)
    hands, neck = (100 * result["per_group"][group]["map_10cm"] for group in ("hands", "neck"))
    assert (hands, neck) == pytest.approx((68.35, 99.20), abs=0.005)


def test_an_interval_is_around_its_own_figure():
    """The neck is always wrong, hidden joints far off, and those that move right half as often."""
    rng, frames = np.random.default_rng(3), 200
    truth = np.zeros((frames, 15, 3))
    truth[:, [Joint.LEFT_SHOULDER, Joint.RIGHT_SHOULDER], 1] = truth[:, [Joint.LEFT_HIP, Joint.RIGHT_HIP], 1] = 0.2
    truth[:, [Joint.LEFT_SHOULDER, Joint.LEFT_HIP], 0] = 0.2
    truth[:, [Joint.LEFT_SHOULDER, Joint.RIGHT_SHOULDER], 1] -= 0.5
    truth[::3, Joint.LEFT_HAND] += 1.0
    off_m = rng.choice([0.01, 0.15], size=(frames, 15), p=[0.9, 0.1])
    off_m[:, Joint.NECK] = 0.15
    off_m[::3, Joint.LEFT_HAND] = rng.choice([0.01, 0.15], size=len(off_m[::3]))
    visible = rng.random((frames, 15)) < 0.7
    off_m[~visible] += 0.3
    results = pose_results(
        truth, truth + off_m[..., None] * (1.0, 0, 0), visible=visible, unit=np.arange(frames), person=np.full(frames, "a")
    )
    found = evaluate(results)
    assert found["moving_joints"] == len(truth[::3])
    for name, (low, high) in found["interval"].items():
        assert low < found[name] < high, name


def test_a_distance_is_compared_where_the_reference_found_the_joint_too():
    truth = np.zeros((4, 15, 3))
    near, far = truth + np.array([0.02, 0, 0]), truth + np.array([0.03, 0, 0])
    near[1, :5] = NAN
    assert difference(pose_results(truth, far), pose_results(truth, near))["mean_error_cm"]["value"] == pytest.approx(1)


def test_a_heading_belongs_to_the_sector_around_it():
    headings = np.radians([0, 22, -22, 23, -23, 179, -179, NAN])
    found = {name: np.flatnonzero(rows).tolist() for name, rows in yaw_octants(headings).items()}
    assert {name: rows for name, rows in found.items() if rows} == {"0": [0, 1, 2], "45": [3], "-45": [4], "180": [5, 6]}


JOINTS_M = np.random.default_rng(0).normal(size=(6, 15, 3))
RESULTS = pose_results(JOINTS_M, JOINTS_M + 0.01)


@pytest.mark.parametrize(
    ("mistaken", "message"),
    [
        (lambda: replace(RESULTS, estimate_m=JOINTS_M[:1]), r"estimate_m: shape \(1, 15, 3\), expected \(frames = 6, 15, 3\)"),
        (lambda: replace(RESULTS, truth_m=JOINTS_M.tolist()), "truth_m: expected a numpy array, found list"),
        (lambda: replace(RESULTS, confidence=90 * RESULTS.confidence), "confidence: expected numbers from 0 to 1"),
        (lambda: replace(RESULTS, confidence=NAN * RESULTS.confidence), "confidence: expected numbers from 0 to 1"),
        (lambda: replace(RESULTS, visible=np.ones((6, 15), int)), "visible: type int64, expected kind b of numpy"),
        (lambda: replace(RESULTS, person=np.array(["ann"])), r"person: shape \(1,\), expected \(frames = 6\)"),
        (lambda: evaluate(None), r"results: expected a kpopnet\.evaluation\.poses\.metrics\.PoseResults, got None"),
        (lambda: evaluate(RESULTS, "0"), "seed='0' must be a whole number"),
        (lambda: difference(RESULTS, RESULTS.select_frames(np.arange(5))), "reference: expected the 6 frames of the results"),
        (lambda: joint_errors_m(JOINTS_M, JOINTS_M[:1]), r"true joints of shape \(6, 15, 3\), estimated ones of \(1, 15, 3\)"),
        (lambda: joint_errors_m(JOINTS_M[..., :2], JOINTS_M[..., :2]), r"expected one, \(\.\.\., 3\)"),
        (lambda: joint_errors_m("truth", JOINTS_M), "true joints: expected an array of numbers"),
        (lambda: fraction_within([0.05], "0.1"), r"threshold_m='0\.1': expected a number"),
        (lambda: average_pose_error_m(np.ones((6, 15)), None), r"visible: expected bool, .* of shape \(6, 15\), found object"),
        (lambda: summary(np.ones((6, 15)), np.ones((6, 15), int)), "visible: expected bool, one an error"),
    ],
)
def test_what_are_no_results_is_refused(mistaken, message):
    with pytest.raises(InputError, match=message):
        mistaken()


def test_errors_may_be_a_list():
    assert fraction_within([0.05, 0.2, NAN], 0.1) == 0.5 and mean_error_m([0.1, 0.3, INF]) == pytest.approx(0.2)
    assert area_under_curve([0.1, INF]) == pytest.approx(0.25)


def test_every_headline_figure_is_its_own_definition():
    rng = np.random.default_rng(0)
    off_m, visible = rng.gamma(1.0, 0.08, (40, 15)), rng.random((40, 15)) < 0.6
    off_m[~visible] += 0.1
    truth_m = np.zeros((40, 15, 3))
    estimate_m = truth_m + off_m[..., None] * (1.0, 0, 0)
    estimate_m[3, 5] = np.nan  # one joint, not the whole image
    found_m, seen = np.delete(off_m.ravel(), 3 * 15 + 5), visible.copy()
    seen[3, 5] = False
    found = evaluate(pose_results(truth_m, estimate_m, visible=visible))
    assert found["median_error_cm"] == pytest.approx(100 * np.median(found_m))
    assert found["average_pose_error_cm"] == pytest.approx(100 * off_m[seen].mean())
    assert found["pose_error_deviation_cm"] == pytest.approx(100 * off_m[seen].std())
    assert found["pck_area_20cm"] == pytest.approx(np.maximum(0, 1 - found_m / 0.2).sum() / off_m.size)
    assert found["pck"] == pytest.approx({f"{cm}cm": (found_m < cm / 100).sum() / off_m.size for cm in (5, 10, 15, 20)})
    rest_m = abs(off_m - (off_m * seen).sum(axis=0) / seen.sum(axis=0))
    assert found["average_pose_error_no_offset_cm"] == pytest.approx(100 * rest_m[seen].mean())
    assert found["missing"]["images_without_estimate"] == 0
