"""Joints of a webcam's points: the frame in which they are read, the network that comes with the package, and other files."""

from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
from dance_people import dance_joints_m
from hypothesis import given
from hypothesis import strategies as st

from kpopnet.dance.joint_files.mediapipe import CAMERA, seen_joints
from kpopnet.errors import InputError
from kpopnet.networks.lifting import HIPS, READ, Lifting, frame_along, sighting
from kpopnet.skeleton import MIRROR, NUM_JOINTS, Joint
from kpopnet.teacher.live.webcam import read_seen
from kpopnet.weights import shipped

POINTS = Path(__file__).parents[2] / "assets" / "webcam_points.npz"


def seen(joints_m):
    """A picture's sighting of (15, 3) joints before a camera, all of whose depth is guessed too small."""
    about_hips_m = joints_m - joints_m[HIPS].mean(axis=0)
    distance_m = np.linalg.norm(joints_m[HIPS].mean(axis=0))
    rays = joints_m[:, :2] / joints_m[:, 2:]
    return sighting(about_hips_m * (1, 1, 0.5), rays, np.full(NUM_JOINTS, 0.95), distance_m)[0]


def found_in_pictures():
    """Sightings of pictures in which MediaPipe found a person, and the (15, 3) true joints about the torso in their frames."""
    with np.load(POINTS) as stored:
        points, true_m = stored["points"], stored["true_m"]
    people = (seen_joints(read_seen({"points": one.tolist(), "age_ms": 0.0}).person, CAMERA) for one in points)
    return [
        (one.sighting, (joints_m - joints_m[Joint.TORSO]) @ one.to_ray.T) for one, joints_m in zip(people, true_m, strict=True)
    ]


@given(st.floats(-0.7, 0.7), st.floats(-0.5, 0.5))
def test_the_frame_looks_along_the_ray_and_is_level(across, down):
    ray = np.array([across, down, 1.0])
    to_ray = frame_along(ray)
    np.testing.assert_allclose(to_ray @ to_ray.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(to_ray) > 0 and to_ray[0, 1] == 0  # x is level
    np.testing.assert_allclose(to_ray @ ray, [0, 0, np.linalg.norm(ray)], atol=1e-12)


def test_a_person_off_the_axis_is_seen_as_one_on_it_is():
    """The same person, seen along the same direction, in another place of the picture: higher, which is all that differs."""
    joints_m = dance_joints_m(0)[40] - dance_joints_m(0)[40, HIPS].mean(axis=0)
    rays = np.array([[0, 0, 1], [0.4, -0.2, 1.0]])
    near, far = (seen(joints_m @ frame_along(ray) + 3 * ray / np.linalg.norm(ray)) for ray in rays)
    np.testing.assert_allclose(near.points_m[:, :2], far.points_m[:, :2], atol=1e-3)
    np.testing.assert_allclose([near.elevation_rad, far.elevation_rad], [0, np.arctan2(0.2, np.hypot(0.4, 1))], atol=1e-3)


def test_the_network_of_the_package_finds_joints_that_mediapipe_misplaces_and_knows_which():
    network, errors_m, chances = Lifting.load(shipped("lifting")[0]), [], []
    for picture, expected_m in found_in_pictures():
        joints_m, chance = network(picture)
        points_m = picture.points_m - picture.points_m[Joint.TORSO]
        errors_m.append([np.linalg.norm(one - expected_m, axis=1) for one in (points_m, joints_m)])
        chances.append(chance)
    placed_m, lifted_m = np.swapaxes(errors_m, 0, 1)
    assert lifted_m.mean() < 0.8 * placed_m.mean() and (lifted_m < 0.1).mean() > (placed_m < 0.1).mean() + 0.08
    sure = np.array(chances) > 0.8
    assert (lifted_m[sure] < 0.1).mean() > 0.85 and (lifted_m[~sure] < 0.1).mean() < 0.6


def test_a_person_in_the_mirror_has_nearly_the_joints_in_the_mirror_also_in_a_dark_picture():
    """Films show all points well: a network whose numbers such a picture leaves far behind puts hands half a metre off."""
    network, apart_m = Lifting.load(shipped("lifting")[0]), []
    for picture, _ in found_in_pictures():
        dark = picture._replace(visibility=0.8 * picture.visibility)
        mirrored = dark._replace(points_m=dark.points_m[MIRROR] * (-1, 1, 1), visibility=dark.visibility[MIRROR])
        in_mirror_m = network(mirrored)[0][MIRROR] * (-1, 1, 1)
        apart_m.append([np.linalg.norm(one - network(picture)[0], axis=1) for one in (network(dark)[0], in_mirror_m)])
    assert np.mean(apart_m) < 0.04 and np.max(apart_m) < 0.3


def test_another_network_is_refused(tmp_path):
    file = tmp_path / "other.safetensors"
    file.write_bytes(safetensors.numpy.save({"0.weight": np.zeros((60, READ - 1)), "0.bias": np.zeros(4 * NUM_JOINTS)}))
    with pytest.raises(InputError, match=r"other\.safetensors: .*no network that lifts joints"):
        Lifting.load(file)
