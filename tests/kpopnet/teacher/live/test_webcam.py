"""Points that MediaPipe found in a browser as joints: an analytic person before a webcam, whole, cut and hidden."""

import math

import numpy as np
import pytest

from kpopnet.dance.joint_files.points import MEDIAPIPE_NAMES
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from kpopnet.sources.source import CameraAwayError
from kpopnet.teacher.live.webcam import CAMERA, WebcamCamera, WebcamEstimator, read_seen

PLACE_M = np.array([0.3, 0.1, 2.6])


def world_m() -> np.ndarray:
    """(33, 3) points of a person who faces the camera: their right is on the picture's left."""
    heights_m = {
        "shoulder": -0.5, "elbow": -0.25, "wrist": 0.0, "hip": 0.0, "knee": 0.4, "ankle": 0.8, "heel": 0.82, "index": 0.09,
    }  # fmt: skip
    points = []
    for name in MEDIAPIPE_NAMES:
        side = -1 if "right" in name else 1 if "left" in name else 0
        y = next((height for part, height in heights_m.items() if part in name), -0.68)
        y = 0.8 if "foot_index" in name else 0.09 if "pinky" in name or "thumb" in name else y
        z = -0.16 if "foot_index" in name else -0.08 if "nose" in name else 0.0
        points.append([side * (0.1 if "hip" in name or y > 0.3 else 0.2 if y > -0.6 else 0.07), y, z])
    return np.array(points)


def message(place_m: np.ndarray = PLACE_M, visibility: float = 0.9) -> dict:
    """What the page sends of that person at a place before the camera; points outside the picture are not visible."""
    uvz = CAMERA.project(world_m() + place_m)
    shares = (uvz[:, :2] + 0.5) / [CAMERA.width, CAMERA.height]
    inside = ((shares >= 0) & (shares <= 1)).all(axis=1)
    return {"points": np.column_stack([world_m(), shares, visibility * inside]).tolist(), "age_ms": 40.0}


def joints(given: dict):
    people = WebcamEstimator().update(read_seen(given).person, CAMERA)
    return people[0] if people else None


def test_a_person_has_the_joints_and_the_place_of_the_points():
    found, points = joints(message()), dict(zip(MEDIAPIPE_NAMES, world_m() + PLACE_M, strict=True))
    np.testing.assert_allclose(found.joints_camera_m[Joint.RIGHT_SHOULDER], points["right_shoulder"], atol=1e-3)
    np.testing.assert_allclose(found.joints_camera_m[Joint.LEFT_KNEE], points["left_knee"], atol=1e-3)
    np.testing.assert_allclose(found.joints_camera_m[Joint.HEAD], (points["left_ear"] + points["right_ear"]) / 2, atol=1e-3)
    palm = np.mean([points[f"left_{part}"] for part in ("wrist", "index", "pinky")], axis=0)
    np.testing.assert_allclose(found.joints_camera_m[Joint.LEFT_HAND], palm, atol=1e-3)
    middle = np.mean([points[f"{side}_{part}"] for side in ("left", "right") for part in ("hip", "shoulder")], axis=0)
    np.testing.assert_allclose(found.joints_camera_m[Joint.TORSO], middle, atol=1e-3)
    np.testing.assert_allclose(found.confidence, 0.9, atol=1e-3)


def test_a_person_of_whom_half_is_out_of_the_picture_is_not_sure():
    below = joints(message(PLACE_M + np.array([0, 1.0, 0])))
    assert below.confidence[[Joint.RIGHT_FOOT, Joint.LEFT_KNEE]].max() == 0
    assert 0 < below.confidence.max() < 0.5
    assert joints(message(PLACE_M + np.array([3.0, 0, 0]))) is None
    assert joints(message(visibility=0.0)) is None and joints({"points": [], "age_ms": 1}) is None


def test_the_time_is_that_of_the_picture_and_silence_is_told(monkeypatch):
    monkeypatch.setattr("kpopnet.teacher.live.webcam.time.monotonic", lambda: 100.0)
    assert read_seen(message()).taken == pytest.approx(99.96)
    monkeypatch.setattr("kpopnet.teacher.live.webcam.SILENCE_S", 0.01)
    camera = WebcamCamera()
    camera.keep(read_seen(message()))
    assert camera.read().person is not None
    with pytest.raises(CameraAwayError, match="allow it in the browser"):
        camera.read()


@pytest.mark.parametrize(
    "change",
    [
        {"points": "none"},
        {"points": [[0.0] * 6]},
        {"points": [[None] * 6] * 33},
        {"points": [[1e9] * 6] * 33},
        {"age_ms": -1.0},
        {"age_ms": math.inf},
    ],
)
def test_other_messages_are_refused(change):
    with pytest.raises(InputError, match="the webcam's points"):
        read_seen(message() | change)
