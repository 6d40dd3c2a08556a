"""Sets of dances, recorded or simulated, in the folder format of docs/kpop_format.md, read on demand.

Joints have the order of `kpopnet.skeleton.Joint`, in metres in the frame of a camera that faces the dancer: x right, y down,
z forward. `depth_mm` holds the pixels of the person's bounding box, frame by frame and row by row; `boxes` (T, 4) are x0, y0,
x1, y1 in the image of `camera`, the last two exclusive, all 0 in a frame without a person.
"""

import csv
import hashlib
import io
import math
import re
import unicodedata
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.dance.performance import Performance
from kpopnet.data.made_sets import MANIFEST
from kpopnet.datasets.protocol import BenchmarkConfig, Origin, check_joints
from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import Hdf5Schema, attributes_of, open_hdf5, read_array, stored_array
from kpopnet.runtime.input_files import (
    ArraySchema,
    as_path,
    check_budget,
    check_fields,
    check_names,
    expect,
    parse_json,
    plain_name,
    read_json,
    read_text,
)
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

FORMAT, VERSION = "kpopnet dance", 1
TEACHER, LABELS = "teacher.h5", "labels.csv"
MAX_FRAMES = 200_000  # nearly two hours at 30 fps
MAX_COORDINATE_M, MAX_NAME_BYTES, MAX_LABELS_BYTES = 1000.0, 200, 1_000_000

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

MARGIN_PX = 8  # around the union of all boxes, to which a recording is cropped


@dataclass
class KpopConfig(BenchmarkConfig):
    """Settings of a set of dances on disk.

    Attributes:
        dances: number of dances to evaluate, the first ones of the set, for a quick test; all by default.
        dance: name of the dance whose scores over time are plotted; by default the dance in which the score of a worse
            learner is farthest above, or least below, that of the next better learner.
        poses: folder of the cached poses of the estimators; by default `poses` in the folder of the set.
        seen_teacher: each estimator's learners are compared with the teacher as it sees them (network, realtime, best): what
            it is off of all who dance the same is no fault.
    """

    name: str = "kpop"
    dances: int | None = None
    dance: str | None = None
    poses: str | None = None
    seen_teacher: bool = False

    def __post_init__(self) -> None:
        if self.dances is not None and self.dances < 1:
            raise InputError(f"benchmark.dances={self.dances}: expected at least 1, or omit it for all")


@dataclass(frozen=True)
class DepthClip:
    """A depth recording of one segmented person, cropped to the union of the person's bounding boxes."""

    depth_m: np.ndarray  # (T, h, w) float32 metres, 0 where nothing of the person was measured
    camera: Camera  # camera of the cropped images
    times_s: np.ndarray  # (T,) float64 seconds


@dataclass(frozen=True)
class Learner:
    """One recording of one learner. Its contents are read on demand; a damaged file raises InputError then."""

    name: str
    path: Path

    @cached_property
    def depth_key(self) -> str | None:
        """The `depth_key` of the recording; None if the file has no depth."""
        with open_hdf5(self.path, SCHEMA) as file:
            if "depth_mm" not in file:
                return None
            stored = attributes_of(file).get("depth_key")
            if isinstance(stored, str) and re.fullmatch("[0-9a-f]{16}", stored):  # it becomes part of a file name
                return stored
            return depth_key(*read_stored_depth(self.path, file))

    @cached_property
    def about(self) -> dict:
        """The notes that the writer of the file stored in it: level and strengths of a simulated learner, otherwise empty."""
        where = f"{self.path}: attribute about"
        with open_hdf5(self.path, SCHEMA) as file:
            about = parse_json(attributes_of(file).get("about", "{}"), where)
        expect(isinstance(about, dict), where, "a JSON object")
        return about

    def times_s(self) -> np.ndarray:
        """(T,) float64 times of the frames in seconds."""
        with open_hdf5(self.path, SCHEMA) as file:
            return read_times(self.path, file)

    def joints(self) -> Performance | None:
        """The true joints; None if the file has none."""
        return read_performance(self.path)

    def depth(self) -> DepthClip:
        """Reads the depth recording; raises InputError if the file has none, or is damaged or invalid."""
        path = self.path
        with open_hdf5(path, SCHEMA) as file:
            expect("depth_mm" in file, str(path), "a recording depth_mm; only its true joints can be scored")
            times_s = read_times(path, file)
            depth_mm, boxes, camera = read_stored_depth(path, file)
        nonempty = boxes[boxes[:, 2] > boxes[:, 0]]
        expect(len(nonempty) > 0, str(path), f"a person in one of its {len(boxes)} frames; every box is empty")
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


@dataclass(frozen=True)
class Dance:
    """One dance; its learners are in the experts' order, the best first, or by name where ranks are not asked for."""

    name: str
    folder: Path
    learners: tuple[Learner, ...]

    def teacher(self) -> Performance:
        """Reads the motion of the teacher; raises InputError if the file is missing, damaged or invalid."""
        performance = read_performance(self.folder / TEACHER)
        if performance is None:
            raise InputError(f"{self.folder / TEACHER}: expected an array joints_m")
        return performance


class KpopSet:
    """A folder of dances, read one dance at a time; `unlabelled` counts those that are left out for want of labels."""

    def __init__(self, folder: Path | str, ranked: bool = True) -> None:
        """Lists the dances, or with ranked=False also those without labels.

        Raises InputError if the folder does not exist or holds no dances, or its manifest is invalid.
        """
        self.folder = as_path(folder)
        if not self.folder.is_dir():
            raise InputError(f"{self.folder}: no such folder; `python -m synth benchmark=kpop_sim` makes a set of dances")
        self._ranked, files = ranked, (TEACHER, LABELS)[: 1 + ranked]
        self.names = sorted(path.parent.name for path in self.folder.glob(f"*/{files[-1]}"))
        check_names(str(self.folder), self.names)
        self.unlabelled = len({path.parent.name for path in self.folder.glob(f"*/{TEACHER}")} - set(self.names))
        if not self.names:
            raise InputError(
                f"{self.folder}: no dances in it; a dance is a folder with {', '.join(files)} and a file for each learner "
                "(docs/kpop_format.md)"
            )
        self.manifest = read_manifest(self.folder)

    def __len__(self) -> int:
        return len(self.names)

    def dance(self, name: str) -> Dance:
        """Reads the labels of one dance, if ranked; raises InputError if they are invalid, or a learner's file is missing."""
        if name not in self.names:
            first = ", ".join(self.names[:5])
            raise InputError(f"dance={name}: not among the {len(self.names)} of {self.folder}: {first}, ...")
        folder = self.folder / name
        learners, files = [], {plain_name(file.name): file for file in folder.glob("*.h5")}
        for learner in read_labels(folder / LABELS) if self._ranked else learners_in(folder):
            path = folder / f"{learner}.h5"
            if not path.is_file():  # an archive made by macOS may hold the letters of its name in parts
                path = files.get(plain_name(path.name), path)
            if not path.is_file():
                existing = sorted(file.stem for file in folder.glob("*.h5") if file.name != TEACHER)
                raise InputError(f"{path}: missing, though {LABELS} ranks {learner}; there are {', '.join(existing) or 'none'}")
            learners.append(Learner(learner, path))
        return Dance(name, folder, tuple(learners))


def learners_in(folder: Path) -> list[str]:
    """Names of the learners of a dance by their files; raises InputError for fewer than two, or one that is not valid."""
    names = sorted(path.stem for path in folder.glob("[!.]*.h5") if path.name != TEACHER)
    check_names(str(folder), names)
    expect(len(names) >= 2 and all(map(is_learner_name, names)), str(folder), f"files NAME.h5 of two learners, found {names}")
    return names


def open_set(config: KpopConfig) -> KpopSet:
    """Opens the set of dances in a configuration; raises InputError if no folder is configured, or as `KpopSet`."""
    return KpopSet(config.folder("a folder of dances (docs/kpop_format.md)"))


def read_labels(path: Path) -> list[str]:
    """Reads the names of the learners, the best first; raises InputError unless their ranks are 1, 2, ..."""
    try:
        lines = csv.reader(io.StringIO(read_text(path, MAX_LABELS_BYTES), newline=""))
        rows = [[cell.strip() for cell in row] for row in lines if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{path}: not a text file of comma-separated values ({error})") from error
    expect(rows[:1] == [["learner", "rank"]], str(path), "a first line learner,rank and one line for each learner")
    ranks: dict[str, int] = {}
    for number, row in enumerate(rows[1:], 2):
        if len(row) != 2 or not re.fullmatch("[0-9]{1,9}", row[1]) or row[0] in ranks or not is_learner_name(row[0]):
            raise InputError(f"{path}, row {number}: {','.join(row)!r}; expected a new valid name of a learner and a rank")
        ranks[row[0]] = int(row[1])
    if sorted(ranks.values()) != list(range(1, len(ranks) + 1)) or len(ranks) < 2:
        raise InputError(f"{path}: expected each of the ranks 1, 2, ... once, for at least two learners, found {ranks}")
    return sorted(ranks, key=lambda learner: ranks[learner])


@dataclass(frozen=True)
class Manifest:
    """The description of a set for the reader of a report."""

    name: str
    origin: Origin
    about: str
    dances: int | None = None  # number of dances of the complete set; None if unknown
    hash: str = ""  # of the settings of a simulated set; "" otherwise
    ordered: bool = True  # whether the order of the learners means that one dances better than the next
    independent: bool = True  # whether each dance is another one; excerpts of few recordings are not


def read_manifest(folder: Path) -> Manifest:
    """Reads the manifest of a folder. A folder without manifest counts as a real set without description."""
    path = folder / MANIFEST
    if not path.is_file():
        return Manifest(folder.name, Origin.REAL, "A set without a manifest.json: its origin is not documented.")
    kept = {"name": str, "about": str, "dances": int | None, "hash": str, "ordered": bool, "independent": bool}
    known = {"simulated": bool} | kept
    try:
        given = check_fields(str(path), read_json(path), known, optional=known)
    except InputError as error:
        raise InputError(f"{error}: not a manifest; delete it, or make the set again") from error
    origin = Origin.SIMULATED if given.get("simulated") else Origin.REAL
    described: dict = {"name": folder.name, "about": ""} | {name: given[name] for name in kept if name in given}
    return Manifest(origin=origin, **described)


def read_performance(path: Path) -> Performance | None:
    """Reads the joints in the file of a teacher or a learner; None if it has none."""
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


A_NAME = "a name of letters, digits, spaces, -, _ and ., other than teacher"
"""What `is_learner_name` accepts, for messages."""


def is_learner_name(name: str) -> bool:
    """Whether a name is valid for a learner's file in the folder of the dance."""
    letters = all(one.isalnum() or one in "-_. " or unicodedata.category(one) in ("Mn", "Mc") for one in name)
    plain = letters and name == name.strip() and not name.startswith(".")
    return bool(name) and plain and len(name.encode()) <= MAX_NAME_BYTES and f"{name}.h5" != TEACHER


def check_times(path: Path, times_s: np.ndarray) -> None:
    """Raises InputError unless (T,) times are finite, increase, and are at least one and at most MAX_FRAMES."""
    increase = np.isfinite(times_s).all() and (np.diff(times_s) > 0).all()
    expectation = f"1 to {MAX_FRAMES} finite times that increase from frame to frame, found {len(times_s)}"
    expect(bool(increase and 0 < len(times_s) <= MAX_FRAMES), f"{path}: times_s", expectation)
