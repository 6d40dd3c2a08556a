"""Runs mutated files through their readers, in a child process with a limit on memory and time."""

import multiprocessing
import resource
import shutil
import tempfile
import zlib
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

TIME_LIMIT_S = 10.0
MEMORY_LIMIT_BYTES = 1_600_000_000
"""Address space beyond what the process has after reading the valid file: the budget of 1 GB a file, and some to work with."""

ACCEPTED, REFUSED = "accepted", "refused"


@dataclass
class Report:
    """What came of the cases of one format.

    Attributes:
        outcomes: number of cases by outcome: accepted, refused, or what should not happen.
        faults: (case, what happened) of each case that should not happen.
    """

    outcomes: Counter = field(default_factory=Counter)
    faults: list[tuple[int, str]] = field(default_factory=list)


class Fuzzer:
    """A child process that reads mutated files of any format; it is started again when it hangs or dies."""

    def __init__(self, seed: int) -> None:
        """`seed` is that of all cases."""
        self.seed = seed
        self._process = self._pipe = None

    def __enter__(self) -> "Fuzzer":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None

    def fuzz(self, name: str, cases: range) -> Report:
        """Reads mutated files of one format.

        Case k is a function of the format's name, the seed and k, so that a fault can be repeated alone.
        """
        report = Report()
        for case in cases:
            kind, message = self._run(name, case)
            report.outcomes[kind] += 1
            if kind not in (ACCEPTED, REFUSED):
                report.faults.append((case, f"{kind}: {message}"))
        return report

    def _run(self, name: str, case: int) -> tuple[str, str]:
        """(outcome, message) of one case."""
        self._prepare(name)
        try:
            self._pipe.send((name, case))
            if self._pipe.poll(TIME_LIMIT_S):
                return self._pipe.recv()
        except (EOFError, BrokenPipeError, ConnectionResetError):
            pass
        self.__exit__()
        return "hang or crash", f"no answer within {TIME_LIMIT_S:g} s, or the process died"

    def _prepare(self, name: str) -> None:
        """Has the process make and read the format's valid file, outside the time limit: imports and compilation take long.

        Raises:
            RuntimeError: the valid file cannot be read.
        """
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_work, args=(theirs, self.seed), daemon=True)
            self._process.start()
            theirs.close()
        self._pipe.send((name, None))
        if not self._pipe.poll(300) or (problem := self._pipe.recv()):
            raise RuntimeError(f"{name}: the valid file cannot be read: {problem}")


def _work(pipe: Connection, seed: int) -> None:
    import logging
    import os
    import warnings

    from fuzz.formats import FORMATS
    from fuzz.mutations import mutate_file

    # Files may be read with warnings, and training prints its progress.
    warnings.simplefilter("ignore")
    logging.disable()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    prepared = None
    with tempfile.TemporaryDirectory() as temporary:
        valid, mutated = Path(temporary) / "valid", Path(temporary) / "mutated"
        while True:
            name, case = pipe.recv()
            form = FORMATS[name]
            if case is None:
                pipe.send("" if name == prepared else _make_and_read(form, valid))
                prepared = name
                continue
            rng = np.random.default_rng([zlib.crc32(name.encode()), seed, case])
            shutil.rmtree(mutated, ignore_errors=True)
            shutil.copytree(valid, mutated, symlinks=True)
            targets = sorted({path for pattern in form.files for path in mutated.glob(pattern) if path.is_file()})
            mutate_file(targets[int(rng.integers(len(targets)))], rng)
            pipe.send(_outcome(form, mutated))


def _make_and_read(form, folder: Path) -> str:
    """Makes the valid file and reads it; returns what was wrong. Afterwards memory is limited."""
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        form.make(folder)
        form.read(folder)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    _limit_memory()
    return ""


def _outcome(form, folder: Path) -> tuple[str, str]:
    from kpopnet.errors import InputError

    try:
        form.read(folder)
    except InputError as error:
        message = str(error)
        if "\n" in message:
            return "message of several lines", message
        if any("\ud800" <= character <= "\udfff" for character in message):
            return "message that cannot be printed", repr(message)
        return REFUSED, message
    except Exception as error:
        return type(error).__name__, " ".join(str(error).split())[:300]
    return ACCEPTED, ""


def _limit_memory() -> None:
    """Limits the address space to MEMORY_LIMIT_BYTES beyond what is in use; the limit can be raised again."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY_LIMIT_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
