"""The console script."""

import importlib
import os
import re
import shutil
import subprocess
import sys
import types
from functools import cache, partial

import pytest
from programs import ROOT, run_program

from kpopnet import cli
from kpopnet.cli import PROGRAMS

kpopnet = partial(run_program, "-m", ROOT, "kpopnet.cli")


@cache  # two tests look at it
def helped(*words: str) -> subprocess.CompletedProcess:
    return kpopnet(*words, "--help")


def test_help_names_every_program_and_the_version_is_the_packages():
    done = kpopnet("--help")
    assert done.returncode == 0 and all(f"kpopnet {name}" in done.stdout for name in PROGRAMS)
    assert kpopnet("--version").stdout.strip().count(".") == 2


SETTINGS = {"train": "training.lr ", "evaluate": "estimator.tracker.start "}
"""Settings that the help of a program must describe."""


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_program_answers_help_and_describes_its_settings(name):
    done = helped(name)
    assert done.returncode == 0 and len(done.stdout) > 300 and "Traceback" not in done.stderr, done.stderr
    assert SETTINGS.get(name, "") in done.stdout


HYDRA = ("generate", "train", "evaluate")
"""Programs whose settings are in files."""


@pytest.mark.parametrize("name", [*sorted(PROGRAMS.keys() - HYDRA), "teach add", "convert recordings"])
def test_every_option_is_on_a_page(name):
    told = "".join(page.read_text() for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")) if page.stem != "ledger")
    options = set(re.findall(r"(?<![\w-])--[a-z-]+", helped(*name.split()).stdout)) - {"--help"}
    assert [one for one in sorted(options) if not re.search(rf"{one}(?![\w-])", told)] == []


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["dance"], 2, "there is no program dance; there are generate, train"),
        (["generate", "splits.train=many"], 1, "splits.train"),
        (["evaluate", "estimator=[realtim]"], 1, "error: estimator=realtim: expected one of best, fitted_network, "),
    ],
)
def test_a_mistake_is_one_line(words, code, message):
    done = kpopnet(*words)
    assert done.returncode == code and message in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_a_library_that_a_slim_installation_lacks_is_named(monkeypatch, capsys):
    for name in ("begin_imports", "end_imports"):
        monkeypatch.setattr(cli, name, lambda: None)
    later = types.ModuleType("imports_it_later")
    later.main = lambda: importlib.import_module("no_such_library")
    monkeypatch.setitem(sys.modules, "imports_it_later", later)
    for module, kind in (
        ("no_such_library.part", SystemExit), ("imports_it_later", SystemExit), ("kpopnet.no_such_part", ModuleNotFoundError)
    ):  # fmt: skip
        monkeypatch.setattr(sys, "argv", ["kpopnet", "train"])
        monkeypatch.setitem(PROGRAMS, "train", (module, ""))
        with pytest.raises(kind):
            cli.main()
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert all(one.startswith("error: kpopnet train needs no_such_library, which is not installed") for one in told)


def test_the_programs_work_from_an_installed_package(tmp_path):
    """As a wheel lays it out: configurations inside the package, no checkout around it."""
    for package in ("kpopnet", "synth"):
        shutil.copytree(ROOT / package, tmp_path / "site" / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "configs", tmp_path / "site" / "kpopnet" / "configs")
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    command = [sys.executable, "-P", "-m", "kpopnet.cli", "generate", "benchmark=kpop_sim", "--cfg", "job"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and "dances: 100" in done.stdout, done.stderr
    assert "  seed: 2018  # another seed gives other dances, people and errors." in done.stdout  # of this benchmark, no other
