"""Frames of EVAL and SMMC-10, packed field by field in the published layouts."""

import struct

import numpy as np
from slopes import slope_m

from kpopnet.camera import Camera

CAMERAS = {"eval": Camera(285.7, 281.3, 158.2, 121.9, 320, 240), "smmc10": Camera(204.8, 203.1, 72.3, 87.6, 144, 176)}
FIRST = {"eval": "seq_a_0.bin", "smmc10": "real01_7.cal.bin"}
IDS = (1, 3, 5, 24)


def scene(name: str, frame: int) -> np.ndarray:
    return slope_m(frame, CAMERAS[name].height, CAMERAS[name].width)


def position_m(number: int, frame: int = 0) -> tuple[float, float, float]:
    """Position of a joint or marker in the camera frame."""
    return 0.01 * number + 0.01 * frame, -0.02 * number, 2.0 + 0.01 * number


def points_of(name: str, frame: int) -> np.ndarray:
    """(H, W, 3) points in the files' axes: x right, y up, z negative."""
    return CAMERAS[name].points(scene(name, frame)) * np.float32([1, -1, -1])


def frame_of(name: str, frame: int, *, magic=None, joints=None, points=None, njoints=None, padding=b"") -> bytes:
    """A frame of a set.

    A joint or marker is (id, position in the camera frame), or (id, position, cond); a marker is visible where cond > 0.
    """
    joints = [(number, position_m(number, frame)) for number in IDS] if joints is None else joints
    points = points_of(name, frame) if points is None else points
    slots = [*joints, *[(77, (5, 5, 5), 9.0)] * 64]  # what stands behind the last one is undefined
    stored = [(number, x, -y, -z, *(cond or [1.0])) for number, (x, y, z), *cond in slots]
    count = struct.pack("<i", len(joints) if njoints is None else njoints)
    magic = {"eval": 7, "smmc10": -1982}[name] if magic is None else magic
    if name == "eval":
        parts = [struct.pack("<ii", magic, frame), points.astype("<f4").tobytes(), struct.pack("<i", 1)]
        # A C string ends at its zero byte; the rest of the buffer and the padding are undefined.
        parts += [struct.pack("<255sx3f", b"LSHO\0leftover" if slot == 0 else b"", 0.2, 0.4, -2.4) for slot in range(32)]
        return b"".join([*parts, count, *(struct.pack("<i3f", *one[:4]) for one in stored[:32])])
    by_column = [points[i % 176, i // 176] for i in range(25344)]
    parts = [
        struct.pack("<iiq", magic, frame, 40_000 * frame),
        np.array(by_column, "<f4").tobytes(),
    ]
    parts += [np.full(25344, value, "<u2").tobytes() for value in (300, 7, 9)]  # dist, amp, conf
    parts += [count, *(struct.pack("<ii4fI", one[0], frame, *one[1:], 3) for one in stored[:64])]
    return b"".join(parts) + padding
