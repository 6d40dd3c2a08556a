"""Depth from numpy's files: .npz, which is unpacked one image at a time, and .npy, which is mapped into memory."""

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, expect, names_in, open_npy, read_npy_header, read_npz
from kpopnet.sources.source import Recording, StoredImage, parsing

NAMES = ("depth_mm", "depth_m", "depth")
"""Names by which depth is known among other arrays."""

NOT_NPZ = "not a readable .npz file"


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


def rate_of(times_s: np.ndarray) -> float | None:
    """Images per second by the median step of (T,) times; None of fewer than two."""
    if len(times_s) < 2:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(1 / np.median(np.diff(times_s)))


def read_npz_depth(path: Path, key: str | None) -> Recording:
    """An .npz file with an array of depth, and if known `camera` or `intrinsics`, `times_s` or `fps`.

    Raises:
        InputError: not a readable .npz file, or not such arrays.
    """
    shapes = {}
    with parsing(str(path), NOT_NPZ), zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            if info.filename.endswith(".npy") and not info.flag_bits & 1:
                with archive.open(info) as member:
                    shapes[info.filename.removesuffix(".npy")] = read_npy_header(member, f"{path}: {info.filename}")[0]
    name = chosen_array(str(path), shapes, key)
    frames, height, width = shapes[name]
    schemas = {
        "camera": ArraySchema("fiu", (6,), False), "intrinsics": ArraySchema("fiu", shapes.get("intrinsics", ()), False),
        "times_s": ArraySchema("fiu", (frames,), False), "fps": ArraySchema("fiu", (), False),
    }  # fmt: skip
    known = read_npz(path, schemas)
    times_s = known.get("times_s")
    fps = float(known["fps"]) if "fps" in known else None
    if times_s is not None:
        fps = rate_of(times_s) or fps

    def images() -> Iterator[StoredImage]:
        with parsing(str(path), NOT_NPZ), zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as member:
            _, fortran, dtype = read_npy_header(member, f"{path}: {name}")
            if fortran:
                raise InputError(f"{path}: {name} is stored in Fortran order; save it again with numpy.ascontiguousarray")
            needed = height * width * dtype.itemsize
            for number in range(frames):
                where, packed = f"{path}: {name}, frame {number}", member.read(needed)
                expect(len(packed) == needed, where, f"{needed:,} bytes, found {len(packed):,}: truncated")
                time_s = None if times_s is None else float(times_s[number])
                yield StoredImage(np.frombuffer(packed, dtype).reshape(height, width), where, time_s)

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


def read_npy(path: Path) -> Recording:
    """An .npy file of (T, H, W) depth, or (H, W) for a single image.

    Raises:
        InputError: not a readable .npy file of such depth.
    """
    with path.open("rb") as file:
        axes = len(read_npy_header(file, str(path))[0])
    stored = open_npy(path, ArraySchema("fiu", (None,) * (2 if axes == 2 else 3)))
    sequence = stored.reshape(-1, *stored.shape[-2:])

    def images() -> Iterator[StoredImage]:
        return (StoredImage(np.asarray(depth), f"{path}: frame {number}") for number, depth in enumerate(sequence))

    return Recording(images, sequence.shape[2], sequence.shape[1], len(sequence))
