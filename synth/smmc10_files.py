"""`smmc10_sim` in SMMC-10's bytes: see `kpopnet.benchmarks.smmc10_format`."""

from collections import Counter
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.organised_points import FROM_OPENGL, depth_of_points
from kpopnet.benchmarks.smmc10_format import HEIGHT, MAGIC, PACKED, WIDTH, find_layout, image_points, stored_points
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS
from synth.film import Shot
from synth.markers import MARKERS
from synth.smmc10_sim import CAMERA, FPS, Smmc10Sim
from synth.stand_in_files import StandInFormat

MARKER_IDS = {name: number for number, name in enumerate(MARKERS)}

JOINT_MARKERS = {
    "head": ["LFHD", "RFHD", "LBHD", "RBHD"],
    "neck": ["C7", "CLAV"],
    # One hip's marker in front and the other's behind: with the shoulders', the middle of shoulders and hips.
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
"""Which markers' mean is taken for a joint."""

RANGE_M = 5.0
"""The distance that 65,536 would stand for in `dist`: what a SwissRanger modulated at 30 MHz can tell apart."""

_SLOPES = CAMERA.points(np.ones((HEIGHT, WIDTH), np.float32))


def as_frame(shot: Shot, number: int, layout: np.dtype = PACKED) -> np.ndarray:
    """() a frame of SMMC-10, packed as the notes that we have of it, or padded.

    A timestamp is in microseconds. `dist` is the distance from the camera, `conf` is full where something was measured;
    `amp`, the amplitude, is not simulated and 0. A marker that is not tracked has cond -1 and lies at the origin.
    """
    frame = np.zeros((), layout)
    points = _SLOPES * shot.depth_m[..., None]
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


def as_bytes(shot: Shot, number: int) -> bytes:
    return as_frame(shot, number).tobytes()


def count_frames(path: Path) -> int:
    return find_layout(path)[1]


def look(path: Path, number: int) -> tuple[np.ndarray, np.ndarray]:
    """A frame's depth (176, 144) and joints (15, 3) in the camera frame, NaN where their markers are not visible."""
    layout, _ = find_layout(path)
    frame = np.fromfile(path, layout, count=1, offset=number * layout.itemsize)[0]
    markers = frame["markers"][: len(MARKERS)]
    places_m = np.where(markers["cond"][:, None] > 0, markers["pos"] * FROM_OPENGL, np.nan)
    joints_m = np.full((NUM_JOINTS, 3), np.nan, np.float32)
    for joint, names in JOINT_MARKERS.items():
        joints_m[JOINT_NAMES.index(joint)] = places_m[[MARKER_IDS[name] for name in names]].mean(axis=0)
    return depth_of_points(image_points(frame["points"]), Counter()), joints_m


SMMC10_SIM = StandInFormat(
    maker=Smmc10Sim,
    stands_for="SMMC-10",
    suffix=".cal.bin",
    truth={
        "joint_markers": {joint: [MARKER_IDS[name] for name in names] for joint, names in JOINT_MARKERS.items()},
        "markers": MARKER_IDS,
    },
    as_bytes=as_bytes,
    count_frames=count_frames,
    look=look,
)
