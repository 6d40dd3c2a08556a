"""Definitions of all pose metrics in a report.

All metrics are computed from one array, `errors_m` (N, 15): the Euclidean distance in metres between the estimated and the
true position of each joint in each of N frames. It is NaN where a joint has no true position, and infinite where it has a
true position but no estimate (a missing joint). Therefore

- a joint without a true position is not counted;
- a missing joint counts as an error above every threshold, and is left out of every mean and median. Reports state the
  number of missing joints beside these;
- metrics over several frames and joints are pooled: every joint of every frame has the same weight;
- a frame whose true pose the estimator was given (start=label) is not scored, as if it had no true joints.

Names with 14 are over the paper's fourteen joints, all but the neck, as published figures are. All others are over fifteen.
"""

from dataclasses import dataclass, fields

import numpy as np

from kpopnet.dance.performance import numbers
from kpopnet.errors import InputError, check_number, check_type
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.poses.definition import torso_axes
from kpopnet.evaluation.values import plain
from kpopnet.runtime.input_files import ArraySchema, check_array, expect
from kpopnet.skeleton import JOINT_GROUPS, JOINT_NAMES, NUM_JOINTS, PAPER_JOINTS, Joint

WITHIN_M = 0.10
"""An error below this is that of a correct joint (paper, section 4.1)."""

THRESHOLDS_M = (0.05, WITHIN_M, 0.15, 0.20)
CURVE_END_M = 0.20
MOVING_M = 0.20
"""A joint is moving where it is farther than this from where the person's rest pose has it."""


SCHEMA = {
    **dict.fromkeys(("truth_m", "estimate_m"), ArraySchema("f", ("frames", NUM_JOINTS, 3))),
    "confidence": ArraySchema("f", ("frames", NUM_JOINTS)),
    "visible": ArraySchema("b", ("frames", NUM_JOINTS)),
    "yaw_rad": ArraySchema("f", ("frames",)),
    "given": ArraySchema("b", ("frames",)),
    **dict.fromkeys(("sequence", "person"), ArraySchema("U", ("frames",))),
    "unit": ArraySchema("Uiu", ("frames",)),
}
"""What the arrays of `PoseResults` must be."""


@dataclass(frozen=True)
class PoseResults:
    """True joints, and the joints that one estimator found, in the N frames of an evaluation.

    Raises InputError for arrays of another shape or type, and confidence outside of 0..1.
    """

    truth_m: np.ndarray  # (N, 15, 3) true joints in metres in the camera frame, NaN where they are unknown
    estimate_m: np.ndarray  # (N, 15, 3) estimated joints likewise, NaN where missing
    confidence: np.ndarray  # (N, 15) of the estimates, 0..1
    visible: np.ndarray  # (N, 15) bool, whether the joint is visible in the depth image
    yaw_rad: np.ndarray  # (N,) heading of the person, NaN where unknown
    given: np.ndarray  # (N,) bool, whether the estimator was given the true joints of this frame; it is not scored there
    sequence: np.ndarray  # (N,) its name
    person: np.ndarray  # (N,) identity; "" if unknown
    unit: np.ndarray  # (N,) name of the person, room or sequence that the bootstrap resamples as a whole

    def __post_init__(self) -> None:
        lengths: dict[str, int] = {}
        for name, schema in SCHEMA.items():
            array = getattr(self, name)
            expect(isinstance(array, np.ndarray), name, f"a numpy array, found {type(array).__name__}")
            check_array(name, array.shape, array.dtype, schema, lengths)
        expect(bool(((self.confidence >= 0) & (self.confidence <= 1)).all()), "confidence", "numbers from 0 to 1")

    @property
    def sequence_names(self) -> list[str]:
        return list(dict.fromkeys(self.sequence.tolist()))

    def errors_m(self) -> np.ndarray:
        """(N, 15) `errors_m`, as the module defines it."""
        errors_m = joint_errors_m(self.truth_m, self.estimate_m)
        errors_m[self.given] = np.nan
        return errors_m

    def select_frames(self, rows: np.ndarray) -> "PoseResults":
        """The frames of an index or boolean mask."""
        return PoseResults(*(getattr(self, one.name)[rows] for one in fields(self)))


def concatenated(parts: list[PoseResults]) -> PoseResults:
    """The frames of several sequences."""
    return PoseResults(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(PoseResults)))


def joint_errors_m(truth_m: np.ndarray, estimate_m: np.ndarray) -> np.ndarray:
    """(N, 15) float64 distances of two (N, 15, 3) arrays in metres, NaN and infinite as the module defines it.

    Raises InputError unless both have one shape (..., 3).
    """
    truth_m, estimate_m = numbers("true joints", truth_m), numbers("estimated joints", estimate_m)
    if truth_m.shape != estimate_m.shape or truth_m.shape[-1:] != (3,):
        raise InputError(f"true joints of shape {truth_m.shape}, estimated ones of {estimate_m.shape}: expected one, (..., 3)")
    errors_m = np.linalg.norm(estimate_m - truth_m, axis=-1)
    errors_m[np.isnan(errors_m)] = np.inf
    errors_m[np.isnan(truth_m).any(axis=-1)] = np.nan
    return errors_m


def fraction_within(errors_m: np.ndarray, threshold_m: float) -> float:
    """The fraction, 0..1, of joints with a true position whose error is strictly below the threshold (PCK).

    At 0.1 m this is the mAP of the paper (section 4.1) and the metric of ITOP.
    """
    check_number("threshold_m", threshold_m)
    labelled = ~np.isnan(errors_m := numbers("errors", errors_m))
    return ratio((errors_m[labelled] < threshold_m).sum(), labelled.sum())


def area_under_curve(errors_m: np.ndarray) -> float:
    """The area under `fraction_within` for thresholds from 0 to CURVE_END_M, divided by that of a perfect estimator: 0..1.

    Exact, without sampling: a joint with error e is below the threshold for max(0, 1 - e / CURVE_END_M) of the range.
    """
    errors_m = numbers("errors", errors_m)
    labelled = errors_m[~np.isnan(errors_m)]
    return ratio(np.maximum(0, 1 - labelled / CURVE_END_M).sum(), labelled.size)


def mean_error_m(errors_m: np.ndarray) -> float:
    """The mean over all joints with true position and estimate, visible or not; NaN if there are none."""
    errors_m = numbers("errors", errors_m)
    found = errors_m[np.isfinite(errors_m)]
    return ratio(found.sum(), found.size)


def average_pose_error_m(errors_m: np.ndarray, visible: np.ndarray) -> float:
    """The paper's average pose error (Eq. 16): the mean over the visible joints of all frames with true position and estimate.

    Assumptions: the paper does not say how a missing estimate counts; it is left out.
    """
    _check_visible(errors_m, visible)
    # Eq. (16)
    return mean_error_m(np.where(visible, errors_m, np.nan))


def _check_visible(errors_m: np.ndarray, visible: np.ndarray) -> None:
    if np.shape(visible) != np.shape(errors_m) or np.asarray(visible).dtype != bool:
        shapes = f"{np.shape(errors_m)}, found {np.asarray(visible).dtype} of shape {np.shape(visible)}"
        raise InputError(f"visible: expected bool, one an error, of shape {shapes}")


def without_offsets(results: PoseResults) -> np.ndarray:
    """(N, 15) `errors_m` after the constant offset of each joint is subtracted from the estimates.

    Data sets define the position of a joint, such as the hip, differently. The offset of a joint is the mean of estimate -
    truth, a vector in the camera frame, over all frames in which the joint is visible and estimated. Subtracting it also
    removes bias of the estimator, so the result is a lower bound, to be read beside the raw error.
    """
    difference = results.estimate_m.astype(np.float64) - results.truth_m
    usable = results.visible & np.isfinite(difference).all(axis=-1)
    total = np.where(usable[..., None], difference, 0).sum(axis=0)
    offset_m = total / np.maximum(usable.sum(axis=0), 1)[:, None]
    return joint_errors_m(results.truth_m, results.estimate_m - offset_m)


def moving_joints(truth_m: np.ndarray, person: np.ndarray) -> np.ndarray:
    """(N, 15) bool, joints farther than MOVING_M from where the rest pose of the person (N,) has them; false where unknown.

    The rest pose is the median of the person's true joints over the frames that have them, in the axes of the torso and from
    its centre: an estimator that always answers a mean pose has most other joints right. Unknown people, "", have none.
    """
    own_m = np.einsum("nab,njb->nja", torso_axes(truth_m.astype(np.float64)), truth_m - truth_m[:, [Joint.TORSO]])
    moving = np.zeros(own_m.shape[:2], bool)
    for one in filter(None, np.unique(person).tolist()):
        rows = person == one
        own = own_m[rows]
        known = np.isfinite(own).all(axis=-1).any(axis=0)  # joints of which some frame has the position
        moving[np.ix_(rows, known)] = np.linalg.norm(own[:, known] - np.nanmedian(own[:, known], axis=0), axis=-1) > MOVING_M
    return moving


def summary(errors_m: np.ndarray, visible: np.ndarray) -> dict:
    """The main metrics of (N, K) errors of K joints: lengths in cm, fractions in 0..1, NaN where undefined.

    `pose_error_deviation_cm`: the standard deviation of the errors whose mean is `average_pose_error_cm`, the error bars of
    Fig. 10. Assumptions: the paper does not say over which set it is taken; here over all frames and visible joints together.
    """
    _check_visible(errors_m, visible)
    found = errors_m[np.isfinite(errors_m)]
    seen = errors_m[visible & np.isfinite(errors_m)]
    return {
        "images": len(errors_m),
        "map_10cm": fraction_within(errors_m, WITHIN_M),
        "mean_error_cm": 100 * mean_error_m(errors_m),
        "median_error_cm": 100 * float(np.median(found)) if found.size else np.nan,
        "average_pose_error_cm": 100 * average_pose_error_m(errors_m, visible),
        "pose_error_deviation_cm": 100 * float(np.std(seen)) if seen.size else np.nan,
        "labelled_joints": int((~np.isnan(errors_m)).sum()),
        "missing_joints": int(np.isinf(errors_m).sum()),
    }


def evaluate(results: PoseResults, seed: int = 0) -> dict:
    """All metrics of one estimator: `summary` over all frames, then by threshold, joint, joint group, sequence and yaw.

    Frames without any true joint, and those whose label the estimator was given, are left out. What is undefined is None.
    `seed` is the bootstrap's.
    """
    check_type("results", results, PoseResults)
    labelled = results.select_frames(np.isfinite(results.truth_m).all(axis=-1).any(axis=1))
    scored = ~labelled.given
    results = labelled.select_frames(scored)
    errors_m, visible = results.errors_m(), results.visible

    def of_joints(columns: list[int]) -> dict:
        return summary(errors_m[:, columns], visible[:, columns])

    def of_frames(rows: np.ndarray) -> dict:
        return summary(errors_m[rows], visible[rows])

    moving = moving_joints(results.truth_m, results.person)

    def of_moving(rows: np.ndarray | slice) -> dict:
        errors = np.where(moving[rows], errors_m[rows], np.nan)
        return {"moving_10cm": fraction_within(errors, WITHIN_M), "moving_joints": int((~np.isnan(errors)).sum())}

    whole, fourteen = summary(errors_m, visible), of_joints(list(PAPER_JOINTS))
    return plain(
        whole
        | of_moving(slice(None))
        | {
            "map_14": fourteen["map_10cm"],
            "paper_joints": fourteen,
            "average_pose_error_no_offset_cm": 100 * average_pose_error_m(without_offsets(results), visible),
            "pck": {f"{100 * limit:.0f}cm": fraction_within(errors_m, limit) for limit in THRESHOLDS_M},
            "pck_area_20cm": area_under_curve(errors_m),
            "interval": intervals(errors_m, visible, moving, Bootstrap(results.unit, seed)),
            "missing": {
                "joints": whole["missing_joints"],
                "of_labelled_joints": whole["labelled_joints"],
                "images_without_estimate": int(np.isnan(results.estimate_m).all(axis=(1, 2)).sum()),
            },
            "per_joint": {name: of_joints([joint]) for joint, name in enumerate(JOINT_NAMES)},
            "per_group": {name: of_joints([int(joint) for joint in joints]) for name, joints in JOINT_GROUPS.items()},
            "per_sequence": {
                name: of_frames(results.sequence == name)
                for name in labelled.sequence_names  # the same names for every estimator, whichever frames it was given
            },
            "per_person": {
                name: of_frames(results.person == name) | of_moving(results.person == name)
                for name in np.unique(labelled.person).tolist()
                if name
            },
            "by_yaw": {name: of_frames(rows[scored]) for name, rows in yaw_octants(labelled.yaw_rad).items() if rows.any()},
        }
    )


def yaw_octants(yaw_rad: np.ndarray) -> dict[str, np.ndarray]:
    """(N,) bool masks of the frames in each 45 degree sector, by the centre of the sector in degrees.

    A frame with unknown yaw is in no sector.
    """
    known = np.isfinite(yaw_rad)
    octant = np.round(np.where(known, yaw_rad, 0) / (np.pi / 4)).astype(int) % 8
    return {str((45 * k + 179) % 360 - 179): known & (octant == k) for k in (5, 6, 7, 0, 1, 2, 3, 4)}


def intervals(
    errors_m: np.ndarray, visible: np.ndarray, moving: np.ndarray, bootstrap: Bootstrap
) -> dict[str, list[float] | None]:
    """95 % intervals [low, high] of the main metrics of (N, 15) errors; None with too few units."""
    labelled, found = ~np.isnan(errors_m), np.isfinite(errors_m)
    seen, fourteen = found & visible, list(PAPER_JOINTS)
    distance_cm = 100 * np.where(found, errors_m, 0)
    ratios = {
        "map_10cm": (errors_m < WITHIN_M, labelled),
        "moving_10cm": ((errors_m < WITHIN_M) & moving, labelled & moving),
        "map_14": (errors_m[:, fourteen] < WITHIN_M, labelled[:, fourteen]),
        "mean_error_cm": (distance_cm, found),
        "average_pose_error_cm": (distance_cm * seen, seen),
    }
    return {name: bootstrap.interval(*sums) for name, sums in ratios.items()}


def difference(results: PoseResults, reference: PoseResults, seed: int = 0) -> dict:
    """How much larger the figures of an estimator are than those of a reference on the same frames, with paired intervals.

    Each resample holds the same units for both, so what makes a unit hard for both cancels. Frames that either was given are
    left out for both. Distances are compared over the joints that both found: over all joints, an estimator that finds only
    easy ones would seem to be nearer. The result has a dict of `value` and `interval`, None where undefined, for each metric:
    `within_10cm_points` (percentage points) and `mean_error_cm`. Raises InputError for results of other frames.
    """
    check_type("results", results, PoseResults)
    check_type("reference", reference, PoseResults)
    expect(len(results.unit) == len(reference.unit), "reference", f"the {len(results.unit)} frames of the results")
    first, second = results.errors_m(), reference.errors_m()
    scored = ~np.isnan(first) & ~np.isnan(second)
    kept = scored.any(axis=1)
    first, second, scored = first[kept], second[kept], scored[kept]
    bootstrap, both = Bootstrap(results.unit[kept], seed), np.isfinite(first) & np.isfinite(second)

    def paired(change: np.ndarray, counted: np.ndarray) -> dict:
        change = np.where(counted, change, 0)
        return {"value": ratio(change.sum(), counted.sum()), "interval": bootstrap.interval(change, counted)}

    within = 100.0 * (first < WITHIN_M) - 100.0 * (second < WITHIN_M)
    distance_cm = 100 * np.where(both, first, 0) - 100 * np.where(both, second, 0)
    return plain({"within_10cm_points": paired(within, scored), "mean_error_cm": paired(distance_cm, both)})


def ratio(numerator: float, denominator: float) -> float:
    """NaN where there is nothing to divide by."""
    return float(numerator / denominator) if denominator else float("nan")
