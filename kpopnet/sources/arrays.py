"""Depth from arrays: .npz, unpacked image by image, HDF5, read chunk by chunk, and .npy; recordings of our own, HDF5."""

import errno
import os
import shutil
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import astuple
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import (
    ArraySchema,
    check_array,
    check_budget,
    expect,
    names_in,
    parsing,
    read_npy_header,
    read_npz,
)
from kpopnet.sources.source import Recording, StoredImage, rate

NAMES = ("depth_mm", "depth_m", "depth")
"""Names by which depth is known among other arrays."""

GZIP_LEVEL, MAX_DEPTH_MM = 1, 65535
LEAST_FREE_BYTES = 200_000_000
"""A recording ends where less is free on the disk."""

NOT_NPZ, NOT_HDF5 = "not a readable .npz file", "not a readable HDF5 file"


def _chosen(where: str, shapes: Mapping[str, tuple[int, ...]], key: str | None) -> str:
    """The name of the array that holds the depth: `key`, one of NAMES, or the only one of three axes."""
    listed = names_in(f"{name} {shape}" for name, shape in shapes.items()) or "none"
    if key is not None:
        if len(shapes.get(key, ())) != 3:
            raise InputError(f"{where}: no array {key} of shape (frames, height, width); it holds {listed}")
        return key
    fitting = [name for name, shape in shapes.items() if len(shape) == 3 and shape[2] > 3]
    known = [name for name in NAMES if name in fitting] or fitting
    if not known:
        raise InputError(f"{where}: no array of shape (frames, height, width); it holds {listed}")
    if len(known) > 1 and known[0] not in NAMES:
        raise InputError(f"{where}: several arrays could be depth, say which (--key): it holds {listed}")
    return known[0]


def read_npz_depth(path: Path, key: str | None) -> Recording:
    """An .npz file with an array of depth, and if known `times_s` or `fps`, and `camera` (fx, fy, cx, cy, width, height) or
    `intrinsics` (fx, fy, cx, cy, or a 3x3 matrix).
    """
    shapes = {}
    with parsing(path, NOT_NPZ), zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            if info.filename.endswith(".npy") and not info.flag_bits & 1:
                with archive.open(info) as member:
                    shape, _, dtype = read_npy_header(member, f"{path}: {info.filename}", may_be_objects=True)
                if not dtype.hasobject:  # as of a dict of notes beside the depth
                    shapes[info.filename.removesuffix(".npy")] = shape
    name = _chosen(str(path), shapes, key)
    frames, height, width = shapes[name]
    schemas = {
        "camera": ArraySchema("fiu", (6,), False), "intrinsics": ArraySchema("fiu", shapes.get("intrinsics", ()), False),
        "times_s": ArraySchema("fiu", (frames,), False), "fps": ArraySchema("fiu", (), False),
    }  # fmt: skip
    known = read_npz(path, schemas)
    times_s, camera = known.get("times_s"), None
    if "camera" in known:
        camera = Camera.from_numbers(known["camera"].astype(float).tolist(), f"{path}: camera")
    elif "intrinsics" in known:
        given, where = known["intrinsics"].astype(float), f"{path}: intrinsics"
        expect(given.shape in ((4,), (3, 3)), where, f"fx, fy, cx, cy or a 3x3 matrix, found shape {given.shape}")
        if given.shape == (3, 3):
            try:
                camera = Camera.from_intrinsics(given, width, height)
            except InputError as error:
                raise InputError(f"{where}: {error}") from error
        else:
            camera = Camera.from_numbers([*given.tolist(), width, height], where)

    def images() -> Iterator[StoredImage]:
        with parsing(path, NOT_NPZ), zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as member:
            for number, depth in enumerate(_stored_images(member, f"{path}: {name}")):
                yield StoredImage(depth, f"{path}: {name}, frame {number}", None if times_s is None else float(times_s[number]))

    fps = rate(times_s) or (float(known["fps"]) if "fps" in known else None)
    return Recording(images, width, height, frames, fps, camera)


def read_hdf5(path: Path, key: str | None) -> Recording:
    """An HDF5 file with an array of depth; if known, attributes `camera` and `fps` of the file, `times_s` beside the array."""
    with parsing(path, NOT_HDF5), _opened(path) as file:
        arrays: dict[str, h5py.Dataset] = {}
        # Links to other places are not followed.
        file.visititems(lambda name, one: arrays.update({name: one}) if isinstance(one, h5py.Dataset) else None)
        shapes = {one: array.shape for one, array in arrays.items() if array.shape and array.dtype.kind in "fiu"}
        name = _chosen(str(path), shapes, key)
        depth = arrays[name]
        if depth.is_virtual or depth.external:
            raise InputError(f"{path}: {name} lies in another file; expected it in this one")
        frames, height, width = depth.shape
        block = min((depth.chunks or (1,))[0], frames)  # a compressed chunk is unpacked once
        check_budget(path, block * height * width * depth.dtype.itemsize, f"a chunk of {name}")
        times = name.removesuffix(name.rpartition("/")[2]) + "times_s"
        # A writer that was killed may have written one time more.
        known = len(shapes.get(times, ())) == 1 and frames <= shapes[times][0] <= frames + 1
        times_s = arrays[times][:frames] if known else None
        fps = _attribute(path, file, "fps", "a number")
        camera = _attribute(path, file, "camera", "fx, fy, cx, cy, width, height")

    def images() -> Iterator[StoredImage]:
        with parsing(path, NOT_HDF5), _opened(path) as file:
            for start in range(0, frames, block):
                for number, image in enumerate(file[name][start : start + block], start):
                    time_s = None if times_s is None else float(times_s[number])
                    yield StoredImage(image, f"{path}: {name}, frame {number}", time_s)

    stated = Camera.from_numbers(camera, f"{path}: camera") if camera else None
    return Recording(images, width, height, frames, rate(times_s) or (fps[0] if fps else None), stated)


def _opened(path: Path) -> h5py.File:
    """A file for reading, also one to which `DepthWriter` writes just now, or wrote when it was killed."""
    try:
        return h5py.File(path, locking=False)
    except OSError as error:
        if "already open for write" not in str(error):
            raise
        return h5py.File(path, locking=False, swmr=True)


class DepthWriter:
    """Writes depth images to an HDF5 file that `read_hdf5` opens, with camera and times.

    HDF5's mode for a single writer and many readers orders what is written, so that the images so far can be read at any
    moment, also after a kill.

    Attributes:
        images: number of images so far.
    """

    def __init__(self, path: Path, camera: Camera) -> None:
        """Raises OSError as `add`: on a full disk HDF5 makes a file at which it crashes."""
        shape = camera.height, camera.width
        self.path = path
        self._check_space()
        self._file = h5py.File(path, "w", libver="latest")
        self._file.attrs["camera"] = astuple(camera)
        packed: dict[str, Any] = {"chunks": (1, *shape), "compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True}
        self._depth = self._file.create_dataset("depth_mm", (0, *shape), "<u2", maxshape=(None, *shape), **packed)
        self._times = self._file.create_dataset("times_s", (0,), "<f8", maxshape=(None,), chunks=(1024,))
        self._file.swmr_mode = True
        self.images = 0

    def add(self, depth_m: np.ndarray, time_s: float) -> None:
        """Adds (H, W) float metres, rounded to millimetres; beyond 65.5 m they are not measured, 0.

        Raises OSError: less than LEAST_FREE_BYTES are free; HDF5 cannot close a file on a full disk.
        """
        self._check_space()
        number, depth_mm = self.images, np.rint(depth_m * MM_PER_METRE)
        stored = np.where(depth_mm > MAX_DEPTH_MM, 0, depth_mm).astype("<u2")
        shuffled = stored.reshape(-1, 1).view(np.uint8).T.tobytes()
        self._times.resize(number + 1, 0)
        self._times[number] = time_s
        self._times.flush()
        self._depth.resize(number + 1, 0)
        # Packed here, as HDF5 would, because HDF5 stops all other threads meanwhile.
        self._depth.id.write_direct_chunk((number, 0, 0), zlib.compress(shuffled, GZIP_LEVEL))
        self._depth.flush()
        self.images += 1

    def close(self) -> None:
        self._file.close()

    def _check_space(self) -> None:
        if shutil.disk_usage(self.path.parent).free < LEAST_FREE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))


def _attribute(path: Path, file: h5py.File, name: str, expected: str) -> list[float] | None:
    """An attribute of as many finite numbers as `expected` names; None without one."""
    if name not in file.attrs:
        return None
    stored, count = np.ravel(file.attrs[name]), len(expected.split(","))
    fits = stored.dtype.kind in "fiu" and len(stored) == count and bool(np.isfinite(stored).all())
    expect(fits, f"{path}: attribute {name}", expected)
    return stored.astype(float).tolist()


def read_npy(path: Path) -> Recording:
    """An .npy file of (T, H, W) depth, or (H, W) for a single image."""
    with path.open("rb") as file:
        shape, _, dtype = read_npy_header(file, str(path))
    schema = ArraySchema("fiu", (None,) * (2 if len(shape) == 2 else 3))
    check_array(str(path), shape, dtype, schema)
    frames, height, width = (1, *shape)[-3:]

    def images() -> Iterator[StoredImage]:
        with path.open("rb") as file:
            for number, depth in enumerate(_stored_images(file, str(path))):
                yield StoredImage(depth, f"{path}: frame {number}")

    return Recording(images, width, height, frames)


def _stored_images(file: IO[bytes], where: str) -> Iterator[np.ndarray]:
    """The (H, W) images of an .npy stream, one after another."""
    shape, fortran, dtype = read_npy_header(file, where)
    frames, height, width = (1, *shape)[-3:]
    if fortran and frames * height * width > max(shape, default=0):
        raise InputError(f"{where}: stored in Fortran order; save it again with numpy.ascontiguousarray")
    needed = height * width * dtype.itemsize
    for number in range(frames):
        packed = file.read(needed)
        expect(len(packed) == needed, f"{where}, frame {number}", f"{needed:,} bytes, found {len(packed):,}: truncated")
        yield np.frombuffer(packed, dtype).reshape(height, width)
