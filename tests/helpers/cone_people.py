"""People of round cones: the bodies that the tracker fits, rendered independently of it."""

import numpy as np
from numba import njit
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
    fractions = np.linspace(0, 1, SPHERES)[:, None]
    for (a, b), (radius_a, radius_b) in zip(PARTS, body.radii_m, strict=True):
        centres_m, radii_m = rows[a] + fractions * (rows[b] - rows[a]), radius_a + fractions[:, 0] * (radius_b - radius_a)
        _draw_spheres(depth, centres_m, radii_m, np.array([camera.fx, camera.fy, camera.cx, camera.cy]))
    return np.where(np.isfinite(depth), depth, 0).astype(np.float32)


@njit(cache=True)
def _draw_spheres(depth, centres, radii, intrinsics):
    """Draws spheres into an (H, W) depth image wherever they are nearer."""
    fx, fy, cx, cy = intrinsics
    height, width = depth.shape
    for i in range(len(centres)):
        (x, y, z), radius = centres[i], radii[i]
        reach = 1.1 * fx * radius / z + 1
        u, v = fx * x / z + cx, fy * y / z + cy
        for row in range(max(int(v - reach), 0), min(max(int(v + reach), 0), height)):
            for column in range(max(int(u - reach), 0), min(max(int(u + reach), 0), width)):
                squared = radius**2 - ((column - cx) * z / fx - x) ** 2 - ((row - cy) * z / fy - y) ** 2
                if squared > 0:
                    depth[row, column] = min(depth[row, column], z - np.sqrt(squared))
