"""Points that MediaPipe found in a browser as joints: an analytic person before a webcam, whole, cut and hidden."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpopnet.dance.joint_files.mediapipe import CAMERA, EXCHANGED
from kpopnet.dance.joint_files.points import MEDIAPIPE_NAMES
from kpopnet.errors import InputError
from kpopnet.networks.lifting import READ, Lifting
from kpopnet.skeleton import Joint
from kpopnet.sources.source import CameraAwayError
from kpopnet.teacher.live.webcam import WebcamCamera, WebcamEstimator, read_seen

PLACE_M, ON_AXIS_M = np.array([0.3, 0.1, 2.6]), np.array([0.0, 0.0, 2.6])


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


def message(place_m: np.ndarray = PLACE_M, visibility: float = 0.9, turned_deg: float = 0.0) -> dict:
    """What the page sends of that person, turned, at a place before the camera; points outside the picture are not visible."""
    points_m = world_m() @ Rotation.from_euler("y", turned_deg, degrees=True).as_matrix().T
    uvz = CAMERA.project(points_m + place_m)
    shares = (uvz[:, :2] + 0.5) / [CAMERA.width, CAMERA.height]
    inside = ((shares >= 0) & (shares <= 1)).all(axis=1)
    return {"points": np.column_stack([points_m, shares, visibility * inside]).tolist(), "age_ms": 40.0}


def seen_the_other_way(given: dict) -> dict:
    """What the page sends where MediaPipe takes the same person for one who looks the other way."""
    return {"points": (np.array(given["points"])[EXCHANGED] * [1, 1, -1, 1, 1, 1]).tolist(), "age_ms": given["age_ms"]}


@pytest.fixture
def joints(monkeypatch):
    """Finds a message's person, by a network that changes nothing."""
    layers = {"0.weight": np.zeros((60, READ)), "0.bias": np.zeros(60)}
    monkeypatch.setattr(Lifting, "load", lambda _: Lifting(layers))

    def found(given: dict):
        people = WebcamEstimator().update(read_seen(given).person, CAMERA)
        return people[0] if people else None

    return found


def test_a_person_has_the_joints_and_the_place_of_the_points_and_is_where_the_picture_shows_them(joints):
    found, points = joints(message(ON_AXIS_M)), dict(zip(MEDIAPIPE_NAMES, world_m() + ON_AXIS_M, strict=True))
    expected_m = {
        Joint.RIGHT_SHOULDER: points["right_shoulder"],
        Joint.LEFT_KNEE: points["left_knee"],
        Joint.HEAD: (points["left_ear"] + points["right_ear"]) / 2,
        Joint.LEFT_HAND: np.mean([points[f"left_{part}"] for part in ("wrist", "index", "pinky")], axis=0),
        Joint.TORSO: np.mean([points[f"{side}_{part}"] for side in ("left", "right") for part in ("hip", "shoulder")], axis=0),
    }
    torso_m = found.joints_camera_m[Joint.TORSO]
    np.testing.assert_allclose(torso_m, expected_m[Joint.TORSO], atol=0.05)
    for joint, place_m in expected_m.items():
        np.testing.assert_allclose(found.joints_camera_m[joint] - torso_m, place_m - expected_m[Joint.TORSO], atol=1e-2)
    np.testing.assert_allclose(found.confidence, 0.5, atol=1e-6)  # what such a network says
    moved_m = joints(message(PLACE_M)).joints_camera_m - found.joints_camera_m
    np.testing.assert_allclose(np.median(moved_m, axis=0), PLACE_M - ON_AXIS_M, atol=0.03)


def test_a_person_of_whom_half_is_out_of_the_picture_is_not_sure(joints):
    below = joints(message(PLACE_M + np.array([0, 1.0, 0])))
    assert below.confidence[[Joint.RIGHT_FOOT, Joint.LEFT_KNEE]].max() == 0
    assert 0 < below.confidence.max() < 0.3
    assert joints(message(PLACE_M + np.array([3.0, 0, 0]))) is None
    assert joints(message(visibility=0.0)) is None and joints({"points": [], "age_ms": 1}) is None


def test_a_person_close_to_a_laptop_is_found_though_not_sure(joints):
    """Of whom head, shoulders and elbows are in the picture."""
    shown = message(ON_AXIS_M)
    for name, point in zip(MEDIAPIPE_NAMES, shown["points"], strict=True):
        point[5] *= not any(part in name for part in ("wrist", "pinky", "index", "thumb", "hip", "knee", "ankle", "heel"))
    found = joints(shown)
    np.testing.assert_allclose(found.joints_camera_m[Joint.TORSO], [0, -0.25, 2.6], atol=0.1)
    assert 0 < found.confidence[Joint.HEAD] < 0.3 and found.confidence[Joint.LEFT_HAND] == 0


def sides(messages: list[dict], fps: float = 10.0) -> np.ndarray:
    """(T,) by how much the left shoulder is to the right of the right one in each picture, metres."""
    estimator = WebcamEstimator()
    poses = [estimator.update(read_seen(one).person, CAMERA, number / fps)[0] for number, one in enumerate(messages)]
    joints_m = np.array([pose.joints_camera_m for pose in poses])
    return joints_m[:, Joint.LEFT_SHOULDER, 0] - joints_m[:, Joint.RIGHT_SHOULDER, 0]


@pytest.mark.parametrize("fps", [7.0, 15.0])
@pytest.mark.parametrize("wrong", [(3,), (2, 5, 8), (4, 5), (9,)])
def test_sides_that_are_exchanged_in_single_pictures_are_exchanged_back(joints, wrong, fps):
    moving = [message(PLACE_M + np.array([0.03 * number, 0, 0])) for number in range(12)]
    mixed = [seen_the_other_way(one) if number in wrong else one for number, one in enumerate(moving)]
    np.testing.assert_allclose(sides(mixed, fps), sides(moving, fps), atol=1e-6)
    assert min(sides(mixed, fps)) > 0.3


def test_who_turns_round_is_not_exchanged_and_who_is_seen_so_for_long_is_believed(joints):
    turning = sides([message(turned_deg=20.0 * min(number, 9)) for number in range(20)])
    assert turning[0] > 0.3 and max(turning[9:]) < -0.3
    first = sides([seen_the_other_way(message())] + 11 * [message()])
    assert first[0] < 0 < min(first[1:])
    for_long = sides(5 * [message()] + 20 * [seen_the_other_way(message())])
    assert min(for_long[:7]) > 0.3 and max(for_long[-8:]) < -0.3
    apart = sides([message(), seen_the_other_way(message())], fps=1.0)
    assert apart[0] > 0 > apart[1]


def test_the_time_is_that_of_the_picture_and_silence_is_told(monkeypatch):
    monkeypatch.setattr("kpopnet.teacher.live.webcam.time.monotonic", lambda: 100.0)
    assert read_seen(message()).taken == pytest.approx(99.96)
    monkeypatch.setattr("kpopnet.teacher.live.webcam.SILENCE_S", 0.01)
    camera = WebcamCamera()
    camera.keep(read_seen(message()))
    assert camera.read().person is not None
    with pytest.raises(CameraAwayError, match="allow it in the browser"):
        camera.read()


POINTS = ("none", [[0.0] * 6], [[None] * 6] * 33, [[1e9] * 6] * 33)


def test_other_messages_are_refused():
    for change in (*({"points": one} for one in POINTS), {"age_ms": -1.0}, {"age_ms": math.inf}):
        with pytest.raises(InputError, match="the webcam's points"):
            read_seen(message() | change)
