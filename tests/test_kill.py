"""Two kills of a program; `python -m tests.kill` does as many as wanted, and looks for planted faults first."""

import subprocess
import sys

from programs import ROOT


def test_a_killed_program_gets_done_with_the_same_result_and_leaves_no_process():
    command = [sys.executable, "-m", "tests.kill", "--program", "teacher", "--kills", "2", "--seed", "7"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and "1 failures, 1 deaths" in done.stdout, done.stdout + done.stderr
