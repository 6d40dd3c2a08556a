"""Runs mutated files through their readers, in a child process that judges what each of them did, and that they may end."""

import contextlib
import hashlib
import itertools
import logging
import multiprocessing
import os
import resource
import shutil
import signal
import tempfile
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from unittest.mock import patch

import numpy as np

from fuzz.formats import FORMATS
from fuzz.hostile import CANARY, NEVER, SECRET, TELLS, WILD
from fuzz.structures import mutate_file
from kpopnet.errors import InputError

ACCEPTED, REFUSED = "accepted", "refused"

BUDGET_GB = 0.05
"""What the content of a file may take here; `MOST_BYTES` leaves room for copies of it."""

MOST_BYTES, ADDRESS_SPACE_BYTES = 250_000_000, 4_000_000_000
MOST_CPU_S, MOST_S = 10, 40
"""Memory and time of one case, whose valid file takes kilobytes and milliseconds."""

ODD_FOLDER = "case \x1b[31m\n"
"""A folder of strangers may have a name that would reach the terminal."""

Case = tuple[str, int]
"""A format and the number of one of its mutations."""

Faults = list[tuple[int, str]]
"""Cases and what happened that should not happen."""


def fuzz(names: Iterable[str], cases: range, seed: int, stop_at_first: bool = False) -> dict[str, tuple[Counter, Faults]]:
    """Reads mutated files of some formats: by format the number of cases by outcome, and the faults.

    Case k of a format is a function of the format's name, the seed and k, so that a fault can be repeated alone.
    """
    found: dict[str, tuple[Counter, Faults]] = {name: (Counter(), []) for name in names}
    left = [(name, case) for name in found for case in cases if case % FORMATS[name].every == 0]
    while left:
        for (name, case), outcome, message in _answers(left, seed):
            left.remove((name, case))
            outcomes, faults = found[name]
            outcomes[outcome] += 1
            if outcome not in (ACCEPTED, REFUSED):
                faults.append((case, f"{outcome}: {message}"))
                if stop_at_first:
                    return found
    return found


def _answers(cases: list[Case], seed: int) -> Iterator[tuple[Case, str, str]]:
    """The outcome of cases and what is said of it, as a child finds them, up to one that ends the child."""
    processes = multiprocessing.get_context("spawn")
    ours, theirs = processes.Pipe(duplex=False)
    with tempfile.TemporaryDirectory(prefix="fuzz_") as place, patch.dict(os.environ, OMP_NUM_THREADS="1"):
        child = processes.Process(target=_read_all, args=(theirs, cases, seed, Path(place)))
        child.start()
        theirs.close()
        try:
            for case in cases:
                try:
                    answer = ours.recv()
                except (EOFError, OSError):
                    yield case, "hang or crash", "the process that read it ended"
                    return
                if isinstance(answer, str):  # an exception of its own, and no fault of a reader
                    raise RuntimeError(answer)
                yield case, *answer
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)  # with what a reader may have left
            child.kill()
            child.join()
            ours.close()


def _read_all(answers: Connection, cases: list[Case], seed: int, place: Path) -> None:
    """In the child: sends the outcome of each case."""
    os.setsid()
    for output in (1, 2):  # what a library prints is of no interest
        os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    os.environ["KPOPNET_FILE_BUDGET_GB"] = str(BUDGET_GB)
    warnings.simplefilter("ignore")  # files may be read with warnings
    logging.disable()
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        for name, numbers in itertools.groupby(cases, lambda one: one[0]):
            for outcome in _outcomes(name, seed, place, [case for _, case in numbers]):
                answers.send(outcome)
    except Exception:
        answers.send(traceback.format_exc())


def _outcomes(name: str, seed: int, place: Path, cases: list[int]) -> Iterator[tuple[str, str]]:
    form, valid, outside, work = FORMATS[name], *(place / part for part in ("valid", "outside", "work"))
    for folder in (valid, outside, work):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
    os.chdir(work)
    form.make(valid)
    expected = ""
    for case in (None, *cases):
        rng = np.random.default_rng([zlib.crc32(name.encode()), seed, case or 0])
        copied = place / (ODD_FOLDER if rng.random() < 0.1 else "case")
        shutil.copytree(valid, copied)
        if case is None:
            expected = digest(form.read(copied))
        else:
            files = sorted(path for path in copied.rglob("*") if path.is_file())
            demand = mutate_file(files[int(rng.integers(len(files)))], rng, form.is_own)
            yield judge(form.read, copied, outside, demand, expected)
        for folder in (copied, work / CANARY):
            shutil.rmtree(folder, ignore_errors=True)


def judge(read, mutated: Path, outside: Path, demand: str, expected: str) -> tuple[str, str]:
    """Reads a mutated file; what should not happen, or ACCEPTED, or REFUSED."""
    files, before_bytes, before_s = listing(mutated, outside), _restarted_peak_bytes(), _cpu_s()
    content, message = None, ""
    signal.alarm(MOST_S)  # ends this process
    try:
        content = read(mutated)
    except InputError as error:
        message = str(error)
    except Exception as error:
        return type(error).__name__, " ".join(str(error).split())[:300]
    finally:
        signal.alarm(0)
    taken_bytes, taken_s = _peak_bytes() - before_bytes, _cpu_s() - before_s
    if left := [int(one) for path in Path("/proc/self/task").glob("*/children") for one in path.read_text().split()]:
        for one in left:
            os.kill(one, signal.SIGKILL)
        return "process left behind", f"{len(left)} of them"
    if stray := [path.name for path in Path().iterdir()]:
        return ("code ran" if CANARY in stray else "file left behind"), f"it made {stray}"
    if changed := listing(mutated, outside) ^ files:
        return "input changed", f"files read: {sorted({Path(path).name for path, _ in changed})}"
    if taken_bytes > MOST_BYTES and demand != WILD:
        return "memory", f"{taken_bytes / 1e6:.0f} MB, {message[:100]}"
    if taken_s > MOST_CPU_S:
        return "time", f"{taken_s:.1f} s, {message[:100]}"
    if content is None:
        return (REFUSED, message) if message.isprintable() else ("message that is no plain line", repr(message))
    numbers = [one for one in content if one.dtype.kind == "f" and one.size]
    if demand != WILD and any(np.isclose(one, SECRET, rtol=0, atol=1e-6).mean() > 0.5 for one in numbers):
        return "content of another file", "what lies outside was read"
    if demand == NEVER or (demand == TELLS and digest(content) != expected):
        return "damage accepted", "another content than that of the valid file"
    return ACCEPTED, ""


def digest(content: list[np.ndarray]) -> str:
    """A digest of arrays."""
    found = hashlib.sha256()
    for one in content:
        found.update(repr((one.shape, one.dtype.str)).encode() + np.ascontiguousarray(one).tobytes())
    return found.hexdigest()


def listing(*folders: Path) -> set[tuple[str, bytes]]:
    """The files of folders with their contents, and the folders in them."""
    return {(str(path), path.read_bytes() if path.is_file() else b"") for folder in folders for path in folder.rglob("*")}


def _restarted_peak_bytes() -> int:
    """Lets the peak of resident memory begin anew (Linux); the memory that is resident now."""
    Path("/proc/self/clear_refs").write_text("5")
    return _peak_bytes()


def _peak_bytes() -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM"))


def _cpu_s() -> float:
    """Processor time of this process and of its children that have ended."""
    return sum(one.ru_utime + one.ru_stime for one in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))
