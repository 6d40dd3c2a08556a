"""The notice that numba compiles."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from programs import ROOT

PROGRAM = """
import subprocess
import tempfile
from numba import njit
from kpopnet.runtime import compilation
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
compilation.available_cores = lambda: CORES
print(kernel(1), kernel(2), kernel(1.5))
for words, process in started:
    print(words, process.wait())
"""


@pytest.mark.parametrize("cores", [1, 2])
def test_the_first_use_of_a_kernel_is_announced_once_and_another_core_compiles_beside(cores, tmp_path):
    (tmp_path / "tempfile.py").write_text("raise SystemExit('a file of the user is no module of ours')")
    program = PROGRAM.replace("CORES", str(cores))
    words = [sys.executable, "-P", "-c", program]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    kernels, *beside = done.stdout.splitlines()
    assert kernels == "4 6 5.0"
    assert beside == ["['-P', '-c', 'from tempfile import gettempdir; gettempdir()'] 0"][: cores - 1]
    notice, first, *rest = done.stderr.splitlines()
    assert notice.startswith("compiling kernels for this machine") and first.endswith("kernel 1: kernel")
    assert len(rest) <= 1  # a line a second at most, and none for what a kernel calls


READ_ONLY = """
import errno
import os
import tempfile
made = tempfile.TemporaryFile
def refusing(*given, **named):
    if str(named.get("dir")).startswith(tempfile.gettempdir()):
        return made(*given, **named)
    raise OSError(errno.EROFS, "read-only")
tempfile.TemporaryFile = refusing
import kpopnet
import kpopnet.data.cube
print(os.environ["NUMBA_CACHE_DIR"], os.path.isdir(os.environ["NUMBA_CACHE_DIR"]))
"""


def test_where_nothing_can_be_written_kernels_are_kept_as_long_as_the_process(tmp_path):
    """As in a container without a home whose image is read-only."""
    environment = os.environ | {"XDG_CACHE_HOME": "/dev/null/nowhere", "TMPDIR": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)
    told = subprocess.check_output([sys.executable, "-c", READ_ONLY], cwd=ROOT, env=environment, text=True)
    folder, was_there = told.split()
    assert was_there == "True" and Path(folder).parent == tmp_path and not Path(folder).exists()


NOWHERE = """
import os, sys, tempfile
def refuse(*given, **named):
    raise FileNotFoundError(2, "No usable temporary directory found")
tempfile.TemporaryFile = tempfile.mkdtemp = refuse
os.access = lambda *given: False
from numba.core.caching import _CacheLocator
_CacheLocator.ensure_cache_path = refuse
from kpopnet.cli import main
main()
"""


@pytest.mark.parametrize(
    ("program", "code", "told"), [("--version", 0, ""), ("score", 1, "error: compiled kernels .* set NUMBA_CACHE_DIR to .*\n")]
)
def test_where_no_folder_at_all_can_be_written_it_says_what_to_set(program, code, told):
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    words = [sys.executable, "-c", NOWHERE, program]
    done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == code and re.fullmatch(told, done.stderr)
