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

import csv
import hashlib
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.dance.performance import Performance
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import Hdf5Schema, attributes_of, open_hdf5, read_array, stored_array
from kpopnet.runtime.input_files import ArraySchema, check_budget, expect, parse_json, read_json, read_text
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT, VERSION = "kpopnet dance", 1
TEACHER, LABELS, MANIFEST = "teacher.h5", "labels.csv", "manifest.json"
MARGIN_PX = 8
"""Margin around the union of all boxes, to which a recording is cropped."""

MAX_FRAMES = 200_000
"""Larger recordings are rejected: nearly two hours at 30 fps."""

MAX_COORDINATE_M = 1000.0
MAX_NAME_BYTES = 200
MAX_LABELS_BYTES = 1_000_000

_DEPTH_KEY = re.compile("[0-9a-f]{16}")

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


@dataclass(frozen=True)
class DepthClip:
    """A depth recording of one segmented person, cropped to the union of the person's bounding boxes.

    Attributes:
        depth_m: (T, h, w) float32 metres, 0 where nothing of the person was measured.
        camera: camera of the cropped images.
        times_s: (T,) float64 seconds.
    """

    depth_m: np.ndarray
    camera: Camera
    times_s: np.ndarray


def read_performance(path: Path) -> Performance | None:
    """Reads the joints in the file of a teacher or a learner; None if it has none.

    Raises:
        InputError: the file is missing, damaged or invalid.
    """
    with open_hdf5(path, SCHEMA) as file:
        if "joints_m" not in file:
            return None
        times_s = _times(path, file)
        joints_m = read_array(file, "joints_m").astype(np.float32)
    check_joints(joints_m, path)
    return Performance(joints_m, times_s)


def read_depth(path: Path) -> DepthClip:
    """Reads the depth recording in the file of a learner.

    Raises:
        InputError: the file has no depth, or is damaged or invalid.
    """
    with open_hdf5(path, SCHEMA) as file:
        if "depth_mm" not in file:
            raise InputError(f"{path}: no depth_mm in it; only true joints can be scored")
        times_s = _times(path, file)
        depth_mm, boxes, camera = _stored_depth(path, file)
    nonempty = boxes[boxes[:, 2] > boxes[:, 0]]
    if not len(nonempty):
        raise InputError(f"{path}: no person in any of its {len(boxes)} frames (every box is empty)")
    x0, y0 = np.maximum(nonempty[:, :2].min(axis=0) - MARGIN_PX, 0).tolist()
    x1, y1 = np.minimum(nonempty[:, 2:].max(axis=0) + MARGIN_PX, [camera.width, camera.height]).tolist()
    whole = len(boxes), y1 - y0, x1 - x0
    what = f"the recording of {whole[0]} frames of {x1 - x0}x{y1 - y0} pixels"
    check_budget(path, 4 * math.prod(whole) + depth_mm.nbytes, what)
    depth_m = np.zeros(whole, np.float32)
    start = 0
    for image, (left, top, right, bottom) in zip(depth_m, boxes.tolist(), strict=True):
        stop = start + (right - left) * (bottom - top)
        pixels = depth_mm[start:stop].reshape(bottom - top, right - left)
        if stop > start:
            image[top - y0 : bottom - y0, left - x0 : right - x0] = pixels / np.float32(MM_PER_METRE)
        start = stop
    return DepthClip(depth_m, camera.cropped(x0, y0, x1 - x0, y1 - y0), times_s)


def read_times(path: Path) -> np.ndarray:
    """Reads the times of the frames in the file of a teacher or a learner: (T,) float64 seconds.

    Raises:
        InputError: there are no times, or the file is damaged or invalid.
    """
    with open_hdf5(path, SCHEMA) as file:
        return _times(path, file)


def read_depth_key(path: Path) -> str | None:
    """A digest of the depth recording in the file of a learner, 16 hexadecimal digits; None if it has no depth.

    Raises:
        InputError: the file is missing, damaged or invalid.
    """
    with open_hdf5(path, SCHEMA) as file:
        if "depth_mm" not in file:
            return None
        stored = attributes_of(file).get("depth_key")
        if isinstance(stored, str) and _DEPTH_KEY.fullmatch(stored):  # it becomes part of a file name
            return stored
        return depth_key(*_stored_depth(path, file))


def read_about(path: Path) -> dict:
    """Reads the notes of the writer of a learner's file: level and strengths of a simulated learner, otherwise empty.

    Raises:
        InputError: the file is missing or damaged, or the notes are not a JSON object.
    """
    where = f"{path}: attribute about"
    with open_hdf5(path, SCHEMA) as file:
        about = parse_json(attributes_of(file).get("about", "{}"), where)
    expect(isinstance(about, dict), where, "a JSON object")
    return about


def read_labels(path: Path) -> list[str]:
    """Reads the names of the learners in the experts' order, the best first.

    Raises:
        InputError: the file is missing or empty, has other columns, or its ranks are not 1, 2, ...
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; it holds the ranking: a line learner,rank and one line for each learner")
    try:
        lines = csv.reader(io.StringIO(read_text(path, MAX_LABELS_BYTES), newline=""))
        rows = [row for row in lines if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: not a text file of comma-separated values ({error})") from error
    if not rows:
        raise InputError(f"{path}: empty; expected a line learner,rank and one line for each learner, rank 1 for the best")
    header, *body = ([cell.strip() for cell in row] for row in rows)
    if header != ["learner", "rank"]:
        raise InputError(f"{path}: its first line is {','.join(header)!r}; expected learner,rank")
    ranks: dict[str, int] = {}
    for number, row in enumerate(body, 2):
        if len(row) != 2 or not re.fullmatch("[0-9]{1,9}", row[1]) or int(row[1]) < 1:
            raise InputError(f"{path}, row {number}: {','.join(row)!r}; expected the name of a learner and a rank of 1 or more")
        if row[0] in ranks or not is_learner_name(row[0]):
            raise InputError(f"{path}, row {number}: {row[0]!r} occurs twice, or is not a valid file name of a learner")
        ranks[row[0]] = int(row[1])
    if sorted(ranks.values()) != list(range(1, len(ranks) + 1)) or len(ranks) < 2:
        raise InputError(
            f"{path}: its ranks are {', '.join(map(str, ranks.values())) or 'none'}; expected each of 1, 2, ... once, for at "
            "least two learners"
        )
    return sorted(ranks, key=lambda learner: ranks[learner])


@dataclass(frozen=True)
class Manifest:
    """The description of a set.

    Attributes:
        name: of the set.
        origin: real or simulated.
        about: what a reader needs to interpret the results.
        dances: number of dances of the complete set; None if unknown.
        hash: hash of the configuration of a simulated set; "" otherwise.
    """

    name: str
    origin: Origin
    about: str
    dances: int | None
    hash: str


def read_manifest(folder: Path) -> Manifest:
    """Reads the manifest of a folder. A folder without manifest counts as a real set without description.

    Raises:
        InputError: the manifest is not JSON, or holds invalid values.
    """
    path = folder / MANIFEST
    if not path.is_file():
        return Manifest(folder.name, Origin.REAL, "A set without a manifest.json: its origin is not documented.", None, "")
    try:
        manifest = read_json(path)
        expect(isinstance(manifest, dict), str(path), "a JSON object")
        dances = manifest.get("dances")
        expect(dances is None or (type(dances) is int and dances >= 0), f"{path}: dances", "a whole number")
    except InputError as error:
        raise InputError(f"{error}: not a manifest; delete it, or make the set again") from error
    return Manifest(
        name=str(manifest.get("name", folder.name)),
        origin=Origin.SIMULATED if manifest.get("simulated") else Origin.REAL,
        about=str(manifest.get("about", "")),
        dances=dances,
        hash=str(manifest.get("hash", "")),
    )


def _times(path: Path, file: h5py.File) -> np.ndarray:
    times_s = read_array(file, "times_s").astype(np.float64)
    check_times(times_s, path)
    return times_s


def _stored_depth(path: Path, file: h5py.File) -> tuple[np.ndarray, np.ndarray, Camera]:
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
