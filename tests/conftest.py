"""Imported before any test module, and so before torch: kpopnet sets how OpenMP's threads wait.

Hypothesis tries the same examples in every run, so that a change is judged by what it changed;
`pytest --hypothesis-profile=default` looks for new ones.
"""

from math import ceil
from pathlib import Path

import pytest
from hypothesis import settings

import kpopnet  # noqa: F401

settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Deals the files out, the programs' own tests first, so that two processes seldom need the same kernels at a time.

    Neighbours in a folder do; whichever came second would compile them once more instead of reading them from the cache. Those
    of the programs take longest, and no process shall be left alone with them in the end; of these train.py comes first, whose
    kernels two processes of a training would otherwise compile at a time in `test_distributed_entry.py`.
    """
    here, first = Path(__file__).parent, "test_train_entry.py"
    files = sorted({item.path for item in items}, key=lambda path: (path.parent != here, path.name != first, path))
    half = ceil(len(files) / 2)
    place = {path: (number % half, number // half) for number, path in enumerate(files)}
    items.sort(key=lambda item: place[item.path])
