"""Checks a file of `torch.save` before torch reads it: which objects its pickle names, and how much memory it takes.

Even torch's restricted unpickler lets a file of a few bytes ask for gigabytes: a compressed archive, bytearray(10**10), a memo
of 10**9 entries, a tensor whose strides are 0. Here nothing but tensors, numbers, texts and containers passes.
"""

import math
import pickletools
import zipfile
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_budget

MAX_PICKLE_BYTES = 16_000_000
MAX_DEPTH = 16

_GLOBALS = {
    "torch._utils _rebuild_tensor_v2",
    "collections OrderedDict",
    *(
        f"torch {kind}Storage"
        for kind in ("Float", "Double", "Half", "BFloat16", "Long", "Int", "Short", "Char", "Byte", "Bool")
    ),
}

_OPCODES = {
    *("PROTO", "STOP", "MARK", "GLOBAL", "REDUCE", "BINPERSID", "BINPUT", "LONG_BINPUT", "BINGET", "LONG_BINGET"),
    *("NONE", "NEWTRUE", "NEWFALSE", "BININT", "BININT1", "BININT2", "LONG1", "BINFLOAT", "BINUNICODE", "SHORT_BINUNICODE"),
    *("EMPTY_DICT", "EMPTY_LIST", "EMPTY_TUPLE", "TUPLE", "TUPLE1", "TUPLE2", "TUPLE3"),
    *("APPEND", "APPENDS", "SETITEM", "SETITEMS", "MEMOIZE", "BUILD"),
}
"""What torch.save writes for tensors, numbers, texts and containers."""


def read_state_file(path: Path) -> Any:
    """Reads a file of `torch.save`.

    Raises:
        InputError: it holds something else than tensors, numbers, texts, dicts and lists, or takes too much memory.
    """
    _check_archive(path)
    value = torch.load(path, map_location="cpu", weights_only=True)
    _check_value(value, str(path), MAX_DEPTH, set())
    return value


def _check_archive(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        if any(one.compress_type != zipfile.ZIP_STORED or one.flag_bits & 1 for one in members):
            raise InputError(f"{path}: compressed or encrypted; expected a file of torch.save, which is neither")
        total = sum(one.file_size for one in members)
        if total > path.stat().st_size:
            raise InputError(f"{path}: its parts have {total:,} bytes, more than the file")
        check_budget(path, total, "its content")
        pickles = [one for one in members if one.filename.endswith("data.pkl")]
        if len(pickles) != 1 or pickles[0].file_size > MAX_PICKLE_BYTES:
            raise InputError(f"{path}: expected one data.pkl of at most {MAX_PICKLE_BYTES:,} bytes in it")
        content = archive.read(pickles[0])
    for place, (opcode, argument, _) in enumerate(pickletools.genops(content)):
        unknown = opcode.name not in _OPCODES or (opcode.name == "GLOBAL" and argument not in _GLOBALS)
        if unknown or (opcode.name == "LONG_BINPUT" and int(argument or 0) > place):
            raise InputError(
                f"{path}: holds {opcode.name} {str(argument or '')[:60]}; expected tensors, numbers, texts, dicts and lists"
            )


def _check_value(value: Any, where: str, depth: int, seen: set[int]) -> None:
    if isinstance(value, Tensor):
        if value.layout != torch.strided or value.numel() * value.element_size() > value.untyped_storage().nbytes():
            raise InputError(f"{where}: a tensor {tuple(value.shape)} is larger than what is stored of it")
        if value.is_floating_point() and not bool(torch.isfinite(value).all()):
            raise InputError(f"{where}: a tensor {tuple(value.shape)} holds numbers that are not finite")
    elif isinstance(value, dict | list | tuple):
        if id(value) in seen:
            return
        seen.add(id(value))
        if depth == 0:
            raise InputError(f"{where}: containers are nested more than {MAX_DEPTH} deep")
        for one in value.values() if isinstance(value, dict) else value:
            _check_value(one, where, depth - 1, seen)
    elif not isinstance(value, str | int | float | None) or (isinstance(value, float) and math.isnan(value)):
        raise InputError(f"{where}: holds {str(value)[:40]!r}, expected tensors, numbers, texts and containers of them")
