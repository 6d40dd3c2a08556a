"""Table 1: one estimator at every combination of the values of two settings."""

import pytest

from kpopnet.errors import InputError
from kpopnet.evaluation.poses.sweep import sweep_of
from kpopnet.paper_tracker.tracker import PaperTrackerConfig

RADII, TOLERANCES = [0.08, 0.11], [0.04, 0.05, 0.06]


def test_only_the_two_settings_of_the_first_estimator_are_varied():
    axes = {"epsilon_m": TOLERANCES, "r_m": RADII}
    found = sweep_of(axes, {"mine": PaperTrackerConfig(repaired=True), "other": None})
    assert found.estimator == "mine" and [len(row) for row in found.names] == [2, 2, 2]
    assert len(found.settings) == 5, "the combination that equals the configured estimator is evaluated once"
    assert found.names[1][1] == "mine"
    for row, tolerance in zip(found.names, TOLERANCES, strict=True):
        for name, radius in zip(row, RADII, strict=True):
            if name != "mine":
                assert name == f"mine epsilon_m={tolerance} r_m={radius}"
                assert found.settings[name] == PaperTrackerConfig(repaired=True, r_m=radius, epsilon_m=tolerance)


@pytest.mark.parametrize(
    ("setting", "values", "message"),
    [
        ("r_mm", [80], r"estimator\.mine\.r_mm"),
        ("r_m", [-1.0], r"expected r_m in 0\.\.2 m"),
        ("r_m", [], "two settings with at least one value each"),
    ],
)
def test_a_setting_that_cannot_be_varied_is_named(setting, values, message):
    with pytest.raises(InputError, match=message):
        sweep_of({"repaired": [True, False], setting: values}, {"mine": PaperTrackerConfig()})
    with pytest.raises(InputError, match="expected an estimator"):
        sweep_of({"repaired": [True, False], setting: values}, {})
