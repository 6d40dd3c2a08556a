"""The floor's plane before cameras of known pitch, roll and height."""

import numpy as np
import pytest
from extraction_scenes import CAMERA, noisy

from kpopnet.camera import CAMERAS, Camera
from kpopnet.paper_extraction.floor import find_floor

DELTA_F_M = 0.03


def plane(pitch_deg: float, roll_deg: float, height_m: float) -> np.ndarray:
    """(4,) the floor of a camera that looks down by a pitch."""
    pitch, roll = np.radians([pitch_deg, roll_deg])
    return np.array([np.sin(roll) * np.cos(pitch), -np.cos(roll) * np.cos(pitch), -np.sin(pitch), height_m])


def floor_and_wall(floor: np.ndarray, camera: Camera, wall_m: float = 4.0) -> np.ndarray:
    """(H, W) float32 metres: the floor up to a wall that faces the camera."""
    slope = camera.points(np.ones((camera.height, camera.width))) @ floor[:3]
    z = np.where(slope < 0, -floor[3] / np.minimum(slope, -1e-9), np.inf)
    return np.minimum(z, wall_m).astype(np.float32)


def error_m(found: np.ndarray, depth_m: np.ndarray, true: np.ndarray, camera: Camera = CAMERA) -> float:
    """Greatest distance of the floor's visible points from the plane that was found."""
    points = camera.points(depth_m)
    on_floor = np.abs(points @ true[:3] + true[3]) < 1e-3
    return np.abs(points[on_floor] @ found[:3] + found[3]).max()


@pytest.mark.parametrize("camera", [CAMERAS["kinect_v1"], CAMERAS["smmc10"]])
@pytest.mark.parametrize("pitch_deg", [-5, 15, 38])
@pytest.mark.parametrize(("roll_deg", "height_m"), [(8, 0.7), (-8, 1.8)])
def test_the_floor_is_found_before_a_tilted_camera(camera, pitch_deg, roll_deg, height_m):
    true = plane(pitch_deg, roll_deg, height_m)
    depth_m = floor_and_wall(true, camera)
    points = camera.points(depth_m)
    seen = (np.abs(points @ true[:3] + true[3]) < 1e-3).mean()
    found = find_floor(noisy(depth_m, 3), camera, DELTA_F_M, None)
    if seen < 0.02:
        assert found is None
    elif seen > 0.05:
        assert error_m(found, depth_m, true, camera) < DELTA_F_M


def test_the_floor_of_the_image_before_is_the_start_of_the_next_one():
    true = plane(10, 0, 1.2)
    depth_m = floor_and_wall(true, CAMERA)
    measured_m = noisy(depth_m, 0)
    for before in (plane(10.5, 0.5, 1.21), plane(70, 0, 1)):  # of the floor, and of a wall: it is searched for again
        assert error_m(find_floor(measured_m, CAMERA, DELTA_F_M, before), depth_m, true) < DELTA_F_M


def test_a_few_wrong_measurements_below_the_floor_do_not_move_it():
    true = plane(20, 0, 1.8)
    depth_m = floor_and_wall(true, CAMERA)
    measured_m = noisy(depth_m, 0)
    on_floor = np.abs(CAMERA.points(depth_m) @ true[:3] + true[3]) < 1e-3
    wrong = on_floor & (np.random.default_rng(0).random(depth_m.shape) < 0.02)
    measured_m[wrong] *= 2  # as of a mirror image
    assert error_m(find_floor(measured_m, CAMERA, DELTA_F_M, None), depth_m, true) < DELTA_F_M


@pytest.mark.parametrize("depth_m", [np.full((120, 160), 3, np.float32), np.zeros((120, 160), np.float32)])
def test_a_wall_or_nothing_is_no_floor(depth_m):
    assert find_floor(noisy(depth_m, 0), CAMERA, DELTA_F_M, None) is None
    assert find_floor(depth_m, CAMERA, DELTA_F_M, None) is None
