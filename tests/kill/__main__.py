"""Kills a program again and again at random times, starts it again until it is done, and compares the result.

    python -m tests.kill --program synth --kills 50 --seed 0
    python -m tests.kill                                        # all programs

Each start of the program is killed by SIGKILL after a time drawn from 0 to the length of an undisturbed run; only its first
process is killed, as a user or a scheduler does. After each kill every other process of it must end within 5 s. A run that
gets done is compared with an undisturbed one: files byte for byte, trained weights bit for bit; then the next one begins, until
there were as many kills as wanted. Prints a line for each program, and ends with exit code 1 where anything differed, stayed
alive or failed.
"""

import argparse
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.kill.programs import PROGRAMS, ROOT, Program

LATEST_END_S = 5.0
"""Within this time after a kill every process of the program must have ended."""

MOST_SECONDS = 300.0


def start(program: Program, folder: Path) -> subprocess.Popen:
    """Starts a program as the leader of a session of its own; its output goes to FOLDER.log."""
    with folder.with_suffix(".log").open("ab") as log:
        return subprocess.Popen(
            program.command(folder), cwd=ROOT, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )  # fmt: skip


def finish(program: Program, folder: Path) -> Any:
    """Runs a program to its end, and gives its result."""
    if code := start(program, folder).wait(timeout=MOST_SECONDS):
        raise RuntimeError(f"exit code {code}: {folder.with_suffix('.log').read_text(errors='replace')[-2000:]}")
    return program.result(folder)


def killed(program: Program, folder: Path, after_s: float) -> bool:
    """Starts a program and kills it after some seconds; False if it was done before that."""
    process = start(program, folder)
    try:
        if code := process.wait(timeout=after_s):
            raise RuntimeError(f"exit code {code}: {folder.with_suffix('.log').read_text(errors='replace')[-2000:]}")
        return False
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    began = time.monotonic()
    while left := alive_in(process.pid):
        if time.monotonic() - began > LATEST_END_S:
            for one in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(one, signal.SIGKILL)
            raise RuntimeError(f"processes alive after {LATEST_END_S:g} s: {left}")
        time.sleep(0.02)
    return True


def alive_in(session: int) -> list[int]:
    """The running processes of a session, from Linux's /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, _, of_session = path.read_text().rpartition(")")[2].split()[:4]
            if int(of_session) == session and state not in "ZX":
                found.append(int(path.parent.name))
    return found


def differences(found: Any, expected: Any) -> str:
    """Where two results differ, in a few words."""
    if isinstance(found, dict) and isinstance(expected, dict):
        names = sorted(name for name in found.keys() | expected.keys() if found.get(name) != expected.get(name))
        return ", ".join(f"{name}: {differences(found.get(name), expected.get(name))}" for name in names)
    return f"{str(found)[:60]} against {str(expected)[:60]}"


def judge(name: str, kills: int, seed: int, folder: Path) -> str:
    """Kills one program that many times in runs below `folder`; what was seen."""
    program, rng = PROGRAMS[name](folder), random.Random(f"{seed} {name}")
    began = time.monotonic()
    expected, whole_s = finish(program, folder / "whole"), time.monotonic() - began
    count = resumed = runs = 0
    while count < kills:
        run, starts = folder / f"run_{runs}", 0
        while count < kills and killed(program, run, rng.uniform(0, whole_s)):
            count, starts = count + 1, starts + 1
            resumed += starts > 1
        if (found := finish(program, run)) != expected:
            raise RuntimeError(f"after {starts} kills the result differs: {differences(found, expected)}")
        runs += 1
    return f"{name}: {kills} kills, {resumed} of them of resumed runs; {runs} finished runs, all equal"


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("python -m tests.kill", description=__doc__, formatter_class=form)
    parser.add_argument("--program", choices=sorted(PROGRAMS), action="append", help="one program; may be given again")
    parser.add_argument("--kills", type=int, default=50, help="of each program: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="of the times: %(default)s")
    given = parser.parse_args()
    failed = False
    for name in given.program or PROGRAMS:
        with tempfile.TemporaryDirectory(prefix="kpopnet_kill_") as folder:
            try:
                print(judge(name, given.kills, given.seed, Path(folder)))
            except RuntimeError as error:
                failed = True
                print(f"{name}: {error}", file=sys.stderr)
    raise SystemExit(failed)


if __name__ == "__main__":
    main()
