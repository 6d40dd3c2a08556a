"""Locks on output folders, between real processes."""

import contextlib
import subprocess
import sys

import pytest
from programs import ROOT

from kpopnet.errors import InputError
from kpopnet.runtime import folder_lock
from kpopnet.runtime.folder_lock import LOCK_FILE, alone, locked

HOLD = """
import sys, time
from kpopnet.runtime.folder_lock import EVERYTHING, locked
numbers = range(*map(int, sys.argv[2:])) if sys.argv[2:] else EVERYTHING
with locked(sys.argv[1], numbers):
    print("held", flush=True)
    sys.stdin.readline()
"""


@contextlib.contextmanager
def another_process_holds(folder, *numbers):
    command = [sys.executable, "-c", HOLD, str(folder), *map(str, numbers)]
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(folder_lock, "PATIENCE_S", 0.3)


def test_a_second_writer_is_refused_until_the_first_has_ended(tmp_path):
    with another_process_holds(tmp_path / "out") as process:
        refused = pytest.raises(InputError, match=r"out: another process writes there \(it holds \.lock\); wait")
        with refused, locked(tmp_path / "out"):
            pass
        process.communicate("\n", timeout=10)
        assert not list((tmp_path / "out").iterdir())  # who leaves last removes the file
        with locked(tmp_path / "out"):
            assert (tmp_path / "out" / LOCK_FILE).exists()
    assert not list((tmp_path / "out").iterdir())


def test_the_kernel_releases_the_lock_of_a_killed_process(tmp_path):
    with another_process_holds(tmp_path) as process:
        process.kill()
        process.wait()
        assert (tmp_path / LOCK_FILE).exists()
        with locked(tmp_path):
            pass


def test_ranges_that_do_not_overlap_are_written_at_the_same_time(tmp_path):
    with another_process_holds(tmp_path, 10, 20):
        for free in (range(10), range(20, 30)):
            with locked(tmp_path, free), alone(tmp_path) as is_alone:
                assert not is_alone
        for taken in (range(11), range(19, 25), range(12, 13), folder_lock.EVERYTHING):
            with pytest.raises(InputError, match="another process writes"), locked(tmp_path, taken):
                pass
    with locked(tmp_path, range(10)), alone(tmp_path) as is_alone:
        assert is_alone


def test_after_a_look_whether_it_is_alone_a_process_holds_its_own_range_only(tmp_path):
    with locked(tmp_path, range(5, 10)):
        with alone(tmp_path) as is_alone:
            assert is_alone
        with another_process_holds(tmp_path, 0, 5), another_process_holds(tmp_path, 10, 99):
            pass
        with pytest.raises(AssertionError), another_process_holds(tmp_path, 9, 12):
            pass


def test_a_process_may_lock_a_folder_twice(tmp_path):
    with locked(tmp_path):
        with locked(tmp_path, range(3)):
            pass
        with pytest.raises(AssertionError), another_process_holds(tmp_path):
            pass
    with another_process_holds(tmp_path):
        pass


def test_no_two_of_many_processes_hold_the_lock_at_once(tmp_path):
    code = (
        "import sys, time; from pathlib import Path; from kpopnet.runtime import folder_lock; folder_lock.PATIENCE_S = 60\n"
        "for _ in range(20):\n"
        "    with folder_lock.locked(sys.argv[1] + '/out'):\n"
        "        mark = Path(sys.argv[1]) / 'mark'; mark.open('x').close(); time.sleep(0.001); mark.unlink()\n"
    )
    processes = [subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], cwd=ROOT) for _ in range(4)]
    assert [process.wait(timeout=60) for process in processes] == [0] * 4


def test_a_file_system_without_locks_is_told_of(tmp_path, monkeypatch, capsys):
    def refuse(*_):
        raise OSError(folder_lock.errno.ENOLCK, "No locks available")

    monkeypatch.setattr(folder_lock.fcntl, "lockf", refuse)
    with locked(tmp_path):
        assert "no locks" in capsys.readouterr().err
