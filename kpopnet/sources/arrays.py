"""Depth from numpy's files: .npz, which is unpacked one image at a time, and .npy, which is mapped into memory."""

import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, expect, names_in, open_npy, read_npy_header, read_npz
from kpopnet.sources.source import Recording, StoredImage, check_size

NAMES = ("depth_mm", "depth_m", "depth")
"""Names by which depth is known among other arrays."""


def chosen_array(where: str, shapes: Mapping[str, tuple[int, ...]], key: str | None) -> str:
    """The name of the array that holds the depth: `key`, one of NAMES, or the only one of three axes.

    Raises:
        InputError: there is none, or several.
    """
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


def rate_of(where: str, times_s: np.ndarray | None, fps: float | None) -> float | None:
    """Images per second as a file tells it: of its times, else as stated; None where it tells neither.

    Raises:
        InputError: not 1 to 1000.
    """
    if times_s is not None and len(times_s) > 1:
        with np.errstate(divide="ignore", invalid="ignore"):
            fps = float(1 / np.median(np.diff(times_s)))
    if fps is not None and not 1 <= fps <= 1000:
        raise InputError(f"{where}: its times or its rate mean {fps:g} images a second; expected 1 to 1000")
    return fps


def read_npz_depth(path: Path, key: str | None) -> Recording:
    """An .npz file with an array of depth, and if known `camera` or `intrinsics`, `times_s` or `fps`.

    Raises:
        InputError: not a readable .npz file, or not such arrays.
    """
    shapes = {}
    with _archive(path) as archive:
        for info in archive.infolist():
            if info.filename.endswith(".npy") and not info.flag_bits & 1:
                with archive.open(info) as member:
                    shapes[info.filename.removesuffix(".npy")] = read_npy_header(member, f"{path}: {info.filename}")[0]
    name = chosen_array(str(path), shapes, key)
    frames, height, width = shapes[name]
    check_size(f"{path}: {name}", width, height, frames)
    schemas = {
        "camera": ArraySchema("fiu", (6,), False), "intrinsics": ArraySchema("fiu", shapes.get("intrinsics", ()), False),
        "times_s": ArraySchema("fiu", (frames,), False), "fps": ArraySchema("fiu", (), False),
    }  # fmt: skip
    known = read_npz(path, schemas)
    times_s = known.get("times_s")
    fps = rate_of(str(path), times_s, float(known["fps"]) if "fps" in known else None)

    def images() -> Iterator[StoredImage]:
        for number, depth in enumerate(_unpacked(path, name)):
            yield StoredImage(depth, f"{path}: {name}, frame {number}", None if times_s is None else float(times_s[number]))

    return Recording(images, width, height, frames, fps, _camera(path, known, width, height))


def _camera(path: Path, known: Mapping[str, np.ndarray], width: int, height: int) -> Camera | None:
    """The camera of `camera` (fx, fy, cx, cy, width, height) or `intrinsics` (fx, fy, cx, cy, or a 3x3 matrix)."""
    if "camera" in known:
        return Camera.from_numbers(known["camera"].astype(float).tolist(), f"{path}: camera")
    if "intrinsics" not in known:
        return None
    given = known["intrinsics"].astype(float)
    expect(given.shape in ((4,), (3, 3)), f"{path}: intrinsics", f"fx, fy, cx, cy or a 3x3 matrix, found shape {given.shape}")
    if given.shape == (3, 3):
        return Camera.from_intrinsics(given, width, height)
    return Camera.from_numbers([*given.tolist(), width, height], f"{path}: intrinsics")


@contextmanager
def _archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Opens an .npz file; what goes wrong within becomes an InputError."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except InputError:
        raise
    except Exception as error:  # of the archive's own bytes: zipfile.BadZipFile, zlib.error, struct.error, KeyError and others
        reason = next(iter(str(error).splitlines()), type(error).__name__)[:200]
        raise InputError(f"{path}: not a readable .npz file ({reason})") from error


def _unpacked(path: Path, name: str) -> Iterator[np.ndarray]:
    """The images of one array of an .npz file, unpacked one after another."""
    with _archive(path) as archive, archive.open(f"{name}.npy") as member:
        shape, fortran, dtype = read_npy_header(member, f"{path}: {name}")
        if fortran:
            raise InputError(f"{path}: {name} is stored in Fortran order; save it again with numpy.ascontiguousarray")
        for number in range(shape[0]):
            yield _image(member, shape[1:], dtype, f"{path}: {name}, frame {number}")


def _image(member: IO[bytes], shape: tuple[int, ...], dtype: np.dtype, where: str) -> np.ndarray:
    needed = math.prod(shape) * dtype.itemsize
    try:
        packed = member.read(needed)
    except (EOFError, zlib.error, zipfile.BadZipFile) as error:
        raise InputError(f"{where}: damaged ({error})") from error
    expect(len(packed) == needed, where, f"{needed:,} bytes, found {len(packed):,}: truncated")
    return np.frombuffer(packed, dtype).reshape(shape)


def read_npy(path: Path, key: str | None) -> Recording:
    """An .npy file of (T, H, W) depth, or (H, W) for a single image.

    Raises:
        InputError: not a readable .npy file of such depth, or a key is given.
    """
    if key is not None:
        raise InputError(f"{path}: an .npy file has no arrays by name, such as {key}")
    with path.open("rb") as file:
        axes = len(read_npy_header(file, str(path))[0])
    stored = open_npy(path, ArraySchema("fiu", (None,) * (2 if axes == 2 else 3)))
    sequence = stored.reshape(-1, *stored.shape[-2:])
    frames, height, width = sequence.shape
    check_size(str(path), width, height, frames)

    def images() -> Iterator[StoredImage]:
        return (StoredImage(np.asarray(depth), f"{path}: frame {number}") for number, depth in enumerate(sequence))

    return Recording(images, width, height, frames)
