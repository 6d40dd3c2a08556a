"""One kill of each program at a random time; `python -m tests.kill` does as many as wanted."""

import subprocess
import sys

import pytest
from programs import ROOT


@pytest.mark.parametrize("program", ["synth", "train", "evaluate"])
def test_a_killed_program_gets_done_with_the_same_result_and_leaves_no_process(program):
    command = [sys.executable, "-m", "tests.kill", "--program", program, "--kills", "1", "--seed", "7"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
