"""Interface of all benchmarks: depth sequences of one person each, with true joints and the origin of both."""

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Protocol

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import as_path, expect
from kpopnet.skeleton import NUM_JOINTS, Joint


class Origin(Enum):
    """Of the depth of a benchmark: a sensor, or a simulation."""

    REAL = "real"
    SIMULATED = "simulated"


@dataclass
class BenchmarkConfig:
    """Settings of a benchmark.

    Attributes:
        name: of the benchmark.
        path: folder of the set, as published or as `python -m synth` wrote it.
    """

    name: str
    path: str | None = None

    def folder(self, what: str) -> Path:
        """The folder of the set; raises InputError, which says what it is, if none is given."""
        if self.path is None:
            raise InputError(f"benchmark={self.name} needs benchmark.path=PATH, {what}")
        return as_path(self.path)


@dataclass(frozen=True)
class Sequence:
    """A depth sequence of one person."""

    name: str  # unique in its benchmark
    identity: str  # identity of the person; "" if unknown. Equal identities are the same person
    fps: float | None  # frames per second, None where the set does not say; 0 where every frame is a still of another moment
    camera: Camera  # camera of the depth images
    depth_m: np.ndarray  # (T, H, W) float32 metres; 0 where nothing was measured
    joints_camera_m: np.ndarray  # (T, 15, 3) float32 true joints in metres in the camera frame; NaN where unknown
    # (T, 15) bool, whether the set calls the joint visible, as SMMC-10 its markers; else whether its position is known
    visible: np.ndarray
    # (T,) float32 heading of the person, 0 facing the camera, positive to the person's left; None if unknown
    yaw_rad: np.ndarray | None = None
    is_segmented: bool = True  # whether the depth shows only the person, with 0 elsewhere. Otherwise it shows the whole scene
    # name of the room and camera that this sequence shares with other sequences of its benchmark; "" if it shares them with
    # none, or if that is unknown
    room: str = ""

    def __post_init__(self) -> None:
        frames = len(self.depth_m)
        assert self.depth_m.shape == (frames, self.camera.height, self.camera.width)
        assert self.depth_m.dtype == np.float32
        assert self.joints_camera_m.shape == (frames, NUM_JOINTS, 3)
        assert self.visible.shape == (frames, NUM_JOINTS) and self.visible.dtype == bool
        assert not (self.visible & np.isnan(self.joints_camera_m).any(axis=-1)).any()
        assert self.yaw_rad is None or self.yaw_rad.shape == (frames,)


class Benchmark(Protocol):
    """A data set for the evaluation of estimators. Sequences are read one at a time, never the whole set.

    A simulated set also has `provenance`, a dict with seed, version and config_hash that identifies it. A set of several people
    whose labels are other points of the body than ours has `label_definition`, the name of that definition ("Kinect SDK"):
    reports then also judge the estimates in it (`kpopnet.evaluation.poses.definition`).
    """

    name: str  # as in the configuration
    origin: Origin
    truth: str  # origin of the true joints, for the sentence "compared with ...": "Kinect SDK labels", "motion capture"
    about: str  # what a reader needs to interpret the results, in a sentence or two

    def sequence_names(self) -> list[str]:
        """Names of all sequences, always in the same order."""
        ...

    def read(self, name: str) -> Sequence:
        """Reads one sequence; raises InputError if its files are missing, truncated or invalid."""
        ...


MAX_COORDINATE_M = 100.0
"""Joints of a benchmark that lie farther from the camera are damage."""


def check_joints(where: str, joints_m: np.ndarray, limit_m: float = MAX_COORDINATE_M) -> None:
    """Raises InputError unless some joints are known, and all that are known (not NaN) lie within `limit_m` of the camera."""
    known = joints_m[~np.isnan(joints_m)]
    expect(known.size > 0 and bool(np.abs(known).max() <= limit_m), where, f"joints in metres, at most {limit_m:g} m")


def heading_rad(joints_camera_m: np.ndarray) -> np.ndarray:
    """(T,) float32 heading in radians: 0 facing the camera, positive to the person's left; NaN if unknown.

    The front direction is the cross product of the right-to-left vectors of hips and shoulders with the vector from hips to
    shoulders of (T, 15, 3) joints, projected on the x-z plane of the camera. Assumptions: the camera is upright; its tilt is
    unknown and ignored, so the result is meaningless for a camera that looks down.
    """
    joints = joints_camera_m.astype(np.float64)
    hips = joints[:, Joint.LEFT_HIP] + joints[:, Joint.RIGHT_HIP]
    shoulders = joints[:, Joint.LEFT_SHOULDER] + joints[:, Joint.RIGHT_SHOULDER]
    to_left = joints[:, [Joint.LEFT_HIP, Joint.LEFT_SHOULDER]] - joints[:, [Joint.RIGHT_HIP, Joint.RIGHT_SHOULDER]]
    front = np.cross(to_left.sum(axis=1), shoulders - hips)
    towards_front, towards_camera = front[:, 0] + 1j * front[:, 2], -(hips[:, 0] + 1j * hips[:, 2])
    return np.angle(towards_front * towards_camera.conj()).astype(np.float32)


def evenly_spaced(names: list[str], count: int | None) -> list[str]:
    """`count` names, evenly spaced from the first to the last; all if count is None. Raises InputError if it is less than 1."""
    if count is None or count >= len(names):
        return names
    if count < 1:
        raise InputError(f"sequences={count}: expected at least 1, or omit it for all {len(names)}")
    return [names[round(index)] for index in np.linspace(0, len(names) - 1, count)]
