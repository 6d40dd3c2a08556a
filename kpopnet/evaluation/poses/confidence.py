"""Judges the confidence of an estimator: is it the probability that a joint is within 10 cm of the truth?

Only joints with a true position and an estimate count. A missing joint has confidence 0 by definition, and would count as a
success of the confidence. Two questions are asked:

- Calibration. The joints are divided into `BINS` bins of equal width by their confidence. The reliability diagram has the share
  of joints within 10 cm in each bin over their mean confidence. The expected calibration error (Guo et al. 2017) is the mean
  distance between the two, weighted by the number of joints.
- Ranking. The risk-coverage curve (Geifman & El-Yaniv 2017) has the mean error of the most confident share of the joints. The
  area below it is its mean over all shares: at worst about the mean error of all joints, at best that of a confidence that
  orders joints by their true error. Joints of equal confidence count with their mean error.

A data set that defines a joint elsewhere than the estimator does lowers the calibration: the confidence cannot know the offset.
"""

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from kpopnet.evaluation.blocks import Block
from kpopnet.evaluation.poses.metrics import PoseResults

WITHIN_M = 0.10
BINS = 10
SHARES = (0.25, 0.5, 0.75, 0.9, 1.0)
CURVE_POINTS = 200


class Judged(NamedTuple):
    """The N joints with a true position and an estimate.

    Attributes:
        error_m: (N,) distance from the true position, metres.
        confidence: (N,) in 0..1.
    """

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
    """All figures of the confidence of one estimator.

    Returns:
        Under "confidence": number of joints; `mean` confidence, and share `within_10cm`, which should be equal; `ece`; the area
        `risk_cm` below the risk-coverage curve, and `risk_best_cm` of the best order; `error_cm` of the most confident shares;
        and the `bins` of the reliability diagram. None where there are no joints.
    """
    joints = judged(results)
    if not len(joints.error_m):
        none = dict.fromkeys(("mean", "within_10cm", "ece", "risk_cm", "risk_best_cm"))
        return {"confidence": {"joints": 0, **none, "error_cm": {}, "bins": []}}
    curve_m, best_m = risk_curve_m(joints), risk_curve_m(joints._replace(confidence=-joints.error_m))
    return {
        "confidence": {
            "joints": len(joints.error_m),
            "mean": float(joints.confidence.mean()),
            "within_10cm": float((joints.error_m < WITHIN_M).mean()),
            "ece": calibration_error(joints),
            "risk_cm": 100 * float(curve_m.mean()),
            "risk_best_cm": 100 * float(best_m.mean()),
            "error_cm": {
                f"{100 * share:.0f}%": 100 * float(curve_m[max(1, round(share * len(curve_m))) - 1]) for share in SHARES
            },
            "bins": [
                {"joints": int(count), "mean": float(mean), "within_10cm": float(within)}
                for count, mean, within in zip(*reliability(joints), strict=True)
                if count
            ],
        }
    }


def confidence_figure(results: dict[str, PoseResults], title: str) -> Figure:
    """The reliability diagram and the risk-coverage curve of every estimator, by name."""
    figure = Figure(figsize=(11, 4.8), layout="constrained")
    reliable, risk = figure.subplots(1, 2)
    reliable.plot((0, 1), (0, 1), color="grey", linewidth=0.8, linestyle=":")
    for name, one in results.items():
        joints = judged(one)
        if not len(joints.error_m):
            continue
        count, mean, within = reliability(joints)
        (line,) = reliable.plot(mean[count > 0], within[count > 0], linewidth=1, label=name)
        # The area of a dot is its bin's share of the joints.
        reliable.scatter(mean, within, s=6 + 400 * count / count.sum(), color=line.get_color(), alpha=0.6)
        curve_m = risk_curve_m(joints)
        at = np.linspace(0, len(curve_m) - 1, min(CURVE_POINTS, len(curve_m))).astype(int)
        risk.plot((at + 1) / len(curve_m) * 100, 100 * curve_m[at], label=name)
    reliable.set(xlabel="confidence", ylabel="share of joints within 10 cm", xlim=(0, 1), ylim=(0, 1))
    risk.set(xlabel="most confident share of the joints, %", ylabel="their mean error, cm", xlim=(0, 100))
    risk.set_ylim(bottom=0)
    for panel in (reliable, risk):
        panel.grid(alpha=0.3)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(fontsize=8)
    figure.suptitle(title)
    return figure


def confidence_blocks(metrics: dict[str, dict]) -> list[Block]:
    """The section of the report, from the metrics of every estimator by name."""
    judged_metrics = {}
    for name, one in metrics.items():
        judged_metrics[name] = one["confidence"]
        if "in_label_definition" in one:
            judged_metrics[f"{name}, in the labels' definition"] = one["in_label_definition"]["confidence"]
    shares = [f"{100 * share:.0f}%" for share in SHARES]
    header = ["", "mean confidence", "within 10 cm", "calibration error", "area", "best area"]
    header += [f"error of {share}" for share in shares]
    rows = [
        [
            name,
            *(f"{100 * one[key]:.1f} %" for key in ("mean", "within_10cm", "ece")),
            *(f"{value:.2f} cm" for value in (one["risk_cm"], one["risk_best_cm"], *map(one["error_cm"].get, shares))),
        ]
        for name, one in judged_metrics.items()
        if one["joints"]
    ]
    text = (
        "The confidence is meant as the probability that a joint is within 10 cm of its true position. Calibration error: mean "
        f"distance between the confidence and the share within 10 cm, in {BINS} bins. Area: mean error of the most confident "
        "share of the joints, averaged over all shares; the best one orders joints by their true error. Missing joints are "
        "left out. The mean pose has confidence 1 throughout."
    )
    return [
        ("heading", "Confidence"),
        ("text", text),
        ("table", (header, rows)),
        ("figure", ("confidence.png", "Share within 10 cm over confidence, and error of the most confident joints")),
    ]
