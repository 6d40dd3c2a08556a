"""The one protocol that trackers and networks share: a depth sequence and a camera in, joints and confidence out."""

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS


class Estimate(NamedTuple):
    """Joints of one person over a sequence.

    Attributes:
        joints_camera_m: (T, 15, 3) float32, NaN where a joint is missing.
        confidence: (T, 15) float32 in 0..1, 0 where a joint is missing.
    """

    joints_camera_m: np.ndarray
    confidence: np.ndarray

    @classmethod
    def of_nobody(cls, frames: int) -> "Estimate":
        """All joints missing, to be filled in where somebody is found."""
        return cls(np.full((frames, NUM_JOINTS, 3), np.nan, np.float32), np.zeros((frames, NUM_JOINTS), np.float32))


class Estimator(Protocol):
    """Estimates one person's joints from depth in which only that person is left (0 elsewhere)."""

    name: str

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """Joints of the one person in each frame.

        Args:
            depth_m: (T, H, W) of that person alone, 0 elsewhere; floating-point metres or uint16 millimetres.
            camera: the camera of these pixels.

        Returns:
            (T, 15, 3) joints and (T, 15) confidence; NaN and 0 in frames with an empty silhouette.

        Raises:
            InputError: depth of another type or shape.
        """
        ...


def who_looks(estimator: Estimator) -> Estimator:
    """The one that looks at the depth: whose joints are fitted, where an estimator fits another's, or itself."""
    return getattr(estimator, "estimator", estimator)


class Start(NamedTuple):
    """A known pose: (15, 3) joints_camera_m in that frame."""

    frame: int
    joints_camera_m: np.ndarray


def first_label(joints_camera_m: np.ndarray) -> Start:
    """The first of (T, 15, 3) true poses that has every joint.

    Raises:
        InputError: none has.
    """
    complete = np.flatnonzero(np.isfinite(joints_camera_m).all(axis=(1, 2)))
    if not len(complete):
        raise InputError("start=label needs a frame with all fifteen joints, and there is none; use start=standing or y_pose")
    return Start(int(complete[0]), joints_camera_m[complete[0]])


@runtime_checkable
class StartedEstimator(Estimator, Protocol):
    """One that follows movement and can be told a pose to begin from.

    Attributes:
        starts_from_label: it wants a true pose, which whoever judges it then gives it and says so.
    """

    starts_from_label: bool

    def estimate(self, depth_m: np.ndarray, camera: Camera, start: Start | None = None) -> Estimate: ...


def starts_from_label(estimator: Estimator) -> bool:
    """Whether it wants to be told a true pose."""
    return isinstance(estimator, StartedEstimator) and estimator.starts_from_label
