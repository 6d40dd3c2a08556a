"""Rotations of a whole pose, for the search of a lost one."""

import numpy as np

from kpopnet.skeleton import Joint


def rotate_about_spine(joints_m: np.ndarray, angle_rad: float) -> np.ndarray:
    """The pose rotated about the torso's long axis, positive to the person's left."""
    hips = (joints_m[Joint.RIGHT_HIP] + joints_m[Joint.LEFT_HIP]) / 2
    return _rotate(joints_m, joints_m[Joint.NECK] - hips, angle_rad)


def rotate_about_shoulders(joints_m: np.ndarray, angle_rad: float) -> np.ndarray:
    """The pose rotated about the line through the shoulders, positive forwards."""
    return _rotate(joints_m, joints_m[Joint.LEFT_SHOULDER] - joints_m[Joint.RIGHT_SHOULDER], angle_rad)


def _rotate(joints_m: np.ndarray, axis: np.ndarray, angle_rad: float) -> np.ndarray:
    """Rodrigues rotation about an axis through the torso's centre."""
    middle = joints_m[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]].mean(0)
    axis = axis / (np.linalg.norm(axis) + 1e-9)
    offset = joints_m - middle
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return middle + offset * cos + np.cross(axis, offset) * sin + np.outer(offset @ axis, axis) * (1 - cos)
