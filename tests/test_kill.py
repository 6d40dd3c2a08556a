"""One kill of some programs; `python -m tests.kill` does as many as wanted, and looks for planted faults first."""

import subprocess
import sys

import pytest
from programs import ROOT


@pytest.mark.parametrize(("program", "kind"), [("synth", "deaths"), ("teacher", "failures")])
def test_a_killed_program_gets_done_with_the_same_result_and_leaves_no_process(program, kind):
    command = [sys.executable, "-m", "tests.kill", "--program", program, "--kind", kind, "--kills", "1", "--seed", "7"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
