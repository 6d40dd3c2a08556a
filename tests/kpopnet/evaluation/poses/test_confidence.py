"""Calibration and ranking of a confidence, against constructed joints."""

import numpy as np
import pytest
from pose_results import results_of_errors

from kpopnet.evaluation.poses.confidence import evaluate_confidence


def honest(rng: np.random.Generator, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 15) errors that are below 10 cm with the probability that the (N, 15) confidence says."""
    confidence = rng.random((frames, 15))
    hit = rng.random((frames, 15)) < confidence
    return np.where(hit, rng.uniform(0, 0.099, hit.shape), rng.uniform(0.101, 0.5, hit.shape)), confidence


def found(error_m: np.ndarray, confidence: np.ndarray) -> dict:
    return evaluate_confidence(results_of_errors(error_m, confidence=confidence))["confidence"]


def test_an_honest_confidence_is_calibrated_and_a_biased_one_is_not() -> None:
    error_m, confidence = honest(np.random.default_rng(0), 2000)
    assert found(error_m, confidence)["ece"] < 0.02
    # Halved, each bin is off by its confidence: 1/4 on average.
    assert found(error_m, confidence / 2)["ece"] == pytest.approx(0.25, abs=0.02)


def test_the_area_lies_between_the_best_order_and_its_reverse() -> None:
    error_m, confidence = honest(np.random.default_rng(3), 200)
    orders = {"best": 1 - error_m, "honest": confidence, "none": np.ones_like(error_m), "worst": error_m}
    areas, honestly = {name: found(error_m, one)["risk_cm"] for name, one in orders.items()}, found(error_m, confidence)
    assert areas["best"] == pytest.approx(honestly["risk_best_cm"])
    assert areas["best"] < areas["honest"] < areas["none"] < areas["worst"]
    assert [areas["none"], honestly["error_cm"]["100%"]] == pytest.approx([100 * error_m.mean()] * 2)
    assert honestly["error_cm"]["25%"] < honestly["error_cm"]["75%"]


def test_the_error_of_a_share_is_the_mean_of_the_joints_that_are_surest() -> None:
    error_m = np.arange(60).reshape(4, 15) / 1000
    assert found(error_m, 1 - error_m)["error_cm"] == pytest.approx(
        {f"{share}%": (60 * share / 100 - 1) / 20 for share in (25, 50, 75, 90, 100)}
    )
