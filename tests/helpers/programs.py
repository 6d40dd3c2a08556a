"""The programs as a user runs them."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def run_program(script: str, place: Path, *overrides: str, launcher: tuple[str, ...] = ()) -> subprocess.CompletedProcess:
    """Runs a script of the repository in the folder `place`, by python or what is launched by it."""
    return subprocess.run(
        [sys.executable, *launcher, str(ROOT / script), *overrides],
        cwd=place,
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
