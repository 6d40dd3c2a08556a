"""What this machine offers, and how a process uses it."""

import ctypes
import os
import sys
from pathlib import Path

MOST_PER_CORE = 4
"""Processes for each core beyond which more of them only take memory."""

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""The environment of a process whose libraries compute on one thread."""

M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD = -1, -2, -3
KEPT_BYTES, AHEAD_BYTES, LARGE_BYTES = 256 << 20, 16 << 20, 32 << 20


def own_python(statement: str) -> tuple[list[str], dict[str, str]]:
    """The words and the environment of a process that executes a statement with this one's modules, on one thread.

    It imports from where this process does, and not from the folder that the user happens to be in.
    """
    places = os.pathsep.join(place or str(Path.cwd()) for place in sys.path)
    return [sys.executable, "-P", "-c", statement], os.environ | ONE_THREAD | {"PYTHONPATH": places}


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def bounded_processes(asked: int, name: str = "processes") -> int:
    """The number of processes to start: at most MOST_PER_CORE for each core, with a notice where more were asked for."""
    most = MOST_PER_CORE * available_cores()
    if asked > most:
        print(f"{name}={asked}: takes {most}, {MOST_PER_CORE} for each core of this machine", file=sys.stderr, flush=True)
    return min(asked, most)


def keep_freed_memory() -> None:
    """Lets glibc keep up to 256 MB of freed memory, and take arrays up to 32 MB from it.

    By default it returns every freed array of an image's size to the kernel, and gets the next one back page by page: that
    was a third of the time of generating samples. Without effect on systems with another C library.
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for option, value in ((M_MMAP_THRESHOLD, LARGE_BYTES), (M_TRIM_THRESHOLD, KEPT_BYTES), (M_TOP_PAD, AHEAD_BYTES)):
            mallopt(option, value)
