"""Planted faults: does a harness find what it is there for?

A fault is a table `[NAME]` of a TOML file: its `class`; `about`, what it breaks; `edits`, each a file with an old and a new
text; `run`, the smallest run of the harness that shows it; `shows`, a regular expression of what that run then prints. Each
fault is planted alone into a copy of the checkout, and is found if the run fails and shows it.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Collection
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("kpopnet", "synth", "tests", "configs", "train.py", "evaluate.py", "pyproject.toml")
MOST_S = 600


def planted(folder: Path) -> dict[str, dict]:
    """The faults in the files of a folder, by name."""
    return {name: one for path in sorted(folder.glob("*.toml")) for name, one in tomllib.loads(path.read_text()).items()}


def find_all(folder: Path, harness: str, names: Collection[str] = ()) -> bool:
    """Plants the faults of a folder one by one, all or those named, and prints a table; whether the harness found each."""
    faults, found = planted(folder), 0
    chosen = {name: faults[name] for name in names or faults}
    with tempfile.TemporaryDirectory(prefix="planted_") as place:
        checkout = Path(place) / "checkout"
        checkout.mkdir()
        for name in COPIED:  # with the times of files, by which caches of compiled code are found
            (shutil.copytree if (ROOT / name).is_dir() else shutil.copy2)(ROOT / name, checkout / name)
        print(f"{'class':22} {'planted fault':72} {'seconds':>7}  found by")
        for name, fault in chosen.items():
            began = time.monotonic()
            shown = find(fault, harness, checkout)
            seconds = time.monotonic() - began
            print(f"{fault['class']:22} {name + ': ' + fault['about']:72} {seconds:7.1f}  {shown or 'NOTHING'}", flush=True)
            found += shown is not None
    print(f"{found} of {len(chosen)} planted faults found")
    return found == len(chosen)


def find(fault: dict, harness: str, checkout: Path) -> str | None:
    """Plants a fault into a copy of the checkout and runs the harness there: what showed it, or None."""
    try:
        for edit in fault["edits"]:
            path = checkout / edit["file"]
            text = path.read_text()
            if text.count(edit["old"]) != 1:
                raise ValueError(f"{edit['file']}: expected once, found {text.count(edit['old'])} times: {edit['old']}")
            path.write_text(text.replace(edit["old"], edit["new"]))
        done = subprocess.run(
            [sys.executable, "-m", harness, *fault["run"]], cwd=checkout, timeout=MOST_S,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
            env=os.environ | {"PYTHONPATH": str(checkout), "PYTHONDONTWRITEBYTECODE": "1"},
        )  # fmt: skip
    finally:
        for edit in fault["edits"]:
            shutil.copy2(ROOT / edit["file"], checkout / edit["file"])
    shown = re.search(fault["shows"], done.stdout)
    if done.returncode and shown:
        return " ".join(shown[0].split())[:60]
    if done.returncode:
        print(done.stdout[-1500:], file=sys.stderr)
    return None
