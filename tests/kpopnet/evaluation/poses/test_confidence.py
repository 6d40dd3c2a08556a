"""Calibration and ranking of a confidence, against constructed joints and slow twins."""

import numpy as np
import pytest
from pose_results import results_of_errors as results

from kpopnet.evaluation.poses.confidence import (
    BINS,
    Judged,
    calibration_error,
    evaluate_confidence,
    reliability,
    risk_curve_m,
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


def test_ties_count_with_their_mean_whatever_their_order() -> None:
    rng = np.random.default_rng(2)
    error_m, confidence = rng.random(60), rng.integers(0, 4, 60) / 4
    curves = [risk_curve_m(Judged(error_m[order], confidence[order])) for order in (np.arange(60), rng.permutation(60))]
    np.testing.assert_allclose(*curves)
    np.testing.assert_allclose(risk_curve_m(Judged(error_m, np.ones(60))), error_m.mean())


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


def test_missing_joints_joints_without_label_and_given_frames_do_not_count() -> None:
    error_m, confidence = honest(np.random.default_rng(4), 20)
    more_m, more = np.concatenate([error_m] * 3), np.concatenate([confidence] * 3)
    more_m[20:40, ::2], more_m[20:40, 1::2], more[20:40] = np.nan, np.inf, 0
    one = results(more_m, more)
    one.given[40:] = True
    assert evaluate_confidence(one) == evaluate_confidence(results(error_m, confidence))
    nothing = evaluate_confidence(results(np.full((3, 15), np.inf), np.zeros((3, 15))))["confidence"]
    assert nothing["joints"] == 0 and nothing["ece"] is None
