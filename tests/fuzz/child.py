"""The child process of the harness: reads mutated files, and judges all that each of them did.

Started by `fuzz.runner` as `child.py SEED FOLDER`, with pairs of a format's name and a case's number on standard
input. Prints a line of JSON for each: name, number, outcome, message.
"""

import hashlib
import itertools
import json
import logging
import os
import resource
import shutil
import signal
import sys
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:1] = [str(TESTS.parent), str(TESTS), str(TESTS / "helpers")]

import numpy as np  # noqa: E402

from fuzz.formats import FORMATS  # noqa: E402
from fuzz.structures import mutate_file  # noqa: E402
from fuzz.traps import CANARY, NEVER, SECRET, TELLS, WILD  # noqa: E402
from kpopnet.errors import InputError  # noqa: E402

ACCEPTED, REFUSED = "accepted", "refused"

BUDGET_GB = 0.05
"""What the content of a file may take here; `MOST_BYTES` leaves room for copies of it."""

MOST_BYTES, ADDRESS_SPACE_BYTES = 250_000_000, 4_000_000_000
MOST_CPU_S, MOST_S = 10, 40
"""Memory and time of one case, whose valid file takes kilobytes and milliseconds."""

ODD_FOLDER = "case \x1b[31m\n"
"""A folder of strangers may have a name that would reach the terminal."""


def main() -> None:
    seed, place = sys.argv[1:]
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what a library prints is no answer
    os.environ["KPOPNET_FILE_BUDGET_GB"] = str(BUDGET_GB)
    warnings.simplefilter("ignore")  # files may be read with warnings
    logging.disable()
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name, cases in itertools.groupby(json.load(sys.stdin), lambda one: one[0]):
        for answer in judged(name, int(seed), Path(place), [case for _, case in cases]):
            print(json.dumps((name, *answer)), file=answers, flush=True)


def judged(name: str, seed: int, place: Path, cases: list[int]) -> Iterator[tuple[int, str, str]]:
    """Yields (case, outcome, message) of each case."""
    form, valid, outside, work = FORMATS[name], *(place / part for part in ("valid", "outside", "work"))
    for folder in (valid, outside, work):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
    os.chdir(work)
    form.make(valid)
    files = listing(valid)
    expected = digest(form.read(valid))
    if listing(valid) != files:
        yield cases[0], "input changed", "a valid file"
        return
    for case in cases:
        rng = np.random.default_rng([zlib.crc32(name.encode()), seed, case])
        mutated = place / (ODD_FOLDER if rng.random() < 0.1 else "case")
        shutil.copytree(valid, mutated)
        targets = sorted({path for pattern in form.files for path in mutated.glob(pattern)})
        demand = mutate_file(targets[int(rng.integers(len(targets)))], rng, outside, form.is_own)
        yield case, *judge(form.read, mutated, outside, demand, expected)
        shutil.rmtree(mutated, ignore_errors=True)
        shutil.rmtree(work / CANARY, ignore_errors=True)


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
    if left := _children():
        for one in left:
            os.kill(one, signal.SIGKILL)
        return "process left behind", f"{len(left)} of them"
    if stray := [path.name for path in Path().iterdir()]:
        return ("code ran" if CANARY in stray else "file left behind"), f"it made {stray}"
    if listing(mutated, outside) != files:
        return "input changed", f"files read: {names(listing(mutated, outside) ^ files)}"
    if taken_bytes > MOST_BYTES and demand != WILD:
        return "memory", f"{taken_bytes / 1e6:.0f} MB, {message[:100]}"
    if taken_s > MOST_CPU_S:
        return "time", f"{taken_s:.1f} s, {message[:100]}"
    if content is None:
        return (REFUSED, message) if message.isprintable() else ("message that is no plain line", repr(message))
    numbers = [one for one in content if one.dtype.kind == "f" and one.size]
    secret = any(np.isclose(one, SECRET, rtol=0, atol=1e-6).mean() > 0.5 for one in numbers)
    if secret and demand != WILD:
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


def names(files: set[tuple[str, bytes]]) -> list[str]:
    return sorted({Path(path).name for path, _ in files})


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


def _children() -> list[int]:
    return [int(one) for path in Path("/proc/self/task").glob("*/children") for one in path.read_text().split()]


if __name__ == "__main__":
    main()
