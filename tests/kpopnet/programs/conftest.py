"""The programs in this process."""

import importlib
import sys

import pytest


@pytest.fixture
def program(monkeypatch, capsys):
    """Runs a program of kpopnet and returns what it prints, or, if it is said to fail, its one line about a user's mistake.

    It reads strangers' files of joints in this process: `joint_files/test_reader.py` is about the other one.
    """
    monkeypatch.setattr("kpopnet.dance.joint_files.reader.read_in_child", lambda reader, *given: reader(*given))

    def run(name: str, *words: object, fails: bool = False) -> str:
        main = importlib.import_module(f"kpopnet.programs.{name}").main
        monkeypatch.setattr(sys, "argv", [f"kpopnet {name}", *map(str, words)])
        capsys.readouterr()
        if not fails:
            main()
            return capsys.readouterr().out
        with pytest.raises(SystemExit) as ended:
            main()
        mistakes = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
        assert ended.value.code == 1 and len(mistakes) == 1
        return mistakes[0]

    return run
