"""People of round cones in several poses, whose truth is known, for tests of what fits a body to them."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones

from kpopnet.camera import CAMERAS
from kpopnet.tracker.cells import cells_of

CAMERA = CAMERAS["kinect_v1"]
POSES = {
    "y": {},
    "arms down": {"elevation_deg": -50, "spread_deg": 8, "yaw_deg": 20},
    "elbows bent": {"elevation_deg": 10, "elbow_deg": 70, "yaw_deg": -15},
}


@pytest.fixture(scope="module", params=POSES)
def person(request):
    """A person of round cones: true joints, body, cells."""
    joints = cone_joints(**POSES[request.param])
    body = cone_body(joints)
    return joints, body, cells_of(draw_cones(joints, body, CAMERA), CAMERA)


def moved(joints: np.ndarray, seed: int, least_m: float = 0.03, most_m: float = 0.05) -> np.ndarray:
    """Every joint somewhere else, so far away."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=joints.shape)
    return joints + way / np.linalg.norm(way, axis=1, keepdims=True) * rng.uniform(least_m, most_m, (len(joints), 1))
