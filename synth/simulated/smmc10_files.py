"""Converts `smmc10_sim` to SMMC-10's file format (`kpopnet.datasets.smmc10.format`)."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kpopnet.datasets.point_clouds.organised import FROM_OPENGL, depth_of_points
from kpopnet.datasets.smmc10.format import HEIGHT, MAGIC, PACKED, WIDTH, find_layout, image_points, stored_points
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS
from synth.body.markers import MARKERS
from synth.simulated.film import Shot
from synth.simulated.smmc10_sim import CAMERA, FPS, Smmc10Sim
from synth.simulated.writer import StandInFormat

MARKER_IDS = {name: number for number, name in enumerate(MARKERS)}

JOINT_MARKERS = {
    "head": ["LFHD", "RFHD", "LBHD", "RBHD"],
    "neck": ["C7", "CLAV"],
    # One hip's marker is in front and the other's behind: their mean with the shoulders' is the middle of shoulders and hips.
    "torso": ["LSHO", "RSHO", "LASI", "RPSI"],
    **{
        f"{side}_{joint}": [f"{side[0].upper()}{marker}" for marker in markers]
        for side in ("right", "left")
        for joint, markers in (
            ("shoulder", ["SHO"]),
            ("elbow", ["ELB"]),
            ("hand", ["WRI"]),
            ("hip", ["ASI", "PSI"]),
            ("knee", ["KNE"]),
            ("foot", ["ANK"]),
        )
    },
}
"""Joint to the markers whose mean stands for it."""

RANGE_M = 5.0
"""Distance that corresponds to 65,536 in `dist`: the unambiguous range of a SwissRanger modulated at 30 MHz."""

_RAYS = CAMERA.points(np.ones((HEIGHT, WIDTH), np.float32))


def as_frame(shot: Shot, number: int, layout: np.dtype = PACKED) -> np.ndarray:
    """A frame of SMMC-10, shape ().

    The timestamp is in microseconds. `dist` is the distance from the camera. `conf` has its greatest value where depth was
    measured, 0 elsewhere. `amp`, the amplitude, is not simulated and 0. An untracked marker has cond -1 and position 0.

    Args:
        shot: the frame.
        number: of the frame in its sequence.
        layout: packed, as in our notes on the format, or padded.
    """
    frame = np.zeros((), layout)
    points = _RAYS * shot.depth_m[..., None]
    frame["magic"], frame["frame"], frame["timestamp"] = MAGIC, number, round(number * 1e6 / FPS)
    frame["points"] = stored_points(points * FROM_OPENGL)
    distance = np.linalg.norm(points, axis=-1) / RANGE_M * 2**16
    frame["dist"] = stored_points(np.minimum(distance, 2**16 - 1).astype(np.uint16))
    frame["conf"] = stored_points(np.where(shot.depth_m > 0, np.uint16(2**16 - 1), np.uint16(0)))
    frame["nmarkers"] = len(MARKERS)
    markers = frame["markers"][: len(MARKERS)]
    markers["id"], markers["frame"] = list(MARKER_IDS.values()), number
    markers["pos"] = np.where(shot.markers_tracked[:, None], shot.markers_camera_m * FROM_OPENGL, 0)
    markers["cond"] = np.where(shot.markers_tracked, 1, -1)
    return frame


def encode(shots: Iterator[Shot]) -> Iterator[bytes]:
    """The bytes of a file of SMMC-10, frame by frame."""
    return (as_frame(shot, number).tobytes() for number, shot in enumerate(shots))


def count_frames(path: Path) -> int:
    """Number of frames in a file."""
    return find_layout(path)[1]


def read_frame(path: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Depth (176, 144) and joints (15, 3) of a frame in a file, metres, camera frame; NaN where markers are not visible."""
    layout, _ = find_layout(path)
    frame = np.fromfile(path, layout, count=1, offset=number * layout.itemsize)[0]
    markers = frame["markers"][: len(MARKERS)]
    markers_m = np.where(markers["cond"][:, None] > 0, markers["pos"] * FROM_OPENGL, np.nan)
    joints_m = np.full((NUM_JOINTS, 3), np.nan, np.float32)
    for joint, names in JOINT_MARKERS.items():
        joints_m[JOINT_NAMES.index(joint)] = markers_m[[MARKER_IDS[name] for name in names]].mean(axis=0)
    return depth_of_points(image_points(frame["points"]), Counter()), joints_m


SMMC10_SIM = StandInFormat(
    maker=Smmc10Sim,
    stands_for="SMMC-10",
    suffix=".cal.bin",
    truth={
        "joint_markers": {joint: [MARKER_IDS[name] for name in names] for joint, names in JOINT_MARKERS.items()},
        "markers": MARKER_IDS,
    },
    encode=encode,
    count_frames=count_frames,
    look=read_frame,
)
