"""The files of one dance: teacher, learners and labels, in the folder format of K-Pop sets (docs/kpop_format.md).

Joints have the order of `kpopnet.skeleton.Joint`, in metres in the frame of a camera that faces the dancer: x right, y down,
z forward. `depth_mm` holds the pixels of the person's bounding box, frame by frame and row by row; `boxes` (T, 4) are x0, y0,
x1, y1 in the image of `camera`, the last two exclusive, all 0 in a frame without a person.
"""

import hashlib
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.performance import Performance
from kpopnet.datasets.protocol import check_joints
from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import Hdf5Schema, attributes_of, open_hdf5, read_array, stored_array
from kpopnet.runtime.input_files import ArraySchema, expect
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT, VERSION = "kpopnet dance", 1
TEACHER, LABELS, MANIFEST = "teacher.h5", "labels.csv", "manifest.json"
MAX_FRAMES = 200_000
"""Larger recordings are rejected: nearly two hours at 30 fps."""

MAX_COORDINATE_M = 1000.0
MAX_NAME_BYTES = 200

SCHEMA = Hdf5Schema(
    name="the file of a teacher or a learner",
    attributes={"format": str, "version": int, "camera": list[float], "joint_names": list[str], "about": str},
    optional=("camera", "joint_names", "about"),
    fixed={"format": FORMAT, "version": VERSION, "joint_names": list(JOINT_NAMES)},
    arrays={
        "times_s": ArraySchema("f", ("T",)),
        "joints_m": ArraySchema("f", ("T", NUM_JOINTS, 3), required=False),
        "boxes": ArraySchema("iu", ("T", 4), required=False),
        "depth_mm": ArraySchema("u", (None,), required=False),
    },
    remedy="copy or make it again",
)


def read_performance(path: Path) -> Performance | None:
    """Reads the joints in the file of a teacher or a learner; None if it has none.

    Raises:
        InputError: the file is missing, damaged or invalid.
    """
    with open_hdf5(path, SCHEMA) as file:
        if "joints_m" not in file:
            return None
        times_s = read_times(path, file)
        joints_m = read_array(file, "joints_m").astype(np.float32)
    check_joints(f"{path}: joints_m", joints_m, MAX_COORDINATE_M)
    return Performance(joints_m, times_s)


def read_times(path: Path, file: h5py.File) -> np.ndarray:
    """Reads the times of the frames: (T,) float64 seconds."""
    times_s = read_array(file, "times_s").astype(np.float64)
    check_times(path, times_s)
    return times_s


def read_stored_depth(path: Path, file: h5py.File) -> tuple[np.ndarray, np.ndarray, Camera]:
    """Reads `depth_mm` (N,), `boxes` (T, 4) and the camera of the whole image, and checks that they are consistent."""
    if "camera" not in file.attrs or "boxes" not in file:
        raise InputError(f"{path}: expected an attribute camera and an array boxes beside depth_mm")
    camera = Camera.from_numbers(attributes_of(file)["camera"], f"{path}: attribute camera")
    boxes = read_array(file, "boxes").astype(np.int64)
    x0, y0, x1, y1 = boxes.T
    inside = (x0 >= 0) & (y0 >= 0) & (x1 > x0) & (y1 > y0) & (x1 <= camera.width) & (y1 <= camera.height)
    valid = inside | (boxes == 0).all(axis=1)
    if not valid.all():
        frame, size = int(valid.argmin()), f"{camera.width}x{camera.height}"
        raise InputError(f"{path}: the box {boxes[frame].tolist()} of frame {frame} is not within {size}")
    pixels, (stored,) = int(((x1 - x0) * (y1 - y0)).sum()), stored_array(file, "depth_mm").shape
    expect(stored == pixels, f"{path}: depth_mm", f"the {pixels} pixels that its boxes hold, found {stored}")
    return read_array(file, "depth_mm"), boxes, camera


def depth_key(depth_mm: np.ndarray, boxes: np.ndarray, camera: Camera) -> str:
    """A digest, 16 hexadecimal digits, of (N,) uint16 pixels, (T, 4) boxes and the camera of the whole image."""
    digest = hashlib.sha256(repr(camera).encode())
    digest.update(np.ascontiguousarray(boxes, np.int64).data)
    digest.update(np.ascontiguousarray(depth_mm, np.uint16).data)
    return digest.hexdigest()[:16]


def is_learner_name(name: str) -> bool:
    """Whether a name is valid for a learner's file in the folder of the dance."""
    plain = name == name.strip() and not name.startswith(".") and all(letter.isalnum() or letter in "-_. " for letter in name)
    return bool(name) and plain and len(name.encode()) <= MAX_NAME_BYTES and f"{name}.h5" != TEACHER


def check_times(path: Path, times_s: np.ndarray) -> None:
    """Raises InputError unless (T,) times are finite, increase, and are at least one and at most MAX_FRAMES."""
    increase = np.isfinite(times_s).all() and (np.diff(times_s) > 0).all()
    expectation = f"1 to {MAX_FRAMES} finite times that increase from frame to frame, found {len(times_s)}"
    expect(bool(increase and 0 < len(times_s) <= MAX_FRAMES), f"{path}: times_s", expectation)
