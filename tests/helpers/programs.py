"""The programs as a user runs them."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]


def torchrun(processes: int) -> list[str]:
    """What starts a script in several processes."""
    return [sys.executable, "-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={processes}"]


def run_program(script: str | Path, place: Path, *words: object, processes: int = 0) -> subprocess.CompletedProcess:
    """Runs a script, by default of the repository, in the folder `place`; it can import the tests' helpers."""
    started = torchrun(processes) if processes else [sys.executable]
    path = os.pathsep.join((str(ROOT), str(ROOT / "tests" / "helpers")))
    return subprocess.run(
        [*started, str(ROOT / script), *map(str, words)],
        cwd=place,
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": path},
    )


def ended(process: int) -> bool:
    """Whether a process ends within half a minute; one that does not is killed."""
    for _ in range(600):
        try:
            os.kill(process, 0)
            if Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z":  # nobody waits for it
                return True
        except (ProcessLookupError, FileNotFoundError):
            return True
        time.sleep(0.05)
    os.kill(process, signal.SIGKILL)
    return False


def tool(name: str) -> ModuleType:
    """A program of tools/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
