"""Some mutations of every file format that strangers send; `make fuzz` runs thousands."""

import pytest
from fuzz.formats import FORMATS
from fuzz.runner import fuzz
from programs import ROOT

CASES = 50
"""Of each format."""


@pytest.mark.parametrize("name", FORMATS)
def test_mutated_files_are_read_or_refused_in_one_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for place in (ROOT, ROOT / "tests", ROOT / "tests" / "helpers"):
        monkeypatch.syspath_prepend(place)  # the child imports the formats and the tests' helpers
    outcomes, faults = fuzz(name, range(CASES), seed=1)
    assert sum(outcomes.values()) == CASES and faults == []
