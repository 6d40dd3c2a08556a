"""Where people face, told from their joints."""

import numpy as np

from kpopnet.skeleton import Joint


def heading_rad(joints_camera_m: np.ndarray) -> np.ndarray:
    """(T,) float32: where the person's front points, 0 at the camera, positive to the person's left; NaN if unknown.

    By the lines of hips and shoulders and the trunk between them, in the plane of the camera's x and z: the camera is taken
    to stand upright. Its tilt is not known and left out; of one that looks down this is nonsense.
    """
    joints = joints_camera_m.astype(np.float64)
    hips = joints[:, Joint.LEFT_HIP] + joints[:, Joint.RIGHT_HIP]
    shoulders = joints[:, Joint.LEFT_SHOULDER] + joints[:, Joint.RIGHT_SHOULDER]
    to_left = joints[:, [Joint.LEFT_HIP, Joint.LEFT_SHOULDER]] - joints[:, [Joint.RIGHT_HIP, Joint.RIGHT_SHOULDER]]
    front = np.cross(to_left.sum(axis=1), shoulders - hips)
    towards_front, towards_camera = front[:, 0] + 1j * front[:, 2], -(hips[:, 0] + 1j * hips[:, 2])
    return np.angle(towards_front * towards_camera.conj()).astype(np.float32)
