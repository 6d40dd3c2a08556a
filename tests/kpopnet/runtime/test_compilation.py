"""The notice that numba compiles."""

import subprocess
import sys

from programs import ROOT

PROGRAM = """
import subprocess
import tempfile
from numba import njit
from kpopnet.runtime.compilation import announce_compilation
announce_compilation(tempfile.gettempdir)
announce_compilation()
@njit
def inner(x):
    return x + 1
@njit
def kernel(x):
    return inner(x) * 2
Popen, started = subprocess.Popen, []
subprocess.Popen = lambda words, **given: started.append((words[1:], process := Popen(words, **given))) or process
print(kernel(1), kernel(2), kernel(1.5))
[(words, process)] = started
print(words, process.wait())
"""


def test_the_first_use_of_a_kernel_is_announced_once_with_its_name():
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, check=True)
    kernels, beside = done.stdout.splitlines()
    assert kernels == "4 6 5.0"
    assert beside == "['-c', 'from tempfile import gettempdir; gettempdir()'] 0"
    notice, first, *rest = done.stderr.splitlines()
    assert notice.startswith("compiling kernels for this machine") and first.endswith("kernel 1: kernel")
    assert len(rest) <= 1  # a line a second at most, and none for what a kernel calls
