"""How a program ends whose output is not read to its end."""

import subprocess
import sys

import pytest
from programs import ROOT

PROGRAM = """
import os
import sys
from kpopnet.runtime.endings import user_errors
@user_errors
def main():
    sys.stdin.read()
    {what}
main()
"""


@pytest.mark.parametrize("what", ["print('a line')", "for _ in range(10000): print('a line')"])
def test_output_that_no_program_reads_ends_a_program_without_words(what):
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(what=what)], cwd=ROOT,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as program:  # fmt: skip
        program.stdout.close()
        program.stdin.close()
        assert (program.stderr.read(), program.wait()) == (b"", 141)


def test_another_pipe_that_is_broken_is_told():
    what = "raise BrokenPipeError('a child ended')"
    done = subprocess.run([sys.executable, "-c", PROGRAM.format(what=what)], cwd=ROOT, input=b"", capture_output=True)
    assert done.returncode == 1 and b"BrokenPipeError: a child ended" in done.stderr
