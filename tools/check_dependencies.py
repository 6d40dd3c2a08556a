"""Runs a fast part of the tests with the lowest and with the newest allowed version of each dependency.

    python tools/check_dependencies.py lowest newest      # environments in outputs/dependencies/, which are made each time

The lower bounds are those of pyproject.toml; what only these need follows. Exit code 1 if an installation or a test fails.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLACE = ROOT / "outputs" / "dependencies"
EXTRAS = ("app", "video", "ros", "record3d", "c3d", "export", "oak")
TEST_TOOLS = ("pytest", "hypothesis")
TESTS = (
    "tests/kpopnet/test_camera.py", "tests/kpopnet/test_errors.py", "tests/kpopnet/test_ridge.py", "tests/kpopnet/runtime",
    "tests/kpopnet/data", "tests/kpopnet/dance/joint_files", "tests/kpopnet/sources", "tests/kpopnet/networks",
    "tests/kpopnet/finder", "tests/kpopnet/teacher/test_rating.py", "tests/synth/scene",
)  # fmt: skip
"""Something of each library."""


def requirements() -> list[str]:
    """The dependencies, those of EXTRAS and TEST_TOOLS, as pyproject.toml has them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    tools = [one for one in extras["dev"] if re.match(r"[\w-]+", one)[0] in TEST_TOOLS]
    return sorted({*project["dependencies"], *(one for name in EXTRAS for one in extras[name]), *tools})


def lowest(requirement: str) -> str:
    """The requirement that only the lower bound fits, whatever its last number where it has but two."""
    name, bound = re.match(r"([\w-]+)[^>]*>=\s*([\w.]+)", requirement).groups()
    return f"{name}=={bound}{'.*' if bound.count('.') == 1 else ''}"


def passes(which: str) -> bool:
    """Whether the tests pass in a new environment with the `lowest` or `newest` versions."""
    folder = PLACE / which
    shutil.rmtree(folder, ignore_errors=True)
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    wanted = [lowest(one) if which == "lowest" else one for one in requirements()]
    steps = (
        ("-m", "pip", "install", "--disable-pip-version-check", "--quiet", "--upgrade", "--upgrade-strategy", "eager", *wanted),
        ("-m", "pip", "install", "--disable-pip-version-check", "--quiet", "--no-deps", "--editable", str(ROOT)),
        ("-m", "pip", "freeze", "--exclude-editable"),
        ("-m", "pytest", "-q", *TESTS),
    )
    return all(subprocess.run([python, *step], cwd=ROOT, check=False).returncode == 0 for step in steps)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", nargs="+", choices=("lowest", "newest"))
    failed = [which for which in parser.parse_args().which if not passes(which)]
    sys.exit(f"does not pass: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
