"""A dance as it was seen: joints over time, and how sure each is."""

import numpy as np

from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS


class Performance:
    """A dance as joints over time.

    Attributes:
        joints_m: (T, 15, 3) float64 in the camera frame, NaN where a joint is missing.
        times_s: (T,) float64, strictly increasing, on the clock that the music runs by: the teacher's and the learner's zero
            are the same instant of it.
        confidence: (T, 15) float64 in 0..1, how sure each joint is; 0 where it is missing. What is less sure counts less.
    """

    def __init__(self, joints_m: np.ndarray, times_s: np.ndarray, confidence: np.ndarray | None = None) -> None:
        """Without a confidence all joints that are there are sure."""
        joints_m, times_s = np.array(joints_m, np.float64), np.array(times_s, np.float64)
        if joints_m.ndim != 3 or joints_m.shape[1:] != (NUM_JOINTS, 3) or not len(joints_m):
            raise InputError(f"joints of shape {joints_m.shape}: expected (frames, {NUM_JOINTS}, 3) and at least one frame")
        if times_s.shape != joints_m.shape[:1]:
            raise InputError(f"{len(joints_m)} frames with times of shape {times_s.shape}: expected one time a frame")
        right = np.isfinite(times_s)
        right[1:] &= ~(times_s[1:] <= times_s[:-1])
        if not right.all():
            wrong = int(np.argmin(right))
            raise InputError(f"frame {wrong} has time {times_s[wrong]}: times must be finite and grow from frame to frame")
        self.times_s = times_s
        self.joints_m, self.confidence = whole_joints(joints_m, confidence)

    def __len__(self) -> int:
        return len(self.times_s)


def whole_joints(joints_m: np.ndarray, confidence: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Joints that are there as a whole or not at all, and how sure each is.

    Args:
        joints_m: (..., 15, 3) metres; one with a coordinate that is not finite is missing.
        confidence: (..., 15) in 0..1; None for 1 throughout.

    Returns:
        (..., 15, 3) with missing joints NaN, and (..., 15) float64 with theirs 0.

    Raises:
        InputError: a confidence of another shape, or not in 0..1.
    """
    shape = joints_m.shape[:-1]
    found = np.ones(shape) if confidence is None else np.asarray(confidence, np.float64)
    if found.shape != shape:
        raise InputError(f"confidence of shape {found.shape}: expected one number a joint, {shape}")
    if not ((found >= 0) & (found <= 1)).all():
        raise InputError(f"confidence from {found.min()} to {found.max()}: expected numbers from 0 to 1")
    missing = ~np.isfinite(joints_m).all(axis=-1)
    return np.where(missing[..., None], np.nan, joints_m), np.where(missing, 0.0, found)
