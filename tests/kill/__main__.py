"""Kills a program again and again, starts it again until it is done, and compares the result.

    python -m tests.kill --program synth --kills 50 --seed 0
    python -m tests.kill --planted                              # first: does the harness find each planted fault?
    python -m tests.kill                                        # all programs

There are two kinds of kills, which alternate. A death: SIGKILL after a time drawn from 0 to the length of an undisturbed run;
only the first process is killed, as a user or a scheduler does, and every other process must end within 30 s. A failure of the
power: all processes are killed at once before a drawn operation on files, and what was written and not synced is lost
(`tests.kill.disk`). A run that gets done loses power once more, and is compared with an undisturbed one: files byte for byte,
trained weights bit for bit; then the next one begins, until there were as many kills as wanted. Prints a line for each program,
and ends with exit code 1 where anything differed, stayed alive or failed.
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

from tests.kill.disk import Disk
from tests.kill.programs import PROGRAMS, ROOT, Program
from tests.planted import find_all

LATEST_END_S = 30.0
"""Within this time after a death every process of the program must have ended; a worker that is loading libraries ends after it
(some 3 s of an idle machine)."""

MOST_SECONDS = 300.0

KINDS = FAILURES, DEATHS = ["failures", "deaths"]


class Runs:
    """The runs of one program, and what was seen of them; `expected` is the result of an undisturbed one."""

    def __init__(self, program: Program, folder: Path, rng: random.Random, kinds: list[str]) -> None:
        self._program, self._rng = program, rng
        self._kinds = {kind: {DEATHS: self.die, FAILURES: self.lose_power}[kind] for kind in kinds}
        self.counts = dict.fromkeys((*kinds, "of resumed runs", "finished runs"), 0)
        began = time.monotonic()
        self.expected = self.finish(folder / "whole")
        if shared := self.expected.get("rooms of both splits"):
            raise RuntimeError(f"rooms of both splits: {shared}")
        self._whole_s, self._operations = time.monotonic() - began, Disk(folder / "whole").operations

    @property
    def kills(self) -> int:
        return sum(self.counts[kind] for kind in self._kinds)

    def start(self, folder: Path, cut: int = 0) -> subprocess.Popen:
        """Starts the program as the leader of a session of its own; its output goes to FOLDER.log."""
        try:
            command = self._program.command(folder)
        except (ValueError, OSError) as error:
            raise RuntimeError(f"what is left cannot be taken up again: {error}") from error
        with folder.with_suffix(".log").open("ab") as log:
            return subprocess.Popen(
                command, cwd=ROOT, stdout=log, stderr=log, stdin=subprocess.DEVNULL,
                start_new_session=True, env=os.environ | {"OMP_NUM_THREADS": "1"} | Disk(folder).begin(cut),
            )  # fmt: skip

    def finish(self, folder: Path) -> Any:
        """Runs the program to its end, and gives its result."""
        ended(self.start(folder).wait(timeout=MOST_SECONDS), folder)
        try:
            return self._program.result(folder)
        except (ValueError, OSError) as error:
            raise RuntimeError(f"the result cannot be read: {error}") from error

    def die(self, folder: Path) -> bool:
        """Starts the program and kills its first process after some seconds; False if it was done before that."""
        process = self.start(folder)
        try:
            ended(process.wait(timeout=self._rng.uniform(0, self._whole_s)), folder)
            return False
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        began = time.monotonic()
        while left := alive_in(process.pid):
            if time.monotonic() - began > LATEST_END_S:
                os.killpg(process.pid, signal.SIGKILL)
                raise RuntimeError(f"processes alive after {LATEST_END_S:g} s: {left}")
            time.sleep(0.02)
        return True

    def lose_power(self, folder: Path) -> bool:
        """Starts the program, and the power fails before one of its operations; False if it was done before that."""
        process = self.start(folder, self._rng.randint(1, self._operations))
        code = process.wait(timeout=MOST_SECONDS)
        if failed := code == -signal.SIGKILL:
            while alive_in(process.pid):
                time.sleep(0.02)
        else:
            ended(code, folder)
        Disk(folder).fail(self._rng)
        return failed

    def kill_until_done(self, folder: Path, most: int) -> None:
        """Kills one run, at most this number of times, until it is done."""
        starts = 0
        while self.kills < most:
            kind, began = min(self._kinds, key=lambda one: self.counts[one]), time.monotonic()
            if not self._kinds[kind](folder):
                if not starts:  # a whole run; the first one may have compiled kernels, on a machine that was busier
                    self._whole_s = min(self._whole_s, time.monotonic() - began)
                break
            starts += 1
            self.counts[kind] += 1
            self.counts["of resumed runs"] += starts > 1
        self.finish(folder)
        Disk(folder).fail(self._rng)
        if (found := self.finish(folder)) != self.expected:
            raise RuntimeError(f"after {starts} kills the result differs: {differences(found, self.expected)}")
        self.counts["finished runs"] += 1


def ended(code: int, folder: Path) -> None:
    """Raises RuntimeError unless a program has ended well."""
    if code:
        raise RuntimeError(f"exit code {code}: {folder.with_suffix('.log').read_text(errors='replace')[-2000:]}")


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
    if isinstance(found, list) and isinstance(expected, list):
        found, expected = [one for one in found if one not in expected], [one for one in expected if one not in found]
    return f"{str(found)[:200]} against {str(expected)[:200]}"


def judge(name: str, kinds: list[str], kills: int, seed: int, folder: Path) -> str:
    """Kills one program that many times in runs below `folder`; what was seen."""
    runs = Runs(PROGRAMS[name](folder), folder, random.Random(f"{seed} {name}"), kinds)
    while runs.kills < kills:
        runs.kill_until_done(folder / f"run_{runs.counts['finished runs']}", kills)
    return f"{name}: " + ", ".join(f"{count} {what}" for what, count in runs.counts.items()) + ", all equal"


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("python -m tests.kill", description=__doc__, formatter_class=form)
    parser.add_argument("--program", choices=sorted(PROGRAMS), action="append", help="one program; may be given again")
    parser.add_argument("--kills", type=int, default=50, help="of each program: %(default)s")
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=KINDS, help="of kills; both by default")
    parser.add_argument("--seed", type=int, default=0, help="of the times and operations: %(default)s")
    parser.add_argument("--planted", nargs="*", metavar="NAME", help="look for planted faults instead, all by default")
    given = parser.parse_args()
    if given.planted is not None:
        sys.exit(not find_all(Path(__file__).with_name("planted"), "tests.kill", given.planted))
    failed = False
    for name in given.program or PROGRAMS:
        with tempfile.TemporaryDirectory(prefix="kpopnet_kill_") as folder:
            try:
                print(judge(name, given.kind, given.kills, given.seed, Path(folder)), flush=True)
            except RuntimeError as error:
                failed = True
                print(f"{name}: {error}", file=sys.stderr)
    raise SystemExit(failed)


if __name__ == "__main__":
    main()
