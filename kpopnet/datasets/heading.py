"""Heading of a person, computed from the joints."""

import numpy as np

from kpopnet.skeleton import Joint


def heading_rad(joints_camera_m: np.ndarray) -> np.ndarray:
    """(T,) float32 heading in radians: 0 facing the camera, positive to the person's left; NaN if unknown.

    The front direction is the cross product of the right-to-left vectors of hips and shoulders with the vector from hips to
    shoulders, projected on the x-z plane of the camera. Assumptions: the camera is upright; its tilt is unknown and
    ignored, so the result is meaningless for a camera that looks down.

    Args:
        joints_camera_m: (T, 15, 3) metres in the camera frame.
    """
    joints = joints_camera_m.astype(np.float64)
    hips = joints[:, Joint.LEFT_HIP] + joints[:, Joint.RIGHT_HIP]
    shoulders = joints[:, Joint.LEFT_SHOULDER] + joints[:, Joint.RIGHT_SHOULDER]
    to_left = joints[:, [Joint.LEFT_HIP, Joint.LEFT_SHOULDER]] - joints[:, [Joint.RIGHT_HIP, Joint.RIGHT_SHOULDER]]
    front = np.cross(to_left.sum(axis=1), shoulders - hips)
    towards_front, towards_camera = front[:, 0] + 1j * front[:, 2], -(hips[:, 0] + 1j * hips[:, 2])
    return np.angle(towards_front * towards_camera.conj()).astype(np.float32)
