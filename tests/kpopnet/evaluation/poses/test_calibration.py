"""The weights of the confidence are fitted by maximum likelihood to labelled joints of the trackers and the refinement."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from fitted_people import moved

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.evaluation.poses import calibration
from kpopnet.evaluation.poses.calibration import SHIPPED, Labelled, describe, gather, labelled, logistic_weights
from kpopnet.paper_tracker.init import checks
from kpopnet.tracker.estimator import TrackerEstimator
from kpopnet.tracker.fit.confidence import probability

CAMERA = CAMERAS["kinect_v1"]


def test_the_weights_are_recovered_and_maximise_the_likelihood() -> None:
    rng = np.random.default_rng(0)
    evidence = np.column_stack([np.ones(20000), rng.random((20000, 2))])
    hit = rng.random(20000) < probability(evidence, (-1.0, 3.0, -0.5))
    weights = logistic_weights(evidence, hit)
    np.testing.assert_allclose(weights, (-1.0, 3.0, -0.5), atol=0.15)

    def likelihood(at: np.ndarray) -> float:
        chance = probability(evidence, tuple(at))
        return float(np.log(np.where(hit, chance, 1 - chance)).sum())

    for change in (*np.eye(3), *-np.eye(3)):
        assert likelihood(weights) > likelihood(weights + 0.02 * change)


def test_separable_evidence_gives_finite_weights() -> None:
    evidence = np.column_stack([np.ones(10), np.arange(10) < 5])
    assert np.isfinite(logistic_weights(evidence, np.arange(10) < 5)).all()


def test_only_joints_with_truth_estimate_and_evidence_count() -> None:
    truth_m, joints_m, evidence = np.zeros((2, 15, 3)), np.full((2, 15, 3), 0.1), np.ones((2, 15, 4))
    truth_m[0, 0], joints_m[0, 1], evidence[1] = np.nan, np.nan, np.nan
    found = labelled(truth_m, joints_m, evidence)
    assert found.evidence.shape == (13, 4)
    np.testing.assert_allclose(found.error_m, 0.1 * np.sqrt(3))


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
    monkeypatch.setattr(checks, "MIN_FRONT_SCORE", 0.0)  # cones have no chin
    monkeypatch.setattr(calibration, "labelled_people", lambda folders: [(depth_m, CAMERA, joints)] * len(folders))
    found = gather(["one", "two"], Fixed(np.stack([moved(pose, seed) for seed, pose in enumerate(joints)])))
    assert found.keys() == SHIPPED.keys()
    assert len(found["REFINED_WEIGHTS"].error_m) == 2 * 75
    tracked = TrackerEstimator().estimate(depth_m, CAMERA)
    known = np.isfinite(tracked.joints_camera_m).all(axis=-1)
    assert known.any()
    evidence = found["TRACKED_WEIGHTS"].evidence
    expected = np.tile(tracked.confidence[known], 2)
    np.testing.assert_allclose(probability(evidence, SHIPPED["TRACKED_WEIGHTS"]), expected, atol=1e-6)


def test_the_text_is_that_of_the_constants() -> None:
    rng = np.random.default_rng(1)
    evidence = np.column_stack([np.ones(4000), rng.random((4000, 2))])
    hit = rng.random(4000) < probability(evidence, SHIPPED["TRACKED_WEIGHTS"])
    first, second = describe("TRACKED_WEIGHTS", Labelled(evidence, np.where(hit, 0.02, 0.2))).splitlines()
    weights = eval(first.partition(" = ")[2])
    np.testing.assert_allclose(weights, SHIPPED["TRACKED_WEIGHTS"], atol=0.6)
    assert "4000 joints" in second


@pytest.mark.parametrize("error_m", [0.02, 0.3])
def test_joints_of_one_kind_teach_nothing(error_m) -> None:
    with pytest.raises(InputError, match="nothing to learn from"):
        describe("TRACKED_WEIGHTS", Labelled(np.ones((5, 3)), np.full(5, error_m)))
