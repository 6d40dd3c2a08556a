"""Reads a stranger's file in a child process with limits of time, memory and open files.

On damaged or hostile bytes a parser may crash, take all memory or never end. Then only the child ends, and the caller gets an
`InputError`. What a parser raises becomes one too. Text, numbers and arrays cross to the parent, which unpickles nothing. The
limits are no sandbox: they stop accidents, not code that runs.
"""

import json
import logging
import math
import os
import pickle
import signal
import subprocess
import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from kpopnet.errors import InputError
from kpopnet.runtime.cpu import own_python
from kpopnet.runtime.input_files import first_line

log = logging.getLogger(__name__)

R = TypeVar("R")

START_S = 60.0
"""Longest time for the start of a child and the imports of its reader."""

SECONDS, MEMORY_BYTES = 60.0, 4_000_000_000
"""Default limits: 64 MB of BVH take ten seconds; interpreter and libraries take 1 GB of address space."""

OPEN_FILES = 128
MAX_TEXT_BYTES = 64_000_000
"""Most text of one result."""


def read_in_child(
    reader: Callable[..., R], path: Path | str, *args: Any, seconds: float = SECONDS, memory_bytes: int = MEMORY_BYTES
) -> R:
    """Returns reader(path, *args), computed in a child process.

    `reader` is a function of a module, which the child imports: about 0.2 s for numpy. Its result is made of None, bool, int,
    float, str, arrays of numbers or text, and of lists, tuples and dictionaries by name of these; lists come back as tuples.
    What the reader warns of is logged here.
    Raises InputError as the reader does, or if the reader raised another exception, crashed, or needed more than `seconds` or
    `memory_bytes` of address space.
    """
    with closing(iterate_in_child(_once, path, reader, *args, seconds=seconds, memory_bytes=memory_bytes)) as results:
        return next(results)


def _once(path: Path, reader: Callable[..., R], *args: Any) -> Iterator[R]:
    yield reader(path, *args)


def iterate_in_child(
    reader: Callable[..., Iterator[R]],
    path: Path | str,
    *args: Any,
    seconds: float = SECONDS,
    memory_bytes: int = MEMORY_BYTES,
) -> Generator[R, None, None]:
    """Yields what reader(path, *args) yields, as `read_in_child`; `seconds` limits each item."""
    path = Path(path)
    words, environment = own_python("from kpopnet.runtime.untrusted import serve; serve()")
    pipe = subprocess.PIPE
    child = subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, env=environment)
    assert child.stdin is not None and child.stdout is not None
    try:
        with suppress(BrokenPipeError):  # and stays open: the child ends where this process does
            pickle.dump((reader, path, args, seconds, memory_bytes), child.stdin)
            child.stdin.flush()
        _answer(child, path, START_S)
        while True:
            kind, value = _answer(child, path, seconds)
            if kind == "end":
                return
            if kind == "error":
                raise InputError(value)
            if kind == "warning":
                log.warning("%s", InputError(value))  # which escapes what is no text
                continue
            yield value
    finally:
        child.kill()
        child.stdout.close()
        with suppress(BrokenPipeError):
            child.stdin.close()
        child.wait()


def _answer(child: subprocess.Popen, path: Path, seconds: float) -> tuple[str, Any]:
    """The child's next answer: what it is, and its value."""
    late = threading.Event()
    timer = threading.Timer(seconds, lambda: (late.set(), child.kill()))
    timer.start()
    try:
        assert child.stdout is not None
        kind, value = received(child.stdout)
        return str(kind), value
    except (EOFError, ValueError, TypeError, KeyError, RecursionError, MemoryError):
        reason = f"its reader took longer than {seconds:g} s" if late.is_set() else "its reader crashed"
        raise InputError(f"{path}: cannot be read ({reason}); expected a file that is not damaged") from None
    finally:
        timer.cancel()


def send(value: Any, to: IO[bytes]) -> None:
    """Writes a value as a line of JSON, in which numbers stand for the arrays, and the bytes of these."""
    arrays: list[np.ndarray] = []

    def tree(value: Any) -> Any:
        if isinstance(value, np.ndarray | np.generic):
            arrays.append(np.ascontiguousarray(value).reshape(np.shape(value)))
            return {"array": arrays[-1].dtype.str, "shape": arrays[-1].shape}
        if isinstance(value, dict):
            return {"names": list(value), "values": [tree(one) for one in value.values()]}
        if isinstance(value, list | tuple):
            return [tree(one) for one in value]
        return value

    text = json.dumps(tree(value)).encode()
    to.write(len(text).to_bytes(8, "little") + text)
    for array in arrays:
        if array.dtype.kind not in KINDS:
            raise TypeError(f"an array of {array.dtype}")
        to.write(array.tobytes())
    to.flush()


KINDS = "biufSU"
"""Kinds of arrays that cross, as numpy calls them: no Python objects."""


def received(source: IO[bytes]) -> Any:
    """Reads what `send` has written; ValueError, KeyError or TypeError for anything else, EOFError at the end."""

    def exactly(count: int) -> bytes:
        content = source.read(count)
        if len(content) < count:
            raise EOFError
        return content

    def value(tree: Any) -> Any:
        if isinstance(tree, list):
            return tuple(value(one) for one in tree)
        if not isinstance(tree, dict):
            return tree
        if "names" in tree:
            return dict(zip(map(str, tree["names"]), map(value, tree["values"]), strict=True))
        dtype, shape = np.dtype(str(tree["array"])), tuple(map(int, tree["shape"]))
        if dtype.kind not in KINDS or min(shape, default=0) < 0:
            raise ValueError
        array = np.frombuffer(bytearray(exactly(math.prod(shape) * dtype.itemsize)), dtype).reshape(shape)
        return array if shape else array[()]

    length = int.from_bytes(exactly(8), "little")
    if length > MAX_TEXT_BYTES:
        raise ValueError
    return value(json.loads(exactly(length)))


def serve() -> None:
    """In the child: reads the request from standard input and writes the answers to standard output."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    # Some libraries look at standard input as they load (libgfortran, of scipy), which on Windows waits for a thread that reads
    # it: https://github.com/python/cpython/issues/78961
    requests = os.fdopen(os.dup(0), "rb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    reader, path, args, seconds, memory_bytes = pickle.load(requests)
    _limit(memory_bytes)
    threading.Thread(target=_end_with_parent, args=(requests.fileno(),), daemon=True).start()

    def answer(kind: str, value: Any = None) -> None:
        _end_after(0)
        send((kind, value), answers)
        _end_after(seconds)

    class Warnings(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            answer("warning", record.getMessage())

    answer("ready")
    logging.getLogger("kpopnet").addHandler(Warnings(logging.WARNING))
    try:
        for item in reader(path, *args):
            answer("item", item)
        answer("end")
    except InputError as error:
        answer("error", str(error))
    except MemoryError:
        answer("error", f"{path}: cannot be read (it takes more than {memory_bytes / 1e9:g} GB of memory)")
    except Exception as error:  # whatever a parser makes of damaged bytes
        answer("error", f"{path}: cannot be read ({type(error).__name__}: {first_line(error)})")


def _end_with_parent(pipe: int) -> None:
    while os.read(pipe, 1):
        pass
    os._exit(1)


def _limit(most_bytes: int) -> None:
    with suppress(ImportError, OSError, ValueError):  # not on every system
        import resource

        limits = (resource.RLIMIT_AS, most_bytes), (resource.RLIMIT_CORE, 0), (resource.RLIMIT_NOFILE, OPEN_FILES)
        for which, most in limits:
            _, hard = resource.getrlimit(which)
            resource.setrlimit(which, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _end_after(seconds: float) -> None:
    """Ends this process after the time, in case that no parent is left to do it; 0 for never."""
    if hasattr(signal, "alarm"):
        signal.alarm(math.ceil(2 * seconds))
