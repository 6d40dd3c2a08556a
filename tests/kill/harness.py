"""Starting, killing and watching programs."""

import contextlib
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
LATEST_END_S = 5.0
"""Within this time after a kill every process of the program must have ended."""

MOST_SECONDS = 300.0


class Program(NamedTuple):
    """A program with small settings.

    Attributes:
        command: folder of a run to the command that starts it, or takes it up again.
        result: folder of a finished run to what must not depend on kills.
    """

    command: Callable[[Path], list[str]]
    result: Callable[[Path], Any]


class Undisturbed(NamedTuple):
    """What a run gives that nothing disturbs, and how long it takes."""

    result: Any
    seconds: float


@dataclass
class Tally:
    """What was seen of one program."""

    name: str
    kills: int = 0
    in_first_start: int = 0
    runs: int = 0
    done: int = 0
    latest_end_s: float = 0.0
    undisturbed_s: float = 0.0
    problems: list[str] = field(default_factory=list)

    @staticmethod
    def heading() -> str:
        columns = "program", "undisturbed", "kills", "of resumed runs", "finished runs, all equal", "last process gone after"
        return f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|"

    def row(self) -> str:
        return (
            f"| {self.name} | {self.undisturbed_s:.1f} s | {self.kills} | {self.kills - self.in_first_start} | {self.done} | "
            f"at most {self.latest_end_s:.2f} s |"
        )


def start(program: Program, folder: Path) -> subprocess.Popen:
    """Starts a program as the leader of a session of its own; its output goes to FOLDER.log."""
    with folder.with_suffix(".log").open("ab") as log:
        return subprocess.Popen(
            program.command(folder), cwd=ROOT, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )  # fmt: skip


def undisturbed(program: Program, folder: Path) -> Undisturbed:
    """Runs a program to its end: once to fill the caches of compiled kernels, once for time and result."""
    seconds = 0.0
    for place in (folder.with_name("warming"), folder):
        began = time.monotonic()
        code = start(program, place).wait(timeout=MOST_SECONDS)
        seconds = time.monotonic() - began
        if code:
            raise RuntimeError(f"exit code {code}: {place.with_suffix('.log').read_text(errors='replace')[-2000:]}")
    return Undisturbed(program.result(folder), seconds)


def kill_until_done(
    program: Program, folder: Path, expected: Undisturbed, kills: int, rng: random.Random, tally: Tally
) -> None:
    """Starts and kills one run until it is done; after the last kill that is wanted it is left alone."""
    starts = 0
    while True:
        process = start(program, folder)
        starts += 1
        limit_s = rng.uniform(0, expected.seconds) if tally.kills < kills else MOST_SECONDS
        try:
            code = process.wait(timeout=limit_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            tally.kills += 1
            tally.in_first_start += starts == 1
            gone_s = seconds_until_gone(process.pid)
            tally.latest_end_s = max(tally.latest_end_s, gone_s)
            if gone_s > LATEST_END_S:
                tally.problems.append(f"kill {tally.kills}: processes alive after {LATEST_END_S:g} s: {alive_in(process.pid)}")
                end_session(process.pid)
                return
            continue
        if code:
            tally.problems.append(f"start {starts}: exit code {code}: {folder.with_suffix('.log').read_text()[-1500:]}")
            return
        break
    if (found := program.result(folder)) != expected.result:
        tally.problems.append(f"after {starts} starts the result differs: {differences(found, expected.result)}")
    tally.done += 1


def differences(found: Any, expected: Any) -> str:
    """Where two results differ, in a few words."""
    if isinstance(found, dict) and isinstance(expected, dict):
        names = sorted(name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name))
        return ", ".join(f"{name}: {differences(found.get(name), expected.get(name))}" for name in names)
    return f"{str(found)[:60]} against {str(expected)[:60]}"


def alive_in(session: int) -> list[int]:
    """The running processes of a session, from Linux's /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, _, of_session = path.read_text().rpartition(")")[2].split()[:4]
            if int(of_session) == session and state not in "ZX":
                found.append(int(path.parent.name))
    return found


def seconds_until_gone(session: int) -> float:
    """How long it takes until no process of the session lives; a little above LATEST_END_S if one stays."""
    began = time.monotonic()
    while alive_in(session) and time.monotonic() - began <= LATEST_END_S:
        time.sleep(0.02)
    return time.monotonic() - began


def end_session(session: int) -> None:
    """Ends what a program has left."""
    for process in alive_in(session):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
