"""The door for files that users give: JSON, npz, npy, safetensors, checked against limits before anything large is allocated.

What is read here is data: nothing in it is evaluated, interpolated or unpickled. A reader declares what it expects; what does
not fit raises an InputError of one line that names file, place and expectation.
"""

import json
import math
import os
import types
import typing
import warnings
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from kpopnet.errors import InputError

BUDGET_VARIABLE = "KPOPNET_FILE_BUDGET_GB"
DEFAULT_BUDGET_GB = 1.0
MAX_JSON_BYTES = 64_000_000
MAX_JSON_DEPTH = 64

Settings = TypeVar("Settings")


def file_budget_bytes() -> int:
    """Bytes of memory that the content of one file may take: 1 GB, or the environment variable KPOPNET_FILE_BUDGET_GB.

    Raises:
        InputError: the variable is not a positive number.
    """
    given = os.environ.get(BUDGET_VARIABLE, str(DEFAULT_BUDGET_GB))
    try:
        budget_gb = float(given)
    except ValueError:
        budget_gb = math.nan
    if not 0 < budget_gb < 1e6:
        raise InputError(f"{BUDGET_VARIABLE}={given}: expected a positive number of gigabytes")
    return int(budget_gb * 1e9)


def check_budget(path: Path | str, declared_bytes: int, what: str) -> None:
    """Refuses a file before its content is allocated.

    Args:
        path: the file.
        declared_bytes: memory that the content takes, as the file declares it.
        what: the content, for the message: "depth_mm (300, 480, 640)".

    Raises:
        InputError: it exceeds the budget.
    """
    if declared_bytes > (budget := file_budget_bytes()):
        raise InputError(
            f"{path}: {what} would take {declared_bytes / 1e9:.1f} GB of memory, more than {budget / 1e9:g} GB a file; "
            f"set {BUDGET_VARIABLE} to allow more"
        )


def read_text(path: Path, max_bytes: int = MAX_JSON_BYTES) -> str:
    """Reads a UTF-8 text file of at most `max_bytes`.

    Raises:
        InputError: the file is missing, unreadable, too large, or not UTF-8.
    """
    try:
        size = path.stat().st_size
        if size > max_bytes:
            raise InputError(f"{path}: {size:,} bytes, expected at most {max_bytes:,}")
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text ({error.reason} at byte {error.start})") from error
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise InputError(f"{path}: cannot be read ({error})") from error


def read_json(path: Path, max_bytes: int = MAX_JSON_BYTES, *, non_finite: bool = False) -> Any:
    """Reads a JSON file of finite numbers, or of NaN and Infinity too, and limited depth.

    Raises:
        InputError: as `read_text` and `parse_json`.
    """
    return parse_json(read_text(Path(path), max_bytes), str(path), non_finite=non_finite)


def parse_json(text: str | bytes, where: str, *, non_finite: bool = False) -> Any:
    """Parses JSON: numbers must be finite, integers of at most 64 bits, brackets nested at most MAX_JSON_DEPTH deep.

    Args:
        text: the JSON.
        where: file and place, for messages.
        non_finite: whether NaN, Infinity and -Infinity, which Python writes, are numbers too.

    Raises:
        InputError: it is not such JSON.
    """

    def constant(name: str) -> float:
        return float(name) if non_finite else _refuse_constant(name)

    try:
        value = json.loads(text, parse_constant=constant, parse_int=_limited_int, parse_float=_finite_float)
    except RecursionError as error:
        raise InputError(f"{where}: brackets are nested too deeply; expected at most {MAX_JSON_DEPTH} levels") from error
    except (ValueError, TypeError) as error:
        raise InputError(f"{where}: not valid JSON ({error})") from error
    if _is_deeper(value, MAX_JSON_DEPTH):
        raise InputError(f"{where}: brackets are nested too deeply; expected at most {MAX_JSON_DEPTH} levels")
    if has_surrogates(value):
        raise InputError(f"{where}: a text has half of a surrogate pair, which is no character")
    return value


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a finite number")


def _limited_int(digits: str) -> int:
    if len(digits) > 20 or not -(2**63) <= (value := int(digits)) < 2**64:
        raise ValueError(f"the integer {digits[:24]}... does not fit into 64 bits")
    return value


def _finite_float(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"{digits[:24]} is not a finite number")
    return value


def _is_deeper(value: Any, levels: int) -> bool:
    if not isinstance(value, dict | list):
        return False
    return levels <= 0 or any(_is_deeper(one, levels - 1) for one in (value.values() if isinstance(value, dict) else value))


def has_surrogates(value: Any) -> bool:
    """Whether any text in nested dicts and lists cannot be written as UTF-8."""
    if isinstance(value, str):
        return any("\ud800" <= character <= "\udfff" for character in value)
    if isinstance(value, dict):
        return any(has_surrogates(key) or has_surrogates(one) for key, one in value.items())
    return isinstance(value, list) and any(map(has_surrogates, value))


def check_fields(where: str, value: Any, schema: Mapping[str, Any], optional: Iterable[str] = ()) -> dict[str, Any]:
    """Checks that a value of JSON is an object with the given names and types; it may have other names too.

    Args:
        where: file and place, for messages.
        value: of JSON.
        schema: types by name: bool, int, float (which an integer fits), str, dict, list[TYPE], TYPE | None.
        optional: names that may be missing.

    Raises:
        InputError: it is not such an object.
    """
    expect(isinstance(value, dict), where, f"an object of {names_in(schema)}, found {_shown(value)}")
    if missing := [name for name in schema if name not in value and name not in optional]:
        raise InputError(f"{where}: lacks {names_in(missing)}")
    for name, hint in schema.items():
        if name in value and not _is_of(value[name], hint):
            expected = hint.__name__ if isinstance(hint, type) and not typing.get_args(hint) else str(hint)
            raise InputError(f"{where}: {name} is {_shown(value[name])}, expected {expected}")
    return value


def settings_from(kind: type[Settings], value: Any, where: str) -> Settings:
    """Makes an object of a flat dataclass from an object of JSON; the dataclass is the schema.

    Raises:
        InputError: an unknown or missing name, another type, or a value that the dataclass refuses.
    """
    declared = fields(kind)  # pyright: ignore[reportArgumentType]
    optional = [one.name for one in declared if one.default is not MISSING or one.default_factory is not MISSING]
    check_fields(where, value, typing.get_type_hints(kind), optional)
    if unknown := sorted(set(value) - {one.name for one in declared}):
        raise InputError(f"{where}: has settings unknown to this version: {names_in(unknown)}")
    try:
        return kind(**value)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _is_of(value: Any, hint: Any) -> bool:
    if isinstance(hint, types.UnionType):
        return any(_is_of(value, one) for one in typing.get_args(hint))
    if typing.get_origin(hint) is list:
        return isinstance(value, list) and all(_is_of(one, typing.get_args(hint)[0]) for one in value)
    if hint in (int, float):
        return isinstance(value, int if hint is int else int | float) and not isinstance(value, bool)
    return isinstance(value, hint)


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:40]}..."


def check_names(where: str, names: Iterable[str]) -> None:
    """Raises InputError if the name of a file or folder is not UTF-8: figures and reports could not show it."""
    for name in names:
        if has_surrogates(name):
            raise InputError(
                f"{where}: {name.encode('utf-8', 'backslashreplace').decode()}: a name that is not UTF-8; rename it"
            )


def expect(condition: bool, where: str, expectation: str) -> None:
    """Raises InputError("WHERE: expected EXPECTATION") unless the condition holds."""
    if not condition:
        raise InputError(f"{where}: expected {expectation}")


@dataclass(frozen=True)
class ArraySchema:
    """What an array in a file must be.

    Attributes:
        kinds: allowed numpy kinds: "f" floats, "u" and "i" integers, "b" bool, "S" and "U" text.
        shape: the length of each axis; None for any length, a name for a length that other arrays of the file share.
        required: whether the file must have it.
    """

    kinds: str
    shape: tuple[int | str | None, ...]
    required: bool = True


def check_array(
    where: str, shape: tuple[int, ...], dtype: np.dtype, schema: ArraySchema, lengths: dict[str, int] | None = None
) -> None:
    """Checks the declared shape and type of an array, which need not be in memory yet.

    Args:
        where: file and name of the array, for messages.
        shape: as declared.
        dtype: as declared.
        schema: what is expected.
        lengths: lengths by name, of the arrays checked before; completed by this one.

    Raises:
        InputError: shape or type differ.
    """
    lengths = {} if lengths is None else lengths
    expected = ", ".join(
        "any" if one is None else f"{one} = {lengths[one]}" if one in lengths else str(one) for one in schema.shape
    )
    fits = len(shape) == len(schema.shape) and all(
        one is None or found == (lengths.setdefault(one, found) if isinstance(one, str) else one)
        for found, one in zip(shape, schema.shape, strict=True)
    )
    if not fits:
        raise InputError(f"{where}: shape {tuple(shape)}, expected ({expected})")
    if dtype.kind not in schema.kinds or dtype.hasobject:
        raise InputError(f"{where}: type {dtype}, expected kind {' or '.join(schema.kinds)} of numpy")


def read_npz(path: Path, schemas: dict[str, ArraySchema]) -> dict[str, np.ndarray]:
    """Reads the named arrays of an .npz file; their headers are checked, with their memory, before anything is unpacked.

    Args:
        path: the file.
        schemas: by the arrays' names; other arrays of the file are not read.

    Returns:
        The arrays by name; those that are not required may be missing.

    Raises:
        InputError: the file is missing, damaged, encrypted, or too large, or an array is not as expected.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members = {info.filename: info for info in archive.infolist()}
            lengths: dict[str, int] = {}
            total = 0
            for name, schema in schemas.items():
                if (info := members.get(f"{name}.npy")) is None:
                    expect(not schema.required, str(path), f"an array {name}")
                    continue
                if info.flag_bits & 1:
                    raise InputError(f"{path}: {name} is encrypted; expected a plain .npz file")
                with archive.open(info) as member:
                    shape, _, dtype = read_npy_header(member, f"{path}: {name}")
                check_array(f"{path}: {name}", shape, dtype, schema, lengths)
                total += math.prod(shape) * dtype.itemsize
                check_budget(path, total, "its arrays")
            found = {}
            for name in schemas:
                if (info := members.get(f"{name}.npy")) is not None:
                    with archive.open(info) as member:
                        found[name] = np.lib.format.read_array(member, allow_pickle=False)
            return found
    except InputError:
        raise
    except (
        OSError,
        EOFError,
        ValueError,
        TypeError,
        SyntaxError,
        RuntimeError,
        NotImplementedError,
        zipfile.BadZipFile,
    ) as error:
        raise InputError(f"{path}: not a readable .npz file ({_first_line(error)})") from error
    except Exception as error:  # zlib.error, lzma.LZMAError, struct.error: of the archive's own bytes
        raise InputError(f"{path}: not a readable .npz file ({type(error).__name__}: {_first_line(error)})") from error


def read_npy_header(file: IO[bytes], where: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, Fortran order and type that a .npy stream declares, for `where` in messages.

    Raises:
        InputError: not such a header, or one of an array of Python objects.
    """
    readers: dict[tuple[int, int], Callable] = {
        (1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0
    }  # fmt: skip
    try:
        version = np.lib.format.read_magic(file)
        if version not in readers:
            raise InputError(f"{where}: .npy version {version}, expected 1.0 or 2.0")
        with warnings.catch_warnings(action="error"):  # numpy warns of a header that it has to repair
            shape, fortran, dtype = readers[version](file, max_header_size=10_000)
    except InputError:
        raise
    except Exception as error:  # of the parser of Python's literals, among others tokenize.TokenError
        raise InputError(f"{where}: not a readable .npy header ({_first_line(error)})") from error
    if dtype.hasobject or any(length < 0 for length in shape):
        raise InputError(f"{where}: an array of {dtype} and shape {shape}; expected plain numbers")
    return shape, fortran, dtype


def open_npy(path: Path, schema: ArraySchema) -> np.ndarray:
    """Opens an .npy file as a read-only memory map; its header is checked first.

    Raises:
        InputError: the file is missing or damaged, or its array is not as expected.
    """
    try:
        with Path(path).open("rb") as file:
            shape, fortran, dtype = read_npy_header(file, str(path))
            check_array(str(path), shape, dtype, schema)
            expect(0 not in shape, str(path), f"an array that is not empty, found {shape}")
            start, size = file.tell(), file.seek(0, os.SEEK_END)
            needed = math.prod(shape) * dtype.itemsize
            expect(size - start >= needed, str(path), f"{needed:,} bytes of numbers, found {size - start:,}: truncated")
            return np.memmap(path, dtype, "r", start, shape, "F" if fortran else "C")
    except InputError:
        raise
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read ({_first_line(error)})") from error


def read_with(reader: Callable[[Path], Any], path: Path, problem: str, inflated: float = 1.0) -> Any:
    """Reads a file with the parser of a library, whose exceptions are of many types.

    Args:
        reader: reads the file; it must not allocate more than `inflated` times the file's size.
        path: the file.
        problem: what to tell the user: "missing or damaged".
        inflated: memory of the content per byte of the file.

    Raises:
        InputError: the file is too large, or the parser raised an exception.
    """
    try:
        check_budget(path, int(Path(path).stat().st_size * inflated), "its content")
        return reader(path)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: {problem} ({_first_line(error)})") from error


def check_finite(where: str, array: np.ndarray) -> None:
    """Raises InputError if a number of the array is NaN or infinite."""
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise InputError(f"{where}: {np.count_nonzero(~np.isfinite(array))} numbers are not finite")


def _first_line(error: BaseException) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)[:200]


def names_in(names: Iterable[str]) -> str:
    """Names for a message, at most ten."""
    listed = list(names)
    return ", ".join(listed[:10]) + (f" and {len(listed) - 10} more" if len(listed) > 10 else "")
