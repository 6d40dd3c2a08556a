"""People of round cones in several poses, with known joints, for tests of the fitted body."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones

from kpopnet.camera import CAMERAS
from kpopnet.geometry.depth_grid import build_depth_grid

CAMERA = CAMERAS["kinect_v1"]
POSES = {
    "y": {},
    "arms down": {"elevation_deg": -50, "abduction_deg": 8, "yaw_deg": 20},
    "elbows bent": {"elevation_deg": 10, "elbow_deg": 70, "yaw_deg": -15},
}


@pytest.fixture(scope="module", params=POSES)
def person(request):
    """A person of round cones: true joints, body, depth grid."""
    joints = cone_joints(**POSES[request.param])
    body = cone_body(joints)
    return joints, body, build_depth_grid(draw_cones(joints, body, CAMERA), CAMERA)


def moved(joints: np.ndarray, seed: int, least_m: float = 0.03, most_m: float = 0.05) -> np.ndarray:
    """Displaces every joint in a random direction by a distance in the given range."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=joints.shape)
    return joints + direction / np.linalg.norm(direction, axis=1, keepdims=True) * rng.uniform(
        least_m, most_m, (len(joints), 1)
    )
