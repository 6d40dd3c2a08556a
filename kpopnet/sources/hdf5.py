"""Depth from HDF5 files."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import Hdf5Schema, attributes_of, open_hdf5, read_array, stored_array
from kpopnet.runtime.input_files import ArraySchema, check_budget
from kpopnet.sources.arrays import chosen_array, rate_of
from kpopnet.sources.source import Recording, StoredImage, check_size

NAME = "an HDF5 file of depth"
TIMES = "times_s"


def read_hdf5(path: Path, key: str | None) -> Recording:
    """An HDF5 file with an array of depth at its root; if known attributes `camera` and `fps`, or an array `times_s`.

    Raises:
        InputError: not a readable HDF5 file, or not such arrays.
    """
    with open_hdf5(path, Hdf5Schema(NAME, {})) as file:
        shapes = {name: one.shape for name, one in file.items() if isinstance(one, h5py.Dataset) and one.shape}
        name = chosen_array(str(path), shapes, key)
        frames, height, width = shapes[name]
        check_size(f"{path}: {name}", width, height, frames)
        block = max(1, (stored_array(file, name).chunks or [1])[0])
        check_budget(path, 8 * min(block, frames) * height * width, f"a chunk of {name}")
        attributes = attributes_of(file)
    arrays = {name: ArraySchema("fiu", (frames, height, width))}
    if TIMES in shapes:
        arrays[TIMES] = ArraySchema("fiu", (frames,))
    schema = Hdf5Schema(NAME, arrays)
    with open_hdf5(path, schema) as file:
        times_s = read_array(file, TIMES) if TIMES in shapes else None

    def images() -> Iterator[StoredImage]:
        with open_hdf5(path, schema) as file:
            stored = stored_array(file, name)
            for start in range(0, frames, block):
                for number, depth in enumerate(stored[start : start + block], start):
                    time_s = None if times_s is None else float(times_s[number])
                    yield StoredImage(depth, f"{path}: {name}, frame {number}", time_s)

    fps = rate_of(str(path), times_s, _number(path, attributes.get("fps")))
    return Recording(images, width, height, frames, fps, _camera(path, attributes.get("camera")))


def _camera(path: Path, stored: Any) -> Camera | None:
    """The camera of an attribute fx, fy, cx, cy, width, height; None without one."""
    if stored is None:
        return None
    if not isinstance(stored, list) or len(stored) != 6 or any(_number(path, one) is None for one in stored):
        raise InputError(f"{path}: attribute camera is not fx, fy, cx, cy, width, height")
    return Camera.from_numbers(stored, f"{path}: attribute camera")


def _number(path: Path, stored: Any) -> float | None:
    """A number of an attribute; None without one."""
    if stored is None:
        return None
    if isinstance(stored, list | np.ndarray) and len(stored) == 1:
        stored = stored[0]
    if not isinstance(stored, int | float) or not math.isfinite(stored):
        raise InputError(f"{path}: an attribute is {str(stored)[:40]!r}, expected a number")
    return float(stored)
