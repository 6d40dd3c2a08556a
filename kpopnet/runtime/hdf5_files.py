"""Opens HDF5 files and compares them with a declared schema; whatever h5py raises becomes an `InputError` of one line.

Files on one's own disk are opened in this process. Those of strangers are read by `kpopnet.runtime.untrusted`.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Protocol, TypeVar

import h5py
import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, check_array, check_budget, check_fields, expect, names_in, parsing


@dataclass(frozen=True)
class Hdf5Schema:
    """What the HDF5 files of one format hold at their root; whatever else they hold is not read."""

    name: str  # of the format, for messages
    arrays: Mapping[str, ArraySchema]  # by name; texts have kind "S"
    # types by name, as for `kpopnet.runtime.input_files.check_fields`
    attributes: Mapping[str, Any] = field(default_factory=dict)
    optional: tuple[str, ...] = ()  # attributes that may be missing
    fixed: Mapping[str, Any] = field(default_factory=dict)  # attributes with one valid value
    remedy: str = "copy it again"  # what to do about a damaged file, for messages


@contextmanager
def open_hdf5(path: Path, schema: Hdf5Schema, **options: Any) -> Iterator[h5py.File]:
    """Opens a file for reading; `options` are those of h5py.File. What reading within raises is an InputError too."""
    with opened_hdf5(path, schema, **options) as file, readable(path, schema):
        yield file


def opened_hdf5(path: Path, schema: Hdf5Schema, **options: Any) -> h5py.File:
    """As `open_hdf5`, for a file that stays open; reading it needs `readable`."""
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file; expected {schema.name}")
    with readable(path, schema):
        file = h5py.File(path, "r", locking=False, **options)
        lengths: dict[str, int] = {}
        kinds = {name: type(value) for name, value in schema.fixed.items()} | dict(schema.attributes)
        attributes = check_fields(f"{path}: attributes", attributes_of(file), kinds, schema.optional)
        for name, value in schema.fixed.items():
            found = attributes.get(name, value)
            expect(found == value, f"{path}: attribute {name}", f"{str(value)[:200]}, found {str(found)[:200]}")
        for name, expected in schema.arrays.items():
            if name in file or expected.required:
                data = stored_array(file, name)
                dtype = np.dtype("S1") if h5py.check_string_dtype(data.dtype) else data.dtype
                check_array(f"{path}: {name}", data.shape, dtype, expected, lengths)
        return file


def attributes_of(file: h5py.File) -> dict[str, Any]:
    """The attributes of a file as numbers, texts and lists of them."""
    values = {name: one.tolist() if isinstance(one, np.ndarray | np.generic) else one for name, one in file.attrs.items()}
    return {name: one.decode(errors="replace") if isinstance(one, bytes) else one for name, one in values.items()}


def stored_array(file: h5py.File, name: str) -> h5py.Dataset:
    """An array of a file, not in memory and not a link to another file."""
    data = file.get(name)
    if not isinstance(data, h5py.Dataset) or data.shape is None:
        raise InputError(f"{file.filename}: expected an array {name}, found {names_in(file) or 'none'}")
    if data.external or data.is_virtual or data.file.filename != file.filename:
        raise InputError(f"{file.filename}: {name} lies in another file; expected an array stored in this one")
    return data


def read_array(file: h5py.File, name: str) -> np.ndarray:
    """Reads a whole array, in native byte order."""
    data = stored_array(file, name)
    check_budget(file.filename, data.size * data.dtype.itemsize, f"{name} {data.shape}")
    values = data[()]
    return values.astype(values.dtype.newbyteorder("="), copy=False)


class Kept(Protocol):
    """What holds an open file."""

    file: h5py.File


K = TypeVar("K", bound=Kept)


def kept_open(files: dict[int, K], number: int, opened: Callable[[], K]) -> K:
    """The file of a number among those that are open, opened if it is not; of too many the one used longest ago is closed."""
    files[number] = file = files.pop(number, None) or opened()
    if len(files) > most_open():
        files.pop(next(iter(files))).file.close()
    return file


@cache
def most_open() -> int:
    """Half of the files that a process may have open: loaders of data share memory by files, too."""
    try:
        import resource  # not on every system
    except ImportError:
        return 200
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return max(most // 2, 1) if most > 0 else 10_000  # -1: as many as one likes


def readable(path: Path, schema: Hdf5Schema) -> AbstractContextManager:
    """Turns errors of reading a file into an InputError that names it."""
    return parsing(path, f"{schema.name} cannot be read", schema.remedy)
