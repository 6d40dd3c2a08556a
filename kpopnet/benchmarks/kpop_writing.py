"""Writes dances in the folder format of K-Pop sets (`kpopnet.benchmarks.kpop_format`)."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import h5py
import numpy as np

from kpopnet.benchmarks.kpop_format import (
    FORMAT,
    LABELS,
    TEACHER,
    VERSION,
    check_joints,
    check_one_each,
    check_times,
    depth_key,
    is_learner,
)
from kpopnet.camera import MM_PER_METRE, Camera, depth_in_metres
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.replacing import replacing
from kpopnet.skeleton import JOINT_NAMES

_CHUNK = 1 << 16
_MOST_MM = np.iinfo(np.uint16).max


def write_teacher(folder: Path, performance: Performance, about: Mapping | None = None) -> None:
    """Writes DANCE/teacher.h5; the folder may be new.

    Raises:
        InputError: joints or times that could not be read again.
    """
    _write(folder / TEACHER, performance.times_s, performance.joints_m, None, about)


def write_learner(
    folder: Path,
    name: str,
    times_s: np.ndarray,
    joints_m: np.ndarray | None = None,
    depth: "PackedDepth | None" = None,
    about: Mapping | None = None,
) -> None:
    """Writes DANCE/NAME.h5; the folder may be new.

    Args:
        folder: of the dance.
        name: the learner's.
        times_s: (T,) of the frames.
        joints_m: (T, 15, 3) true joints in the frame of the camera.
        depth: the recording.
        about: whatever else should be kept, as JSON.

    Raises:
        InputError: neither joints nor depth, a name that cannot be a file's, or what could not be read again: times that do
            not grow, another number of joints or images than of times, joints of another shape or in no metres.
    """
    if joints_m is None and depth is None:
        raise InputError(f"learner {name}: neither joints nor depth to write")
    _check_name(name)
    _write(folder / f"{name}.h5", times_s, joints_m, depth, about)


def write_labels(folder: Path, best_first: Iterable[str]) -> None:
    """Writes DANCE/labels.csv, last of all: a dance without it is not finished.

    Raises:
        InputError: fewer than two learners, one of them twice, or a name that cannot be a file's.
    """
    names = list(best_first)
    for name in names:
        _check_name(name)
    if len(set(names)) != len(names) or len(names) < 2:
        raise InputError(f"{folder / LABELS}: learners {', '.join(names) or 'none'}; expected two or more, each of them once")
    lines = ["learner,rank", *(f"{name},{rank}" for rank, name in enumerate(names, 1))]
    with replacing(folder / LABELS) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _check_name(name: str) -> None:
    if not is_learner(name):
        raise InputError(f"learner {name!r}: not a name for a file; take letters, digits, - and _")


class PackedDepth:
    """A recording being gathered: of every frame only the box around the person."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self._parts: list[np.ndarray] = []
        self._boxes: list[tuple[int, int, int, int]] = []

    def add(self, depth_m: np.ndarray, x0: int = 0, y0: int = 0) -> None:
        """The next frame.

        Args:
            depth_m: (h, w) of the person alone, metres in floating point or uint16 millimetres; 0 where there is nothing.
            x0: column of the whole image in which its first pixel lies.
            y0: its row.

        Raises:
            InputError: no such image, one that does not lie within the camera's, or a depth too great to be stored.
        """
        where = f"depth of frame {len(self)}"
        depth_m = depth_in_metres(depth_m, where=where)
        if depth_m.ndim != 2:
            raise InputError(f"{where}: expected shape (h, w), got {depth_m.shape}; add one frame at a time")
        height, width = depth_m.shape
        if not (0 <= x0 <= self.camera.width - width and 0 <= y0 <= self.camera.height - height):
            raise InputError(
                f"{where}: {width}x{height} pixels from ({x0}, {y0}) on do not lie within the camera's "
                f"{self.camera.width}x{self.camera.height}"
            )
        depth_mm = np.rint(depth_m * MM_PER_METRE)
        if depth_mm.max(initial=0) > _MOST_MM:
            raise InputError(f"{where}: {depth_m.max():g} m; at most {_MOST_MM / MM_PER_METRE} can be stored, in metres")
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
        return np.concatenate(self._parts) if self._parts else np.zeros(0, np.uint16)

    @property
    def boxes(self) -> np.ndarray:
        return np.array(self._boxes, np.int32).reshape(-1, 4)


def _write(
    path: Path, times_s: np.ndarray, joints_m: np.ndarray | None, depth: PackedDepth | None, about: Mapping | None
) -> None:
    times_s = np.asarray(times_s, np.float64)
    check_times(times_s, path)
    if joints_m is not None:
        joints_m = np.asarray(joints_m, np.float32)
        check_joints(joints_m, path)
        check_one_each(len(joints_m), "poses", times_s, path)
    if depth is not None:
        check_one_each(len(depth), "images", times_s, path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as part, h5py.File(part, "w") as file:
        file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
        file.attrs["joint_names"] = JOINT_NAMES
        file.attrs["about"] = json.dumps(about or {})
        file["times_s"] = times_s
        if joints_m is not None:
            file["joints_m"] = joints_m
        if depth is not None:
            camera, depth_mm, boxes = depth.camera, depth.depth_mm, depth.boxes
            file.attrs["camera"] = (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
            file.attrs["depth_key"] = depth_key(depth_mm, boxes, camera)
            file["boxes"] = boxes
            file.create_dataset("depth_mm", data=depth_mm, chunks=(_CHUNK,), maxshape=(None,), compression=1, shuffle=True)
