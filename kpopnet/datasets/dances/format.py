"""The folder format of K-Pop sets: dances with the motion of a teacher, learners and the experts' ranking of them.

The paper's own set is no longer available. A set is a folder with one folder per dance (docs/kpop_format.md):

    manifest.json        optional description of the set, see `Manifest`
    DANCE/teacher.h5     joints_m (T, 15, 3), times_s (T,)
    DANCE/LEARNER.h5     times_s (T,) with a depth recording, true joints, or both
    DANCE/labels.csv     learner,rank: the experts' ranking, 1 for the best

Joints have the order of `kpopnet.skeleton.Joint` and are in metres in the frame of a camera that faces the dancer: x right, y
down, z forward. The camera of the teacher may be a virtual one. Times of teacher and learners have the same zero in the music.

Depth is stored for the bounding box of the person in each frame: `depth_mm` holds the rows of all boxes one after the other,
and `boxes` (T, 4) their positions in the image (x0, y0, x1, y1, the last two exclusive; all 0 in a frame without a person).
`camera` is that of the whole image: fx, fy, cx, cy, width, height. Depth outside the box, and 0 in `depth_mm`, mean that
nothing of the person was measured.
"""

import hashlib
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.dance.performance import Performance
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
    check_joints(joints_m, path)
    return Performance(joints_m, times_s)


def read_times(path: Path, file: h5py.File) -> np.ndarray:
    """Reads the times of the frames: (T,) float64 seconds."""
    times_s = read_array(file, "times_s").astype(np.float64)
    check_times(times_s, path)
    return times_s


def read_stored_depth(path: Path, file: h5py.File) -> tuple[np.ndarray, np.ndarray, Camera]:
    """Reads `depth_mm` (N,), `boxes` (T, 4) and the camera of the whole image, and checks that they are consistent."""
    if "camera" not in file.attrs or "boxes" not in file:
        raise InputError(f"{path}: expected an attribute camera and an array boxes beside depth_mm")
    camera = Camera.from_numbers(attributes_of(file)["camera"], f"{path}: attribute camera")
    boxes = read_array(file, "boxes").astype(np.int64)
    x0, y0, x1, y1 = boxes.T
    empty = (boxes == 0).all(axis=1)
    inside = (x0 >= 0) & (y0 >= 0) & (x1 > x0) & (y1 > y0) & (x1 <= camera.width) & (y1 <= camera.height)
    if not (inside | empty).all():
        frame = int(np.argmin(inside | empty))
        raise InputError(
            f"{path}: the box {boxes[frame].tolist()} of frame {frame} is not within {camera.width}x{camera.height}"
        )
    pixels, (stored,) = int(((x1 - x0) * (y1 - y0)).sum()), stored_array(file, "depth_mm").shape
    expect(stored == pixels, f"{path}: depth_mm", f"the {pixels} pixels that its boxes hold, found {stored}")
    return read_array(file, "depth_mm"), boxes, camera


def depth_key(depth_mm: np.ndarray, boxes: np.ndarray, camera: Camera) -> str:
    """A digest of a depth recording, 16 hexadecimal digits.

    Args:
        depth_mm: (N,) uint16 millimetres, the pixels of all boxes.
        boxes: (T, 4) integers x0, y0, x1, y1.
        camera: camera of the whole image.
    """
    digest = hashlib.sha256(repr(camera).encode())
    digest.update(np.ascontiguousarray(boxes, np.int64).data)
    digest.update(np.ascontiguousarray(depth_mm, np.uint16).data)
    return digest.hexdigest()[:16]


def is_learner_name(name: str) -> bool:
    """Whether a name is valid for a learner's file in the folder of the dance."""
    plain = name == name.strip() and not name.startswith(".") and all(letter.isalnum() or letter in "-_. " for letter in name)
    return bool(name) and plain and len(name.encode()) <= MAX_NAME_BYTES and f"{name}.h5" != TEACHER


def check_times(times_s: np.ndarray, path: Path) -> None:
    """Checks the times of the frames, (T,) seconds.

    Raises:
        InputError: there are none or too many, the shape is wrong, or they do not increase.
    """
    if times_s.ndim != 1 or len(times_s) > MAX_FRAMES:
        raise InputError(f"{path}: its times_s have the shape {times_s.shape}; expected (T,), at most {MAX_FRAMES}")
    if not len(times_s) or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
        raise InputError(f"{path}: its times_s must be finite and increase from frame to frame, with at least one frame")


def check_joints(joints_m: np.ndarray, path: Path) -> None:
    """Checks (T, 15, 3) joints in metres.

    Raises:
        InputError: the shape is wrong, a value is infinite or too large for metres, or all joints are missing.
    """
    if joints_m.ndim != 3 or joints_m.shape[1:] != (NUM_JOINTS, 3):
        raise InputError(f"{path}: joints_m has the shape {joints_m.shape}; expected (T, {NUM_JOINTS}, 3)")
    if np.isinf(joints_m).any() or (np.abs(joints_m) > MAX_COORDINATE_M).any():
        raise InputError(
            f"{path}: joints_m holds values beyond {MAX_COORDINATE_M:g} m; expected metres, NaN for missing joints"
        )
    if np.isnan(joints_m).all():
        raise InputError(f"{path}: all joints in joints_m are missing")


def check_frame_count(count: int, what: str, times_s: np.ndarray, path: Path) -> None:
    """Checks that there is one item per frame.

    Raises:
        InputError: the number of items differs from the number of times.
    """
    if count != len(times_s):
        raise InputError(f"{path}: {count} {what} but {len(times_s)} times_s; there must be one for each frame")
