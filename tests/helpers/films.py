"""A benchmark of three films of a square that moves, and an estimator whose errors in them are known."""

import numpy as np

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import Origin, Sequence
from kpopnet.estimator import Estimate

CAMERA = Camera.centred(80.0, 96, 72)
FRAMES = 36
POSE_M = np.stack([np.linspace(-0.4, 0.4, 15), np.linspace(0.7, -0.7, 15), np.full(15, 2.5)], axis=1).astype(np.float32)
OFF_M = {"one": 0.02, "two": 0.12, "three": 0.06}
"""Mean error of the estimates of each sequence; the error of each frame alternates by 1 cm about it."""


class Films:
    """A benchmark of three sequences, in which a square in place of a person moves to the right.

    The sixth frame has no label. Sequences named in `single` have one frame; `unlabelled` joints have no label in those of
    `without_labels`; `identities` are those of the people.
    """

    truth, about = "made-up joints", "Made up."

    def __init__(self, name: str = "films", origin: Origin = Origin.SIMULATED, fps: float = 30.0, is_segmented: bool = True):
        self.name, self.origin, self.fps, self.is_segmented = name, origin, fps, is_segmented
        self.single: tuple[str, ...] = ()
        self.without_labels: dict[str, list[int]] = {}
        self.identities: dict[str, str] = {}

    def sequence_names(self) -> list[str]:
        return list(OFF_M)

    def read(self, name: str) -> Sequence:
        joints = POSE_M + np.linspace(0, 0.5, FRAMES)[:, None, None] * np.array([1, 0, 0])
        joints = joints.astype(np.float32)
        joints[5] = np.nan
        joints[:, self.without_labels.get(name, [])] = np.nan
        depth_m = np.zeros((FRAMES, CAMERA.height, CAMERA.width), np.float32)
        depth_m[:, 15:60, 30:70] = 2.5
        depth_m[0, 0, 0] = 1 + list(OFF_M).index(name)  # identifies the sequence for the estimator
        kept = slice(0, 1 if name in self.single else FRAMES)
        known = np.isfinite(joints).all(axis=-1)
        person = self.identities.get(name, "")
        return Sequence(name, person, self.fps, CAMERA, depth_m[kept], joints[kept], known[kept], None, self.is_segmented)


class Off:
    """Estimates with an error of OFF_M times a factor, and records what it was given."""

    name = "off"

    def __init__(self, factor: float = 1.0, starts_from_label: bool = False) -> None:
        self.factor, self.starts_from_label = factor, starts_from_label
        self.given: list[np.ndarray] = []
        self.starts: list = []

    def estimate(self, depth_m: np.ndarray, camera: Camera, start=None) -> Estimate:
        self.given.append(depth_m)
        self.starts.append(start)
        name = list(OFF_M)[int(depth_m[0, 0, 0]) - 1]
        off_m = self.factor * OFF_M[name] + np.where(np.arange(len(depth_m)) % 2, 0.01, -0.01)
        moved = np.linspace(0, 0.5, FRAMES)[: len(depth_m), None, None] * np.array([1, 0, 0])
        joints = POSE_M + moved + off_m[:, None, None] * np.array([0, 0, 1])
        return Estimate(joints.astype(np.float32), np.ones((len(depth_m), 15), np.float32))
