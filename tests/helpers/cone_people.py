"""People of round cones: the bodies that the tracker fits, rendered independently of it."""

import numpy as np
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
    depth = np.full((camera.height, camera.width), np.inf)
    rows = extend_joints(np.asarray(joints_camera_m, np.float64), body.trunk_offsets_m)
    for (a, b), (radius_a, radius_b) in zip(PARTS, body.radii_m, strict=True):
        for fraction in np.linspace(0, 1, SPHERES):
            x, y, z = rows[a] + fraction * (rows[b] - rows[a])
            radius = radius_a + fraction * (radius_b - radius_a)
            u, v, _ = camera.project(np.array((x, y, z)))
            reach = 1.1 * camera.fx * radius / z + 1
            u0, u1 = (int(np.clip(u + side * reach, 0, camera.width)) for side in (-1, 1))
            v0, v1 = (int(np.clip(v + side * reach, 0, camera.height)) for side in (-1, 1))
            aside = (np.arange(u0, u1) - camera.cx) * z / camera.fx - x
            below = (np.arange(v0, v1)[:, None] - camera.cy) * z / camera.fy - y
            squared = radius**2 - aside**2 - below**2
            box = depth[v0:v1, u0:u1]
            np.minimum(box, z - np.sqrt(np.maximum(squared, 0)), out=box, where=squared > 0)
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)
