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


def eval_frame(frame: int, *, magic=7, joints=None, points=None, njoints=None, nmarkers=1) -> bytes:
    """A frame of EVAL; a joint is (id, position in the camera frame)."""
    joints = [(number, position_m(number, frame)) for number in IDS] if joints is None else joints
    points = points_of("eval", frame) if points is None else points
    parts = [struct.pack("<ii", magic, frame), points.astype("<f4").tobytes(), struct.pack("<i", nmarkers)]
    # A C string ends at its zero byte; the rest of the buffer and the padding are undefined.
    parts += [struct.pack("<255sx3f", b"LSHO\0leftover" if slot == 0 else b"", 0.2, 0.4, -2.4) for slot in range(32)]
    parts.append(struct.pack("<i", len(joints) if njoints is None else njoints))
    for slot in range(32):
        number, (x, y, z) = joints[slot] if slot < len(joints) else (77, (5, 5, 5))
        parts.append(struct.pack("<i3f", number, x, -y, -z))
    return b"".join(parts)


def smmc10_frame(frame: int, *, magic=-1982, joints=None, points=None, njoints=None, padding=b"") -> bytes:
    """A frame of SMMC-10; a marker is (id, position in the camera frame) and visible, or (id, position, cond)."""
    joints = [(number, position_m(number, frame)) for number in IDS] if joints is None else joints
    points = points_of("smmc10", frame) if points is None else points
    stored = [points[i % 176, i // 176] for i in range(25344)]  # column by column
    parts = [struct.pack("<iiq", magic, frame, 40_000 * frame), np.array(stored, "<f4").tobytes()]
    parts += [np.full(25344, value, "<u2").tobytes() for value in (300, 7, 9)]  # dist, amp, conf
    parts.append(struct.pack("<i", len(joints) if njoints is None else njoints))
    for slot in range(64):
        number, (x, y, z), *cond = joints[slot] if slot < len(joints) else (77, (5, 5, 5), 9.0)
        parts.append(struct.pack("<ii4fI", number, frame, x, -y, -z, *(cond or [1.0]), 3))
    return b"".join(parts) + padding


FRAMES = {"eval": eval_frame, "smmc10": smmc10_frame}
