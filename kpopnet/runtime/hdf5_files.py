"""The door for HDF5 files: each format declares its attributes and arrays once; a file is compared with that before it is read.

`open_hdf5` opens a file in this process only after a child process has described it (`kpopnet.runtime.hdf5_probe`) and the
description fits the schema. Links to other places, virtual and external data are refused, and memory is bounded before it is
allocated. `read_rows` reads arrays: it unpacks compressed chunks itself, because libhdf5 neither bounds what a chunk unpacks
to, nor refuses a chunk that is too short, and then returns memory that is not the file's.
"""

import itertools
import math
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_probe import describe
from kpopnet.runtime.input_files import ArraySchema, check_array, check_budget, expect, has_surrogates, names_in

TEXT = "T"
"""Kind of an array of texts of variable length, beside numpy's kinds."""

TEXT_OVERHEAD_BYTES = 80
"""Memory that a text takes in Python beside its characters."""

DEFLATE, SHUFFLE, FLETCHER32 = 1, 2, 3
CHECKSUM_BYTES = 4
MAX_CACHED = 4096
SETTLED_NS = 100_000_000
"""A file that changed less than this before it was described is described again: its time could hide another change."""


@dataclass(frozen=True)
class Attribute:
    """What an attribute of a file must be.

    Attributes:
        kinds: "U" for text, or numpy's kinds of numbers.
        shape: the length of each axis, None for any; () is a single value.
        low: least value of numbers.
        high: greatest value of numbers.
        equals: the only value, if given.
        one_of: the only values, if given.
        required: whether the file must have it.
    """

    kinds: str
    shape: tuple[int | None, ...] = ()
    low: float = -math.inf
    high: float = math.inf
    equals: Any = None
    one_of: tuple = ()
    required: bool = True


@dataclass(frozen=True)
class StoredArray(ArraySchema):
    """What an array of an HDF5 file must be.

    Attributes:
        kinds: as ArraySchema; TEXT for texts of variable length.
        shape: as ArraySchema.
        required: as ArraySchema.
        item_bytes: bytes of one number; None for any.
        rows_read: number of rows that are read at once; None for all.
    """

    item_bytes: int | None = None
    rows_read: int | None = None


@dataclass(frozen=True)
class Hdf5Schema:
    """What the HDF5 files of one format hold at their root; whatever else they hold is not read.

    Attributes:
        name: of the format, for messages.
        arrays: by name.
        attributes: by name.
        lengths: computes from file name and attributes the lengths that shapes name; raises InputError.
        remedy: what to do about a damaged file, for messages.
    """

    name: str
    arrays: Mapping[str, StoredArray]
    attributes: Mapping[str, Attribute] = field(default_factory=dict)
    lengths: Callable[[str, dict[str, Any]], dict[str, int]] = lambda where, attributes: {}
    remedy: str = "copy it again"


@dataclass(frozen=True)
class Described:
    """What is known of a file that fits its schema.

    Attributes:
        stamp: size, times and number of the file when it was described.
        attributes: values by name, with those that the schema does not name.
        members: the probe's descriptions by name.
    """

    stamp: tuple[int, ...]
    attributes: dict[str, Any]
    members: dict[str, dict[str, Any]]

    def __contains__(self, name: str) -> bool:
        return name in self.members

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array."""
        return tuple(self.members[name]["shape"])


_cache: dict[str, tuple[tuple[int, ...], dict[str, Any]]] = {}


def check_hdf5(path: Path, schema: Hdf5Schema) -> Described:
    """Describes a file and compares it with a schema; this process does not open it.

    Raises:
        InputError: the file is missing, damaged, or not as the schema says.
    """
    stamp = _stamp(path, schema)
    known, description = _cache.get(str(path), (None, None))
    if known != stamp or description is None:
        try:
            description = describe(path)
        except InputError as error:
            raise InputError(f"{error}; {schema.remedy}") from error
        if time.time_ns() - stamp[1] > SETTLED_NS:
            if len(_cache) >= MAX_CACHED:
                _cache.pop(next(iter(_cache)))
            _cache[str(path)] = stamp, description
    values = {name: one["value"] for name, one in description["attributes"].items()}
    for name, expected in schema.attributes.items():
        _check_attribute(f"{path}: attribute {name}", description["attributes"].get(name), expected, schema)
    _check_arrays(path, description["members"], schema, schema.lengths(str(path), values))
    return Described(stamp, values, description["members"])


def _stamp(path: Path, schema: Hdf5Schema) -> tuple[int, ...]:
    try:
        if path.is_file():
            status = path.stat()
            return status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise InputError(f"{path}: cannot be read ({error})") from error
    raise InputError(f"{path}: no such file; expected {schema.name}")


def _check_attribute(where: str, found: dict[str, Any] | None, expected: Attribute, schema: Hdf5Schema) -> None:
    if found is None:
        expect(not expected.required, where, f"to find it in {schema.name}; {schema.remedy}")
        return
    value, shape = found["value"], tuple(found["shape"])
    fits = len(shape) == len(expected.shape) and all(
        one in (None, length) for length, one in zip(shape, expected.shape, strict=True)
    )
    kinds = " or ".join({"U": "text", "i": "integer", "u": "integer", "f": "number"}[kind] for kind in expected.kinds)
    if value is None or not fits or found["kind"] not in expected.kinds:
        lengths = tuple("any" if one is None else one for one in expected.shape)
        raise InputError(f"{where}: kind {found['kind']} and shape {shape}, expected {kinds}, {lengths or 'a single value'}")
    if has_surrogates([value] if isinstance(value, str) else value):
        raise InputError(f"{where}: not UTF-8 text")
    if expected.equals is not None and value != expected.equals:
        raise InputError(f"{where}: {_shown(value)}, expected {_shown(expected.equals)}")
    if expected.one_of and value not in expected.one_of:
        raise InputError(f"{where}: {_shown(value)}, expected {names_in(map(str, expected.one_of))}")
    if "U" not in expected.kinds and not all(
        expected.low <= one <= expected.high for one in np.ravel(np.asarray(value, object)).tolist()
    ):
        raise InputError(f"{where}: {_shown(value)}, expected {expected.low:g} to {expected.high:g}")


def _shown(value: Any) -> str:
    return (", ".join(map(str, value)) if isinstance(value, list) else str(value))[:300]


def _check_arrays(path: Path, members: dict[str, dict[str, Any]], schema: Hdf5Schema, lengths: dict[str, int]) -> None:
    memory = 0
    for name, expected in schema.arrays.items():
        where = f"{path}: {name}"
        found = members.get(name)
        if found is None:
            expect(not expected.required, str(path), f"an array {name}, found {names_in(members) or 'none'}; {schema.remedy}")
            continue
        if found["link"] != "hard" or found.get("outside"):
            raise InputError(f"{where} is a link or lies in other files; expected an array stored in this file")
        if "error" in found:
            raise InputError(f"{where} cannot be read ({found['error']}); {schema.remedy}")
        memory += _check_array(where, found, expected, lengths)
        check_budget(path, memory, f"{name} {tuple(found['shape'])} with what is read beside it")


def _check_array(where: str, found: dict[str, Any], expected: StoredArray, lengths: dict[str, int]) -> int:
    """Checks one array and returns the memory that reading it takes at once, in bytes."""
    shape, is_text = tuple(found["shape"]), found["type"] == "text"
    if found["type"] == "object" or (is_text and TEXT not in expected.kinds):
        raise InputError(f"{where}: values of variable length, expected kind {' or '.join(expected.kinds)} of numpy")
    dtype = np.dtype("S1" if is_text else found["type"])
    check_array(where, shape, dtype, replace(expected, kinds=f"{expected.kinds}S") if is_text else expected, lengths)
    if expected.item_bytes not in (None, dtype.itemsize):
        raise InputError(f"{where}: numbers of {dtype.itemsize} bytes, expected {expected.item_bytes}")
    codes = [code for code, _ in found["filters"]]
    shuffled = [values for code, values in found["filters"] if code == SHUFFLE]
    if len(codes) != len(set(codes)) or not {DEFLATE, SHUFFLE, FLETCHER32}.issuperset(codes):
        raise InputError(f"{where}: packed with HDF5's filters {codes}, expected gzip and shuffle; pack it so with h5repack")
    if codes and (is_text or (shuffled and shuffled[0][:1] != [dtype.itemsize])):
        raise InputError(f"{where}: its filters do not belong to its type")
    rows = shape[:1] if expected.rows_read is None else (min(shape[0], expected.rows_read),)
    read = math.prod((*rows, *shape[1:])) * (TEXT_OVERHEAD_BYTES if is_text else dtype.itemsize) + found["text_bytes"]
    chunk = math.prod(found["chunks"] or (0,)) * dtype.itemsize
    return read + 2 * chunk + found["most_chunk_bytes"]


@contextmanager
def open_hdf5(path: Path, schema: Hdf5Schema, described: Described | None = None, **options: Any) -> Iterator[h5py.File]:
    """Opens a file for reading once its description fits the schema.

    Args:
        path: the file.
        schema: of its format.
        described: the result of `check_hdf5`, which is not repeated unless the file has changed since.
        options: of h5py.File.

    Raises:
        InputError: the file is missing, damaged, or not as the schema says; also within, if reading fails.
    """
    file = opened_hdf5(path, schema, described, **options)
    with file, readable(path, schema):
        yield file


def opened_hdf5(path: Path, schema: Hdf5Schema, described: Described | None = None, **options: Any) -> h5py.File:
    """As `open_hdf5`, for a file that stays open.

    Raises:
        InputError: the file is missing, damaged, or not as the schema says.
    """
    path = Path(path)
    if described is None or described.stamp != _stamp(path, schema):
        check_hdf5(path, schema)
    with readable(path, schema):
        return h5py.File(path, "r", locking=False, **options)


@contextmanager
def readable(path: Path, schema: Hdf5Schema, part: str = "a part of it") -> Iterator[None]:
    """Turns the errors of reading an opened file into an InputError that names it and the part that is read."""
    try:
        yield
    except InputError:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, MemoryError) as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)[:200]
        raise InputError(f"{path}: {part} cannot be read ({reason}); {schema.remedy}") from error


def stored_array(file: h5py.File, name: str) -> h5py.Dataset:
    """An array of a file that fits its schema."""
    data = file[name]
    assert isinstance(data, h5py.Dataset)
    return data


def read_rows(data: h5py.Dataset, start: int = 0, stop: int | None = None) -> np.ndarray:
    """Reads consecutive rows of an array; as `StoredRows.read`."""
    return StoredRows(data).read(start, stop)


class StoredRows:
    """An array of a file opened by `open_hdf5`, of at least one axis, read row by row; numbers have native byte order."""

    def __init__(self, data: h5py.Dataset) -> None:
        self.data = data
        self._stored, self._native = data.dtype, data.dtype.newbyteorder("=")
        properties = data.id.get_create_plist()
        self._filters = [int(properties.get_filter(number)[0]) for number in range(properties.get_nfilters())]
        self._chunks = data.chunks if self._filters and not data.dtype.hasobject else None
        self._chunk_bytes = math.prod(self._chunks or ()) * data.dtype.itemsize

    def __len__(self) -> int:
        return len(self.data)

    def __getitem__(self, row: int) -> np.ndarray:
        """One row; raises as `read`."""
        return self.read(row, row + 1)[0]

    def read(self, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Reads consecutive rows.

        Args:
            start: the first row.
            stop: the last row plus one; the end of the array by default.

        Raises:
            OSError, ValueError: a part cannot be read, or a chunk does not unpack to its declared size.
        """
        data, chunks = self.data, self._chunks
        length = len(data)
        stop = length if stop is None else stop
        if not 0 <= start <= stop <= length:
            raise ValueError(f"{data.name} has {length} rows")
        if chunks is None:
            return data[start:stop].astype(self._native, copy=False)
        if chunks == (1, *data.shape[1:]) and stop == start + 1 and FLETCHER32 not in self._filters:
            return self._chunk((start, *(0 for _ in chunks[1:])))
        read = np.empty((stop - start, *data.shape[1:]), self._native)
        ranges = [range(start - start % chunks[0], stop, chunks[0])]
        ranges += [range(0, length, step) for length, step in zip(data.shape[1:], chunks[1:], strict=True)]
        for corner in itertools.product(*ranges):
            chunk = self._chunk(corner)
            first, last = max(corner[0], start), min(corner[0] + chunks[0], stop)
            inside = [slice(at, at + step) for at, step in zip(corner[1:], chunks[1:], strict=True)]
            target = read[(slice(first - start, last - start), *inside)]
            target[...] = chunk[(slice(first - corner[0], last - corner[0]), *map(slice, target.shape[1:]))]
        if FLETCHER32 in self._filters:
            read[...] = data[start:stop]  # libhdf5 compares the checksums
        return read

    def _chunk(self, corner: tuple[int, ...]) -> np.ndarray:
        """The chunk whose first element is `corner`, unpacked."""
        identity, nbytes = self.data.id, self._chunk_bytes
        if identity.get_chunk_info_by_coord(corner).byte_offset is None:  # never written
            return np.full(self._chunks or (), self.data.fillvalue, self._native)
        packed: Any
        skipped, packed = identity.read_direct_chunk(corner)
        for number in reversed(range(len(self._filters))):
            code = 0 if skipped >> number & 1 else self._filters[number]
            if code == FLETCHER32:
                packed = packed[:-CHECKSUM_BYTES]
            elif code == DEFLATE:
                packed = _inflated(packed, nbytes + CHECKSUM_BYTES)
            elif code == SHUFFLE and self._stored.itemsize > 1 and len(packed) == nbytes:
                packed = _unshuffled(packed, self._stored.itemsize)
        if memoryview(packed).nbytes != nbytes:
            raise ValueError(f"a chunk of {self.data.name} has {memoryview(packed).nbytes} bytes, expected {nbytes}")
        read = np.frombuffer(packed, self._stored).reshape(self._chunks or ())
        return read.astype(self._native, copy=not read.flags.writeable)


def _inflated(packed: bytes, most_bytes: int) -> bytes:
    unpack = zlib.decompressobj()
    try:
        unpacked = unpack.decompress(packed, most_bytes + 1)
    except zlib.error as error:
        raise ValueError(f"a chunk is damaged: {error}") from error
    if not unpack.eof:
        raise ValueError("a chunk is longer than it should be, or cut off")
    return unpacked


def _unshuffled(packed: bytes, size: int) -> bytes | np.ndarray:
    """The inverse of the filter that stores all first bytes of the numbers, then all second bytes, and so on."""
    planes = np.frombuffer(packed, np.uint8).reshape(size, -1)
    if size not in (2, 4, 8):
        return planes.T.tobytes()
    numbers = planes[-1].astype(f"<u{size}")
    for plane in planes[-2::-1]:
        numbers <<= 8
        numbers |= plane
    return numbers
