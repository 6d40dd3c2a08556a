"""People of round cones: the bodies that the tracker fits, rendered independently of it."""

import numpy as np
from spheres import draw_spheres, row
from y_people import y_joints

from kpopnet.camera import Camera
from kpopnet.geometry.body import PARTS, Body, body_from_model, neck_fraction
from kpopnet.geometry.cones import extend_joints
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import Joint

SPHERES = 24
PLACE_M = (0.0, 0.15, 3.2)


def cone_joints(*args, place_m: tuple[float, float, float] = PLACE_M, **kwargs) -> np.ndarray:
    """`y_joints` with the neck at the position of the tracker's bodies."""
    joints = y_joints(*args, place_m=place_m, **kwargs)
    shoulders = (joints[Joint.RIGHT_SHOULDER] + joints[Joint.LEFT_SHOULDER]) / 2
    fraction = neck_fraction(HumanModel.from_joints(joints).arms_raised)
    joints[Joint.NECK] = shoulders + fraction * (joints[Joint.HEAD] - shoulders)
    return joints


def cone_body(joints_m: np.ndarray) -> Body:
    return body_from_model(HumanModel.from_joints(joints_m))


def draw_cones(joints_camera_m: np.ndarray, body: Body, camera: Camera) -> np.ndarray:
    """(H, W) float32 metres: closely spaced spheres along every part, 0 elsewhere."""
    rows = extend_joints(np.asarray(joints_camera_m, np.float64), body.trunk_offsets_m)
    parts = zip(PARTS, body.radii_m, strict=True)
    return draw_spheres((ball for (a, b), radii in parts for ball in row(rows[a], rows[b], *radii, SPHERES)), camera)
