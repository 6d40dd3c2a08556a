"""Kills of programs; `python -m tests.kill` does as many as wanted, and looks for planted faults first."""

import random
import subprocess
import sys
import time
from pathlib import Path

from programs import ROOT, ended, environment

from tests.kill.__main__ import Runs
from tests.kill.programs import Program


def test_a_killed_program_gets_done_with_the_same_result_and_leaves_no_process():
    command = [sys.executable, "-m", "tests.kill", "--program", "teacher", "--kills", "2", "--seed", "7"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and "1 failures, 1 deaths" in done.stdout, done.stdout + done.stderr


SLOW_ONCE = """
import pathlib, sys, time
run = pathlib.Path(sys.argv[1])
run.mkdir(exist_ok=True)
compiled = run.with_name("compiled")
time.sleep(0.5 if compiled.exists() else 4)
compiled.touch()
"""


def test_kills_do_not_come_after_the_end_because_the_first_run_was_slow(tmp_path):
    program = Program(lambda run: [sys.executable, "-c", SLOW_ONCE, str(run)], lambda run: {})
    runs = Runs(program, tmp_path, random.Random(0), ["deaths"])
    for number in range(4):
        runs.kill_until_done(tmp_path / f"run_{number}", 3)
    assert runs.kills == 3


POOL = """
import time
from kpopnet.runtime.parallel import in_processes
if __name__ == "__main__":
    list(in_processes(time.sleep, [600, 600], 2))
"""


def test_the_processes_of_a_pool_end_with_a_program_that_is_killed(tmp_path):
    (tmp_path / "pool.py").write_text(POOL)
    program = subprocess.Popen([sys.executable, tmp_path / "pool.py"], env=environment())
    children, until = [], time.monotonic() + 120
    while len(children) < 3 and time.monotonic() < until:  # two workers, and what looks after their semaphores
        time.sleep(0.05)
        children = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
    program.kill()
    program.wait()
    assert len(children) == 3 and all(ended(int(child)) for child in children)
