"""Reads files that users give (JSON, npz, npy, files of libraries) and checks them against what a reader declares.

Nothing in a file is evaluated, interpolated or unpickled. What does not fit raises an `InputError` of one line: file, place,
what was expected. In the functions below `where` is file and place, for that line. Sizes are limited before memory is taken.
"""

import json
import math
import os
import re
import reprlib
import types
import typing
import unicodedata
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from kpopnet.errors import InputError

BUDGET_VARIABLE = "KPOPNET_FILE_BUDGET_GB"
DEFAULT_BUDGET_GB = 1.0
MAX_JSON_BYTES = 64_000_000
MAX_JSON_DEPTH = 64
MAX_JSON_VALUES = 8_000_000
"""Values separated by commas, and a quarter as many lists and objects: 1 GB. 64 MB of text may hold several times as many."""

JOINERS = "\u200c\u200d"
"""Join the parts of an emoji, and letters of Persian or Hindi, or keep them apart."""

_LARGE_NUMBER = re.compile(r"[0-9]{19}|[0-9][eE]")
_HALF = re.compile(r"\\u[dD][89a-fA-F]|[\ud800-\udfff]")

Settings = TypeVar("Settings")
R = TypeVar("R")


# --- sizes and errors -----------------------------------------------------------------------------------------------------


def check_budget(path: Path | str, declared_bytes: int, what: str) -> None:
    """Refuses content that declares more memory than 1 GB, or KPOPNET_FILE_BUDGET_GB; `what`: "depth_mm (300, 480, 640)"."""
    given = os.environ.get(BUDGET_VARIABLE, str(DEFAULT_BUDGET_GB))
    try:
        budget_gb = float(given)
    except ValueError:
        raise InputError(f"{BUDGET_VARIABLE}={given}: expected a number of gigabytes") from None
    if declared_bytes > budget_gb * 1e9:
        raise InputError(
            f"{path}: {what} would take {declared_bytes / 1e9:.1f} GB of memory, more than {budget_gb:g} GB a file; "
            f"set {BUDGET_VARIABLE} to allow more"
        )


@contextmanager
def parsing(where: Path | str, problem: str, remedy: str = "") -> Iterator[None]:
    """Turns what a library raises for damaged bytes, which is of many types, into "WHERE: PROBLEM (reason); REMEDY"."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{where}: {problem} ({_reason(error)}){remedy and f'; {remedy}'}") from error


def read_with(reader: Callable[[Path], R], path: Path, problem: str) -> R:
    """Reads a file with the parser of a library, which must not take more memory than the file's size; see `parsing`."""
    with parsing(path, problem):
        check_budget(path, Path(path).stat().st_size, "its content")
        return reader(path)


def _reason(error: Exception) -> str:
    """Why a file cannot be read; `where` names the file already."""
    return (isinstance(error, OSError) and error.strerror) or first_line(error)


def first_line(error: BaseException) -> str:
    """The first line of an exception's message, or its type."""
    return next(iter(str(error).splitlines()), type(error).__name__)[:200]


def as_path(given: Path | str) -> Path:
    """The path that a caller gives; raises InputError for what is none, such as None."""
    try:
        return Path(given)
    except TypeError:
        raise InputError(f"expected the path of a file or folder, got {given!r:.80}") from None


def named(path: Path) -> Path:
    """The path with a name to show: where a folder is given as "." or "..", the folder's own."""
    return path.resolve() if path.name in ("", "..") else path


def expect(condition: bool, where: str, expectation: str) -> None:
    """Raises InputError("WHERE: expected EXPECTATION") unless the condition holds."""
    if not condition:
        raise InputError(f"{where}: expected {expectation}")


def check_names(where: str, names: Iterable[str]) -> None:
    """Raises InputError if the name of a file or folder is not UTF-8: figures and reports could not show it."""
    for name in filter(_has_surrogates, names):
        raise InputError(f"{where}: {name.encode('utf-8', 'backslashreplace').decode()}: a name that is not UTF-8; rename it")


def plain_name(name: str) -> str:
    """A name that a person gave, letters composed (NFC), each kind of space a plain one."""
    return "".join(" " if unicodedata.category(one) == "Zs" else one for one in unicodedata.normalize("NFC", name))


def can_be_printed(name: str) -> bool:
    """Whether a name has no line breaks, no marks that turn text around, and the like."""
    return all(one.isprintable() or one in JOINERS for one in name)


def names_in(names: Iterable[str]) -> str:
    """Names for a message, at most ten."""
    listed = list(names)
    return ", ".join(listed[:10]) + (f" and {len(listed) - 10} more" if len(listed) > 10 else "")


# --- JSON -----------------------------------------------------------------------------------------------------------------


def read_text(path: Path, max_bytes: int = MAX_JSON_BYTES) -> str:
    """Reads a UTF-8 text file, with or without a byte order mark, which spreadsheets write."""
    try:
        size = path.stat().st_size
        expect(size <= max_bytes, str(path), f"at most {max_bytes:,} bytes, found {size:,}")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text ({error.reason} at byte {error.start})") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({_reason(error)})") from error


def read_json(path: Path, max_bytes: int = MAX_JSON_BYTES, *, non_finite: bool = False) -> Any:
    """Reads a JSON file, see `parse_json`."""
    return parse_json(read_text(Path(path), max_bytes), str(path), non_finite=non_finite)


def parse_json(text: str | bytes, where: str, *, non_finite: bool = False) -> Any:
    """Parses JSON: numbers must be finite, integers of at most 64 bits, brackets nested at most MAX_JSON_DEPTH deep.

    With `non_finite` NaN, Infinity and -Infinity, which Python writes, are numbers too.
    """
    if isinstance(text, bytes):
        try:
            text = text.decode()
        except UnicodeDecodeError as error:
            raise InputError(f"{where}: not UTF-8 text ({error.reason} at byte {error.start})") from error
    most_lists = MAX_JSON_VALUES // 4
    if text.count(",") > MAX_JSON_VALUES or text.count("[") + text.count("{") > most_lists:
        raise InputError(f"{where}: expected at most {MAX_JSON_VALUES:,} values, and {most_lists:,} lists and objects")
    checked = {"parse_int": _int64, "parse_float": _finite} if _LARGE_NUMBER.search(text) else {}  # ten times slower
    try:
        value = json.loads(text, parse_constant=float if non_finite else _finite, **checked)
        if _is_deeper(value, MAX_JSON_DEPTH):
            raise RecursionError
    except RecursionError as error:
        raise InputError(f"{where}: brackets are nested too deeply; expected at most {MAX_JSON_DEPTH} levels") from error
    except (ValueError, TypeError) as error:
        raise InputError(f"{where}: not valid JSON ({error})") from error
    if _HALF.search(text) and _has_surrogates(json.dumps(value, ensure_ascii=False)):
        raise InputError(f"{where}: a text has half of a surrogate pair, which is no character")
    return value


def _int64(digits: str) -> int:
    if len(digits) > 20 or not -(2**63) <= (value := int(digits)) < 2**64:
        raise ValueError(f"the integer {digits[:24]}... does not fit into 64 bits")
    return value


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"{digits[:24]} is not a finite number")
    return value


def _is_deeper(value: Any, levels: int) -> bool:
    if not isinstance(value, dict | list):
        return False
    return levels <= 0 or any(_is_deeper(one, levels - 1) for one in (value.values() if isinstance(value, dict) else value))


def _has_surrogates(text: str) -> bool:
    """Whether a text cannot be written as UTF-8."""
    return text.encode(errors="replace") != text.encode(errors="surrogatepass")


def parse_numbers(text: str, where: str, count: int) -> list[float]:
    """Finite numbers between blanks or commas."""
    with parsing(where, f"expected {count} numbers"):
        numbers = [float(word) for word in text.replace(",", " ").split()]
    expect(len(numbers) == count and all(map(math.isfinite, numbers)), where, f"{count} finite numbers, found {len(numbers)}")
    return numbers


def check_fields(where: str, value: Any, schema: Mapping[str, Any], optional: Iterable[str] = ()) -> dict[str, Any]:
    """Checks that a value of JSON is an object with the given names and types; it may have other names too.

    Types are bool, int, float (which an integer fits), str, dict, dict[str, TYPE], list[TYPE] and TYPE | None; `optional` names
    may be missing.
    """
    if not isinstance(value, dict):
        raise InputError(f"{where}: expected an object of {names_in(schema)}, found {_shown(value)}")
    if missing := [name for name in schema if name not in value and name not in optional]:
        raise InputError(f"{where}: lacks {names_in(missing)}")
    for name, hint in schema.items():
        if name in value and not _is_of(value[name], hint):
            expected = hint.__name__ if isinstance(hint, type) and not typing.get_args(hint) else str(hint)
            raise InputError(f"{where}: {name} is {_shown(value[name])}, expected {expected}")
    return value


def settings_from(kind: type[Settings], value: Any, where: str) -> Settings:
    """Makes an object of a flat dataclass, which is the schema, from an object of JSON without unknown names."""
    declared = fields(kind)  # pyright: ignore[reportArgumentType]
    optional = [one.name for one in declared if one.default is not MISSING or one.default_factory is not MISSING]
    check_fields(where, value, typing.get_type_hints(kind), optional)
    if unknown := sorted(set(value) - {one.name for one in declared}):
        raise InputError(f"{where}: has settings unknown to this version: {names_in(unknown)}")
    try:
        return kind(**value)
    except InputError as error:
        if type(error.said) is not str:  # a text for a page, which words it itself
            raise
        raise InputError(f"{where}: {error}") from error


def _is_of(value: Any, hint: Any) -> bool:
    if hint in (int, float):  # first, as of a long recording nearly all are
        return isinstance(value, int if hint is int else int | float) and not isinstance(value, bool)
    if isinstance(hint, types.UnionType):
        return any(_is_of(value, one) for one in typing.get_args(hint))
    if typing.get_origin(hint) is list:
        return isinstance(value, list) and all(_is_of(one, typing.get_args(hint)[0]) for one in value)
    if typing.get_origin(hint) is dict:
        _, of_values = typing.get_args(hint)  # names in JSON are words
        return isinstance(value, dict) and all(_is_of(one, of_values) for one in value.values())
    return isinstance(value, hint)


class _Short(reprlib.Repr):
    """Shortens while it goes; of a library's object, such as a damaged tensor whose text never ends, it shows the type."""

    def repr_instance(self, x: Any, level: int) -> str:
        return repr(x) if isinstance(x, bool | float | types.NoneType) else type(x).__name__


def _shown(value: Any) -> str:
    text = _Short().repr(value)
    return text if len(text) <= 40 else f"{text[:40]}..."


# --- arrays ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ArraySchema:
    """What an array in a file must be."""

    kinds: str  # allowed numpy kinds: "f" floats, "u" and "i" integers, "b" bool, "S" and "U" text
    # the length of each axis; None for any length, a name for a length that other arrays of the file share
    shape: tuple[int | str | None, ...]
    required: bool = True  # whether the file must have the array


def check_array(
    where: str, shape: tuple[int, ...], dtype: np.dtype, schema: ArraySchema, lengths: dict[str, int] | None = None
) -> None:
    """Checks the shape and type of an array, which need not be in memory.

    `lengths` are the named lengths of the arrays that were checked before; this array's are added.
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
    """Reads the named arrays of an .npz file and no others; those that are not required may be missing in the result."""

    def read(path: Path) -> dict[str, np.ndarray]:
        with zipfile.ZipFile(path) as archive:
            sizes = {member.filename.removesuffix(".npy"): member.file_size for member in archive.infolist()}
        check_budget(path, sum(sizes.get(name, 0) for name in schemas), "its arrays")
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in schemas if name in sizes}

    arrays = read_with(read, Path(path), "not a readable .npz file")
    lengths: dict[str, int] = {}
    for name, schema in schemas.items():
        if name in arrays:
            check_array(f"{path}: {name}", arrays[name].shape, arrays[name].dtype, schema, lengths)
        else:
            expect(not schema.required, str(path), f"an array {name}")
    return arrays


def read_npy_header(file: IO[bytes], where: str, may_be_objects: bool = False) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, Fortran order and type that a .npy stream declares: not Python objects, unless nothing else of it is read."""
    with parsing(where, "not a readable .npy header"):
        version = np.lib.format.read_magic(file)
        reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = reader(file, max_header_size=10_000)
    plain = may_be_objects or not dtype.hasobject
    expect(plain and min(shape, default=0) >= 0, where, f"plain numbers, found {dtype} of shape {shape}")
    return shape, fortran, dtype


def open_npy(path: Path, schema: ArraySchema) -> np.ndarray:
    """Opens an .npy file, whose array must not be empty, as a read-only memory map."""
    with parsing(path, "not a readable .npy file"):
        array = np.lib.format.open_memmap(path, mode="r")
    check_array(str(path), array.shape, array.dtype, schema)
    expect(array.size > 0, str(path), f"an array that is not empty, found {array.shape}")
    return array
