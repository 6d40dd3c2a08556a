"""Joints that another estimator says, fitted to the depth."""

from collections.abc import Callable

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from fitted_people import moved

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate
from kpopnet.tracker.cells import cells_of
from kpopnet.tracker.fitted import FittedEstimator, measured_body
from kpopnet.tracker.fitting import fit

CAMERA = CAMERAS["kinect_v1"]


class Saying:
    """An estimator that says what it was told to."""

    name = "saying"

    def __init__(self, joints_m: np.ndarray, confidence: float = 0.75) -> None:
        self.said = Estimate(joints_m.astype(np.float32), np.full(joints_m.shape[:2], confidence, np.float32))

    def estimate(self, depth_m: np.ndarray, camera: object) -> Estimate:
        return self.said


@pytest.fixture(scope="module")
def film():
    """(8, 15, 3) true joints, (8, H, W) metres of somebody who lowers the arms and turns, and joints 3 to 5 cm off."""
    joints = np.stack([cone_joints(30 - 8 * t, yaw_deg=6 * t) for t in range(8)])
    body = cone_body(joints[0])
    depth_m = np.stack([draw_cones(pose, body, CAMERA) for pose in joints])
    return joints, depth_m, np.stack([moved(pose, seed) for seed, pose in enumerate(joints)])


def error_m(found: np.ndarray, joints: np.ndarray) -> float:
    return float(np.linalg.norm(found - joints, axis=-1).mean())


def test_joints_a_little_off_come_nearer(film) -> None:
    joints, depth_m, said = film
    found = FittedEstimator(Saying(said)).estimate(depth_m, CAMERA)
    assert error_m(found.joints_camera_m, joints) < 0.65 * error_m(said, joints)
    assert found.joints_camera_m.dtype == np.float32 and (found.confidence == 0.75).all()


def test_lengths_are_the_medians_over_frames(film) -> None:
    joints, depth_m, said = film
    truth = cone_body(joints[0])
    body = measured_body((pose, cells_of(image, CAMERA)) for pose, image in zip(said, depth_m, strict=True))
    one = measured_body([(said[0], cells_of(depth_m[0], CAMERA))])
    off, off_one = (np.abs(b.limbs_m - truth.limbs_m).mean() for b in (body, one))
    assert off < 0.02 < off_one
    assert measured_body([]) is None
    assert measured_body([(np.full((15, 3), np.nan), cells_of(depth_m[0], CAMERA))]) is None


def test_the_more_a_start_weighs_the_less_it_is_left(film) -> None:
    joints, depth_m, said = film
    cells, body = cells_of(depth_m[0], CAMERA), cone_body(joints[0])
    ways = [error_m(fit(said[0], cells, body, 4, start_weight=weight), said[0]) for weight in (0.01, 0.1, 1.0, 1e4)]
    assert ways == sorted(ways, reverse=True) and ways[-1] < 1e-3 < 0.01 < ways[0]


def test_missing_joints_stay_missing_and_frames_of_nobody_as_they_are(film) -> None:
    _, depth_m, said = film
    said, depth_m = said.astype(np.float32), depth_m.copy()
    said[2, 5], depth_m[4] = np.nan, 0
    depth_m[6] = 0
    depth_m[6, 100, 100] = 2.0
    found = FittedEstimator(Saying(said)).estimate(depth_m, CAMERA).joints_camera_m
    for frame in (2, 4, 6):
        np.testing.assert_array_equal(found[frame], said[frame])
    assert (found[[0, 1, 3, 5, 7]] != said[[0, 1, 3, 5, 7]]).all()


@pytest.mark.parametrize("change", [lambda depth_m: depth_m[0], lambda depth_m: depth_m > 0])
def test_what_is_no_depth_is_refused(film, change: Callable[[np.ndarray], np.ndarray]) -> None:
    _, depth_m, said = film
    with pytest.raises(InputError):
        FittedEstimator(Saying(said)).estimate(change(depth_m), CAMERA)
