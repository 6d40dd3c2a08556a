"""Judges the confidence of an estimator: is it the probability that a joint is within 10 cm of the truth?

Only joints with a true position and an estimate count. A missing joint has confidence 0 by definition, and would count as a
success of the confidence.

- Calibration: the reliability diagram, and the expected calibration error (Guo et al. 2017), the mean distance between the two
  axes of the diagram, weighted by the number of joints.
- Ranking: the risk-coverage curve (Geifman & El-Yaniv 2017). The area below it is its mean over all shares: the mean error of
  all joints for a confidence that tells nothing, more for one that is misleading, and least for one that orders joints by their
  true error. Joints of equal confidence count with their mean error.

A data set that defines a joint elsewhere than the estimator does lowers the calibration: the confidence cannot know the offset.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.evaluation.poses.metrics import WITHIN_M, PoseResults

BINS = 10
SHARES = (0.25, 0.5, 0.75, 0.9, 1.0)


class Judged(NamedTuple):
    """The N joints with a true position and an estimate: (N,) distance between the two in metres, and confidence in 0..1."""

    error_m: np.ndarray
    confidence: np.ndarray


def judged(results: PoseResults) -> Judged:
    """The joints of an evaluation that have a true position and an estimate."""
    error_m = results.errors_m()
    found = np.isfinite(error_m)
    return Judged(error_m[found], results.confidence[found].astype(np.float64))


def reliability(joints: Judged) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(BINS,) number of joints in each bin, their mean confidence, and their share within 10 cm; both NaN in an empty bin."""
    row = np.minimum((joints.confidence * BINS).astype(int), BINS - 1)
    count = np.bincount(row, minlength=BINS)
    sums = (np.bincount(row, values, BINS) for values in (joints.confidence, joints.error_m < WITHIN_M))
    mean, within = (np.divide(total, count, out=np.full(BINS, np.nan), where=count > 0) for total in sums)
    return count, mean, within


def calibration_error(joints: Judged) -> float:
    """The expected calibration error, 0..1, NaN without joints."""
    count, mean, within = reliability(joints)
    return float(np.nansum(count * np.abs(within - mean)) / count.sum()) if count.any() else float("nan")


def risk_curve_m(joints: Judged) -> np.ndarray:
    """(N,) mean error in metres of the 1, 2, ... N most confident joints."""
    _, tie = np.unique(-joints.confidence, return_inverse=True)
    mean_of_tie = np.bincount(tie, joints.error_m) / np.maximum(np.bincount(tie), 1)
    return np.cumsum(mean_of_tie[np.sort(tie)]) / np.arange(1, len(tie) + 1)


def evaluate_confidence(results: PoseResults) -> dict:
    """All figures of the confidence of one estimator, under "confidence"; None where there are no joints.

    The number of joints; `mean` confidence, and share `within_10cm`, which should be equal; `ece`; the area `risk_cm` below the
    risk-coverage curve, and `risk_best_cm` of the best order; `error_cm` of the most confident shares; and the `bins` of the
    reliability diagram.
    """
    joints = judged(results)
    count = len(joints.error_m)
    if not count:
        none = dict.fromkeys(("mean", "within_10cm", "ece", "risk_cm", "risk_best_cm"))
        return {"confidence": {"joints": 0, **none, "error_cm": {}, "bins": []}}
    curve_m, best_m = risk_curve_m(joints), risk_curve_m(joints._replace(confidence=-joints.error_m))
    bins = zip(*(column.tolist() for column in reliability(joints)), strict=True)
    figures = {
        "joints": count,
        "mean": float(joints.confidence.mean()),
        "within_10cm": float((joints.error_m < WITHIN_M).mean()),
        "ece": calibration_error(joints),
        "risk_cm": 100 * float(curve_m.mean()),
        "risk_best_cm": 100 * float(best_m.mean()),
        "error_cm": {f"{100 * share:.0f}%": 100 * float(curve_m[max(1, round(share * count)) - 1]) for share in SHARES},
        "bins": [{"joints": number, "mean": mean, "within_10cm": within} for number, mean, within in bins if number],
    }
    return {"confidence": figures}
