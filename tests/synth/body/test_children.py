"""Children of 6 to 12 years: their shapes, their share of a set, and how sets with and without them are known."""

import json

import numpy as np
import pytest
from programs import ROOT

from synth.body.asset import CHILDREN_YEARS, digest, load_body, load_children
from synth.body.shape import SPLIT_RANGES, BodyConfig, Person, draw_person, shape_person
from synth.rooms.images import RoomImagesConfig, RoomImagesSet
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig
from synth.simulated.stand_ins import EvalSim, EvalSimConfig

GROWN_M = {6.5: 1.18, 9.0: 1.33, 11.5: 1.47}
"""Mean of girls' and boys' median stature, metres, by age in years: WHO growth reference 2007."""


def stature_m(person: Person) -> float:
    return float(np.ptp(person.bare_m[:, 2]))


@pytest.mark.parametrize("years", GROWN_M)
def test_children_are_as_tall_as_the_who_measures_them(years: float) -> None:
    asset = load_children()
    near = np.flatnonzero(np.abs(asset.facts[:, 1] - years) < 0.5)[:40]
    assert np.median([stature_m(shape_person(asset.people[one], asset)) for one in near]) == pytest.approx(
        GROWN_M[years], abs=0.02
    )


def test_children_have_the_adults_mesh_and_rig_and_other_proportions() -> None:
    adults, children = load_body(), load_children()
    assert children.faces is adults.faces and children.weights is adults.weights and children.bone_names == adults.bone_names
    assert CHILDREN_YEARS[0] <= children.facts[:, 1].min() and children.facts[:, 1].max() <= CHILDREN_YEARS[1]
    head = adults.weight_bones[:, 0] == adults.bone("Head")
    heads = []
    for asset in (adults, children):
        people = [shape_person(one, asset) for one in asset.people[:60]]
        heads.append(np.mean([np.ptp(one.bare_m[head, 2]) / stature_m(one) for one in people]))
    assert heads[1] > 1.05 * heads[0]


def test_they_are_the_share_that_is_asked_for() -> None:
    none, half, all_of_them = (
        np.mean([draw_person(np.random.default_rng(n), BodyConfig(children=share), "train").leg_m for n in range(60)])
        for share in (0.0, 0.5, 1.0)
    )
    assert all_of_them < 0.85 * none and half == pytest.approx((none + all_of_them) / 2, abs=0.04)


def test_those_of_benchmarks_are_in_no_training() -> None:
    asset = load_children()
    first = int(SPLIT_RANGES["benchmark"][0] * len(asset.people))
    rows = np.array([shape_person(one, asset).heads_m.ravel() for one in asset.people])
    for split, from_there in (("train", False), ("validation", False), ("benchmark", True)):
        config = BodyConfig(shape_jitter=0.0, children=1.0)
        for n in range(8):
            heads_m = draw_person(np.random.default_rng(n), config, split).heads_m.ravel()
            assert (np.abs(rows - heads_m).max(axis=1).argmin() >= first) == from_there, split


def test_sets_of_adults_are_known_as_before_and_those_with_children_are_others() -> None:
    measured = json.loads((ROOT / "results" / "eval_sim_31.json").read_text())
    assert EvalSim(EvalSimConfig(seed=31)).hash == measured["benchmark"]["config_hash"]
    makers = (
        lambda share: EvalSim(EvalSimConfig(seed=3, children=share)),
        lambda share: RoomImagesSet(RoomImagesConfig(seed=3, children=share)),
        lambda share: SetConfig(SampleConfig(BodyConfig(children=share), renderer="cpu"), 3, "train", 10, 5, None),
    )
    for of in makers:
        assert "children" not in of(0.0).as_json() and of(0.0).hash != of(0.2).hash != of(0.3).hash
    assert digest(False) != digest(True)
    assert "30 % are children of 6 to 12 years" in EvalSim(EvalSimConfig(children=0.3)).manifest_entries()["about"]
    assert "children" not in EvalSim().manifest_entries()["about"]
