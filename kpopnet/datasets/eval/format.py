"""File format of EVAL (Ganapathi et al., ECCV 2012), also written by `python -m synth benchmark=eval_sim`.

A file seq_<subject>_<number>.bin is one sequence: one C struct of 930,704 bytes per frame, and nothing else.

    int32    magic, frame
    float32  points[240][320][3]     organised; metres, x right, y up, z negative in front of the camera; z = 0: not measured
    int32    nmarkers
    { char name[255]; float32 x, y, z; } markers[32]      one byte of padding after the name; z = 0: absent
    int32    njoints
    { int32 id; float32 x, y, z; } joints[32]             z = 0: absent

The reader converts all positions in metres to the camera frame: x right, y down, z forward.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from kpopnet.datasets.point_clouds.joint_maps import describe_map, describe_skipped
from kpopnet.datasets.point_clouds.organised import (
    FROM_OPENGL,
    PointSequence,
    check_marker_count,
    check_sequence_budget,
    depth_of_points,
    fit_camera,
)
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

HEIGHT, WIDTH, LIST_CAPACITY = 240, 320, 32
MARKER = np.dtype([("name", "S256"), ("pos", "<f4", 3)])
JOINT = np.dtype([("id", "<i4"), ("pos", "<f4", 3)])
FRAME = np.dtype(
    [
        ("magic", "<i4"),
        ("frame", "<i4"),
        ("xyz", "<f4", (HEIGHT, WIDTH, 3)),
        ("nmarkers", "<i4"),
        ("markers", MARKER, LIST_CAPACITY),
        ("njoints", "<i4"),
        ("joints", JOINT, LIST_CAPACITY),
    ]
)
FPS = 30.0
FRAMES_PER_BLOCK = 16
"""Number of frames that are read at once: 15 MB."""


def count_frames(path: Path) -> int:
    """Number of frames in a file.

    Raises:
        InputError: the file is missing, empty, or does not end with a complete frame.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    frames, rest = divmod(path.stat().st_size, FRAME.itemsize)
    if rest:
        raise InputError(
            f"{path}: ends {rest} bytes into frame {frames}; a frame of EVAL has {FRAME.itemsize} bytes: the file "
            "is truncated, download it again"
        )
    if not frames:
        raise InputError(f"{path}: holds no frame; download it again")
    return frames


def read_blocks(path: Path) -> Iterator[np.ndarray]:
    """Yields the frames of a file as arrays of FRAME, FRAMES_PER_BLOCK at a time.

    Raises:
        InputError: see `count_frames`; or the header of a frame is invalid.
    """
    frames, magic = count_frames(path), None
    for start in range(0, frames, FRAMES_PER_BLOCK):
        block = np.fromfile(path, FRAME, count=min(FRAMES_PER_BLOCK, frames - start), offset=start * FRAME.itemsize)
        magic = block["magic"][0] if magic is None else magic
        invalid = (block["magic"] != magic) | ~_valid_count(block["nmarkers"]) | ~_valid_count(block["njoints"])
        if invalid.any():
            frame = int(invalid.argmax())
            header = block[frame]
            raise InputError(
                f"{path}: frame {start + frame} has magic {header['magic']} (frame 0 has {magic}), {header['nmarkers']} "
                f"markers and {header['njoints']} joints; expected the same magic in all frames and 0..{LIST_CAPACITY} of "
                "each: this is not an EVAL sequence, or it is damaged"
            )
        yield block


def _valid_count(counts: np.ndarray) -> np.ndarray:
    return (counts >= 0) & (counts <= LIST_CAPACITY)


def read_sequence(path: Path, joint_ids: Mapping[str, list[int]]) -> PointSequence:
    """Reads the sequence in one file.

    Args:
        path: of the file.
        joint_ids: ids in the file by the name of our joint in `kpopnet.skeleton`; the mean of several ids is used. Joints
            that are not in the map are NaN.

    Raises:
        InputError: the file is missing, damaged, or not an EVAL sequence; no pinhole camera fits its points; it holds
            none of the ids.
    """
    frames = count_frames(path)
    check_sequence_budget(path, frames, HEIGHT * WIDTH)
    depth_m = np.empty((frames, HEIGHT, WIDTH), np.float32)
    joints_m = np.full((frames, NUM_JOINTS, 3), np.nan, np.float32)
    markers_m: dict[str, np.ndarray] = {}
    skipped: Counter[str] = Counter()
    camera, start = None, 0
    mapped = {number for ids in joint_ids.values() for number in ids}
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
                elif number not in mapped:
                    skipped[f"joint id {number}, which is not in the map"] += 1
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
                    track = markers_m.setdefault(marker_name(name), np.full((frames, 3), np.nan, np.float32))
                    track[start + row] = position_m
        start += len(block)
        check_marker_count(path, markers_m)
    if camera is None:
        raise InputError(
            f"{path}: no point in front of the camera is measured in its {frames} frames "
            f"({describe_skipped(+skipped) or 'all are 0'})"
        )
    if np.isnan(joints_m).all():
        raise InputError(f"{path}: no frame holds the joints in the map. {describe_map(joint_ids)}. {describe_ids(path)}")
    return PointSequence(camera, depth_m, joints_m, markers_m, +skipped)


def _position(xyz_opengl_m: list[float]) -> np.ndarray | None:
    """(3,) metres in the camera frame, or None if it is absent."""
    position = np.array(xyz_opengl_m, np.float32)
    return position * FROM_OPENGL if np.isfinite(position).all() and position[2] != 0 else None


def marker_name(stored: bytes) -> str:
    """The name of a marker, a C string; the bytes after its terminating zero are undefined."""
    return stored.partition(b"\0")[0].decode("ascii", errors="replace")


def describe_ids(path: Path) -> str:
    """Lists the joints and markers in frame 0 of a file."""
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
