"""Kills of programs; `python -m tests.kill` does as many as wanted, and looks for planted faults first."""

import subprocess
import sys
import time
from pathlib import Path

from programs import ROOT, ended, environment


def test_a_killed_program_gets_done_with_the_same_result_and_leaves_no_process():
    command = [sys.executable, "-m", "tests.kill", "--program", "teacher", "--kills", "2", "--seed", "7"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and "1 failures, 1 deaths" in done.stdout, done.stdout + done.stderr


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
