"""Refines the joints of another estimator: the body is fitted to the depth with a prior at the detected joints.

Beyond the paper. A network on single frames resolves front and back, left and right, with an error of a few centimetres.
The fit locates the surface to a centimetre, but diverges from a distant start.
"""

import numpy as np

from kpopnet.camera import Camera, sequence_in_metres, subsampled
from kpopnet.estimator import Estimate, Estimator, check_estimator
from kpopnet.geometry.depth_grid import MIN_POINTS, build_depth_grid
from kpopnet.tracker.body_estimate import DETECTION_PRIOR_WEIGHT, FIT_ITERATIONS, BodyEstimate
from kpopnet.tracker.confidence import REFINED_WEIGHTS, fit_score, probability, refined_evidence
from kpopnet.tracker.fit import fit


class FittedEstimator:
    """Implements kpopnet.estimator.Estimator. A frame's joints depend on this frame and on those before it.

    The confidence is the estimated probability that the refined joint is within 10 cm of the truth, from the wrapped
    estimator's, which must mean the same, and from the fit (kpopnet.tracker.confidence).
    """

    name = "fitted_network"

    def __init__(self, estimator: Estimator) -> None:
        """Wraps the estimator whose joints are refined."""
        check_estimator("estimator", estimator)
        self.estimator = estimator

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """See `kpopnet.estimator.Estimator`. Frames with missing joints or with fewer than `MIN_POINTS` points are not refined,
        and keep the estimator's joints and confidence.
        """
        depth_m, camera = subsampled(sequence_in_metres(depth_m, camera), camera)
        detected = self.estimator.estimate(depth_m, camera)
        joints_m, evidence = refine(detected, depth_m, camera)
        refined = np.isfinite(evidence).all(axis=-1)
        confidence = np.where(refined, probability(evidence, REFINED_WEIGHTS), detected.confidence)
        return Estimate(joints_m, confidence.astype(np.float32))


def refine(detected: Estimate, depth_m: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """`refine_frame` of each of T frames: (T, 15, 3) float32 joints in metres, and (T, 15, 4) their `refined_evidence`."""
    body = BodyEstimate()
    joints_m = detected.joints_camera_m.copy()
    evidence = np.full((*joints_m.shape[:2], len(REFINED_WEIGHTS)), np.nan)
    for t in range(len(joints_m)):
        frame = Estimate(detected.joints_camera_m[t], detected.confidence[t])
        joints_m[t], evidence[t] = refine_frame(body, frame, depth_m[t], camera)
    return joints_m, evidence


def refine_frame(
    person: BodyEstimate, detected: Estimate, depth_m: np.ndarray, camera: Camera
) -> tuple[np.ndarray, np.ndarray]:
    """Refines the detected (15, 3) joints, with (15,) confidence, of a person's next frame, which is added to the person.

    The depth is (H, W) float32 metres of the person, 0 elsewhere. (15, 3) refined joints in metres and (15, 4) their
    `refined_evidence`, or the detected joints and NaN.
    """
    detected_m, confidence = detected
    not_refined = detected_m, np.full((len(detected_m), len(REFINED_WEIGHTS)), np.nan)
    if not np.isfinite(detected_m).all():
        return not_refined
    grid = build_depth_grid(depth_m, camera)
    body = person.update(detected_m, grid) if len(grid.points_m) >= MIN_POINTS else None
    if body is None:
        return not_refined
    fitted_m = fit(detected_m, grid, body, FIT_ITERATIONS, prior_weight=DETECTION_PRIOR_WEIGHT)
    moved_m = np.linalg.norm(fitted_m - detected_m, axis=-1)
    return fitted_m, refined_evidence(confidence, fit_score(fitted_m, grid, body), moved_m)


def compile_refining() -> None:
    """Has numba compile the kernels of `refine_frame`, and keep them in its cache."""
    x_m = 0, 0, -0.2, 0.2, -0.4, 0.4, -0.5, 0.5, 0, -0.1, 0.1, -0.1, 0.1, -0.1, 0.1  # in the order of `Joint`
    y_m = -0.6, -0.4, -0.4, -0.4, -0.2, -0.2, 0, 0, 0, 0.1, 0.1, 0.5, 0.5, 0.9, 0.9
    standing_m = np.stack([x_m, y_m, np.full(len(x_m), 2.0)], axis=-1).astype(np.float32)
    wall_m, camera = np.full((60, 80), 1.9, np.float32), Camera.from_fov(60.0, 80, 60)
    refine_frame(BodyEstimate(), Estimate(standing_m, np.ones(len(standing_m))), wall_m, camera)
