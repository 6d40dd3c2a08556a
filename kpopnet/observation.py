"""What an estimator sees of one person in one frame, with the truth beside it, for training and for tests."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kpopnet.camera import Camera


@dataclass(frozen=True)
class Observation:
    """One person cut out of one depth image.

    Attributes:
        depth_m: (h, w) float32, the person as sensor and extraction deliver them, 0 elsewhere. May be only the part of
            the picture around the person.
        camera: the camera of exactly these pixels.
        joints_camera_m: (15, 3) float32 true joints.
        visible: (15,) bool.
        ridge: (h, w) float32 ridge probability of depth_m in 0..1, or None when nobody asked for it.
    """

    depth_m: np.ndarray
    camera: Camera
    joints_camera_m: np.ndarray
    visible: np.ndarray
    ridge: np.ndarray | None = None


class ObservationSource(Protocol):
    """Observations by index. The same (index, epoch) is the same observation in any process; a new epoch may draw new
    noise.
    """

    def __len__(self) -> int: ...

    def observe(self, index: int, epoch: int) -> Observation: ...
