"""Calibration and ranking of a confidence, against constructed joints."""

import numpy as np
import pytest
from pose_results import results_of_errors as results

from kpopnet.evaluation.poses.confidence import evaluate_confidence


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
