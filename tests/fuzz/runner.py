"""Runs mutated files through their readers, in a child process that judges them and that they may take down."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from fuzz.formats import FORMATS

ACCEPTED, REFUSED = "accepted", "refused"
CHILD = Path(__file__).with_name("child.py")

Faults = list[tuple[int, str]]
"""Cases and what happened that should not happen."""


def fuzz(names: Iterable[str], cases: range, seed: int, stop_at_first: bool = False) -> dict[str, tuple[Counter, Faults]]:
    """Reads mutated files of some formats: by format the number of cases by outcome, and the faults.

    Case k of a format is a function of the format's name, the seed and k, so that a fault can be repeated alone.
    """
    found: dict[str, tuple[Counter, Faults]] = {name: (Counter(), []) for name in names}
    left = [(name, case) for name in found for case in cases if case % FORMATS[name].every == 0]
    while left:
        for name, case, outcome, message in _answers(left, seed):
            left.remove((name, case))
            found[name][0][outcome] += 1
            if outcome not in (ACCEPTED, REFUSED):
                found[name][1].append((case, f"{outcome}: {message}"))
                if stop_at_first:
                    return found
        if left:  # the child hung or died; the next one begins with the next case
            name, case = left.pop(0)
            found[name][0]["hang or crash"] += 1
            found[name][1].append((case, "hang or crash: the process that read it ended"))
            if stop_at_first:
                return found
    return found


def _answers(cases: list[tuple[str, int]], seed: int) -> Iterator[tuple[str, int, str, str]]:
    """What a child answers to cases until it ends: format, number, outcome and message of each."""
    with tempfile.TemporaryDirectory(prefix="fuzz_") as place, tempfile.TemporaryFile("w+") as complaints:
        child = subprocess.Popen(
            [sys.executable, str(CHILD), str(seed), place],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints, text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"}, start_new_session=True,
        )  # fmt: skip
        assert child.stdin is not None and child.stdout is not None
        try:
            with child.stdin:
                json.dump(cases, child.stdin)
            yield from map(json.loads, child.stdout)
            if child.wait() == 1:  # an exception of its own, and no fault of a reader
                complaints.seek(0)
                raise RuntimeError(complaints.read()[-2000:])
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)  # with what a reader may have left
            child.stdout.close()
            child.wait()
