"""The one protocol that trackers and networks share: a depth sequence and a camera in, joints and confidence out."""

from typing import NamedTuple, Protocol

import numpy as np

from kpopnet.camera import Camera


class Estimate(NamedTuple):
    """Joints of one person over a sequence.

    Attributes:
        joints_camera_m: (T, 15, 3) float32, NaN where a joint is missing.
        confidence: (T, 15) float32 in 0..1, 0 where a joint is missing.
    """

    joints_camera_m: np.ndarray
    confidence: np.ndarray


class Estimator(Protocol):
    """Estimates one person's joints from depth in which only that person is left (0 elsewhere)."""

    name: str

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        """(T, H, W) float32 metres. A frame without a person gives NaN joints with confidence 0."""
        ...
