"""`eval_sim` in EVAL's bytes: see `kpopnet.benchmarks.eval_format`."""

from pathlib import Path

import numpy as np

from kpopnet.benchmarks.eval_format import FRAME, HEIGHT, WIDTH, count_frames
from kpopnet.benchmarks.organised_points import FROM_OPENGL
from kpopnet.skeleton import Joint
from synth.eval_sim import CAMERA, EvalSim
from synth.film import Shot
from synth.markers import MARKERS
from synth.stand_in_files import StandInFormat

MAGIC = -1982
"""What the same authors' SMMC-10 has; EVAL's own is not known to us."""

_SLOPES = CAMERA.points(np.ones((HEIGHT, WIDTH), np.float32))


def as_frame(shot: Shot, number: int) -> np.ndarray:
    """() a frame of EVAL. A joint's id is its place in `kpopnet.skeleton.Joint`."""
    frame = np.zeros((), FRAME)
    frame["magic"], frame["frame"] = MAGIC, number
    frame["xyz"] = _SLOPES * shot.depth_m[..., None] * FROM_OPENGL
    frame["nmarkers"], frame["njoints"] = len(MARKERS), len(Joint)
    frame["markers"]["name"][: len(MARKERS)] = [name.encode() for name in MARKERS]
    frame["markers"]["pos"][: len(MARKERS)] = shot.markers_camera_m * FROM_OPENGL
    frame["joints"]["id"][: len(Joint)] = list(Joint)
    frame["joints"]["pos"][: len(Joint)] = shot.joints_camera_m * FROM_OPENGL
    return frame


def as_bytes(shot: Shot, number: int) -> bytes:
    return as_frame(shot, number).tobytes()


def look(path: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """A frame's depth (240, 320) and joints (15, 3) in the camera frame."""
    frame = np.fromfile(path, FRAME, count=1, offset=number * FRAME.itemsize)[0]
    return -frame["xyz"][..., 2], frame["joints"]["pos"][: len(Joint)] * FROM_OPENGL


EVAL_SIM = StandInFormat(
    maker=EvalSim,
    stands_for="EVAL",
    suffix=".bin",
    truth={"joint_ids": {joint.name.lower(): int(joint) for joint in Joint}, "markers": list(MARKERS)},
    as_bytes=as_bytes,
    count_frames=count_frames,
    look=look,
)
