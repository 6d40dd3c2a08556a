"""Recorded points of other joint sets become the fifteen joints in the camera frame."""

import numpy as np
import pytest
from recorded_points import FRAMES, coco, imperial

from kpopnet.dance.joint_files.points import (
    COCO_NAMES,
    IMPERIAL_NAMES,
    NamedPoints,
    named_performance,
    plain_name,
)
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint


def joints_m(points: np.ndarray) -> np.ndarray:
    names = COCO_NAMES if points.shape[1] == 17 else IMPERIAL_NAMES
    return named_performance(NamedPoints(names, points, fps=60.0), "x").joints_m


def test_indices_of_points_are_the_published_ones():
    published = {5: "left_shoulder", 6: "right_shoulder", 9: "left_wrist", 16: "right_ankle"}
    assert {number: COCO_NAMES[number] for number in published} == published and len(COCO_NAMES) == 17
    published = {17: "right_shoulder", 8: "left_elbow", 0: "right_knee", 4: "left_foot", 11: "neck"}
    assert {number: IMPERIAL_NAMES[number] for number in published} == published and len(set(IMPERIAL_NAMES)) == 21


def test_names_of_every_joint_set_are_found():
    for name in ("WRIST_LEFT", "WristLeft", "left_wrist", "leftWrist", "lWrist", "Wrist.L"):
        assert plain_name(name) == "leftwrist"
    assert plain_name("SHOULDER_RIGHT") == plain_name("RShoulder") == "rightshoulder"
    assert plain_name("ShoulderCenter") == "shouldercenter" and plain_name("left_ear") == "leftear"


@pytest.mark.parametrize("made", [coco, imperial])
def test_joints_face_the_camera_in_metres_for_any_unit_and_axes(made):
    plain = joints_m(made())
    assert plain.shape == (FRAMES, 15, 3)
    assert plain[0, Joint.LEFT_HAND, 0] > plain[0, Joint.RIGHT_HAND, 0] + 0.5
    assert plain[0, Joint.HEAD, 1] < plain[0, Joint.TORSO, 1] < plain[0, Joint.LEFT_KNEE, 1]
    np.testing.assert_allclose(plain[0, Joint.TORSO, [0, 2]], [0, 2.5], atol=0.05)
    # Knees and hands are a little nearer to the camera than the hips: the dancer's front.
    assert plain[0, Joint.LEFT_KNEE, 2] < plain[0, Joint.LEFT_HIP, 2] - 0.03
    rise = np.diff(plain[:, Joint.RIGHT_HAND, 1])
    assert (rise < 0).all() and np.abs(np.diff(plain[:, Joint.LEFT_HAND], axis=0)).max() < 1e-6
    corners = plain[:, [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(axis=1)
    np.testing.assert_allclose(plain[:, Joint.TORSO], corners, atol=1e-6)
    for options in (
        {"heading_rad": 2.0},
        {"unit_m": 0.01},
        {"unit_m": 0.001, "z_up": True},
        {"heading_rad": -1.0, "z_up": True},
    ):
        np.testing.assert_allclose(joints_m(made(**options)), plain, atol=1e-4)
    down = made() * [1, -1, -1], made()[..., [0, 2, 1]] * [1, 1, -1]  # y down, z down, both right-handed
    for points in down:
        np.testing.assert_allclose(joints_m(points), plain, atol=1e-4)


def test_points_that_are_not_an_upright_person_are_rejected():
    points = coco()
    with pytest.raises(InputError, match="not a person's trunk in metres, centimetres or millimetres"):
        joints_m(points * 7)
    with pytest.raises(InputError, match="neither y nor z points up or down"):
        joints_m(points[..., [1, 0, 2]])
    with pytest.raises(InputError, match="no frame has both shoulders"):
        joints_m(np.full_like(points, np.nan))
