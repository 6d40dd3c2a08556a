"""EVAL's files (Ganapathi et al., ECCV 2012), as published and as `python -m synth benchmark=eval_sim` writes them.

A file seq_<subject>_<number>.bin is one sequence: C structs of 930,704 bytes, one a frame, and nothing else.

    int32    magic, frame
    float32  points[240][320][3]     organised; metres, x right, y up, z negative before the camera; z = 0: not measured
    int32    nmarkers
    { char name[255]; float32 x, y, z; } markers[32]      a byte of padding after the name; z = 0: absent
    int32    njoints
    { int32 id; float32 x, y, z; } joints[32]             z = 0: absent

Whatever is here in metres is turned into the camera frame at the door: x right, y down, z forward.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.joint_maps import describe_map, describe_skipped
from kpopnet.benchmarks.organised_points import FROM_OPENGL, PointSequence, depth_of_points, fit_camera
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

HEIGHT, WIDTH, SLOTS = 240, 320, 32
MARKER = np.dtype([("name", "S256"), ("pos", "<f4", 3)])
JOINT = np.dtype([("id", "<i4"), ("pos", "<f4", 3)])
FRAME = np.dtype(
    [
        ("magic", "<i4"),
        ("frame", "<i4"),
        ("xyz", "<f4", (HEIGHT, WIDTH, 3)),
        ("nmarkers", "<i4"),
        ("markers", MARKER, SLOTS),
        ("njoints", "<i4"),
        ("joints", JOINT, SLOTS),
    ]
)
FPS = 30.0
BLOCK = 16
"""Frames read at a time, 15 MB."""


def count_frames(path: Path) -> int:
    """How many frames a file holds.

    Raises:
        InputError: it is missing, empty, or does not end with a whole frame.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    frames, rest = divmod(path.stat().st_size, FRAME.itemsize)
    if rest:
        raise InputError(
            f"{path}: ends {rest} bytes into frame {frames}; a frame of EVAL has {FRAME.itemsize} bytes: the file was "
            "cut off, fetch it again"
        )
    if not frames:
        raise InputError(f"{path}: holds no frame at all; fetch it again")
    return frames


def read_blocks(path: Path) -> Iterator[np.ndarray]:
    """Yields a file's frames as arrays of FRAME, some at a time.

    Raises:
        InputError: see `count_frames`; or a frame's header is none.
    """
    frames, magic = count_frames(path), None
    for start in range(0, frames, BLOCK):
        block = np.fromfile(path, FRAME, count=min(BLOCK, frames - start), offset=start * FRAME.itemsize)
        magic = block["magic"][0] if magic is None else magic
        odd = (block["magic"] != magic) | ~_slots(block["nmarkers"]) | ~_slots(block["njoints"])
        if odd.any():
            frame = int(odd.argmax())
            found = block[frame]
            raise InputError(
                f"{path}: frame {start + frame} has magic {found['magic']} (frame 0 has {magic}), {found['nmarkers']} "
                f"markers and {found['njoints']} joints; expected the same magic in all frames and 0..{SLOTS} of each: "
                "this is no EVAL sequence, or it is torn"
            )
        yield block


def _slots(counts: np.ndarray) -> np.ndarray:
    return (counts >= 0) & (counts <= SLOTS)


def read_sequence(path: Path, joint_ids: Mapping[str, list[int]]) -> PointSequence:
    """Reads one file.

    Args:
        path: of the file.
        joint_ids: the ids of the file's joints whose mean is a joint of ours, by its name in `kpopnet.skeleton`; joints
            of ours that are not named have no truth.

    Raises:
        InputError: the file is missing, torn, or no EVAL sequence; its points are no pinhole camera's; it holds none of
            the ids.
    """
    frames = count_frames(path)
    depth_m = np.empty((frames, HEIGHT, WIDTH), np.float32)
    joints_m = np.full((frames, NUM_JOINTS, 3), np.nan, np.float32)
    markers_m: dict[str, np.ndarray] = {}
    skipped: Counter[str] = Counter()
    camera, start = None, 0
    known = {number for ids in joint_ids.values() for number in ids}
    for block in read_blocks(path):
        rows = slice(start, start + len(block))
        depth_m[rows] = depth_of_points(block["xyz"], skipped)
        if camera is None and depth_m[rows].any():
            measured = depth_m[rows].any(axis=(1, 2))
            camera = fit_camera(block["xyz"][measured][0], str(path))
        for row, frame in enumerate(block):
            by_id = {}
            for number, position in frame["joints"][: frame["njoints"]].tolist():
                position_m = _position(position)
                if position_m is None:
                    skipped["joints that are absent"] += 1
                elif number not in known:
                    skipped[f"joint id {number}, which the map does not name"] += 1
                else:
                    by_id[number] = position_m
            for name, ids in joint_ids.items():
                if all(number in by_id for number in ids):
                    joints_m[start + row, JOINT_NAMES.index(name)] = np.mean([by_id[number] for number in ids], axis=0)
            for name, position in frame["markers"][: frame["nmarkers"]].tolist():
                position_m = _position(position)
                if position_m is None:
                    skipped["markers that are absent"] += 1
                else:
                    places = markers_m.setdefault(marker_name(name), np.full((frames, 3), np.nan, np.float32))
                    places[start + row] = position_m
        start += len(block)
    if camera is None:
        raise InputError(
            f"{path}: not one point is measured before the camera in its {frames} frames "
            f"({describe_skipped(+skipped) or 'all are 0'})"
        )
    if np.isnan(joints_m).all():
        raise InputError(f"{path}: no frame holds the joints that the map names. {describe_map(joint_ids)}. {describe(path)}")
    return PointSequence(camera, depth_m, joints_m, markers_m, +skipped)


def _position(xyz_opengl_m: list[float]) -> np.ndarray | None:
    """(3,) in the camera frame, or None where it is absent."""
    position = np.array(xyz_opengl_m, np.float32)
    return position * FROM_OPENGL if np.isfinite(position).all() and position[2] != 0 else None


def marker_name(stored: bytes) -> str:
    """The name, a C string: what follows its end is whatever lay in memory."""
    return stored.partition(b"\0")[0].decode("ascii", errors="replace")


def describe(path: Path) -> str:
    """What a file's frame 0 holds, in a sentence or two."""
    frame = next(read_blocks(path))[0]
    joints = [
        f"{number} at ({x:.2f}, {-y:.2f}, {-z:.2f})" if z else f"{number} absent"
        for number, (x, y, z) in frame["joints"][: frame["njoints"]].tolist()
    ]
    markers = [marker_name(name) for name, _ in frame["markers"][: frame["nmarkers"]].tolist()]
    return (
        f"Frame 0 of {path} holds joint ids {', '.join(joints) or 'none'} (metres right, down, forward of the camera) "
        f"and markers {', '.join(markers) or 'none'}"
    )
