"""Converts `eval_sim` to EVAL's file format (`kpopnet.datasets.eval.format`)."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kpopnet.datasets.eval.format import FRAME, HEIGHT, WIDTH, count_frames
from kpopnet.datasets.point_clouds.organised import FROM_OPENGL
from kpopnet.skeleton import Joint
from synth.body.markers import MARKERS
from synth.simulated.eval_sim import CAMERA, EvalSim
from synth.simulated.film import Shot
from synth.simulated.writer import StandInFormat

MAGIC = -1982
"""Assumptions: EVAL's own value is not known to us, so this is the value of SMMC-10, by the same authors."""

_RAYS = CAMERA.points(np.ones((HEIGHT, WIDTH), np.float32))


def as_frame(shot: Shot, number: int) -> np.ndarray:
    """A frame of EVAL, shape (). A joint's id is its value in `kpopnet.skeleton.Joint`."""
    frame = np.zeros((), FRAME)
    frame["magic"], frame["frame"] = MAGIC, number
    frame["xyz"] = _RAYS * shot.depth_m[..., None] * FROM_OPENGL
    frame["nmarkers"], frame["njoints"] = len(MARKERS), len(Joint)
    frame["markers"]["name"][: len(MARKERS)] = [name.encode() for name in MARKERS]
    frame["markers"]["pos"][: len(MARKERS)] = shot.markers_camera_m * FROM_OPENGL
    frame["joints"]["id"][: len(Joint)] = list(Joint)
    frame["joints"]["pos"][: len(Joint)] = shot.joints_camera_m * FROM_OPENGL
    return frame


def encode(shots: Iterator[Shot]) -> Iterator[bytes]:
    """The bytes of a file of EVAL, frame by frame."""
    return (as_frame(shot, number).tobytes() for number, shot in enumerate(shots))


def read_frame(path: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Depth (240, 320) and joints (15, 3) of a frame in a file, metres, camera frame."""
    frame = np.fromfile(path, FRAME, count=1, offset=number * FRAME.itemsize)[0]
    return -frame["xyz"][..., 2], frame["joints"]["pos"][: len(Joint)] * FROM_OPENGL


EVAL_SIM = StandInFormat(
    maker=EvalSim,
    stands_for="EVAL",
    suffix=".bin",
    truth={"joint_ids": {joint.name.lower(): int(joint) for joint in Joint}, "markers": list(MARKERS)},
    encode=encode,
    count_frames=count_frames,
    look=read_frame,
)
