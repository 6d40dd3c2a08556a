"""The folder format of K-Pop sets: dances, each with a teacher's motion, learners and the experts' order of them.

The paper's own set is no longer to be had. A set is a folder with a folder for each dance (docs/kpop_format.md):

    manifest.json        optional: what the set is, see `Manifest`
    DANCE/teacher.h5     joints_m (T, 15, 3), times_s (T,)
    DANCE/LEARNER.h5     times_s (T,) with a depth recording, true joints, or both
    DANCE/labels.csv     learner,rank: the experts' order, 1 for the best

Joints are in the order of `kpopnet.skeleton.Joint`, in metres, in the frame of a camera that sees the dancer: x right, y
down, z forward; the teacher's camera may be an imagined one. Learners' times count from the same beat as their teacher's.

Depth is kept as what is around the person: `depth_mm` is all rows of all boxes, one after the other, and `boxes` (T, 4)
says where in the image they lie (x0, y0, x1, y1, the last two exclusive; all 0 where nobody is seen). `camera` is the whole
image's: fx, fy, cx, cy, width, height. Outside its box, and wherever `depth_mm` is 0, nothing of the person was measured.
"""

import csv
import hashlib
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from kpopnet.benchmarks.sequences import Origin
from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT, VERSION = "kpopnet dance", 1
TEACHER, LABELS, MANIFEST = "teacher.h5", "labels.csv", "manifest.json"
MARGIN_PX = 8
"""Kept free around the person when a recording is cut down to where they ever are."""

MOST_FRAMES, MOST_PIXELS = 200_000, 16_000_000
"""Refused beyond: nearly two hours at 30 fps, and an image of 16 megapixels."""

MOST_IN_MEMORY = 2_000_000_000
"""Pixels of one recording once it is unpacked."""

FARTHEST_M = 1000.0

_DEPTH_KEY = re.compile("[0-9a-f]{16}")


@dataclass(frozen=True)
class DepthClip:
    """A depth recording of one person alone, cut down to the part of the image where they ever are.

    Attributes:
        depth_m: (T, h, w) float32, 0 where nothing of the person was measured.
        camera: the camera of these pixels: the whole image's, cropped.
        times_s: (T,) float64.
    """

    depth_m: np.ndarray
    camera: Camera
    times_s: np.ndarray


def read_performance(path: Path) -> Performance | None:
    """The joints in a teacher's or a learner's file, None where it has none.

    Raises:
        InputError: the file is missing, torn or odd.
    """
    with _opened(path) as file:
        if "joints_m" not in file:
            return None
        times_s = _times(file, path)
        named = tuple(np.ravel(file.attrs.get("joint_names", JOINT_NAMES)).tolist())
        if named != JOINT_NAMES:
            raise InputError(f"{path}: its joints are {', '.join(map(str, named))}; expected {', '.join(JOINT_NAMES)}")
        joints_m = _array(file, path, "joints_m", np.floating, (len(times_s), NUM_JOINTS, 3), MOST_FRAMES).astype(np.float32)
    check_joints(joints_m, path)
    return Performance(joints_m, times_s)


def read_depth(path: Path) -> DepthClip:
    """The depth recording in a learner's file.

    Raises:
        InputError: there is none, or it is torn or odd.
    """
    with _opened(path) as file:
        if "depth_mm" not in file:
            raise InputError(f"{path}: no depth_mm in it; there are only true joints to score")
        times_s = _times(file, path)
        depth_mm, boxes, camera = _stored_depth(file, path)
    check_one_each(len(boxes), "boxes", times_s, path)
    seen = boxes[boxes[:, 2] > boxes[:, 0]]
    if not len(seen):
        raise InputError(f"{path}: nobody is seen in any of its {len(boxes)} frames (every box is empty)")
    x0, y0 = np.maximum(seen[:, :2].min(axis=0) - MARGIN_PX, 0).tolist()
    x1, y1 = np.minimum(seen[:, 2:].max(axis=0) + MARGIN_PX, [camera.width, camera.height]).tolist()
    if len(boxes) * (y1 - y0) * (x1 - x0) > MOST_IN_MEMORY:
        raise InputError(f"{path}: {len(boxes)} frames of {x1 - x0}x{y1 - y0} pixels are too many; cut it in pieces")
    depth_m = np.zeros((len(boxes), y1 - y0, x1 - x0), np.float32)
    start = 0
    for image, (left, top, right, bottom) in zip(depth_m, boxes.tolist(), strict=True):
        stop = start + (right - left) * (bottom - top)
        part = depth_mm[start:stop].reshape(bottom - top, right - left)
        if stop > start:
            image[top - y0 : bottom - y0, left - x0 : right - x0] = part / np.float32(MM_PER_METRE)
        start = stop
    return DepthClip(depth_m, camera.cropped(x0, y0, x1 - x0, y1 - y0), times_s)


def read_times(path: Path) -> np.ndarray:
    """(T,) float64: when the frames of a teacher's or a learner's file are, in seconds.

    Raises:
        InputError: there are none, or they are torn or odd.
    """
    with _opened(path) as file:
        return _times(file, path)


def read_depth_key(path: Path) -> str | None:
    """A digest of the depth recording in a learner's file, 16 hexadecimal digits; None where there is no recording.

    Raises:
        InputError: the file is missing, torn or odd.
    """
    with _opened(path) as file:
        if "depth_mm" not in file:
            return None
        stored = file.attrs.get("depth_key")
        if isinstance(stored, str) and _DEPTH_KEY.fullmatch(stored):  # it becomes a part of a file's name
            return stored
        return depth_key(*_stored_depth(file, path))


def read_about(path: Path) -> dict:
    """What whoever wrote a learner's file says of it: of a simulated learner its level and strengths, else nothing."""
    with _opened(path) as file:
        text = file.attrs.get("about", "{}")
    try:
        found = json.loads(text)
    except (TypeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: its attribute `about` is no JSON ({error})") from error
    if not isinstance(found, dict):
        raise InputError(f"{path}: its attribute `about` holds no JSON object")
    return found


def read_labels(path: Path) -> list[str]:
    """The learners' names, the best first.

    Raises:
        InputError: the file is missing or empty, has other columns, or ranks that are no order.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; it says who danced better: a line learner,rank and one for each learner")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a text file of comma-separated values ({error})") from error
    if not rows:
        raise InputError(f"{path}: empty; expected a line learner,rank and one for each learner, rank 1 for the best")
    header, *body = ([cell.strip() for cell in row] for row in rows)
    if header != ["learner", "rank"]:
        raise InputError(f"{path}: its first line is {','.join(header)!r}; expected learner,rank")
    ranks: dict[str, int] = {}
    for number, row in enumerate(body, 2):
        if len(row) != 2 or not row[1].isascii() or not row[1].isdigit() or int(row[1]) < 1:
            raise InputError(f"{path}, row {number}: {','.join(row)!r}; expected a learner's name and a rank from 1 on")
        if row[0] in ranks or not is_learner(row[0]):
            raise InputError(f"{path}, row {number}: {row[0]!r} is there twice, or no name of a learner's file")
        ranks[row[0]] = int(row[1])
    if sorted(ranks.values()) != list(range(1, len(ranks) + 1)) or len(ranks) < 2:
        raise InputError(
            f"{path}: its ranks are {', '.join(map(str, ranks.values())) or 'none'}; expected each of 1, 2, ... once, for at "
            "least two learners"
        )
    return sorted(ranks, key=lambda learner: ranks[learner])


@dataclass(frozen=True)
class Manifest:
    """What a set says of itself.

    Attributes:
        name: of the set.
        origin: real or simulated.
        about: what a reader of a score must know.
        dances: how many dances it will have when it is whole, None where nobody says.
        hash: of the configuration that made it, "" where a program did not.
    """

    name: str
    origin: Origin
    about: str
    dances: int | None
    hash: str


def read_manifest(folder: Path) -> Manifest:
    """What the folder's manifest says; without one it is a real set that nobody described.

    Raises:
        InputError: the manifest is no JSON, or holds odd values.
    """
    path = folder / MANIFEST
    if not path.is_file():
        return Manifest(folder.name, Origin.REAL, "A set without a manifest.json: nothing more is known of it.", None, "")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        dances = found.get("dances")
        return Manifest(
            name=str(found.get("name", folder.name)),
            origin=Origin.SIMULATED if found.get("simulated") else Origin.REAL,
            about=str(found.get("about", "")),
            dances=None if dances is None else int(dances),
            hash=str(found.get("hash", "")),
        )
    except (OSError, UnicodeDecodeError, ValueError, AttributeError, TypeError) as error:
        raise InputError(f"{path}: not a manifest ({error}); delete it, or make the set again") from error


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with h5py.File(path, "r", locking=False) as file:
            found = file.attrs.get("format"), file.attrs.get("version")
            if found != (FORMAT, VERSION):
                raise InputError(f"{path}: expected a {FORMAT} of version {VERSION}, found {found[0]} of {found[1]}")
            yield file
    except (OSError, KeyError, RuntimeError) as error:
        raise InputError(f"{path}: it, or a part of it, cannot be read as HDF5 ({error})") from error


def _array(file: h5py.File, path: Path, name: str, kind: type, shape: tuple[int | None, ...], most: int) -> np.ndarray:
    """A dataset that lies in the file itself, checked before it is read."""
    if not isinstance(file.get(name, getlink=True), h5py.HardLink):
        raise InputError(f"{path}: no {name} in it" if name not in file else f"{path}: {name} lies in another file")
    data = file[name]
    if not isinstance(data, h5py.Dataset) or data.is_virtual or data.external:
        raise InputError(f"{path}: {name} must be an array stored in this file")
    fits = len(data.shape or ()) == len(shape) and all(
        want is None or have == want for have, want in zip(data.shape, shape, strict=True)
    )
    if not np.issubdtype(data.dtype, kind) or not fits:
        wanted = ", ".join("T" if want is None else str(want) for want in shape)
        raise InputError(f"{path}: {name} is {data.dtype} {data.shape}; expected ({wanted}), {_KINDS[kind]}")
    if data.shape[0] > most:
        raise InputError(f"{path}: {name} has {data.shape[0]} entries; at most {most} are read")
    return data[()]


_KINDS = {np.floating: "floating point", np.integer: "integers", np.uint16: "uint16 millimetres"}


def _times(file: h5py.File, path: Path) -> np.ndarray:
    times_s = _array(file, path, "times_s", np.floating, (None,), MOST_FRAMES).astype(np.float64)
    check_times(times_s, path)
    return times_s


def _stored_depth(file: h5py.File, path: Path) -> tuple[np.ndarray, np.ndarray, Camera]:
    """`depth_mm` (N,), `boxes` (T, 4) and the whole image's camera; checked against each other."""
    numbers = np.asarray(file.attrs.get("camera", ()))
    if numbers.shape != (6,) or numbers.dtype.kind not in "fiu":
        raise InputError(f"{path}: its attribute `camera` must be fx, fy, cx, cy, width, height")
    width, height = numbers[4:]
    if not (0 < width * height <= MOST_PIXELS and width == int(width) and height == int(height)):
        raise InputError(f"{path}: its camera's image is {width} x {height} pixels")
    camera = Camera(*numbers[:4].tolist(), int(width), int(height))
    boxes = _array(file, path, "boxes", np.integer, (None, 4), MOST_FRAMES).astype(np.int64)
    x0, y0, x1, y1 = boxes.T
    empty = (boxes == 0).all(axis=1)
    inside = (x0 >= 0) & (y0 >= 0) & (x1 > x0) & (y1 > y0) & (x1 <= camera.width) & (y1 <= camera.height)
    if not (inside | empty).all():
        frame = int(np.argmin(inside | empty))
        raise InputError(f"{path}: frame {frame}'s box {boxes[frame].tolist()} is not within {camera.width}x{camera.height}")
    pixels = int(((x1 - x0) * (y1 - y0)).sum())
    if pixels > MOST_IN_MEMORY:  # said before they are read: unwritten ones take no room in a file
        raise InputError(f"{path}: its boxes hold {pixels} pixels; at most {MOST_IN_MEMORY} are read; cut it in pieces")
    depth_mm = _array(file, path, "depth_mm", np.uint16, (None,), max(pixels, 1))
    if len(depth_mm) != pixels:
        raise InputError(f"{path}: depth_mm has {len(depth_mm)} pixels; its boxes hold {pixels}")
    return depth_mm, boxes, camera


def depth_key(depth_mm: np.ndarray, boxes: np.ndarray, camera: Camera) -> str:
    """16 hexadecimal digits that tell depth recordings apart.

    Args:
        depth_mm: (N,) uint16, the pixels of all boxes.
        boxes: (T, 4) integers.
        camera: the whole image's.
    """
    digest = hashlib.sha256(repr(camera).encode())
    digest.update(np.ascontiguousarray(boxes, np.int64))
    digest.update(np.ascontiguousarray(depth_mm, np.uint16))
    return digest.hexdigest()[:16]


def is_learner(name: str) -> bool:
    """Whether a name can be that of a learner's file, and leads nowhere else."""
    plain = name == name.strip() and not name.startswith(".") and all(letter.isalnum() or letter in "-_. " for letter in name)
    return bool(name) and plain and f"{name}.h5" != TEACHER


def check_times(times_s: np.ndarray, path: Path) -> None:
    """Refuses (T,) seconds that no file may hold.

    Raises:
        InputError: none, too many, another shape, or they do not grow.
    """
    if times_s.ndim != 1 or len(times_s) > MOST_FRAMES:
        raise InputError(f"{path}: its times_s have the shape {times_s.shape}; expected (T,), at most {MOST_FRAMES}")
    if not len(times_s) or not np.isfinite(times_s).all() or (np.diff(times_s) <= 0).any():
        raise InputError(f"{path}: its times_s must be finite and grow from frame to frame, and there must be some")


def check_joints(joints_m: np.ndarray, path: Path) -> None:
    """Refuses (T, 15, 3) joints in metres that no file may hold.

    Raises:
        InputError: another shape, values that are no metres, or no joint at all.
    """
    if joints_m.ndim != 3 or joints_m.shape[1:] != (NUM_JOINTS, 3):
        raise InputError(f"{path}: joints_m has the shape {joints_m.shape}; expected (T, {NUM_JOINTS}, 3)")
    if np.isinf(joints_m).any() or (np.abs(joints_m) > FARTHEST_M).any():
        raise InputError(f"{path}: joints_m holds values beyond {FARTHEST_M:g} m; expected metres, NaN for missing joints")
    if np.isnan(joints_m).all():
        raise InputError(f"{path}: joints_m holds no joint at all")


def check_one_each(count: int, what: str, times_s: np.ndarray, path: Path) -> None:
    """Refuses another number of something than of times.

    Raises:
        InputError: the numbers differ.
    """
    if count != len(times_s):
        raise InputError(f"{path}: {count} {what} but {len(times_s)} times_s; there must be one for each frame")
