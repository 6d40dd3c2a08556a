"""How far estimated joints lie from true ones: every figure of a report, defined.

All of them come from one array, `errors_m` (N, 15): the Euclidean distance in metres between a joint's estimate and
its truth in each of N frames, NaN where there is no truth, and infinite where there is a truth but no estimate
(missing). So

- a joint without truth counts nowhere;
- a missing joint is a miss in every share, and is left out of every mean and median, which is why reports state their
  number beside these;
- figures over several frames and joints pool them: every joint of every frame weighs the same.
"""

from dataclasses import dataclass, replace

import numpy as np

from kpopnet.skeleton import JOINT_GROUPS, JOINT_NAMES

THRESHOLDS_M = (0.05, 0.10, 0.15, 0.20)
CURVE_END_M = 0.20
BOOTSTRAP_DRAWS = 2000
INTERVAL = (2.5, 97.5)
"""Percentiles of the bootstrap's 95 % interval."""


@dataclass(frozen=True)
class Scored:
    """What one estimator did on the frames of a run.

    Attributes:
        truth_m: (N, 15, 3) true joints in the camera frame, NaN where there is no truth.
        estimate_m: (N, 15, 3) estimated joints, NaN where missing.
        visible: (N, 15) bool.
        sequence: (N,) int, which of sequence_names a frame belongs to.
        sequence_names: names.
        yaw_rad: (N,) the person's heading, NaN where unknown.
    """

    truth_m: np.ndarray
    estimate_m: np.ndarray
    visible: np.ndarray
    sequence: np.ndarray
    sequence_names: tuple[str, ...]
    yaw_rad: np.ndarray

    def frames(self, rows: np.ndarray) -> "Scored":
        """Only some of the frames."""
        per_frame = ("truth_m", "estimate_m", "visible", "sequence", "yaw_rad")
        return replace(self, **{name: getattr(self, name)[rows] for name in per_frame})


def joint_errors_m(truth_m: np.ndarray, estimate_m: np.ndarray) -> np.ndarray:
    """(N, 15) float64 `errors_m` of two (N, 15, 3) arrays in metres: see the module."""
    errors_m = np.linalg.norm(estimate_m.astype(np.float64) - truth_m.astype(np.float64), axis=-1)
    errors_m[np.isnan(errors_m)] = np.inf
    errors_m[np.isnan(truth_m).any(axis=-1)] = np.nan
    return errors_m


def share_within(errors_m: np.ndarray, threshold_m: float) -> float:
    """The share, 0..1, of joints with a truth whose error is below the threshold, strictly.

    At 0.1 m this is what the paper calls mAP (section 4.1) and what ITOP is scored by.
    """
    labelled = ~np.isnan(errors_m)
    return _ratio((errors_m[labelled] < threshold_m).sum(), labelled.sum())


def area_under_curve(errors_m: np.ndarray, end_m: float = CURVE_END_M) -> float:
    """The area under `share_within` for thresholds from 0 to end_m, over that of a perfect estimator: 0..1.

    Exact: a joint with error e is within the threshold on a part max(0, 1 - e / end_m) of the way.
    """
    labelled = errors_m[~np.isnan(errors_m)]
    return _ratio(np.maximum(0, 1 - labelled / end_m).sum(), labelled.size)


def mean_error_m(errors_m: np.ndarray) -> float:
    """The mean over all joints with truth and estimate, seen or not; NaN if there are none."""
    found = errors_m[np.isfinite(errors_m)]
    return _ratio(found.sum(), found.size)


def median_error_m(errors_m: np.ndarray) -> float:
    """The median over all joints with truth and estimate, seen or not; NaN if there are none."""
    found = errors_m[np.isfinite(errors_m)]
    return float(np.median(found)) if found.size else float("nan")


def average_pose_error_m(errors_m: np.ndarray, visible: np.ndarray) -> float:
    """The paper's average pose error: the mean over the visible joints with truth and estimate.

    The sum over frames and their visible joints is divided by the number of terms, so a frame in which much is seen
    weighs more than one in which little is. The paper does not say what a missing estimate counts: here, nothing.
    """
    # Eq. (16)
    return mean_error_m(np.where(visible, errors_m, np.nan))


def pose_error_deviation_m(errors_m: np.ndarray, visible: np.ndarray) -> float:
    """The standard deviation of the errors whose mean is `average_pose_error_m`: the bars of Fig. 10.

    The paper does not say over what it is taken: here over all frames and their visible joints at once.
    """
    found = errors_m[visible & np.isfinite(errors_m)]
    return float(np.std(found)) if found.size else float("nan")


def without_offsets(scored: Scored) -> np.ndarray:
    """(N, 15) `errors_m` after taking out what estimate and truth differ by constantly, joint by joint.

    Truths differ in what they call a hip. For each joint the mean of estimate - truth over all frames in which it is
    visible and estimated, a vector in the camera frame, is subtracted from the estimate. It takes out honest bias of
    the estimator too, and it is fitted on what it is judged on (3 numbers a joint): read it as a lower bound beside the
    raw figure, never instead of it.
    """
    difference = scored.estimate_m.astype(np.float64) - scored.truth_m
    usable = scored.visible & np.isfinite(difference).all(axis=-1)
    total = np.where(usable[..., None], difference, 0).sum(axis=0)
    offset_m = total / np.maximum(usable.sum(axis=0), 1)[:, None]
    return joint_errors_m(scored.truth_m, scored.estimate_m - offset_m)


def summary(errors_m: np.ndarray, visible: np.ndarray) -> dict:
    """The headline figures of (N, 15) errors or a part of them: lengths in cm, shares in 0..1, None if undefined."""
    return {
        "images": len(errors_m),
        "map_10cm": _plain(share_within(errors_m, 0.10)),
        "mean_error_cm": _plain(100 * mean_error_m(errors_m)),
        "median_error_cm": _plain(100 * median_error_m(errors_m)),
        "average_pose_error_cm": _plain(100 * average_pose_error_m(errors_m, visible)),
        "pose_error_deviation_cm": _plain(100 * pose_error_deviation_m(errors_m, visible)),
        "labelled_joints": int((~np.isnan(errors_m)).sum()),
        "missing_joints": int(np.isinf(errors_m).sum()),
    }


def evaluate(scored: Scored, seed: int = 0) -> dict:
    """Every figure of one estimator: those of `summary` over all, then by threshold, joint, group, sequence and yaw.

    Args:
        scored: what it did. Frames without any truth are left out.
        seed: of the bootstrap.
    """
    errors_m = joint_errors_m(scored.truth_m, scored.estimate_m)
    judged = ~np.isnan(errors_m).all(axis=1)
    scored, errors_m = scored.frames(judged), errors_m[judged]
    visible = scored.visible

    def part(columns: list[int]) -> dict:
        return summary(errors_m[:, columns], visible[:, columns])

    return summary(errors_m, visible) | {
        "average_pose_error_no_offset_cm": _plain(100 * average_pose_error_m(without_offsets(scored), visible)),
        "pck": {f"{100 * limit:.0f}cm": _plain(share_within(errors_m, limit)) for limit in THRESHOLDS_M},
        "pck_area_20cm": _plain(area_under_curve(errors_m)),
        "interval": intervals(errors_m, visible, scored.sequence, seed),
        "missing": {
            "joints": int(np.isinf(errors_m).sum()),
            "of_labelled_joints": int((~np.isnan(errors_m)).sum()),
            "images_without_estimate": int(np.isnan(scored.estimate_m).all(axis=(1, 2)).sum()),
        },
        "per_joint": {name: part([joint]) for joint, name in enumerate(JOINT_NAMES)},
        "per_group": {name: part([int(joint) for joint in joints]) for name, joints in JOINT_GROUPS.items()},
        "per_sequence": {
            name: summary(errors_m[scored.sequence == index], visible[scored.sequence == index])
            for index, name in enumerate(scored.sequence_names)
            if (scored.sequence == index).any()
        },
        "by_yaw": {
            name: summary(errors_m[rows], visible[rows])
            for name, rows in yaw_octants(scored.yaw_rad).items()
            if rows.any()
        },
    }


def yaw_octants(yaw_rad: np.ndarray) -> dict[str, np.ndarray]:
    """(N,) bool of the frames in each eighth of the circle, by its middle in degrees; an unknown yaw is in none."""
    known = np.isfinite(yaw_rad)
    octant = np.round(np.where(known, yaw_rad, 0) / (np.pi / 4)).astype(int) % 8
    return {str((45 * k + 179) % 360 - 179): known & (octant == k) for k in (5, 6, 7, 0, 1, 2, 3, 4)}


def intervals(errors_m: np.ndarray, visible: np.ndarray, sequence: np.ndarray, seed: int) -> dict:
    """95 % bootstrap intervals of the headline figures, (low, high), or None with fewer than two sequences.

    Frames of a sequence resemble each other, so whole sequences are drawn, with replacement, BOOTSTRAP_DRAWS times.
    Each figure is a ratio of sums, so a draw is a weighting of the sequences' sums. The interval says how much the
    figure would move with other sequences like these, not how it would with another kind.
    """
    labelled, found = ~np.isnan(errors_m), np.isfinite(errors_m)
    seen = found & visible
    ratios = {
        "map_10cm": (errors_m < 0.10, labelled, 1),
        "mean_error_cm": (np.where(found, errors_m, 0), found, 100),
        "average_pose_error_cm": (np.where(seen, errors_m, 0), seen, 100),
    }
    _, row = np.unique(sequence, return_inverse=True)
    count = row.max(initial=-1) + 1
    if count < 2:
        return dict.fromkeys(ratios)
    draws = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), size=BOOTSTRAP_DRAWS)

    def drawn(values: np.ndarray) -> np.ndarray:
        return draws @ np.bincount(row, values.sum(axis=1), count)

    out = {}
    for name, (above, below, unit) in ratios.items():
        numbers = drawn(below)
        values = unit * drawn(above)[numbers > 0] / numbers[numbers > 0]
        out[name] = np.percentile(values, INTERVAL).tolist() if values.size else None
    return out


def _ratio(above: float, below: float) -> float:
    return float(above / below) if below else float("nan")


def _plain(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
