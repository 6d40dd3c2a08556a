"""Describes HDF5 files in a child process: on a damaged file libhdf5 can crash, or not return.

`python -m kpopnet.runtime.hdf5_probe` reads one path per line (JSON) from its standard input and answers each with a line of
JSON: links, data sets and attributes of the file. On the way it walks what a reader walks later: names, types, values of
attributes, index of chunks, texts of variable length. `describe` asks it. The child is started once per process and kept; it
ends when its standard input is closed, so with its parent.
"""

import atexit
import contextlib
import json
import math
import os
import selectors
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from kpopnet.errors import InputError

LIMIT_S = 5.0
"""Longest time for the description of one file, in seconds."""

START_S = 60.0
"""Longest time for the start of the child, in seconds."""

MEMORY_BYTES = 4_000_000_000
"""Address space of the child."""

MAX_LINKS, MAX_ATTRIBUTES, MAX_VALUES, MAX_TEXT = 200, 100, 4096, 1_000_000
"""More links or attributes are not described; attributes with more elements or longer texts have no value."""

MAX_ANSWER_BYTES = 256_000_000


def describe(path: Path) -> dict[str, Any]:
    """Describes one HDF5 file.

    Returns:
        attributes: by name: kind (of numpy; "U" is text, "O" others), shape, value (None if it is too large).
        members: by name: link (hard, soft, external) and error, if it cannot be read; of a data set also shape, type (of numpy;
            "text" has variable length), chunks, filters (number and parameters of each), most_chunk_bytes (stored bytes of the
            largest chunk), text_bytes (of variable length), outside (virtual, or in other files).

    Raises:
        InputError: it is no HDF5 file, or so damaged that its description crashed or took longer than LIMIT_S.
    """
    with _lock:
        answer = _ask(path) or _ask(path)  # a child that something else ended gets a second chance
    if answer is None:
        raise InputError(f"{path}: damaged HDF5 (reading its structure crashed)")
    if "error" in answer:
        raise InputError(f"{path}: not a readable HDF5 file ({answer['error']})")
    return answer


# --- the parent -----------------------------------------------------------------------------------------------------------

_lock = threading.Lock()
_child: subprocess.Popen | None = None


def _ask(path: Path) -> dict[str, Any] | None:
    """The child's answer; None if it ended before it answered."""
    child = _running()
    assert child.stdin is not None
    try:
        child.stdin.write(json.dumps(str(Path(path).absolute())).encode() + b"\n")
        child.stdin.flush()
        if (line := _line(child, LIMIT_S)) is not None:
            return json.loads(line)
        _end()
        return None
    except TimeoutError:
        _end()
        raise InputError(f"{path}: damaged HDF5 (reading its structure took longer than {LIMIT_S:g} s)") from None
    except (OSError, ValueError):
        _end()
        return None
    except BaseException:  # an interrupt: the answer would come before that of the next file
        _end()
        raise


def _running() -> subprocess.Popen:
    global _child
    if _child is not None and _child.poll() is None:
        return _child
    _end()
    root = str(Path(__file__).resolve().parents[2])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))}
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    _child = subprocess.Popen(
        [sys.executable, "-P", "-m", "kpopnet.runtime.hdf5_probe"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        bufsize=0,
    )
    try:
        ready = _line(_child, START_S)
    except TimeoutError:
        ready = None
    if ready is None:
        _end()
        raise InputError(f"the process that checks HDF5 files does not start; try: {sys.executable} -m {__spec__.name}")
    return _child


def _line(child: subprocess.Popen, seconds: float) -> bytes | None:
    """The next line that the child writes; None if it ends first."""
    assert child.stdout is not None
    end = time.monotonic() + seconds
    parts: list[bytes] = []
    received = 0
    with selectors.DefaultSelector() as selector:
        selector.register(child.stdout, selectors.EVENT_READ)
        while not parts or not parts[-1].endswith(b"\n"):
            if not selector.select(max(end - time.monotonic(), 0)):
                raise TimeoutError
            part = os.read(child.stdout.fileno(), 1 << 20)
            received += len(part)
            if not part or received > MAX_ANSWER_BYTES:
                return None
            parts.append(part)
    return b"".join(parts)


@atexit.register
def _end() -> None:
    """Ends the child, whatever it is doing."""
    global _child
    child, _child = _child, None
    if child is not None:
        child.kill()
        child.wait()
        _close(child)


def _close(child: subprocess.Popen) -> None:
    for pipe in (child.stdin, child.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()


def _forget() -> None:
    """In a forked process: the child is its parent's."""
    global _child, _lock
    child, _child, _lock = _child, None, threading.Lock()
    if child is not None:
        child.returncode = 0
        _close(child)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


# --- the child ------------------------------------------------------------------------------------------------------------


def _serve() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides when to end
    _limit_memory()
    print(flush=True)
    for line in sys.stdin:
        signal.alarm(math.ceil(3 * LIMIT_S))  # in case no parent is left to end it
        print(json.dumps(_described(json.loads(line))), flush=True)
        signal.alarm(0)


def _limit_memory() -> None:
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        for which, most in ((resource.RLIMIT_AS, MEMORY_BYTES), (resource.RLIMIT_CORE, 0)):
            _, hard = resource.getrlimit(which)
            resource.setrlimit(which, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _described(path: str) -> dict[str, Any]:
    try:
        with h5py.File(path, "r", locking=False, rdcc_nbytes=0) as file:
            names = list(_first(file, MAX_LINKS))
            attributes = list(_first(file.attrs, MAX_ATTRIBUTES))
            return {
                "attributes": {name: _attribute(file.attrs, name) for name in attributes},
                "members": {name: _member(file, name) for name in names},
            }
    except Exception as error:  # whatever libhdf5 and h5py make of damaged bytes
        return {"error": _reason(error)}


def _first(names: Any, most: int) -> Any:
    for number, name in enumerate(names):
        if number == most:
            raise ValueError(f"more than {most} names")
        yield name


def _attribute(attributes: h5py.AttributeManager, name: str) -> dict[str, Any]:
    try:
        return _value(attributes, name)
    except Exception:  # of a type that h5py does not know, or damaged
        return {"kind": "O", "shape": [], "value": None}


def _value(attributes: h5py.AttributeManager, name: str) -> dict[str, Any]:
    identity = attributes.get_id(name)
    shape, kind = identity.shape or (), identity.dtype.kind
    described: dict[str, Any] = {"kind": kind, "shape": list(shape), "value": None}
    if math.prod(shape) > MAX_VALUES or kind not in "OSUfiub" or identity.dtype.itemsize > MAX_TEXT:
        return described
    value = attributes[name]
    if isinstance(value, h5py.Empty):
        return described
    listed = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    texts = [one.decode("utf-8", "surrogateescape") if isinstance(one, bytes) else one for one in np.ravel(listed).tolist()]
    if kind in "OS":
        if not all(isinstance(one, str) for one in texts) or sum(len(str(one)) for one in texts) > MAX_TEXT:
            return described
        described["kind"], listed = "U", texts if shape else texts[0]
    return described | {"value": listed}


def _member(file: h5py.File, name: str) -> dict[str, Any]:
    link = file.get(name, getlink=True)
    kinds = {h5py.HardLink: "hard", h5py.SoftLink: "soft", h5py.ExternalLink: "external"}
    described: dict[str, Any] = {"link": kinds.get(type(link), "other")}
    if described["link"] != "hard":
        return described
    try:
        one = file[name]
        return described | (_dataset(one) if isinstance(one, h5py.Dataset) else {"error": "not an array"})
    except Exception as error:
        return described | {"error": _reason(error)}


def _dataset(data: h5py.Dataset) -> dict[str, Any]:
    properties = data.id.get_create_plist()
    outside = bool(data.is_virtual or data.external)
    if data.shape is None:
        return {"error": "an empty array"}
    text = h5py.check_string_dtype(data.dtype)
    is_text = text is not None and text.length is None
    described = {
        "shape": list(data.shape),
        "type": "text" if is_text else "object" if data.dtype.hasobject else data.dtype.str,
        "chunks": data.chunks and list(data.chunks),
        "filters": [_filter(properties, number) for number in range(properties.get_nfilters())],
        "outside": outside,
        "most_chunk_bytes": 0,
        "text_bytes": 0,
    }
    if outside:
        return described
    if data.dtype.kind in "fiu" and not data.id.get_type().equal(h5py.h5t.py_create(data.dtype, logical=True)):
        return {"error": "numbers of an unusual format"}
    if data.chunks:
        data.fillvalue  # noqa: B018 - read as a reader does for chunks that were never written
        described["most_chunk_bytes"] = _walk_chunks(data)
    if is_text:
        described["text_bytes"] = _text_bytes(data)
    return described


def _filter(properties: Any, number: int) -> list[Any]:
    code, _, values, _ = properties.get_filter(number)
    return [int(code), [int(one) for one in values]]


def _walk_chunks(data: h5py.Dataset) -> int:
    """Stored bytes of the largest chunk; every chunk must lie in the file."""
    size = data.file.id.get_filesize()
    most = 0

    def visit(chunk: Any) -> None:
        nonlocal most
        if chunk.byte_offset is None or chunk.byte_offset + chunk.size > size:
            raise ValueError("a chunk beyond the end of the file")
        most = max(most, chunk.size)

    data.id.chunk_iter(visit)
    return most


def _text_bytes(data: h5py.Dataset) -> int:
    """Bytes of all texts of variable length; they are read as a reader does, in blocks."""
    if data.ndim > 1 or math.prod(data.shape) > 100_000_000:
        raise ValueError("too many texts")
    if not data.ndim:
        return len(data[()])
    return sum(len(one) for start in range(0, len(data), 4096) for one in data[start : start + 4096])


def _reason(error: Exception) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)[:200]


if __name__ == "__main__":
    _serve()
