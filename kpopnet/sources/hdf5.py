"""Depth from HDF5 files."""

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_budget, expect
from kpopnet.sources.arrays import chosen_array, rate_of
from kpopnet.sources.source import Recording, StoredImage, parsing

NOT_HDF5, TIMES = "not a readable HDF5 file", "times_s"


def read_hdf5(path: Path, key: str | None) -> Recording:
    """An HDF5 file with an array of depth; if known attributes `camera` and `fps` of the file, or an array `times_s` beside it.

    Raises:
        InputError: not a readable HDF5 file, or not such arrays.
    """
    with parsing(str(path), NOT_HDF5), h5py.File(path, locking=False) as file:
        arrays: dict[str, h5py.Dataset] = {}
        # Links to other places are not followed.
        file.visititems(lambda name, one: arrays.update({name: one}) if isinstance(one, h5py.Dataset) else None)
        shapes = {one: array.shape for one, array in arrays.items() if array.shape and array.dtype.kind in "fiu"}
        name = chosen_array(str(path), shapes, key)
        depth = arrays[name]
        if depth.is_virtual or depth.external:
            raise InputError(f"{path}: {name} lies in another file; expected it in this one")
        frames, height, width = depth.shape
        block = min((depth.chunks or (1,))[0], frames)  # a compressed chunk is unpacked once
        check_budget(path, block * height * width * depth.dtype.itemsize, f"a chunk of {name}")
        times = name.removesuffix(name.rpartition("/")[2]) + TIMES
        times_s = arrays[times][:] if shapes.get(times) == (frames,) else None
        fps = _numbers(path, file, "fps", 1)
        camera = _numbers(path, file, "camera", 6)

    def images() -> Iterator[StoredImage]:
        with parsing(str(path), NOT_HDF5), h5py.File(path, locking=False) as file:
            for start in range(0, frames, block):
                for number, image in enumerate(file[name][start : start + block], start):
                    time_s = None if times_s is None else float(times_s[number])
                    yield StoredImage(image, f"{path}: {name}, frame {number}", time_s)

    rate = None if times_s is None else rate_of(times_s)
    return Recording(
        images, width, height, frames, rate or (fps and fps[0]), camera and Camera.from_numbers(camera, f"{path}: camera")
    )


def _numbers(path: Path, file: h5py.File, name: str, count: int) -> list[float] | None:
    """An attribute of `count` finite numbers; None without one."""
    if name not in file.attrs:
        return None
    stored = np.ravel(file.attrs[name])
    fits = stored.dtype.kind in "fiu" and len(stored) == count and bool(np.isfinite(stored).all())
    expect(fits, f"{path}: attribute {name}", "a number" if count == 1 else "fx, fy, cx, cy, width, height")
    return stored.astype(float).tolist()
