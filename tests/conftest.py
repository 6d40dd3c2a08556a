"""Imported before any test module, and so before torch: kpopnet sets how OpenMP's threads wait.

Hypothesis tries the same examples in every run, so that a change is judged by what it changed;
`pytest --hypothesis-profile=default` looks for new ones.
"""

import gc
import os
import signal
from math import isqrt
from pathlib import Path

import pytest
from hypothesis import settings

import kpopnet  # noqa: F401

# Without AMX, which ends the process on virtual machines that advertise it wrongly. oneDNN reads it when it first computes.
os.environ.setdefault("ONEDNN_MAX_CPU_ISA", "AVX512_CORE_BF16")

# A shell that starts the tests in the background ignores the one, nohup the other, and so would every program that they start
# and interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

gc.disable()  # until the tests are collected: a quarter of that time went into looking for garbage among what imports made

settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")


def pytest_collection_finish() -> None:
    """Garbage is looked for again, among what the tests make."""
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Deals the files out so that two processes seldom need the same kernels at a time.

    Neighbours in a folder do; whichever came second would compile them once more instead of reading them from the cache. What
    takes longest comes first, so that no process is left alone with it in the end: the programs' own tests, train.py first,
    whose kernels two processes of a training would compile at a time in `test_distributed_entry.py`, then pages and servers.
    """

    def group(path: Path) -> int:
        names = ("test_train_entry.py",), [path.name] * (path.parent == Path(__file__).parent), ("page.py", "server.py")
        return next((number for number, ends in enumerate(names) if path.name.endswith(tuple(ends))), len(names))

    files = sorted({item.path for item in items})
    stride = isqrt(len(files))
    place = {path: (group(path), number % stride, number) for number, path in enumerate(files)}
    items.sort(key=lambda item: place[item.path])
