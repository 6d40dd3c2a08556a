"""Calibration and ranking of a confidence, against constructed joints and slow twins."""

import numpy as np
import pytest

from kpopnet.evaluation.poses.confidence import (
    BINS,
    Judged,
    calibration_error,
    confidence_blocks,
    confidence_figure,
    evaluate_confidence,
    reliability,
    risk_curve_m,
)
from kpopnet.evaluation.poses.metrics import PoseResults


def results(error_m: np.ndarray, confidence: np.ndarray) -> PoseResults:
    """(N, 15) errors in metres, NaN without a true position and infinite where missing, with their confidence."""
    truth = np.where(np.isnan(error_m)[..., None], np.nan, np.zeros((*error_m.shape, 3)))
    estimate = np.where(np.isfinite(error_m), error_m, np.nan)[..., None] * np.array([0.6, 0.0, 0.8])
    frames = len(error_m)
    return PoseResults(
        truth_m=truth,
        estimate_m=np.where(np.isnan(error_m)[..., None], 0.0, estimate),
        confidence=confidence.astype(np.float32),
        visible=np.ones(error_m.shape, bool),
        sequence=np.zeros(frames, int),
        sequence_names=("s0",),
        yaw_rad=np.full(frames, np.nan),
        unit=np.zeros(frames, int),
        given=np.zeros(frames, bool),
    )


def honest(rng: np.random.Generator, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 15) errors that are below 10 cm with the probability that the (N, 15) confidence says."""
    confidence = rng.random((frames, 15))
    hit = rng.random((frames, 15)) < confidence
    return np.where(hit, rng.uniform(0, 0.099, hit.shape), rng.uniform(0.101, 0.5, hit.shape)), confidence


def test_an_honest_confidence_is_calibrated_and_a_biased_one_is_not() -> None:
    error_m, confidence = honest(np.random.default_rng(0), 2000)
    assert evaluate_confidence(results(error_m, confidence))["confidence"]["ece"] < 0.02
    # Halved, each bin is off by its confidence: 1/4 on average.
    assert evaluate_confidence(results(error_m, confidence / 2))["confidence"]["ece"] == pytest.approx(0.25, abs=0.02)
    always = evaluate_confidence(results(error_m, np.ones_like(confidence)))["confidence"]
    assert always["ece"] == pytest.approx(1 - always["within_10cm"])


def test_the_calibration_error_equals_its_slow_twin() -> None:
    rng = np.random.default_rng(1)
    joints = Judged(rng.uniform(0, 0.3, 500), rng.choice([0.0, 0.05, 0.31, 0.39, 0.95, 1.0], 500))
    total = 0.0
    for k in range(BINS):
        inside = [i for i in range(500) if k / BINS <= joints.confidence[i] < (k + 1) / BINS + (k == BINS - 1)]
        if inside:
            total += abs(sum(joints.error_m[i] < 0.1 for i in inside) - sum(joints.confidence[i] for i in inside))
    assert calibration_error(joints) == pytest.approx(total / 500)
    count, mean, within = reliability(joints)
    assert count.sum() == 500 and count[3] > 0 and 0.31 <= mean[3] <= 0.39 and 0 < within[3] < 1
    assert np.isnan(mean[5]) and np.isnan(within[5])


def test_the_risk_curve_is_the_mean_error_of_the_most_confident() -> None:
    joints = Judged(np.array([0.4, 0.1, 0.2]), np.array([0.1, 0.9, 0.5]))
    np.testing.assert_allclose(risk_curve_m(joints), [0.1, 0.15, 0.7 / 3])


def test_ties_count_with_their_mean_whatever_their_order() -> None:
    rng = np.random.default_rng(2)
    error_m, confidence = rng.random(60), rng.integers(0, 4, 60) / 4
    curves = [risk_curve_m(Judged(error_m[order], confidence[order])) for order in (np.arange(60), rng.permutation(60))]
    np.testing.assert_allclose(*curves)
    np.testing.assert_allclose(risk_curve_m(Judged(error_m, np.ones(60))), error_m.mean())
    # The mean over all orders of the ties.
    shuffled = [rng.permutation(60) for _ in range(2000)]
    orders = [order[np.argsort(-confidence[order], kind="stable")] for order in shuffled]
    mean = np.mean([np.cumsum(error_m[order]) / np.arange(1, 61) for order in orders], axis=0)
    np.testing.assert_allclose(curves[0], mean, atol=0.02)


def test_the_area_lies_between_the_best_order_and_its_reverse() -> None:
    error_m, confidence = honest(np.random.default_rng(3), 200)
    areas = {
        name: evaluate_confidence(results(error_m, one))["confidence"]["risk_cm"]
        for name, one in {"best": 1 - error_m, "honest": confidence, "none": np.ones_like(error_m), "worst": error_m}.items()
    }
    found = evaluate_confidence(results(error_m, confidence))["confidence"]
    assert areas["best"] == pytest.approx(found["risk_best_cm"])
    assert areas["best"] < areas["honest"] < areas["none"] < areas["worst"]
    assert areas["none"] == pytest.approx(100 * error_m.mean())
    assert found["error_cm"]["100%"] == pytest.approx(100 * error_m.mean())
    assert found["error_cm"]["25%"] < found["error_cm"]["75%"]


def test_missing_joints_and_joints_without_label_do_not_count() -> None:
    error_m, confidence = honest(np.random.default_rng(4), 20)
    more_m, more = np.concatenate([error_m, error_m]), np.concatenate([confidence, confidence])
    more_m[20:, ::2], more_m[20:, 1::2], more[20:] = np.nan, np.inf, 0
    assert evaluate_confidence(results(more_m, more)) == evaluate_confidence(results(error_m, confidence))


def test_frames_that_were_given_do_not_count() -> None:
    error_m, confidence = honest(np.random.default_rng(5), 20)
    one = results(error_m, confidence)
    one.given[:5] = True
    assert evaluate_confidence(one) == evaluate_confidence(results(error_m[5:], confidence[5:]))


def test_without_any_estimate_there_are_no_figures_and_the_report_stands() -> None:
    nothing = results(np.full((3, 15), np.inf), np.zeros((3, 15)))
    metrics = evaluate_confidence(nothing)
    assert metrics["confidence"]["joints"] == 0 and metrics["confidence"]["ece"] is None
    *_, (_, (header, rows)), _ = confidence_blocks({"tracker": metrics})
    assert len(header) > 1 and rows == []
    confidence_figure({"tracker": nothing}, "title").canvas.draw()


def test_the_section_has_a_row_for_each_estimator_and_for_the_labels_definition() -> None:
    error_m, confidence = honest(np.random.default_rng(6), 20)
    one = results(error_m, confidence)
    metrics = evaluate_confidence(one)
    blocks = confidence_blocks({"a": metrics | {"in_label_definition": metrics}, "b": metrics})
    (header, rows) = next(content for kind, content in blocks if kind == "table")
    assert [row[0] for row in rows] == ["a", "a, in the labels' definition", "b"]
    assert all(len(row) == len(header) for row in rows)
    figure = confidence_figure({"a": one, "b": one}, "title")
    assert [len(panel.lines) for panel in figure.axes] == [3, 2]
