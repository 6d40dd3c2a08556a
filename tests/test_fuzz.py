"""Some mutations of every file format that strangers send; `make fuzz` runs thousands."""

import os
from collections.abc import Iterator

import pytest
from fuzz.formats import FORMATS
from fuzz.runner import Fuzzer
from programs import ROOT

CASES = 50
"""Of each format."""


@pytest.fixture(scope="module")
def fuzzer() -> Iterator[Fuzzer]:
    with pytest.MonkeyPatch.context() as patch, Fuzzer(seed=1) as started:
        places = (ROOT, ROOT / "tests", ROOT / "tests" / "helpers")
        patch.setenv("PYTHONPATH", os.pathsep.join(map(str, places)))
        yield started


@pytest.mark.parametrize("name", FORMATS)
def test_mutated_files_are_read_or_refused_in_one_line(name: str, fuzzer: Fuzzer) -> None:
    report = fuzzer.fuzz(name, range(CASES))
    assert sum(report.outcomes.values()) == CASES and report.faults == []
