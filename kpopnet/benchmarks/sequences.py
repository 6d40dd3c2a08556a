"""What every benchmark is: depth sequences of one person each, with true joints, and a plain word on what is true."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS


class Origin(Enum):
    """Where a benchmark's depth comes from: a sensor, or a program."""

    REAL = "real"
    SIMULATED = "simulated"


@dataclass(frozen=True)
class Sequence:
    """One person over time.

    Attributes:
        name: unique in its benchmark.
        identity: who it is, or "" where nobody knows. Equal identities are the same person.
        fps: frames a second, or 0 where the frames are stills of their own, or nobody has published it.
        camera: the camera of the depth.
        depth_m: (T, H, W) float32; 0 where nothing was measured.
        joints_camera_m: (T, 15, 3) float32 true joints, NaN where there is no truth.
        visible: (T, 15) bool, false where there is no truth.
        yaw_rad: (T,) float32 the person's heading, 0 facing the camera, positive to the person's left, or None.
        alone: the depth shows the person alone, 0 elsewhere; otherwise the whole scene, floor and walls and all.
    """

    name: str
    identity: str
    fps: float
    camera: Camera
    depth_m: np.ndarray
    joints_camera_m: np.ndarray
    visible: np.ndarray
    yaw_rad: np.ndarray | None = None
    alone: bool = True

    def __post_init__(self) -> None:
        frames = len(self.depth_m)
        assert self.depth_m.shape == (frames, self.camera.height, self.camera.width)
        assert self.depth_m.dtype == np.float32
        assert self.joints_camera_m.shape == (frames, NUM_JOINTS, 3)
        assert self.visible.shape == (frames, NUM_JOINTS) and self.visible.dtype == bool
        assert not (self.visible & np.isnan(self.joints_camera_m).any(axis=-1)).any()
        assert self.yaw_rad is None or self.yaw_rad.shape == (frames,)


class Benchmark(Protocol):
    """A data set to judge estimators on. Sequences are read one at a time, never the whole set.

    Attributes:
        name: as in the configuration.
        origin: real or simulated depth.
        truth: what the joints it holds are, for "against ...": "Kinect SDK labels", "motion capture".
        about: what a reader of a score must know besides, in a sentence or two.

    A simulated set says besides by `provenance`, a dict with seed, version and config_hash, which set of its kind it is.
    """

    name: str
    origin: Origin
    truth: str
    about: str

    def sequence_names(self) -> list[str]:
        """All sequences, in an order that is always the same."""
        ...

    def read(self, name: str) -> Sequence:
        """One sequence.

        Raises:
            InputError: its files are missing, torn or odd.
        """
        ...


def evenly_spaced(names: list[str], count: int | None) -> list[str]:
    """`count` of the names, spread evenly from the first to the last, or all of them."""
    if count is None or count >= len(names):
        return names
    if count < 1:
        raise InputError(f"sequences={count}: expected at least 1, or leave it away for all {len(names)}")
    return [names[round(index)] for index in np.linspace(0, len(names) - 1, count)]
