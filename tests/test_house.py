"""The house: small folders, short functions, files where the architecture says."""

import ast
from pathlib import Path

from programs import ROOT

MOST_FILES, MOST_LINES, MOST_ARGUMENTS = 12, 60, 8

ROOT_NOUNS = {"__init__", "errors", "skeleton", "camera", "ridge", "estimator", "human", "rotations", "cli"}

EXCEPTIONS = {
    "kpopnet/geometry/cones.py:cone_signed_distance": "numba kernel: a part's numbers as scalars, so that loops vectorise",
    "synth/scene/render.py:_triangle": "numba kernel: corners of a triangle as scalars, in registers",
}
"""Functions of more lines or arguments than the rule allows, and why."""


def sources() -> list[Path]:
    return sorted(path for package in ("kpopnet", "synth") for path in (ROOT / package).rglob("*.py"))


def test_the_root_of_kpopnet_holds_only_what_everything_shares() -> None:
    assert {path.stem for path in (ROOT / "kpopnet").glob("*.py")} == ROOT_NOUNS


def test_no_folder_is_crowded() -> None:
    crowded = [folder for folder in {path.parent for path in sources()} if len(list(folder.glob("*.py"))) - 1 > MOST_FILES]
    assert not crowded


def test_functions_are_short_and_take_few_arguments_or_are_listed_with_a_reason() -> None:
    found = set()
    for path in sources():
        name = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            arguments = [one for one in arguments if one.arg not in ("self", "cls")]
            if node.end_lineno - node.lineno + 1 > MOST_LINES or len(arguments) > MOST_ARGUMENTS:
                found.add(f"{name}:{node.name}")
    assert found == set(EXCEPTIONS)


def test_tests_mirror_the_rooms() -> None:
    for package in ("kpopnet", "synth"):
        for folder in (ROOT / "tests" / package).rglob("*"):
            if folder.is_dir() and folder.name != "__pycache__":
                assert (ROOT / folder.relative_to(ROOT / "tests")).is_dir(), folder
