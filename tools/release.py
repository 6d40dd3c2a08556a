"""Prepares a release: writes its version where files state it, builds the wheel, tries it, and says what is left to do by hand.

    make release VERSION=0.2.0
    PYTHONPATH=. python tools/release.py 0.2.0

The wheel, unpacked apart from this checkout, has to state its version and to find no person in two images of a wall by its own
weights. Nothing is committed, tagged or sent.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import zipfile
from datetime import date
from pathlib import Path

import numpy as np

from kpopnet.errors import InputError
from kpopnet.evaluation.report import write_text
from kpopnet.runtime.endings import user_errors

ROOT = Path(__file__).resolve().parent.parent
PLACES = {
    "pyproject.toml": '^version = "{}"$',
    "kpopnet/__init__.py": '^__version__ = "{}"$',
    "CITATION.cff": "^version: {}$",
    "docs/compare.md": r"\bkpopnet is version {}\b",
    "docs/predicting.md": r"\bkpopnet-{}-py3-none-any\.whl\b",
}
"""Files that state the version, and how."""

CHECKLIST = """
{wheel} is ready. Left to do:
[ ] read git diff, and the section {version} of CHANGELOG.md as a user of the version before
[ ] the last column of kpopnet's row in docs/compare.md
[ ] make test lint, in a fresh clone; make fuzz kill; make speed, for what README promises
[ ] git commit -am "Release {version}"; git tag -s v{version}; git push --follow-tags
[ ] a release v{version} at the repository's host with that section, {wheel} and kpopnet.cdx.json
[ ] for the package index, once kpopnet is on it: twine check --strict {wheel}; twine upload {wheel}; then
    let docs/predicting.md, docs/compare.md and kpopnet/runtime/provenance.py name it
[ ] pip install the published wheel on another machine, and run the first commands of README.md
"""


def released(texts: dict[str, str], version: str, on: date) -> dict[str, str]:
    """The texts of `PLACES` and of CHANGELOG.md, by name, with a version newer than theirs.

    Raises InputError where the version is not newer, a file does not state the old one, or nothing has changed since.
    """
    stated = re.search(PLACES["pyproject.toml"].format(r"(\d+\.\d+\.\d+)"), texts["pyproject.toml"], re.MULTILINE)
    if stated is None:
        raise InputError("pyproject.toml: expected a version such as 0.1.0")
    before = stated[1]
    if not re.fullmatch(r"\d+\.\d+\.\d+", version) or _numbers(version) <= _numbers(before):
        raise InputError(f"version {version}: expected one such as 0.2.0, newer than {before}")
    written = {}
    for name, pattern in PLACES.items():
        found = re.compile(pattern.format(re.escape(before)), re.MULTILINE)
        written[name], places = found.subn(lambda match: match[0].replace(before, version), texts[name])
        if not places:
            raise InputError(f"{name}: expected it to state version {before}")
    heading, changes = "## Unreleased\n", texts["CHANGELOG.md"]
    entries = changes.partition(heading)[2].partition("\n## ")[0]
    if "\n- " not in entries:
        raise InputError(f"CHANGELOG.md: nothing has changed since {before}")
    written["CHANGELOG.md"] = changes.replace(heading, f"{heading}\n## {version} - {on.isoformat()}\n", 1)
    return written


def _numbers(version: str) -> list[int]:
    return [int(number) for number in version.split(".")]


def try_wheel(wheel: Path, version: str) -> None:
    """Runs a wheel that is unpacked apart from this checkout; raises InputError where it does not do what it should."""
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(wheel) as packed:
            packed.extractall(folder)
        np.save(Path(folder) / "wall.npy", np.full((2, 120, 160), 2000, np.uint16))
        program = "import kpopnet as k; print(k.__file__, k.__version__, flush=True); from kpopnet.cli import main; main()"
        environment = os.environ | {"PYTHONPATH": folder, "PYTHONSAFEPATH": "1"}
        words = [sys.executable, "-c", program, "predict", "wall.npy", "--fov", "60", "--fps", "30", "--out", "found"]
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        said = f"{done.stdout}{done.stderr}".strip()
        expected = f"{Path(folder).resolve() / 'kpopnet' / '__init__.py'} {version}\n"
        if not done.stdout.startswith(expected) or "no person" not in said:
            raise InputError(f"{wheel}: expected {version} and no person found, it said {said[-300:]}")


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("version")
    version = parser.parse_args().version
    if subprocess.run(["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, text=True, check=True).stdout:
        raise InputError("the checkout has changes; commit them, or after a release that failed: git checkout .")
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in (*PLACES, "CHANGELOG.md")}
    for name, text in released(texts, version, date.today()).items():
        write_text(ROOT / name, text)
    build = "-m pip wheel --disable-pip-version-check --quiet --no-deps --wheel-dir dist ."
    subprocess.run([sys.executable, *build.split()], cwd=ROOT, check=True)
    wheel = Path("dist") / f"kpopnet-{version}-py3-none-any.whl"
    try_wheel(ROOT / wheel, version)
    print(CHECKLIST.format(wheel=wheel, version=version))


if __name__ == "__main__":
    main()
