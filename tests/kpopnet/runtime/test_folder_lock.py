"""Locks on output folders, between real processes."""

import contextlib
import subprocess
import sys
from pathlib import Path

import pytest
from programs import ROOT

from kpopnet.errors import InputError
from kpopnet.runtime import folder_lock
from kpopnet.runtime.folder_lock import locked

HOLD = """
import sys
from kpopnet.runtime.folder_lock import locked
with locked(*sys.argv[1:]):
    print("held", flush=True)
    sys.stdin.readline()
"""


@contextlib.contextmanager
def another_process_holds(folder, *name):
    command = [sys.executable, "-c", HOLD, str(folder), *name]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(folder_lock, "PATIENCE_S", 0.3)


def test_a_second_writer_is_refused_until_the_first_has_ended_or_was_killed(tmp_path):
    with another_process_holds(tmp_path / "out") as process:
        refused = pytest.raises(InputError, match=r"out: another process writes there \(it holds \.lock\); wait")
        with refused, locked(tmp_path / "out"):
            pass
        with locked(tmp_path / "out", ".lock_3-5"):  # other files of the folder
            pass
        process.communicate("\n", timeout=10)
    with locked(tmp_path / "out"):
        with locked(tmp_path / "out"):
            pass
        with pytest.raises(AssertionError), another_process_holds(tmp_path / "out"):  # the first lock is still held
            pass
    assert not list((tmp_path / "out").iterdir())
    with another_process_holds(tmp_path / "out") as process:
        process.kill()
        process.wait()
        with locked(tmp_path / "out"):
            pass


def test_no_two_of_many_processes_hold_the_lock_at_once(tmp_path):
    code = (
        "import sys; from pathlib import Path; from kpopnet.runtime import folder_lock; folder_lock.PATIENCE_S = 60\n"
        "for _ in range(10):\n"
        "    with folder_lock.locked(sys.argv[1] + '/out'):\n"
        "        mark = Path(sys.argv[1]) / 'mark'; mark.open('x').close(); mark.unlink()\n"
    )
    processes = [subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], cwd=ROOT) for _ in range(3)]
    assert [process.wait(timeout=60) for process in processes] == [0] * 3


def test_a_lock_ends_where_an_open_file_cannot_be_removed(tmp_path, monkeypatch):
    def refuse(path, missing_ok=False):  # as Windows does
        raise PermissionError(13, "The process cannot access the file because it is being used by another process", str(path))

    monkeypatch.setattr(Path, "unlink", refuse)
    with locked(tmp_path / "out"):
        pass
    with another_process_holds(tmp_path / "out"):  # nothing holds it any more
        pass
