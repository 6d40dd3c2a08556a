"""One person in one depth image with ground-truth joints, for training and tests."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kpopnet.camera import Camera


@dataclass(frozen=True)
class Observation:
    """One segmented person in one depth image."""

    # (h, w) float32 metres, the person's depth after sensor noise and human extraction, 0 elsewhere. May be a part of the image
    # around the person.
    depth_m: np.ndarray
    camera: Camera  # the camera of exactly these pixels
    joints_camera_m: np.ndarray  # (15, 3) float32 ground-truth joints, camera frame, metres
    visible: np.ndarray  # (15,) bool, the joint is in the image and not occluded


class ObservationSource(Protocol):
    """Observations by index: one (index, epoch) gives the same in any process, another epoch may draw new noise."""

    def __len__(self) -> int: ...

    def observe(self, index: int, epoch: int) -> Observation: ...


@dataclass(frozen=True)
class JoinedSources:
    """The observations of several sources, one source after another."""

    sources: tuple[ObservationSource, ...]

    def __len__(self) -> int:
        return sum(len(source) for source in self.sources)

    def observe(self, index: int, epoch: int) -> Observation:
        for source in self.sources:
            if index < len(source):
                return source.observe(index, epoch)
            index -= len(source)
        raise IndexError("observation beyond the last")
