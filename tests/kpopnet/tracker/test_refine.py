"""Joints detected by another estimator, refined by fitting the body."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones, moved

from kpopnet.camera import CAMERAS
from kpopnet.estimator import Estimate
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.tracker.body_estimate import BodyEstimate
from kpopnet.tracker.refine import FittedEstimator

CAMERA = CAMERAS["kinect_v1"]


class FixedEstimator:
    """An estimator that returns given joints."""

    name = "saying"

    def __init__(self, joints_m: np.ndarray, confidence: float = 0.75) -> None:
        self.detected = Estimate(joints_m.astype(np.float32), np.full(joints_m.shape[:2], confidence, np.float32))

    def estimate(self, depth_m: np.ndarray, camera: object) -> Estimate:
        return self.detected


@pytest.fixture(scope="module")
def film():
    """(8, 15, 3) true joints, (8, H, W) metres of a person who lowers the arms and turns, and joints with 3 to 5 cm error."""
    joints = np.stack([cone_joints(30 - 8 * t, yaw_deg=6 * t) for t in range(8)])
    body = cone_body(joints[0])
    depth_m = np.stack([draw_cones(pose, body, CAMERA) for pose in joints])
    return joints, depth_m, np.stack([moved(pose, seed) for seed, pose in enumerate(joints)])


def error_m(found: np.ndarray, joints: np.ndarray) -> float:
    return float(np.linalg.norm(found - joints, axis=-1).mean())


def test_refinement_reduces_the_error(film) -> None:
    joints, depth_m, detected = film
    found = FittedEstimator(FixedEstimator(detected)).estimate(depth_m, CAMERA)
    assert error_m(found.joints_camera_m, joints) < 0.65 * error_m(detected, joints)
    assert found.joints_camera_m.dtype == found.confidence.dtype == np.float32


def test_lengths_are_medians_over_frames(film) -> None:
    joints, depth_m, detected = film
    truth = cone_body(joints[0])
    person, grids = BodyEstimate(), [build_depth_grid(image, CAMERA) for image in depth_m]
    bodies = [person.update(pose, grid) for pose, grid in zip(detected, grids, strict=True)]
    off_one, *_, off = (np.abs(body.limbs_m - truth.limbs_m).mean() for body in bodies)
    assert off < 0.02 < off_one
    limbs_m = [cone_body(pose).limbs_m for pose in detected]
    np.testing.assert_allclose(bodies[-1].limbs_m, np.median(limbs_m, axis=0))


def test_a_pose_with_invalid_lengths_does_not_count(film) -> None:
    joints, depth_m, _ = film
    grid, person = build_depth_grid(depth_m[0], CAMERA), BodyEstimate()
    assert person.update(np.full((15, 3), np.nan), grid) is None
    body = person.update(joints[0], grid)
    assert person.update(np.full((15, 3), np.nan), grid) is body


def test_a_frame_depends_on_no_later_one(film) -> None:
    _, depth_m, detected = film
    whole = FittedEstimator(FixedEstimator(detected)).estimate(depth_m, CAMERA)
    for frames in (1, 5):
        part = FittedEstimator(FixedEstimator(detected[:frames])).estimate(depth_m[:frames], CAMERA)
        np.testing.assert_array_equal(part.joints_camera_m, whole.joints_camera_m[:frames])
        np.testing.assert_array_equal(part.confidence, whole.confidence[:frames])


def test_frames_with_missing_joints_or_without_a_person_are_unchanged(film) -> None:
    _, depth_m, detected = film
    detected, depth_m = detected.astype(np.float32), depth_m.copy()
    detected[2, 5], depth_m[4] = np.nan, 0
    depth_m[6] = 0
    depth_m[6, 100, 100] = 2.0
    found, confidence = FittedEstimator(FixedEstimator(detected)).estimate(depth_m, CAMERA)
    for frame in (2, 4, 6):
        np.testing.assert_array_equal(found[frame], detected[frame])
        assert (confidence[frame] == 0.75).all()
    assert (found[[0, 1, 3, 5, 7]] != detected[[0, 1, 3, 5, 7]]).all()
    assert (confidence[[0, 1, 3, 5, 7]] != 0.75).all()
