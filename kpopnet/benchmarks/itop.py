"""Benchmark `itop` (Haque et al., ECCV 2016; Zenodo record 3932973): real depth of 20 people from the side and from above.

Of each view and split two HDF5 files are read, as published (unpacked, if they end in .gz):

    ITOP_<side|top>_<train|test>_depth_map.h5     id   (N,) "PP_FFFFF", person and frame
                                                  data (N, 240, 320) float16 metres, 0: not measured
    ITOP_<side|top>_<train|test>_labels.h5        id   (N,) the same
                                                  is_valid (N,) whether people have checked the labels
                                                  visible_joints (N, 15)
                                                  real_world_coordinates (N, 15, 3) metres, x right, y up, z forward

Its fifteen joints are ours, in our order, the right ones the person's right. Labels that nobody checked are no truth; their
frames stay in the sequence, so that a tracker does not lose its way. A set is far larger than memory: sequences are read
one at a time and hold at most LONGEST frames, so one person's recording is several sequences.
"""

import logging
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np

from kpopnet.benchmarks.headings import heading_rad
from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.skeleton import NUM_JOINTS

log = logging.getLogger(__name__)

CAMERA = Camera(1 / 0.0035, 1 / 0.0035, 160.0, 120.0, 320, 240)
"""By the set's own formula: X = (u - 160) Z 0.0035, Y = (120 - v) Z 0.0035."""

VIEWS = ("side", "top")
SPLITS = ("train", "test")
LONGEST = 400
"""Frames of a sequence, 120 MB."""

FROM_ITOP = np.array([1, -1, 1], np.float32)
"""Turns ITOP's axes into the camera frame's."""


@dataclass
class ItopConfig:
    """Which part of the set, and where it lies.

    Attributes:
        path: the folder that holds ITOP_side_test_depth_map.h5 and the others.
        view: side or top.
        split: test or train.
    """

    name: str = "itop"
    path: str | None = None
    view: str = "side"
    split: str = "test"

    def __post_init__(self) -> None:
        for name, known in (("view", VIEWS), ("split", SPLITS)):
            if getattr(self, name) not in known:
                raise InputError(f"benchmark.{name}={getattr(self, name)}: choose one of {', '.join(known)}")


class ItopFiles:
    """One view and split, opened: ids and labels in memory, depth on disk."""

    def __init__(self, folder: Path, view: str, split: str) -> None:
        """Reads the labels.

        Raises:
            InputError: a file is missing, is no HDF5 file, or holds something else.
        """
        self.depth_path = folder / f"ITOP_{view}_{split}_depth_map.h5"
        labels_path = folder / f"ITOP_{view}_{split}_labels.h5"
        with _opened(labels_path) as file:
            ids = _ids(file, labels_path)
            frames = len(ids)
            self.valid = _dataset(file, labels_path, "is_valid", (frames,))[:].astype(bool)
            self.visible = _dataset(file, labels_path, "visible_joints", (frames, NUM_JOINTS))[:] == 1
            joints_m = _dataset(file, labels_path, "real_world_coordinates", (frames, NUM_JOINTS, 3))[:]
        self.joints_camera_m = joints_m.astype(np.float32) * FROM_ITOP
        with _opened(self.depth_path) as file:
            stored = _ids(file, self.depth_path)
            _dataset(file, self.depth_path, "data", (frames, CAMERA.height, CAMERA.width))
        if stored != ids:
            row = next((row for row, pair in enumerate(zip(stored, ids, strict=False)) if len(set(pair)) > 1), None)
            differ = f"{len(stored)} and {len(ids)} frames" if row is None else f"{stored[row]} and {ids[row]} in row {row}"
            raise InputError(f"{self.depth_path} and {labels_path.name} do not belong together: {differ}; fetch both again")
        self.ids = ids

    def depth_m(self, rows: slice) -> np.ndarray:
        """(T, 240, 320) float32 of some rows.

        Raises:
            InputError: they cannot be read.
        """
        with _opened(self.depth_path) as file:
            try:
                stored = file["data"][rows]
            except OSError as error:
                raise InputError(f"{self.depth_path}: rows {rows.start} to {rows.stop} cannot be read ({error})") from error
        return depth_in_metres(stored, CAMERA, where=str(self.depth_path))


def _opened(path: Path) -> h5py.File:
    if not path.is_file():
        packed = path.with_name(path.name + ".gz")
        hint = f"; unpack {packed.name}: gunzip {packed}" if packed.is_file() else ""
        raise InputError(f"{path}: no such file{hint}")
    try:
        return h5py.File(path)
    except OSError as error:
        raise InputError(f"{path}: not a whole HDF5 file ({error}); fetch it again") from error


def _dataset(file: h5py.File, path: Path, name: str, shape: tuple[int, ...] | None) -> h5py.Dataset:
    found = file.get(name)
    if not isinstance(found, h5py.Dataset):
        raise InputError(f"{path}: expected a data set {name}, found {', '.join(file) or 'none'}")
    if shape is not None and found.shape != shape:
        raise InputError(f"{path}: expected {name} of shape {shape}, found {found.shape}")
    if shape is not None and found.dtype.kind not in "fiub":
        raise InputError(f"{path}: expected numbers in {name}, found {found.dtype}")
    return found


def _ids(file: h5py.File, path: Path) -> list[str]:
    """The rows' names, "PP_FFFFF"."""
    stored = _dataset(file, path, "id", None)
    if stored.ndim != 1 or not len(stored):
        raise InputError(f"{path}: expected id of shape (N,) with at least one frame, found {stored.shape}")
    ids = [one.decode(errors="replace") if isinstance(one, bytes) else str(one) for one in stored[:]]
    for row, name in enumerate(ids):
        person, _, frame = name.partition("_")
        if not (person.isdigit() and frame.isdigit()):
            raise InputError(f"{path}: row {row} is called {name!r}; expected person and frame, for instance 00_00053")
    return ids


def sequences_of(ids: list[str]) -> dict[str, slice]:
    """The rows of each sequence by its name, that of its first frame: as evenly long parts of one person's as can be."""
    people = np.array([name.partition("_")[0] for name in ids])
    starts = np.flatnonzero(np.append(True, people[1:] != people[:-1]))
    rows = {}
    for start, stop in zip(starts.tolist(), [*starts[1:].tolist(), len(ids)], strict=True):
        cuts = np.linspace(start, stop, -(-(stop - start) // LONGEST) + 1).round().astype(int).tolist()
        for first, last in pairwise(cuts):
            if ids[first] in rows:
                raise InputError(f"ITOP: frame {ids[first]} is there twice; fetch the files again")
            rows[ids[first]] = slice(first, last)
    return rows


class ItopBenchmark:
    """The original files. The share of joints below 10 cm is the set's own measure: strictly, all joints of valid frames."""

    name = "itop"
    origin = Origin.REAL
    truth = "labels checked by people"

    def __init__(self, config: ItopConfig) -> None:
        """Reads the labels and lists the sequences.

        Raises:
            InputError: the folder does not hold the view and split, or something else under their names.
        """
        if config.path is None:
            raise InputError("benchmark=itop needs benchmark.path=PATH, the folder that holds ITOP_side_test_depth_map.h5")
        self.files = ItopFiles(Path(config.path), config.view, config.split)
        self._rows = sequences_of(self.files.ids)
        self.about = (
            f"Real depth of whole scenes, seen from {'above' if config.view == 'top' else 'the side'}, split {config.split}: "
            f"{int(self.files.valid.sum())} of {len(self.files.ids)} frames have labels that people checked, and only they "
            "are judged. A person's recording is several sequences."
        )
        self._from_above = config.view == "top"
        if self._from_above:
            self.about += (
                " Where a person faces is not told of a camera that looks down. People are found in the scenes as an upright "
                "camera sees them: where nobody is found, this may be why."
            )

    def sequence_names(self) -> list[str]:
        return list(self._rows)

    def read(self, name: str) -> Sequence:
        rows = self._rows[name]
        joints_m = np.where(self.files.valid[rows, None, None], self.files.joints_camera_m[rows], np.nan)
        labelled = np.isfinite(joints_m).all(axis=-1)
        if odd := int((~labelled[self.files.valid[rows]]).sum()):
            log.warning("%s: left out %d labels of valid frames that are not finite", name, odd)
        return Sequence(
            name=name,
            identity=name.partition("_")[0],
            fps=0.0,  # not published
            camera=CAMERA,
            depth_m=self.files.depth_m(rows),
            joints_camera_m=joints_m.astype(np.float32),
            visible=self.files.visible[rows] & labelled,
            yaw_rad=None if self._from_above else heading_rad(joints_m),  # which is about a camera that stands upright
            alone=False,
        )
