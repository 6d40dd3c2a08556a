"""Results of an estimator for tests of metrics."""

import numpy as np

from kpopnet.evaluation.poses.metrics import PoseResults


def pose_results(truth_m: np.ndarray, estimate_m: np.ndarray, **given) -> PoseResults:
    """Frames of one sequence in which every joint is visible and every estimate sure, but for what is given."""
    frames = len(truth_m)
    sequence = np.array([f"s{number}" for number in given.pop("sequence", np.zeros(frames, int))])
    usual = {
        "confidence": np.isfinite(estimate_m).all(-1).astype(np.float32),
        "visible": np.isfinite(truth_m).all(-1),
        "sequence": sequence,
        "yaw_rad": np.full(frames, np.nan),
        "unit": sequence,
        "given": np.zeros(frames, bool),
        "person": np.full(frames, ""),
    }
    return PoseResults(truth_m, estimate_m, **(usual | given))


def results_of_errors(error_m: np.ndarray, **given) -> PoseResults:
    """Results with (N, 15) errors in metres, NaN without a true position and infinite where missing."""
    truth_m = np.where(np.isnan(error_m)[..., None], np.nan, np.zeros((*error_m.shape, 3)))
    estimate_m = np.where(np.isfinite(error_m), error_m, np.nan)[..., None] * np.array([0.6, 0.0, 0.8])
    estimate_m[np.isnan(error_m)] = 0.0
    return pose_results(truth_m, estimate_m, visible=np.ones(error_m.shape, bool), **given)
