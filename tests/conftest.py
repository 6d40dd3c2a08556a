"""Imported before any test module, and so before torch: kpopnet sets how OpenMP's threads wait.

Hypothesis tries the same examples in every run, so that a change is judged by what it changed;
`pytest --hypothesis-profile=default` looks for new ones.
"""

from pathlib import Path

import pytest
from hypothesis import settings

import kpopnet  # noqa: F401

settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The programs' own tests take longest: they come first, so that no process is left alone with them in the end."""
    items.sort(key=lambda item: item.path.parent != Path(__file__).parent)
