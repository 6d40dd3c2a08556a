"""The README is code: its commands compose, its programs run, and what its map names exists."""

import importlib
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def fenced(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def commands() -> list[list[str]]:
    """Every command line of the README, without its comment."""
    lines = [line for block in fenced("sh") for line in block.splitlines() if line.strip()]
    lines += re.findall(r"`(python [^`]+)`", README)
    return [words for line in lines if (words := shlex.split(line.replace("...", ""), comments=True))]


PROGRAMS = {  # the words that start a program, its module and its configuration
    ("python", "-m", "synth"): ("synth.__main__", "generate"),
    ("python", "train.py"): ("train", "train"),
    ("python", "train_tree_walk.py"): ("train_tree_walk", "train_tree_walk"),
    ("python", "evaluate.py"): ("evaluate", "evaluate"),
}


def settings_of_commands() -> list[tuple[str, str, list[str]]]:
    found = []
    for words in commands():
        for start, (module, config) in PROGRAMS.items():
            if tuple(words[: len(start)]) == start:
                settings = [word for word in words[len(start) :] if "=" in word]
                if config == "generate" and any(word.startswith("benchmark=") for word in settings):
                    config = "stand_in"
                found.append((module, config, settings))
    known = {"generate", "stand_in", "train", "train_tree_walk", "evaluate"}
    assert {config for _, config, _ in found} == known and len(found) > 15
    return found


@pytest.mark.parametrize(("module", "config", "settings"), settings_of_commands(), ids=str)
def test_the_settings_in_every_command_compose(module: str, config: str, settings: list[str], monkeypatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    program = importlib.import_module(module)  # which makes its schemas known
    if module != "train":
        # synth and evaluate.py each know benchmark=eval_sim by a schema of that name: the one to be tested must come last.
        importlib.reload(program)
    # A launcher and lists of values belong to a multirun; what each of its runs gets must compose.
    settings = [word if "[" in word else word.split(",")[0] for word in settings if not word.startswith("hydra/launcher")]
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        OmegaConf.to_object(compose(config, [word for word in settings if not word.startswith("hydra.")]))


def test_make_knows_the_targets_that_are_named() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = {words[1] for words in commands() if words[0] == "make"} | set(re.findall(r"`make (\w+)`", README))
    assert {"demo", "test", "speed", "lint"} <= targets
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
    described = re.findall(r"^# make (\w+)", makefile, re.MULTILINE)
    assert [".PHONY:", *described] == re.search(r"^\.PHONY.*", makefile, re.MULTILINE)[0].split()


def test_make_clean_leaves_what_was_generated_and_trained(tmp_path) -> None:
    kept = [tmp_path / "data" / "small" / "shard.h5", tmp_path / "outputs" / "train" / "best", tmp_path / "code.py"]
    removed = [tmp_path / ".venv" / "installed", tmp_path / ".pytest_cache" / "a", tmp_path / "code" / "__pycache__" / "a.pyc"]
    for path in (*kept, *removed):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    subprocess.run(["make", "-f", str(ROOT / "Makefile"), "clean"], cwd=tmp_path, check=True, capture_output=True)
    assert all(path.exists() for path in kept) and not any(path.parent.exists() for path in removed)


def test_the_programs_in_the_readme_name_what_exists() -> None:
    poses, score = fenced("python")
    for program, expected in (
        (poses, {"NetworkEstimator", "FittedEstimator", "TrackerEstimator", "extract_person", "CAMERAS"}),
        (score, {"OnlineScorer", "SCORERS", "Performance", "score_dance"}),
    ):
        names: dict = {}
        exec("\n".join(line for line in program.splitlines() if line.startswith(("from ", "import "))), names)
        assert expected <= names.keys() and all(len(re.findall(rf"\b{name}\b", program)) > 1 for name in expected)


def test_a_dance_is_scored_as_the_readme_says() -> None:
    _, score = fenced("python")
    joints_m, times_s = np.random.default_rng(0).normal(size=(15, 3)) + np.zeros((120, 1, 1)), np.arange(120) / 30
    told = {"teacher_joints_m": joints_m, "teacher_times_s": times_s, "joints_m": joints_m, "times_s": times_s}
    confidence = np.ones((120, 15))
    told |= {"confidence": confidence, "frame_joints_m": joints_m[0], "frame_confidence": confidence[0], "time_s": 0.0}
    exec(score, told)


def test_the_map_from_the_paper_leads_somewhere() -> None:
    table = README[README.index("| paper | here |") :].split("\n\n")[0]
    places = re.findall(r"`([^`]+)`", table)
    assert len(places) > 8
    for place in places:
        if "/" in place:
            assert (ROOT / place).exists(), place
            continue
        module, _, name = place.rpartition(".")
        assert hasattr(importlib.import_module(module), name), place


def test_no_figure_is_left_out() -> None:
    assert not re.search(r"@[A-Z_]+@", README)


def test_links_and_pictures_are_there() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).exists(), target


@pytest.mark.parametrize("path", ["LICENSE", "NOTICE", "constraints.txt", "synth/assets/README.md", ".ci/run"])
def test_what_a_user_must_find_is_there(path: str) -> None:
    assert (ROOT / path).stat().st_size > 100
