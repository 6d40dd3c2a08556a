"""How a program ends whose output is not read to its end."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from programs import ROOT

from kpopnet.runtime import endings

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


def unread(program, *words):
    """Errors and exit code of a program that begins to print when no program reads it any more."""
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(
        [sys.executable, "-c", program, *words], cwd=ROOT, env=buffered,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as started:  # fmt: skip
        started.stdout.close()
        started.stdin.close()
        return started.stderr.read(), started.wait()


@pytest.mark.parametrize("what", ["print('a line')", "for _ in range(10000): print('a line')"])
def test_output_that_no_program_reads_ends_a_program_without_words(what):
    assert unread(PROGRAM.format(what=what)) == (b"", 141)


@pytest.mark.parametrize(
    ("windows", "told", "code"), [(True, rb"", 141), (False, rb"Traceback (?s:.*)OSError: .* Invalid argument\n", 1)]
)
def test_output_that_no_program_reads_ends_a_program_on_windows_too(windows, told, code):
    """There Python makes an EINVAL of it, as subprocess's own comments say."""
    what = f"from kpopnet.runtime import endings; endings.ON_WINDOWS = {windows}; raise OSError(22, 'Invalid argument')"
    errors, ended_with = ended(what)
    assert ended_with == code and re.fullmatch(told, errors)


def test_a_name_that_a_disk_does_not_take_is_told():
    """As of Windows' disks, and USB sticks everywhere."""
    told, code = ended("raise OSError(22, 'Invalid argument', 'a:b?')")
    assert code == 1 and told.startswith(b"error: a:b?: this disk takes no such name") and told.count(b"\n") == 1


def test_a_file_that_another_program_has_open_is_told(monkeypatch):
    """A table in Excel, a film in a player: Windows replaces none."""
    monkeypatch.setattr(endings, "ON_WINDOWS", True)
    told = endings.of_the_disk(PermissionError(13, "The process cannot access the file", "joints.csv"))
    assert told.startswith("joints.csv: permission denied; ") and told.endswith(", or close the program that has it open")


def ended(what, output=subprocess.PIPE):
    """Errors and exit code of a program."""
    program = [sys.executable, "-c", PROGRAM.format(what=what)]
    done = subprocess.run(program, cwd=ROOT, input=b"", stdout=output, stderr=subprocess.PIPE)
    return done.stderr, done.returncode


def test_another_pipe_that_is_broken_is_told():
    told, code = ended("raise BrokenPipeError('a child ended')")
    assert code == 1 and b"BrokenPipeError: a child ended" in told


def test_an_interrupt_of_compiled_code_stops_a_program_and_another_system_error_is_told():
    assert ended("raise SystemError('a result with an exception set') from KeyboardInterrupt()") == (b"stopped\n", 130)
    told, code = ended("raise SystemError('bad argument')")
    assert code == 1 and b"SystemError: bad argument" in told


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["score", "--help"]])
def test_help_that_no_program_reads_ends_quietly_too(words):
    program = "import sys; sys.stdin.read(); from kpopnet.cli import main; main()"
    assert unread(program, *words) == (b"", 141)


@pytest.mark.parametrize("closed", ["1>&-", "2>&-", "1>&- 2>&-"])
def test_a_program_without_a_console_gets_done(tmp_path, closed):
    what = f"print('nowhere'); print('\\ub2e4\\uc2dc', file=sys.stderr); open({str(tmp_path / 'done')!r}, 'x').close()"
    shell = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-c", PROGRAM.format(what=what)]
    ascii_alone = os.environ | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    ended = subprocess.run(shell, cwd=ROOT, env=ascii_alone, input=b"", check=False)
    assert ended.returncode == 0 and (tmp_path / "done").exists()


def test_what_a_terminal_cannot_show_is_printed_as_escapes(monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    told, code = ended("print('\u00e9\uc548', file=sys.stderr); print('\ucda4')")
    assert (told, code) == (b"\\xe9\\uc548\n", 0)


def test_a_folder_where_a_file_should_be_is_named_by_its_own_name(tmp_path):
    writing = f"from pathlib import Path; import kpopnet.runtime.atomic_write as a; a.write_json(Path({str(tmp_path)!r}), 1)"
    assert ended(writing)[0] == f"error: {tmp_path}: is a directory\n".encode()
    missing = tmp_path / "missing" / "a.npz"
    writing = f"from pathlib import Path; import kpopnet.runtime.atomic_write as a; a.write_npz(Path({str(missing)!r}))"
    assert ended(writing)[0] == f"error: {missing}: no such file or directory\n".encode()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_below_the_output_is_told_once():
    with Path("/dev/full").open("wb") as full:
        told, code = ended("print('a line')", full)
    assert code == 1 and told.startswith(b"error: ") and told.count(b"\n") == 1 and b"the disk is full" in told
