import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from real_data import ITOP_SKELETONS

from kpopnet.evaluation.poses.metrics import (
    PoseResults,
    area_under_curve,
    average_pose_error_m,
    evaluate,
    fraction_within,
    intervals,
    joint_errors_m,
    mean_error_m,
    median_error_m,
    without_offsets,
    yaw_octants,
)

ITOP = ITOP_SKELETONS
NAN, INF = np.nan, np.inf


def pose_results(truth, estimate, visible=None, sequence=None, yaw=None) -> PoseResults:
    frames = len(truth)
    sequence = np.zeros(frames, int) if sequence is None else np.asarray(sequence)
    return PoseResults(
        truth_m=truth,
        estimate_m=estimate,
        visible=np.isfinite(truth).all(-1) if visible is None else visible,
        sequence=sequence,
        sequence_names=tuple(f"s{k}" for k in range(sequence.max() + 1)),
        yaw_rad=np.full(frames, NAN) if yaw is None else np.asarray(yaw, float),
    )


def displaced(rng, lengths_m):
    """True joints, and estimates at exactly these distances (N, 15) from them, in random directions."""
    truth = rng.normal(size=(*lengths_m.shape, 3))
    direction = rng.normal(size=truth.shape)
    return truth, truth + lengths_m[..., None] * direction / np.linalg.norm(direction, axis=-1, keepdims=True)


def test_missing_estimates_have_infinite_error_and_missing_truth_nan():
    truth, estimate = np.zeros((1, 15, 3)), np.zeros((1, 15, 3))
    estimate[0, 0] = 0.3, 0, 0.4
    estimate[0, 1] = NAN
    truth[0, 2, 1] = NAN
    truth[0, 3], estimate[0, 3] = NAN, NAN
    assert joint_errors_m(truth, estimate)[0, :5].tolist() == pytest.approx([0.5, INF, NAN, NAN, 0], nan_ok=True)


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


def test_mean_and_median_leave_out_missing_joints():
    errors = np.array([[0.01, 0.02, 0.06, INF, NAN]])
    assert mean_error_m(errors) == pytest.approx(0.03)
    assert median_error_m(errors) == pytest.approx(0.02)
    assert np.isnan(mean_error_m(np.array([[INF]]))) and np.isnan(median_error_m(np.array([[NAN]])))


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
    # One joint is off by 0.2 m in one of two frames: the mean offset is 0.1 m, so 0.1 m remains in each frame.
    estimate = truth[:2].copy()
    estimate[1, 4] += 0, 0.2, 0
    errors = without_offsets(pose_results(truth[:2], estimate))
    assert errors[:, 4] == pytest.approx([0.1, 0.1]) and errors.sum() == pytest.approx(0.2)


def test_offsets_are_fitted_to_visible_and_estimated_joints():
    truth = np.zeros((3, 15, 3))
    estimate = truth + np.array([0.05, 0, 0])
    estimate[1] = NAN
    estimate[2] += 9
    visible = np.ones((3, 15), bool)
    visible[2] = False
    errors = without_offsets(pose_results(truth, estimate, visible))
    assert errors[0] == pytest.approx(0) and np.isinf(errors[1]).all() and (errors[2] > 9).all()


@given(st.lists(st.floats(0, 1) | st.just(INF) | st.just(NAN), min_size=1, max_size=40))
def test_fractions_grow_with_the_threshold_and_stay_in_range(values):
    errors = np.array([values])
    fractions = [fraction_within(errors, threshold) for threshold in (0.0, 0.05, 0.1, 0.2, 2)]
    if np.isnan(values).all():
        assert np.isnan(fractions).all()
    else:
        assert fractions == sorted(fractions) and fractions[0] == 0 and fractions[-1] <= 1
        assert fractions[0] <= area_under_curve(errors) <= 1


def test_every_breakdown_sums_to_the_total():
    rng = np.random.default_rng(4)
    lengths = rng.uniform(0, 0.3, (40, 15))
    truth, estimate = displaced(rng, lengths)
    estimate[rng.random((40, 15)) < 0.1] = NAN
    truth[rng.random((40, 15)) < 0.1] = NAN
    truth[7] = NAN  # a frame without any label is not evaluated
    result = evaluate(pose_results(truth, estimate, sequence=np.repeat([0, 1, 2, 3], 10), yaw=rng.uniform(-9, 9, 40)))
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


def test_a_frame_without_estimate_lowers_the_fractions_only():
    truth = np.zeros((2, 15, 3))
    estimate = truth.copy()
    estimate[1] = NAN
    result = evaluate(pose_results(truth, estimate))
    assert result["map_10cm"] == 0.5 and result["mean_error_cm"] == 0
    assert result["missing"] == {"joints": 15, "of_labelled_joints": 30, "images_without_estimate": 1}


@pytest.mark.parametrize(
    ("degrees", "octant"),
    [
        (0, "0"),
        (22, "0"),
        (23, "45"),
        (-23, "-45"),
        (90, "90"),
        (180, "180"),
        (-179, "180"),
        (-135, "-135"),
        (405, "45"),
    ],
)
def test_yaw_sectors_are_centred_on_their_names(degrees, octant):
    octants = yaw_octants(np.radians([degrees, NAN]))
    assert [name for name, rows in octants.items() if rows[0]] == [octant]
    assert not any(rows[1] for rows in octants.values()) and len(octants) == 8


def test_bootstrap_equals_a_direct_resampling_and_needs_two_sequences():
    rng = np.random.default_rng(5)
    errors, visible = rng.uniform(0, 0.2, (30, 15)), np.ones((30, 15), bool)
    errors[:10] += 0.1
    sequence = np.repeat([0, 4, 9], [10, 5, 15])  # numbers need not be dense
    found = intervals(errors, visible, sequence, seed=7)
    parts = [errors[sequence == k] for k in (0, 4, 9)]
    draws = np.random.default_rng(99).integers(0, 3, (4000, 3))
    means = [100 * np.concatenate([parts[k] for k in draw]).mean() for draw in draws]
    assert found["mean_error_cm"] == pytest.approx(np.percentile(means, [2.5, 97.5]), rel=0.03)
    assert found == intervals(errors, visible, sequence, seed=7)
    assert found["map_10cm"][0] < fraction_within(errors, 0.1) < found["map_10cm"][1]
    assert intervals(errors, visible, np.zeros(30, int), seed=7)["map_10cm"] is None


@pytest.mark.skipif(not ITOP.exists(), reason="needs ITOP's test poses with A2J's published predictions")
def test_metrics_of_published_predictions_equal_the_published_values():
    stored = np.load(ITOP)
    u, v, z = np.moveaxis(stored["a2j_side_pred_uvd"].astype(float), -1, 0)
    estimate = np.stack([(u - 160) * z * 0.0035, (120 - v) * z * 0.0035, z], axis=-1)
    result = evaluate(pose_results(stored["side_m"].astype(float), estimate))
    assert result["images"] == 4863
    assert 100 * result["map_10cm"] == pytest.approx(88.02, abs=0.005)
    assert result["mean_error_cm"] == pytest.approx(5.85, abs=0.005)
    groups = {name: round(100 * figures["map_10cm"], 2) for name, figures in result["per_group"].items()}
    assert groups == {
        "head": 98.54,
        "neck": 99.20,
        "shoulders": 96.23,
        "elbows": 78.92,
        "hands": 68.35,
        "torso": 98.52,
        "hips": 90.85,
        "knees": 90.75,
        "feet": 86.91,
    }
