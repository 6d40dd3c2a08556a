"""People of round cones: the bodies that the tracker fits, rendered independently of it."""

import numpy as np
import pytest
from spheres import draw_spheres, row
from y_people import y_joints

from kpopnet.camera import CAMERAS, Camera
from kpopnet.geometry.body import PARTS, Body, body_from_model, neck_fraction
from kpopnet.geometry.cones import extend_joints
from kpopnet.geometry.depth_grid import DepthGrid, build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import Joint

CAMERA = CAMERAS["kinect_v1"]
SPHERES = 24
PLACE_M = (0.0, 0.15, 3.2)
POSES = {
    "y": {},
    "arms down": {"elevation_deg": -50, "abduction_deg": 8, "yaw_deg": 20},
    "elbows bent": {"elevation_deg": 10, "elbow_deg": 70, "yaw_deg": -15},
}


def cone_joints(*args, place_m: tuple[float, float, float] = PLACE_M, **kwargs) -> np.ndarray:
    """`y_joints` with the neck at the position of the tracker's bodies."""
    joints = y_joints(*args, place_m=place_m, **kwargs)
    shoulders = (joints[Joint.RIGHT_SHOULDER] + joints[Joint.LEFT_SHOULDER]) / 2
    fraction = neck_fraction(HumanModel.from_joints(joints).arms_raised)
    joints[Joint.NECK] = shoulders + fraction * (joints[Joint.HEAD] - shoulders)
    return joints


def cone_body(joints_m: np.ndarray) -> Body:
    return body_from_model(HumanModel.from_joints(joints_m))


def error_m(found_m: np.ndarray, joints_m: np.ndarray) -> np.ndarray:
    """(...) distances between (..., 3) joints."""
    return np.linalg.norm(found_m - joints_m, axis=-1)


def filmed(joints_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(T, H, W) float32 metres of a person with the lengths of the first of (T, 15, 3) poses."""
    return np.stack([draw_cones(pose, cone_body(joints_m[0]), camera) for pose in joints_m])


def draw_cones(joints_camera_m: np.ndarray, body: Body, camera: Camera) -> np.ndarray:
    """(H, W) float32 metres: closely spaced spheres along every part, 0 elsewhere."""
    rows = extend_joints(np.asarray(joints_camera_m, np.float64), body.trunk_offsets_m)
    parts = zip(PARTS, body.radii_m, strict=True)
    return draw_spheres((ball for (a, b), radii in parts for ball in row(rows[a], rows[b], *radii, SPHERES)), camera)


def tracked(tracker, depth_m: np.ndarray, start_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 15, 3) joints in metres and (T, 15) confidences of (T, H, W) images, from a given first pose on."""
    tracker.start(start_m)
    joints, confidence = zip(*[tracker.track(image) for image in depth_m], strict=True)
    return np.array(joints), np.array(confidence)


def seen(joints: np.ndarray) -> tuple[Body, DepthGrid]:
    """The body of a person with these joints, and the grid over its depth image."""
    body = cone_body(joints)
    return body, build_depth_grid(draw_cones(joints, body, CAMERA), CAMERA)


@pytest.fixture(scope="module", params=POSES)
def person(request):
    """A person of round cones: true joints, body, depth grid."""
    joints = cone_joints(**POSES[request.param])
    return joints, *seen(joints)


def moved(joints: np.ndarray, seed: int, least_m: float = 0.03, most_m: float = 0.05) -> np.ndarray:
    """Displaces every joint in a random direction by a distance in the given range."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=joints.shape)
    distances_m = rng.uniform(least_m, most_m, (len(joints), 1))
    return joints + direction / np.linalg.norm(direction, axis=1, keepdims=True) * distances_m
