"""tools/compare_networks.py: figures and paired differences of networks of several seeds."""

import numpy as np
import pytest
from pose_results import results_of_errors
from programs import tool

from kpopnet.evaluation.poses.metrics import PoseResults
from kpopnet.skeleton import JOINT_GROUPS

compare_networks = tool("compare_networks")

SEQUENCES, FRAMES = 8, 5
WAYS = {"depth": ["d0", "d1"], "ridge": ["r0", "r1"]}


def results(length_m: np.ndarray) -> PoseResults:
    """Estimates at these distances (N, 15) from joints at the origin."""
    return results_of_errors(length_m, sequence=np.repeat(np.arange(SEQUENCES), FRAMES))


@pytest.fixture
def four_networks() -> dict[str, PoseResults]:
    """Sequences of very different difficulty, in which the second way is nearer by 1 cm everywhere and by 3 cm at the hands."""
    hard_m = np.repeat(np.linspace(0.03, 0.2, SEQUENCES), FRAMES)[:, None] * np.ones(15)
    gained_m = np.full(15, 0.01)
    gained_m[list(JOINT_GROUPS["hands"])] = 0.03
    return {
        "d0": results(hard_m),
        "d1": results(hard_m + 0.002),
        "r0": results(hard_m - gained_m),
        "r1": results(hard_m + 0.002 - gained_m),
    }


def test_a_constant_gain_has_no_spread_however_hard_the_sequences_are(four_networks) -> None:
    found = compare_networks.compare(four_networks, WAYS, ["ridge-depth"])
    gain = found["ridge-depth"]["shoulders"]["mean_cm"]
    assert gain["value"] == pytest.approx(-1)
    assert gain["interval"] == pytest.approx([-1, -1])
    assert gain["by_network"] == pytest.approx([-1, -1])
    assert found["ridge-depth"]["hands"]["mean_cm"]["value"] == pytest.approx(-3)
    low, high = found["depth"]["shoulders"]["mean_cm"]["interval"]
    assert high - low > 4, "the figures themselves do spread"


def test_a_joint_that_one_network_misses_is_a_miss_and_in_no_mean(four_networks) -> None:
    head = int(JOINT_GROUPS["head"][0])
    networks = four_networks | {"r0": results(np.zeros((SEQUENCES * FRAMES, 15)))}
    networks["r0"].estimate_m[:, head] = np.nan
    found = compare_networks.compare(networks, {"depth": ["d0"], "ridge": ["r0"]}, ["ridge-depth"])
    assert found["ridge"]["head"]["within_10cm"]["value"] == 0
    assert found["ridge-depth"]["head"]["mean_cm"]["value"] is None
