"""People of round cones as a depth grid shows them."""

import numpy as np
from cone_people import cone_body, draw_cones

from kpopnet.camera import CAMERAS
from kpopnet.geometry.body import Body
from kpopnet.geometry.depth_grid import DepthGrid, build_depth_grid

CAMERA = CAMERAS["kinect_v1"]


def seen(joints: np.ndarray) -> tuple[Body, DepthGrid]:
    """The body of a person with these joints, and the grid over its depth image."""
    body = cone_body(joints)
    return body, build_depth_grid(draw_cones(joints, body, CAMERA), CAMERA)


def lengths_m(joints: np.ndarray) -> np.ndarray:
    """(J, J) distances between joints."""
    return np.linalg.norm(joints[:, None] - joints[None], axis=-1)
