"""README.md and docs/ are code: their commands compose, their programs run, and what they name exists."""

import ast
import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from programs import ROOT
from two_people_files import two_people_mm

from kpopnet import cli
from kpopnet.camera import CAMERAS
from kpopnet.dance import diagnosis
from kpopnet.dance.joint_files.reader import SUFFIXES as JOINT_SUFFIXES
from kpopnet.dance.performance import MAX_DURATION_S
from kpopnet.dance.scoring import SCORERS
from kpopnet.dance.words import moments
from kpopnet.datasets import check_script
from kpopnet.datasets.dances import dance_set
from kpopnet.evaluation.acceptance import sheet, watched
from kpopnet.evaluation.report import as_markdown
from kpopnet.live import streams
from kpopnet.pose.estimator import MAX_PEOPLE
from kpopnet.programs import check, live, teach
from kpopnet.runtime.input_files import BUDGET_VARIABLE, DEFAULT_BUDGET_GB
from kpopnet.sources import arrays, opening, stream
from kpopnet.teacher import adding, film, hosting, library, pages, posing, server
from kpopnet.viz import overlay, view_page

PAGES = {
    path.name: path.read_text()
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")))
}
LEDGER = "ledger.md"
"""Holds what was true when it was written: commands of its day need not compose today."""


def fenced(language: str) -> list[tuple[str, str]]:
    """(page, text) of every fenced block of a language."""
    found = [
        (page, block) for page, text in PAGES.items() for block in re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    ]
    return [(page, block) for page, block in found if page != LEDGER]


def commands() -> list[list[str]]:
    """Every command line of the pages, without its comment, and of the help of three programs."""
    lines = [line for _, block in fenced("sh") for line in block.splitlines() if line.strip()]
    lines += [
        line for page, text in PAGES.items() if page != LEDGER for line in re.findall(r"`((?:python|kpopnet) [^`]+)`", text)
    ]
    for path in ("kpopnet/programs/evaluate.py", "kpopnet/programs/train.py", "synth/__main__.py"):
        text = re.sub(r"\\\n\s*", "", ast.get_docstring(ast.parse((ROOT / path).read_text()), clean=False))
        lines += [re.split(r" {3,}|  #", line.strip())[0] for line in text.splitlines() if line.startswith("    python")]
    return [words for line in lines if (words := shlex.split(line.replace("...", ""), comments=True))]


PROGRAMS = {  # the words that start a program, its module, its configuration and the folder of that
    ("python", "-m", "synth"): ("synth.__main__", "generate", "configs/synth"),
    ("kpopnet", "generate"): ("synth.__main__", "generate", "configs/synth"),
    ("python", "train.py"): ("kpopnet.programs.train", "train", "configs"),
    ("kpopnet", "train"): ("kpopnet.programs.train", "train", "configs"),
    ("python", "evaluate.py"): ("kpopnet.programs.evaluate", "evaluate", "configs"),
    ("kpopnet", "evaluate"): ("kpopnet.programs.evaluate", "evaluate", "configs"),
}


def settings_of_commands() -> list[tuple[str, str, str, list[str]]]:
    found = []
    for words in commands():
        for start, (module, config, folder) in PROGRAMS.items():
            if tuple(words[: len(start)]) == start:
                rest = words[len(start) :]
                settings = [word for word in rest if "=" in word and not word.endswith("=NAME")]
                if config == "generate" and any(word.startswith("benchmark=") for word in settings):
                    config = "simulated_set"
                if "--config-name" in rest:
                    config = rest[rest.index("--config-name") + 1]
                found.append((module, config, folder, settings))
    known = {"generate", "simulated_set", "train", "tree_walk", "finder", "evaluate"}
    assert {config for _, config, _, _ in found} == known and len(found) > 25
    return [one for number, one in enumerate(found) if one not in found[:number]]


@pytest.mark.parametrize(("module", "config", "folder", "settings"), settings_of_commands(), ids=str)
def test_the_settings_in_every_command_compose(module: str, config: str, folder: str, settings: list[str]) -> None:
    importlib.import_module(module)  # which registers its schemas
    # A launcher and lists of values belong to a multirun; what each of its runs gets must compose.
    settings = [word if "[" in word else word.split(",")[0] for word in settings if not word.startswith("hydra/launcher")]
    with initialize_config_dir(str(ROOT / folder), version_base="1.3"):
        OmegaConf.to_object(compose(config, [word for word in settings if not word.startswith("hydra.")]))


def test_make_knows_the_targets_that_are_named() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = {words[1] for words in commands() if words[0] == "make"}
    targets |= {target for text in PAGES.values() for target in re.findall(r"`make (\w+)`", text)}
    assert {"demo", "test", "speed", "lint"} <= targets
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
    described = re.findall(r"^# make (\w+)", makefile, re.MULTILINE)
    assert [".PHONY:", *described] == re.search(r"^\.PHONY.*", makefile, re.MULTILINE)[0].split()


def test_make_clean_leaves_what_was_generated_and_trained(tmp_path: Path) -> None:
    kept = [tmp_path / "data" / "small" / "shard.h5", tmp_path / "outputs" / "train" / "best", tmp_path / "code.py"]
    removed = [tmp_path / ".venv" / "installed", tmp_path / ".pytest_cache" / "a", tmp_path / "code" / "__pycache__" / "a.pyc"]
    for path in (*kept, *removed):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    subprocess.run(["make", "-f", str(ROOT / "Makefile"), "clean"], cwd=tmp_path, check=True, capture_output=True)
    assert all(path.exists() for path in kept) and not any(path.parent.exists() for path in removed)


@pytest.mark.parametrize(("page", "program"), fenced("python"), ids=lambda one: one.splitlines()[0][:40])
def test_the_programs_of_the_pages_import_what_exists_and_use_it(page: str, program: str) -> None:
    names: dict = {}
    imports = [line for line in program.splitlines() if line.startswith(("from ", "import "))]
    exec("\n".join(imports), names)
    for name in names.keys() - {"__builtins__"}:
        assert len(re.findall(rf"\b{name}\b", program)) > 1, f"{page}: {name} is imported and not used"


def test_a_dance_is_scored_as_the_page_says() -> None:
    score = "\n".join(program for page, program in fenced("python") if page == "dance_scoring.md")
    joints_m, times_s = np.random.default_rng(0).normal(size=(15, 3)) + np.zeros((120, 1, 1)), np.arange(120) / 30
    confidence = np.ones((120, 15))
    given = {
        "teacher_joints_m": joints_m, "teacher_times_s": times_s, "joints_m": joints_m, "times_s": times_s,
        "confidence": confidence, "frame_joints_m": joints_m[0], "frame_confidence": confidence[0], "time_s": 0.0,
    }  # fmt: skip
    exec(score, given)
    assert given["score"].similarity > 0


def test_people_are_tracked_as_the_page_says(capsys) -> None:
    program = next(program for page, program in fenced("python") if page == "trackers.md")
    exec(program, {"depth": two_people_mm(frames=3)})
    assert sorted(capsys.readouterr().out.splitlines()) == ["0 (3, 15, 3)", "1 (3, 15, 3)"]


def test_the_map_from_the_paper_leads_somewhere() -> None:
    page = PAGES["paper.md"]
    table = page[page.index("| paper | here |") :].split("\n\n")[0]
    places = re.findall(r"`([^`]+)`", table)
    assert len(places) > 25
    for place in places:
        if "/" in place:
            assert (ROOT / place).exists(), place
            continue
        module, _, name = place.rpartition(".")
        if importlib.util.find_spec(module) is None or not hasattr(importlib.import_module(module), name):
            assert importlib.util.find_spec(place), place


def test_every_file_that_a_page_names_exists() -> None:
    for page, text in PAGES.items():
        if page == LEDGER:
            continue
        for place in re.findall(r"`((?:kpopnet|synth|configs|tests|tools|examples|docs)/[\w./-]+)`", text):
            assert (ROOT / place).exists(), f"{page}: {place}"


def test_links_and_figures_are_there() -> None:
    for page, text in PAGES.items():
        folder = ROOT if (ROOT / page).exists() else ROOT / "docs"
        for target in re.findall(r"\]\(([^)#]+)\)", text):
            if "://" not in target:
                assert (folder / target).exists(), f"{page}: {target}"


def test_the_worked_changes_apply_to_this_tree_touch_few_files_and_pass_their_tests(tmp_path: Path) -> None:
    changes = [change for page, change in fenced("diff") if page == "CONTRIBUTING.md"]
    assert len(changes) == 4
    for folder in ("configs", "kpopnet", "synth", "tests"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for change in changes:
        assert 1 <= len(re.findall(r"^\+\+\+ ", change, re.MULTILINE)) <= 3
        done = subprocess.run(["git", "apply"], cwd=tmp_path, input=change, text=True, capture_output=True)
        assert done.returncode == 0, done.stderr
    tests = re.findall(r"^\+\+\+ b/(tests/.*)", "\n".join(changes), re.MULTILINE)
    assert len(tests) == 3
    run = [sys.executable, "-m", "pytest", "-n0", "-q", "-p", "no:cacheprovider", *tests]
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "PYTEST_ADDOPTS": ""}
    done = subprocess.run(run, cwd=tmp_path, env=environment, text=True, capture_output=True)
    assert done.returncode == 0, done.stdout


def test_the_readme_and_the_architecture_are_short() -> None:
    assert len(PAGES["README.md"].splitlines()) <= 100
    assert len(PAGES["architecture.md"].split()) <= 900


def test_what_a_user_must_find_is_there() -> None:
    for path in ("LICENSE", "NOTICE", "CITATION.cff", "CHANGELOG.md", "constraints.txt", "synth/assets/README.md", ".ci/run"):
        assert (ROOT / path).stat().st_size > 100


def test_every_program_is_named_on_the_first_page() -> None:
    assert [name for name in cli.PROGRAMS if not re.search(rf"\bkpopnet {name}\b", PAGES["README.md"])] == []


def test_what_the_pages_say_of_a_format_names_all_that_is_read() -> None:
    for suffix in (*opening.READERS, *opening.WITH_NAMES, *CAMERAS):
        assert f"`{suffix}`" in PAGES["predicting.md"], suffix
    for suffix in JOINT_SUFFIXES:
        assert f"`{suffix}`" in PAGES["joint_files.md"], suffix
    for key in (*dance_set.SCHEMA.attributes, *dance_set.SCHEMA.arrays):
        assert f"| `{key}` |" in PAGES["kpop_format.md"], key
    for field in fields(dance_set.Manifest):
        assert re.search(rf'[`"]{field.name}"?[`:]', PAGES["kpop_format.md"]) or field.name == "origin", field.name


def of_module(name: str, constant: str) -> str:
    """The value of a constant in a module of the teacher's page, as it is written."""
    return re.search(rf"\b{constant} = (\[.*?\]|[\d.]+)", (ROOT / "kpopnet/teacher/page" / name).read_text())[1]


def told_limits() -> list[tuple[str, str]]:
    """(page, words) with the numbers of the code."""
    late_s, bounds = diagnosis.SURE_DELAY_S, f"{adding.MIN_S:g} s to {posing.MAX_S / 60:g} minutes"
    return [
        ("teaching.md", f"A dance lasts {bounds}"),
        ("teaching.md", f"a group, up to {library.MOST_DANCERS},"),
        ("teaching.md", f"`--people N`, up to {MAX_PEOPLE};"),
        ("teaching.md", f"Up to {hosting.MOST_CONNECTIONS} connections and {pages.MOST_PAGES} windows"),
        ("teaching.md", f"Uploads are at most {server.MAX_UPLOAD_BYTES / 1e6:g} MB"),
        ("teaching.md", f"Films last at most {film.MOST_S / 60:g} minutes"),
        ("teaching.md", f"127.0.0.1:{teach.PORT}/"),
        ("teaching.md", f"cut the recording, of at most {int(of_module('record.js', 'LONGEST_S')) // 60} minutes"),
        ("teaching.md", f"Stars stand for the score so far ({of_module('verdicts.js', 'STARS_FROM')[1:-1]})"),
        ("teaching.md", f"a streak counts moves of {of_module('verdicts.js', 'STREAK_FROM')} and more"),
        ("teaching.md", f"Hold the cursor on a field for {int(of_module('pointing.js', 'HOLD_MS')) / 1000:g} s"),
        ("teaching.md", f"{of_module('practice.js', 'GOAL')} unless chosen), slower again when"),
        ("teaching.md", f"it misses it by more than {of_module('practice.js', 'FAR')}."),
        ("teaching.md", f"(of {of_module('practice.js', 'LEAST_S')} s at least"),
        ("live.md", f"127.0.0.1:{live.PORT}/"),
        ("live.md", f"up to {MAX_PEOPLE} or `--people`"),
        ("live.md", f"less than {arrays.LEAST_FREE_BYTES / 1e6:g} MB are free"),
        ("live.md", f"UDP to port {streams.PORTS['osc']} "),
        ("live.md", f"UDP to port {streams.PORTS['vmc']} "),
        ("live.md", f"away for {streams.FORGOTTEN_S:g} s"),
        ("predicting.md", f"at most {stream.LINE_BYTES:,} bytes"),
        ("predicting.md", f"at most {overlay.MOST_GIF_FRAMES} images"),
        ("predicting.md", f"depth of at most {view_page.MOST_CLOUDS} images"),
        ("datasets.md", f"lasts at most {MAX_DURATION_S:,.0f} s"),
        ("kpop_format.md", f"take {DEFAULT_BUDGET_GB:g} GB of memory (`{BUDGET_VARIABLE}`)"),
        ("dance_scoring.md", f"less than {moments.MIN_POINTS:g} points of a phrase of {moments.PHRASE_S:g} s"),
        ("dance_scoring.md", f"{moments.MIN_ERROR_DEG:g} degrees or {moments.MIN_DELAY_S:g} s is not mentioned"),
        ("joint_files.md", f"gains {diagnosis.MIN_GAIN:g} points or more and reaches {diagnosis.MIN_CORRECTED:g}."),
        ("joint_files.md", f"gains {diagnosis.SURE_GAIN:g} points or more"),
        ("joint_files.md", f"off by {late_s:g} s or more (up to {diagnosis.SEARCH_S:g} s"),
        *(
            ("learning_the_score.md", f"| `{name}` | {one.alpha:g} | {one.beta:g} | {one.tau:g} |")
            for name, one in SCORERS.items()
        ),
        ("check.md", f"at least {watched.IN_VIEW_M2:g} m2 of surface that is {100 * watched.NEARER_M:g} cm or more"),
        ("check.md", f"empty with less than {watched.EMPTY_M2:g} m2"),
    ]


@pytest.mark.parametrize(("page", "words"), told_limits())
def test_limits_on_the_pages_are_those_of_the_code(page: str, words: str) -> None:
    assert words in " ".join(PAGES[page].split())


def test_the_page_of_the_acceptance_sheet_has_its_lines_gates_and_script() -> None:
    unknown = {"a camera": dict.fromkeys(line.key for line in sheet.LINES)}
    made = [row.split("|")[1:4] for row in as_markdown(["sheet", sheet.table(unknown)]).splitlines() if row.startswith("| ")]
    told = [row.split("|")[1:4] for row in PAGES["check.md"].splitlines() if row.startswith("| ")]
    assert len(made) == len(sheet.LINES) + 2 and all(row in told for row in made)
    starts = [step.start_s for step in check_script.SCRIPT] + [check_script.END_S]
    for text in (PAGES["check.md"], check.__doc__):
        script = re.search(r"The script[,:].*?60 s end", text, re.DOTALL)[0]
        assert [float(one) for one in re.findall(r"(\d+) s ", script)] == starts
