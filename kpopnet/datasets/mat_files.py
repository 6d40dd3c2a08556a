"""Checks a MATLAB file of version 5 before scipy reads it.

    header   116 bytes of text, 8 of offset, uint16 version 0x0100, "IM" (little-endian) or "MI"
    element  uint32 type, uint32 bytes, data: a matrix (14), or a zlib stream of one (15)
    matrix   elements, padded to 8 bytes: flags (class), dimensions, name, numbers; one of up to 4 bytes is packed into its tag

A compressed element of 9 MB can inflate to 9 GB, and dimensions may declare any size, so both are compared with the budget and
with each other. Only matrices of plain numbers are handed on: cells, structures and sparse matrices are not.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, check_array, check_budget, names_in

HEADER_BYTES = 128
MATRIX, COMPRESSED = 14, 15
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_STORED_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
_COMPLEX = 0x800


class _Element(NamedTuple):
    kind: int
    data: memoryview
    end: int


def checked_variable(path: Path, variable: str, schema: ArraySchema) -> bytes:
    """A MATLAB file that holds nothing but one variable, not compressed.

    Args:
        path: of the file.
        variable: its name.
        schema: what it must be.

    Raises:
        InputError: the file is not a complete MATLAB file of version 5, lacks the variable, or the variable is not as expected
            or exceeds the budget.
    """
    try:
        check_budget(path, path.stat().st_size, "the file")
        content = path.read_bytes()
        order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
        if order is None or content[125 if order == "<" else 124] != 1:
            raise ValueError("its header is not that of MATLAB 5 to 7")
        others = []
        for matrix in _matrices(path, memoryview(content), order):
            name, shape, dtype = _described(matrix, order)
            if name == variable:
                check_array(f"{path}: {variable}", shape, np.dtype(dtype), schema)
                if 0 in shape:
                    raise InputError(f"{path}: expected frames in {variable}, found shape {shape}")
                return content[:HEADER_BYTES] + struct.pack(f"{order}II", MATRIX, len(matrix)) + bytes(matrix)
            others.append(name)
    except InputError:
        raise
    except (OSError, ValueError, struct.error, zlib.error) as error:
        raise InputError(f"{path}: not a complete MATLAB file ({error}); download it again") from error
    raise InputError(f"{path}: expected a variable {variable}, found {names_in(others) or 'none'}")


def _matrices(path: Path, content: memoryview, order: str) -> Iterator[memoryview]:
    """The matrices of a file, inflated within the budget of one file."""
    place = HEADER_BYTES
    while place < len(content):
        kind, length = struct.unpack_from(f"{order}II", content, place)
        data = content[place + 8 : place + 8 + length]
        if len(data) < length:
            raise ValueError(f"an element of {length:,} bytes ends after {len(data):,}")
        place += 8 + length
        if kind == COMPRESSED:
            inflater = zlib.decompressobj()
            kind, length = struct.unpack(f"{order}II", inflater.decompress(data, 8))
            check_budget(path, length, "what is compressed in it")
            data = memoryview(inflater.decompress(inflater.unconsumed_tail, max(length, 1)))
            if len(data) < length:
                raise ValueError(f"a compressed element of {length:,} bytes ends after {len(data):,}")
        if kind == MATRIX:
            yield data


def _described(matrix: memoryview, order: str) -> tuple[str, tuple[int, ...], str]:
    """Name, shape and type of a matrix of plain numbers; shape () and type "O" for other matrices."""
    flags = _element(matrix, 0, order)
    dimensions = _element(matrix, flags.end, order)
    name = _element(matrix, dimensions.end, order)
    (flag_bits,) = struct.unpack_from(f"{order}I", flags.data)
    dtype = _CLASSES.get(flag_bits & 0xFF)
    text = bytes(name.data).decode("ascii", errors="replace")
    if dtype is None or flag_bits & _COMPLEX:
        return text, (), "O"
    if dimensions.kind != 5 or not 8 <= len(dimensions.data) <= 32 * 4 or len(dimensions.data) % 4:
        raise ValueError(f"{text} has invalid dimensions")
    shape = struct.unpack(f"{order}{len(dimensions.data) // 4}i", dimensions.data)
    if min(shape) < 0:
        raise ValueError(f"{text} has dimensions {shape}")
    numbers = _element(matrix, name.end, order)
    item = _STORED_BYTES.get(numbers.kind, 0)
    if not item or len(numbers.data) != item * math.prod(shape):
        raise ValueError(f"{text} declares {shape} numbers and stores {len(numbers.data):,} bytes")
    check_budget(text, math.prod(shape) * np.dtype(dtype).itemsize, f"{dtype} {shape}")
    return text, shape, dtype


def _element(matrix: memoryview, place: int, order: str) -> _Element:
    """The element at a place of a matrix, and where the next one begins."""
    kind, length = struct.unpack_from(f"{order}II", matrix, place)
    if kind >> 16:  # up to 4 bytes, packed into the tag
        kind, length, start = kind & 0xFFFF, kind >> 16, place + 4
        end = place + 8
    else:
        start = place + 8
        end = start + length + -length % 8
    if len(matrix) < start + length or (start == place + 4 and length > 4):
        raise ValueError(f"a part of {length:,} bytes ends after {max(len(matrix) - start, 0):,}")
    return _Element(kind, matrix[start : start + length], end)
