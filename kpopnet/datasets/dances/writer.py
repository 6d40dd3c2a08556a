"""Writer of dances in the folder format of docs/kpop_format.md."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import astuple
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera, check_camera, depth_in_metres
from kpopnet.dance.performance import Performance, check_dance, numbers
from kpopnet.datasets.dances.dance_set import (
    A_NAME,
    FORMAT,
    LABELS,
    MAX_COORDINATE_M,
    SCHEMA,
    TEACHER,
    VERSION,
    check_times,
    depth_key,
    is_learner_name,
)
from kpopnet.datasets.protocol import check_joints
from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import atomic_hdf5, write_whole
from kpopnet.runtime.input_files import as_path, check_array, expect, parsing
from kpopnet.skeleton import JOINT_NAMES

_CHUNK = 1 << 16
_MAX_DEPTH_MM = np.iinfo(np.uint16).max


class PackedDepth:
    """A depth recording in memory that stores only the bounding box of the person in every frame."""

    def __init__(self, camera: Camera) -> None:
        check_camera(camera)
        self.camera = camera
        self._parts: list[np.ndarray] = []
        self._boxes: list[tuple[int, int, int, int]] = []

    def add(self, depth_m: np.ndarray, x0: int = 0, y0: int = 0) -> None:
        """Adds the next frame: (h, w) depth of the segmented person, metres in floating point or uint16 millimetres, 0
        elsewhere; and the column and the row of its first pixel in the whole image.
        """
        where = f"depth of frame {len(self)}"
        depth_m = depth_in_metres(depth_m, where=where)
        expect(depth_m.ndim == 2, where, f"shape (h, w), got {depth_m.shape}; add one frame at a time")
        height, width = depth_m.shape
        if not (isinstance(x0, Integral) and isinstance(y0, Integral)):
            raise InputError(f"{where}: at ({x0!r}, {y0!r}); expected the column and the row of its first pixel")
        if not (0 <= x0 <= self.camera.width - width and 0 <= y0 <= self.camera.height - height):
            raise InputError(
                f"{where}: {width}x{height} pixels at ({x0}, {y0}) are not within the image of the camera, "
                f"{self.camera.width}x{self.camera.height}"
            )
        depth_mm = np.rint(depth_m * MM_PER_METRE)
        expect(depth_mm.max(initial=0) <= _MAX_DEPTH_MM, where, f"at most {_MAX_DEPTH_MM / MM_PER_METRE} m")
        rows, columns = np.flatnonzero(depth_m.any(axis=1)), np.flatnonzero(depth_m.any(axis=0))
        if not len(rows):
            self._boxes.append((0, 0, 0, 0))
            return
        top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
        self._boxes.append((x0 + left, y0 + top, x0 + right, y0 + bottom))
        self._parts.append(depth_mm[top:bottom, left:right].astype(np.uint16).ravel())

    def __len__(self) -> int:
        return len(self._boxes)

    @property
    def depth_mm(self) -> np.ndarray:
        """(N,) uint16 millimetres: the pixels of all boxes."""
        return np.concatenate(self._parts) if self._parts else np.zeros(0, np.uint16)

    @property
    def boxes(self) -> np.ndarray:
        """(T, 4) int32 x0, y0, x1, y1 of each frame; all 0 without a person."""
        return np.array(self._boxes, np.int32).reshape(-1, 4)


def write_teacher(folder: Path | str, performance: Performance, about: Mapping[str, Any] | None = None) -> None:
    """Writes DANCE/teacher.h5, and creates the folder DANCE if necessary; `about` holds notes to store as JSON."""
    check_dance(performance, "the teacher to write")
    _write(as_path(folder) / TEACHER, performance.times_s, performance.joints_m, None, about)


def write_learner(
    folder: Path | str,
    name: str,
    times_s: np.ndarray,
    joints_m: np.ndarray | None = None,
    depth: PackedDepth | None = None,
    about: Mapping[str, Any] | None = None,
) -> None:
    """Writes DANCE/NAME.h5, and creates the folder DANCE if necessary; `about` holds notes to store as JSON.

    Times of the frames (T,) are in seconds, (T, 15, 3) true joints in metres in the camera frame. Raises InputError if neither
    joints nor depth are given, or the name, joints or times are invalid.
    """
    _check_name(name)
    expect(joints_m is not None or depth is not None, f"learner {name}", "joints or depth to write")
    expect(
        depth is None or isinstance(depth, PackedDepth), f"learner {name}: depth", "a PackedDepth, to which images were added"
    )
    _write(as_path(folder) / f"{name}.h5", times_s, joints_m, depth, about)


def write_labels(folder: Path | str, best_first: Iterable[str]) -> None:
    """Writes DANCE/labels.csv, the names of at least two learners in the experts' order. A dance without it is incomplete."""
    folder = as_path(folder)
    if isinstance(best_first, str) or not isinstance(best_first, Iterable):
        raise InputError(f"{folder / LABELS}: expected a list of names, the best first, got {best_first!r:.80}")
    names = list(best_first)
    for name in names:
        _check_name(name)
    if len(set(names)) != len(names) or len(names) < 2:
        raise InputError(f"{folder / LABELS}: learners {', '.join(names) or 'none'}; expected two or more, each once")
    lines = ["learner,rank", *(f"{name},{rank}" for rank, name in enumerate(names, 1))]
    write_whole(folder / LABELS, "\n".join(lines) + "\n")


def _check_name(name: str) -> None:
    expect(isinstance(name, str) and is_learner_name(name), f"learner {name!r:.80}", A_NAME)


def _write(
    path: Path,
    times_s: np.ndarray,
    joints_m: np.ndarray | None,
    depth: PackedDepth | None,
    about: Mapping[str, Any] | None,
) -> None:
    arrays: dict[str, np.ndarray] = {"times_s": numbers(f"{path}: times", times_s)}
    if joints_m is not None:
        arrays["joints_m"] = numbers(f"{path}: joints", joints_m).astype(np.float32)
    if depth is not None:
        arrays |= {"boxes": depth.boxes, "depth_mm": depth.depth_mm}
    expect(isinstance(about, Mapping | None), f"{path}: about", "notes by name, as a dict")
    with parsing(f"{path}: about", "cannot be stored as JSON"):
        notes = json.dumps(dict(about or {}), allow_nan=False)
    lengths: dict[str, int] = {}
    for name, array in arrays.items():
        check_array(f"{path}: {name}", array.shape, array.dtype, SCHEMA.arrays[name], lengths)
    check_times(path, arrays["times_s"])
    if joints_m is not None:
        check_joints(f"{path}: joints_m", arrays["joints_m"], MAX_COORDINATE_M)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_hdf5(path) as file:
        file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
        file.attrs["joint_names"] = JOINT_NAMES
        file.attrs["about"] = notes
        if depth is not None:
            file.attrs["camera"] = astuple(depth.camera)
            file.attrs["depth_key"] = depth_key(arrays["depth_mm"], arrays["boxes"], depth.camera)
            packed = {"chunks": (_CHUNK,), "maxshape": (None,), "compression": 1, "shuffle": True}
            file.create_dataset("depth_mm", data=arrays.pop("depth_mm"), **packed)
        for name, array in arrays.items():
            file[name] = array
