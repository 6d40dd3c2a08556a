"""The tracker as an estimator: its starts, its settings, and its input checks."""

import re

import numpy as np
import pytest
from cone_people import cone_joints, error_m, filmed

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.estimator import Start, first_label
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig

CAMERA = CAMERAS["kinect_v1"]
EMPTY = np.zeros((CAMERA.height, CAMERA.width), np.float32)


@pytest.fixture(scope="module")
def film():
    """(5, 15, 3) true joints and (5, H, W) metres of a person who lowers the arms."""
    joints = np.stack([cone_joints(30 - 5 * t) for t in range(5)])
    return joints, filmed(joints, CAMERA)


def test_frames_before_the_start_have_no_joints(film) -> None:
    joints, depth = film
    estimate = TrackerEstimator().estimate(depth, CAMERA, Start(2, joints[2]))
    assert estimate.joints_camera_m.dtype == estimate.confidence.dtype == np.float32
    assert estimate.joints_camera_m.shape == (5, NUM_JOINTS, 3) and estimate.confidence.shape == (5, NUM_JOINTS)
    assert np.isnan(estimate.joints_camera_m[:2]).all() and not estimate.confidence[:2].any()
    assert error_m(estimate.joints_camera_m[2:], joints[2:]).mean() < 0.03


def test_a_sequence_in_which_the_tracker_never_starts_is_reported(film, caplog) -> None:
    depth = np.zeros((40, CAMERA.height, CAMERA.width), np.float32)
    depth[:, :, 40:280] = np.rot90(film[1][-1:], axes=(1, 2))[:, 40:280]  # lying
    estimator = TrackerEstimator(TrackerEstimatorConfig(start="y_pose"))
    assert np.isnan(estimator.estimate(depth, CAMERA).joints_camera_m).all()
    assert re.search("no joints in 40 of 40 frames: in 40 of them.*no person took the Y pose.*with start=auto", caplog.text)
    caplog.clear()
    estimator.estimate(depth[:39], CAMERA)
    assert not caplog.records
    estimator.estimate(np.stack([EMPTY] * 40), CAMERA)
    assert "no joints in 40 of 40 frames: they are empty" in caplog.text


def test_the_first_label_is_the_first_complete_one(film) -> None:
    joints = film[0].copy()
    joints[0, Joint.LEFT_HAND] = joints[1, Joint.NECK, 2] = np.nan
    start = first_label(joints)
    assert start.frame == 2 and np.array_equal(start.joints_camera_m, joints[2])
    joints[2:, 0] = np.nan
    with pytest.raises(InputError, match="start=label needs a frame with all fifteen joints"):
        first_label(joints)
    with pytest.raises(InputError, match=r"labels of shape \(15, 3\): expected \(frames, 15, 3\)"):
        first_label(joints[0])


def test_a_saved_model_is_read(film, tmp_path) -> None:
    joints, depth = film
    model = HumanModel.from_joints(joints[0])
    model.save(tmp_path / "person.json")
    estimator = TrackerEstimator(TrackerEstimatorConfig(model=str(tmp_path / "person.json")))
    assert estimator.model == model
    assert error_m(estimator.estimate(depth, CAMERA, Start(0, joints[0])).joints_camera_m, joints).mean() < 0.03
    with pytest.raises(InputError, match=r"missing\.json"):
        TrackerEstimator(TrackerEstimatorConfig(model=str(tmp_path / "missing.json")))


def test_the_depth_of_a_whole_room_is_told(caplog) -> None:
    TrackerEstimator().estimate(np.full((2, CAMERA.height, CAMERA.width), 3.0, np.float32), CAMERA)
    assert "tracker: the depth shows a whole room" in caplog.text
