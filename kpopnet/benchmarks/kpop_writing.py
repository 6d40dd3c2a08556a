"""Writes dances in the folder format of K-Pop sets (`kpopnet.benchmarks.kpop_format`)."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import h5py
import numpy as np

from kpopnet.benchmarks.kpop_format import FORMAT, LABELS, TEACHER, VERSION, depth_key, is_plain
from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.replacing import replacing
from kpopnet.skeleton import JOINT_NAMES

_CHUNK = 1 << 16


def write_teacher(folder: Path, performance: Performance, about: Mapping | None = None) -> None:
    """Writes DANCE/teacher.h5; the folder may be new."""
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
        InputError: neither joints nor depth, or a name that cannot be a file's.
    """
    if joints_m is None and depth is None:
        raise InputError(f"learner {name}: neither joints nor depth to write")
    if not is_plain(name) or f"{name}.h5" == TEACHER:
        raise InputError(f"learner {name!r}: not a name for a file; take letters, digits, - and _")
    _write(folder / f"{name}.h5", times_s, joints_m, depth, about)


def write_labels(folder: Path, best_first: Iterable[str]) -> None:
    """Writes DANCE/labels.csv, last of all: a dance without it is not finished."""
    lines = ["learner,rank", *(f"{name},{rank}" for rank, name in enumerate(best_first, 1))]
    with replacing(folder / LABELS) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


class PackedDepth:
    """A recording being gathered: of every frame only the box around the person."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self._parts: list[np.ndarray] = []
        self._boxes: list[tuple[int, int, int, int]] = []

    def add(self, depth_m: np.ndarray, x0: int = 0, y0: int = 0) -> None:
        """The next frame: (h, w) metres of the person alone, whose first pixel is (x0, y0) of the image."""
        rows, columns = np.flatnonzero(depth_m.any(axis=1)), np.flatnonzero(depth_m.any(axis=0))
        if not len(rows):
            self._boxes.append((0, 0, 0, 0))
            return
        top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
        self._boxes.append((x0 + left, y0 + top, x0 + right, y0 + bottom))
        self._parts.append(np.rint(depth_m[top:bottom, left:right] * MM_PER_METRE).astype(np.uint16).ravel())

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
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as part, h5py.File(part, "w") as file:
        file.attrs["format"], file.attrs["version"] = FORMAT, VERSION
        file.attrs["joint_names"] = JOINT_NAMES
        file.attrs["about"] = json.dumps(about or {})
        file["times_s"] = np.asarray(times_s, np.float64)
        if joints_m is not None:
            file["joints_m"] = np.asarray(joints_m, np.float32)
        if depth is not None:
            camera, depth_mm, boxes = depth.camera, depth.depth_mm, depth.boxes
            file.attrs["camera"] = (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
            file.attrs["depth_key"] = depth_key(depth_mm, boxes, camera)
            file["boxes"] = boxes
            file.create_dataset("depth_mm", data=depth_mm, chunks=(_CHUNK,), maxshape=(None,), compression=1, shuffle=True)
