"""What this machine offers."""

import os
import sys

MOST_PER_CORE = 4
"""Processes for each core beyond which more of them only take memory."""


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def bounded_processes(asked: int, name: str = "processes") -> int:
    """The number of processes to start: what was asked for, at most MOST_PER_CORE for each core; says so where it is less."""
    most = MOST_PER_CORE * available_cores()
    if asked > most:
        print(f"{name}={asked}: takes {most}, {MOST_PER_CORE} for each core of this machine", file=sys.stderr, flush=True)
    return min(asked, most)
