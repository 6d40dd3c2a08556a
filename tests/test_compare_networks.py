"""tools/compare_networks.py: figures and paired differences of ways to train, with trainings as the unit."""

from argparse import ArgumentTypeError

import numpy as np
import pytest
from films import Films, Off
from pose_results import results_of_errors
from programs import tool

from kpopnet.errors import InputError
from kpopnet.evaluation.intervals import Bootstrap
from kpopnet.evaluation.poses.metrics import PoseResults
from kpopnet.evaluation.registry import BENCHMARKS, build_benchmark
from kpopnet.skeleton import JOINT_GROUPS

compare_networks = tool("compare_networks")

SEQUENCES, FRAMES, TRAININGS = 8, 5, 5
WAYS = {way: [f"{way}{seed}" for seed in range(TRAININGS)] for way in ("depth", "ridge")}


def results(length_m: np.ndarray) -> PoseResults:
    """Estimates at these distances (N, 15) from joints at the origin."""
    return results_of_errors(length_m, sequence=np.repeat(np.arange(SEQUENCES), FRAMES))


@pytest.fixture
def networks() -> dict[str, PoseResults]:
    """Sequences of very different difficulty, in which the second way is nearer by 1 cm everywhere and by 3 cm at the hands.

    Later seeds train better: by 2 mm each, either way.
    """
    hard_m = np.repeat(np.linspace(0.05, 0.2, SEQUENCES), FRAMES)[:, None] * np.ones(15)
    gained_m = np.full(15, 0.01)
    gained_m[list(JOINT_GROUPS["hands"])] = 0.03
    seeds = range(TRAININGS)
    depth = {f"depth{seed}": results(hard_m - 0.002 * seed) for seed in seeds}
    return depth | {f"ridge{seed}": results(hard_m - 0.002 * seed - gained_m) for seed in seeds}


def test_a_constant_gain_has_no_spread_however_hard_sequences_and_different_trainings_are(networks) -> None:
    found = compare_networks.compare(networks, WAYS, ["ridge-depth"])
    gain = found["ridge-depth"]["shoulders"]["mean_cm"]
    assert gain["value"] == pytest.approx(-1) and gain["by_training"] == pytest.approx([-1] * TRAININGS)
    assert gain["other_trainings"] == pytest.approx([-1, -1])
    assert gain["other_trainings_and_units"] is None, "a bootstrap of equal values does not say how they vary"
    assert found["ridge-depth"]["hands"]["mean_cm"]["value"] == pytest.approx(-3)


def test_trainings_are_the_unit_and_people_are_crossed_with_them(networks) -> None:
    """By hand: five means that fall by 2 mm a seed, t = 2.776 at four degrees of freedom."""
    one = compare_networks.compare(networks, WAYS, [])["depth"]["all"]["mean_cm"]
    means_cm = 12.5 - 0.2 * np.arange(TRAININGS)
    reach = 2.776 * np.std(means_cm, ddof=1) / np.sqrt(TRAININGS)
    assert one["by_training"] == pytest.approx(means_cm) and one["value"] == pytest.approx(means_cm.mean())
    assert one["other_trainings"] == pytest.approx([means_cm.mean() - reach, means_cm.mean() + reach], abs=1e-3)
    low, high = one["other_trainings_and_units"]
    assert high - low > 4, "sequences differ by far more than trainings"


def test_a_joint_that_one_network_misses_is_a_miss_and_in_no_mean(networks) -> None:
    head = int(JOINT_GROUPS["head"][0])
    networks["ridge0"] = results(np.zeros((SEQUENCES * FRAMES, 15)))
    networks["ridge0"].estimate_m[:, head] = np.nan
    found = compare_networks.compare(networks, {"depth": ["depth0"], "ridge": ["ridge0"]}, ["ridge-depth"])
    assert found["ridge"]["head"]["within_10cm"]["value"] == 0
    assert found["ridge-depth"]["head"]["mean_cm"]["value"] is None


@pytest.mark.parametrize(("definition", "people", "judged"), [("markers", 2, True), (None, 2, False), ("markers", 1, False)])
def test_the_labels_definition_is_judged_where_there_is_one_and_others_to_fit_it_on(monkeypatch, definition, people, judged):
    monkeypatch.setattr(compare_networks, "NetworkEstimator", lambda run: Off())
    films = Films()
    films.label_definition = definition
    films.identities = {name: f"s{number % people}" for number, name in enumerate(films.sequence_names())}
    found = compare_networks.measured(films, {"depth": ["depth0"]}, [], processes=1)
    assert ("in_label_definition" in found) is judged and found["units"] == people


def test_a_training_is_one_of_those_of_a_way_once() -> None:
    assert compare_networks.way("depth=a,b") == ("depth", ["a", "b"])
    with pytest.raises(ArgumentTypeError, match="depth=a,b,a: names a training twice"):
        compare_networks.way("depth=a,b,a")


@pytest.mark.parametrize("name", compare_networks.SETS)
def test_a_set_that_can_be_chosen_needs_nothing_but_its_folder(name, tmp_path):
    for file in ("seq_a_0.bin", "real01_1.cal.bin"):
        (tmp_path / file).touch()
    schema, _ = BENCHMARKS[name]
    with pytest.raises(InputError, match=str(tmp_path)) as raised:
        build_benchmark(schema(name=name, path=str(tmp_path)))
    assert "needs benchmark." not in str(raised.value)


@pytest.mark.parametrize(("of_training", "of_person"), [(1.0, 0.2), (0.1, 1.0)])
def test_a_crossed_interval_contains_the_truth_of_other_trainings_and_other_people(of_training, of_person):
    """Five trainings judged by twenty people: whichever of both differs more, and never too narrow."""
    hits, trials = 0, 150
    for trial in range(trials):
        rng = np.random.default_rng([11, trial])
        shared = of_training * rng.normal(size=5) + of_person * rng.normal(size=(20, 1))
        units, trainings = Bootstrap(np.arange(20), trial), Bootstrap(np.arange(5), trial + 1)
        low, high = compare_networks.crossed_interval(
            units.sums(shared + 0.3 * rng.normal(size=(20, 5))) / 20, trainings, units
        )
        hits += low <= 0 <= high
    assert hits / trials >= 0.92  # 150 evaluations: a standard error of 1.8 percent
