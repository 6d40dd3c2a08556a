"""An observed dance: joints over time and their confidence."""

import numpy as np

from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS, Joint

MAX_DURATION_S, MAX_TIME_S = 7200.0, 1e9
"""Longest dance, which bounds the memory of a comparison to a few hundred megabytes, and latest time on a clock."""


class Performance:
    """A dance as joints over time.

    Attributes:
        joints_m: (T, 15, 3) float64 in the camera frame, NaN where a joint is missing.
        times_s: (T,) float64 seconds, strictly increasing, on the clock of the music: zero is the same instant of the music for
            the teacher and the learner.
        confidence: (T, 15) float64 in 0..1; 0 where the joint is missing. A joint of a confidence below
            `kpopnet.dance.features.SEEN_CONFIDENCE` is partly unseen.
    """

    def __init__(self, joints_m: np.ndarray, times_s: np.ndarray, confidence: np.ndarray | None = None) -> None:
        """Checks and copies the arrays; see `mask_missing_joints`."""
        try:
            joints_m, times_s = np.array(joints_m, np.float64), np.array(times_s, np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"joints and times: expected arrays of numbers ({error})") from error
        if joints_m.ndim != 3 or joints_m.shape[1:] != (NUM_JOINTS, 3) or not len(joints_m):
            raise InputError(f"joints of shape {joints_m.shape}: expected (frames, {NUM_JOINTS}, 3) and at least one frame")
        if times_s.shape != joints_m.shape[:1]:
            raise InputError(f"{len(joints_m)} frames with times of shape {times_s.shape}: expected one time a frame")
        valid = np.isfinite(times_s)
        valid[1:] &= ~(times_s[1:] <= times_s[:-1])
        if not valid.all():
            wrong = int(np.argmin(valid))
            raise InputError(f"frame {wrong} has time {times_s[wrong]}: times must be finite and increase from frame to frame")
        if times_s[-1] - times_s[0] > MAX_DURATION_S or np.abs(times_s[[0, -1]]).max() > MAX_TIME_S:
            raise InputError(
                f"times from {times_s[0]:g} to {times_s[-1]:g} s: expected a dance of at most {MAX_DURATION_S:g} s; "
                "are they seconds?"
            )
        self.times_s = times_s
        self.joints_m, self.confidence = mask_missing_joints(joints_m, confidence)

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def is_observed(self) -> bool:
        """Whether any joint of any frame is known, with a confidence above 0."""
        return bool(self.confidence.any())

    @property
    def unseen_joints(self) -> list[Joint]:
        """The joints that are missing in every frame."""
        return [Joint(number) for number in np.flatnonzero(~self.confidence.any(axis=0))]


def as_performance(dance: Performance | np.ndarray, fps: float | None, whose: str) -> Performance:
    """A dance that may be given as (T, 15, 3) joints in metres in the camera frame, whose first frame is at time 0."""
    if isinstance(dance, Performance):
        return dance
    if fps is None or not 0 < fps <= 1000:
        raise InputError(f"the {whose}'s dance is an array without times and fps={fps}; give its frames per second, fps=30")
    try:
        return Performance(dance, np.arange(len(dance)) / fps)
    except InputError as error:
        raise InputError(f"the {whose}'s dance: {error}") from error


def mask_missing_joints(joints_m: np.ndarray, confidence: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """(..., 15, 3) joints with missing ones NaN, and (..., 15) float64 confidence in 0..1 with missing ones 0.

    A joint with a coordinate that is not finite, or of confidence 0, is missing; None is a confidence of 1 everywhere.
    """
    shape = joints_m.shape[:-1]
    values = np.ones(shape) if confidence is None else np.asarray(confidence, np.float64)
    if values.shape != shape:
        raise InputError(f"confidence of shape {values.shape}: expected one number a joint, {shape}")
    if not ((values >= 0) & (values <= 1)).all():
        raise InputError(f"confidence from {values.min()} to {values.max()}: expected numbers from 0 to 1")
    missing = np.logical_not(np.isfinite(joints_m).all(axis=-1)) | (values == 0)
    return np.where(missing[..., None], np.nan, joints_m), np.where(missing, 0.0, values)
