"""tools/fit_confidence.py: the weights of the confidence are fitted by maximum likelihood to labelled joints."""

import numpy as np
from cone_people import cone_body, cone_joints, draw_cones, moved
from programs import tool

from kpopnet.camera import CAMERAS
from kpopnet.estimator import Estimate
from kpopnet.tracker.confidence import probability
from kpopnet.tracker.estimator import TrackerEstimator
from kpopnet.y_pose import initial_pose

CAMERA = CAMERAS["kinect_v1"]
fit = tool("fit_confidence")


def test_the_weights_maximise_the_likelihood_and_stay_finite() -> None:
    rng = np.random.default_rng(0)
    evidence = np.column_stack([np.ones(20000), rng.random((20000, 2))])
    hit = rng.random(20000) < probability(evidence, (-1.0, 3.0, -0.5))
    weights = fit.logistic_weights(evidence, hit)
    np.testing.assert_allclose(weights, (-1.0, 3.0, -0.5), atol=0.15)

    def likelihood(at: np.ndarray) -> float:
        chance = probability(evidence, tuple(at))
        return float(np.log(np.where(hit, chance, 1 - chance)).sum())

    for change in (*np.eye(3), *-np.eye(3)):
        assert likelihood(weights) > likelihood(weights + 0.02 * change)
    separable = np.column_stack([np.ones(10), np.arange(10) < 5])
    assert np.isfinite(fit.logistic_weights(separable, np.arange(10) < 5)).all()


class Fixed:
    """A network that knows the joints to a few centimetres."""

    name = "fixed"

    def __init__(self, joints_m: np.ndarray) -> None:
        self.joints_m = joints_m.astype(np.float32)

    def estimate(self, depth_m: np.ndarray, camera: object) -> Estimate:
        return Estimate(self.joints_m, np.full(self.joints_m.shape[:2], 0.8, np.float32))


def test_every_kind_of_estimate_gives_the_evidence_of_its_confidence(monkeypatch) -> None:
    """The evidence is that from which the estimators compute their confidence."""
    joints = np.stack([cone_joints(40 - 6 * t) for t in range(5)])
    body = cone_body(joints[0])
    depth_m = np.stack([draw_cones(pose, body, CAMERA) for pose in joints])
    monkeypatch.setattr(initial_pose, "MIN_FRONT_SCORE", 0.0)  # cones have no chin
    network = Fixed(np.stack([moved(pose, seed) for seed, pose in enumerate(joints)]))
    found = fit.labelled(depth_m, CAMERA, np.where(np.arange(15)[:, None] == 0, np.nan, joints), network)
    assert found.keys() == fit.SHIPPED.keys() and len(found["REFINED_WEIGHTS"][1]) == 70
    tracked = TrackerEstimator().estimate(depth_m, CAMERA)
    known = np.isfinite(tracked.joints_camera_m).all(axis=-1) & (np.arange(15) > 0)
    assert known.any()
    evidence, _ = found["TRACKED_WEIGHTS"]
    np.testing.assert_allclose(probability(evidence, fit.SHIPPED["TRACKED_WEIGHTS"]), tracked.confidence[known], atol=1e-6)
