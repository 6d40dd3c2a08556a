"""The import rules: every layer imports only layers below it, and no imports go round in a circle (docs/architecture.md)."""

import ast
import importlib
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter

import pytest
from programs import ROOT

LAYERS = (
    ("kpopnet", *(f"kpopnet.{name}" for name in ("errors", "skeleton", "camera", "ridge", "estimator", "human", "rotations"))),
    ("kpopnet.runtime",),
    ("kpopnet.viz", "kpopnet.weights", "kpopnet.languages"),
    ("kpopnet.data",),
    ("kpopnet.geometry", "kpopnet.sources"),
    ("kpopnet.y_pose",),
    ("kpopnet.paper_extraction", "kpopnet.networks", "kpopnet.paper_tracker", "kpopnet.tracker"),
    ("kpopnet.finder", "kpopnet.dance"),
    ("kpopnet.training", "kpopnet.baselines", "kpopnet.pose"),
    ("kpopnet.datasets",),
    ("kpopnet.evaluation", "kpopnet.teacher"),
    ("kpopnet.live",),
    ("kpopnet.programs", "kpopnet.cli"),
)
"""From the lowest on. A package imports itself and the layers below, not its neighbours in its own layer; only the root's
nouns, which are modules, import each other."""

SYNTH_MAY_IMPORT = {*LAYERS[0], "kpopnet.runtime", "kpopnet.viz", "kpopnet.data", "kpopnet.datasets", "kpopnet.dance"}

WITHOUT_TORCH = (
    *("kpopnet.finder.finder", "kpopnet.paper_extraction", "kpopnet.dance.online", "kpopnet.tracker.estimator"),
    "kpopnet.tracker.refine",
    *("kpopnet.networks.estimator", "kpopnet.pose", "kpopnet.programs.predict", "kpopnet.programs.score", "synth.body.teacher"),
)


@cache
def modules() -> dict[str, set[str]]:
    """Every module of kpopnet and synth to the modules of both that it imports, inside functions too."""
    paths = {}
    for path in sorted(path for package in ("kpopnet", "synth") for path in (ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    found = {}
    for name, path in paths.items():
        imported = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{path}: relative imports hide which room they enter"
                imported |= {f"{node.module}.{alias.name}" for alias in node.names}
        known = {one if one in paths else one.rpartition(".")[0] for one in imported}
        found[name] = {one for one in known if one in paths} - {name}
    return found


def room(module: str) -> str:
    """The package below kpopnet, or the root module, that a module belongs to; "synth" for all of synth."""
    return "synth" if module.split(".", maxsplit=1)[0] == "synth" else ".".join(module.split(".")[:2])


def layer(name: str) -> int:
    return next(number for number, names in enumerate(LAYERS) if name in names)


def test_a_module_imports_only_its_own_package_and_the_layers_below() -> None:
    for module, here, imported in ((name, room(name), one) for name, found in modules().items() for one in found):
        there = room(imported)
        if here in (there, "synth") or layer(here) == layer("kpopnet.programs"):
            continue
        assert there != "synth", f"{module} imports {imported}: only programs know both kpopnet and synth"
        both_root = layer(here) == layer(there) == 0
        assert layer(there) < layer(here) or both_root, f"{module} imports {imported}, which does not lie below it"


def test_synth_imports_little_of_kpopnet() -> None:
    for module in (name for name in modules() if room(name) == "synth"):
        foreign = {one for one in modules()[module] if room(one) != "synth"} - {"kpopnet"}
        by_the_finder = module in ("synth.rooms.crops", "synth.rooms.masks")
        makes_what_the_finder_cuts_out = {"kpopnet.finder", "kpopnet.weights"} if by_the_finder else set()
        assert all(room(one) in SYNTH_MAY_IMPORT | makes_what_the_finder_cuts_out for one in foreign), (module, foreign)


def test_what_tools_and_examples_import_of_both_packages_exists() -> None:
    for path in (path for folder in ("tools", "examples") for path in (ROOT / folder).glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] in ("kpopnet", "synth"):
                for name in (alias.name for alias in node.names):
                    known = f"{node.module}.{name}" in modules() or hasattr(importlib.import_module(node.module), name)
                    assert known, f"{path.name} imports {name} of {node.module}"


def test_no_imports_go_round_in_a_circle() -> None:
    # A package's __init__ may gather names from its modules, which may import the package's other modules.
    graph = {name: {one for one in imported if not name.startswith(f"{one}.")} for name, imported in modules().items()}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"a circle: {' -> '.join(error.args[1])}")


def test_every_package_has_a_layer() -> None:
    assert {room(name) for name in modules()} - {"synth"} == {name for names in LAYERS for name in names}


def test_what_estimates_loads_neither_torch_nor_hydra() -> None:
    heavy = {"torch", "hydra", "omegaconf", "mujoco", "tensorboard", "onnx", "onnxruntime"}
    code = f"import sys, {', '.join(WITHOUT_TORCH)}; print(sorted({heavy} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
