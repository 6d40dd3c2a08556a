"""Some mutations of every file format that strangers send; `make fuzz` runs thousands, and looks for planted faults first."""

from pathlib import Path

import pytest
from fuzz.formats import FORMATS
from fuzz.runner import fuzz
from planted import planted
from programs import ROOT

CASES = 5
"""Of each format."""


def test_mutated_files_are_read_or_refused_in_one_line() -> None:
    found = fuzz([name for name in FORMATS if name != "child"], range(CASES), seed=1)
    assert {name: faults for name, (_, faults) in found.items() if faults} == {}
    assert all(sum(outcomes.values()) == -(-CASES // FORMATS[name].every) for name, (outcomes, _) in found.items())


@pytest.mark.parametrize("harness", ["fuzz", "kill"])
def test_planted_faults_fit_the_checkout(harness: str) -> None:
    faults = planted(ROOT / "tests" / harness / "planted")
    page = (ROOT / "docs" / "reliability.md").read_text()
    assert len(faults) >= 12
    for name, fault in faults.items():
        assert f" {name}" in page, f"docs/reliability.md lists all planted faults, but not {name}"
        for edit in fault["edits"]:
            text = Path(ROOT / edit["file"]).read_text()
            assert text.count(edit["old"]) == 1, f"{name}: {edit['file']}"
