"""Benchmarks show other people, garments and furniture than training sets, and people who differ as adults do."""

import numpy as np
import pytest
from stand_ins import recorded_seeds

from kpopnet.errors import InputError
from synth.body.asset import load_body
from synth.body.garments import HELD_BACK, ORDINARY
from synth.body.outfit import put_on
from synth.body.shape import BodyConfig, Person, draw_person
from synth.dances.simulate import KpopSim, KpopSimConfig
from synth.motion import MotionConfig
from synth.rooms.clutter import CLUTTER
from synth.rooms.held_back import BARRIERS, BENCHMARK_CLUTTER
from synth.rooms.images import RoomImagesSet
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene import room as rooms
from synth.simulated.check_sim import CheckSim, CheckSimConfig
from synth.simulated.rooms import Rooms
from synth.simulated.stand_ins import EvalSim, EvalSimConfig, Smmc10Sim
from synth.simulated.two_people import TwoPeople

PEOPLE = 12


def of_training(split: str) -> list[Person]:
    sampler = Sampler(SampleConfig(renderer="cpu"), 0, split)
    return [sampler.person(number) for number in range(PEOPLE)]


def of_benchmarks() -> list[Person]:
    makers = EvalSim(EvalSimConfig(seed=5)), Smmc10Sim(), TwoPeople(), Rooms(), CheckSim()
    dances = KpopSim(KpopSimConfig(seed=5), seconds=(0.5, 0.5))
    people = [maker.person(number) for maker in makers for number in range(PEOPLE // 4)]
    return [*people, dances.take(0, 0, dances.learner(0, 0).motion).played.person]


def nearest_adult(person: Person) -> float:
    """Place among the baked adults, 0 to 1, of the one whose shape is nearest to that of the unclothed person."""
    asset, size = load_body(), person.bare_m.size
    shape, *_ = np.linalg.lstsq(asset.basis[:, :size].T, person.bare_m.ravel() - asset.mean.ravel()[:size], rcond=None)
    return float(np.linalg.norm(asset.people - shape, axis=1).argmin() / len(asset.people))


@pytest.mark.parametrize(("split", "low", "high"), [("train", 0.0, 0.8), ("validation", 0.8, 0.9), ("test", 0.9, 1.0)])
def test_people_of_a_split_are_near_its_own_adults(split: str, low: float, high: float) -> None:
    places = [nearest_adult(person) for person in of_training(split)]
    assert all(low <= place < high for place in places), places


def test_people_of_benchmarks_are_near_adults_who_are_in_no_training() -> None:
    assert all(nearest_adult(person) >= 0.9 for person in of_benchmarks())


def test_people_of_benchmarks_differ_as_much_as_adults_do() -> None:
    """Women and men of the US Army, ANSUR II (2012): stature 162.8 ± 6.4 and 175.6 ± 6.9 cm; all adults differ more."""
    people = [draw_person(np.random.default_rng([1, n]), BodyConfig(), "benchmark") for n in range(150)]
    stature_cm = [100 * np.ptp(person.bare_m[:, 2]) for person in people]
    assert 165 < np.mean(stature_cm) < 175 and 9.5 < np.std(stature_cm) < 12.5


@pytest.mark.parametrize("maker", [EvalSim(frames=(24, 30)), TwoPeople(frames=(20, 20)), KpopSim(seconds=(0.5, 0.5))])
def test_seeds_of_a_benchmark_begin_with_its_name_and_those_of_training_do_not(maker, monkeypatch) -> None:
    name, seeds = tuple(maker.benchmark.name.encode()), recorded_seeds(monkeypatch)
    if isinstance(maker, KpopSim):
        maker.record(0, 1, maker.take(0, 1, maker.learner(0, 1).motion))
    else:
        list(maker.shots(0, maker.take(0), range(2)))
    # Dances are composed from 63-bit seeds, while training seeds count from 0.
    assert len(seeds) >= 4 and all(seed[: len(name)] == name or seed[0] > 2**40 for seed in seeds)
    seeds.clear()
    list(Sampler(SampleConfig(renderer="cpu"), 0, "train").samples(0, 3))
    assert len(seeds) >= 8 and all(len(seed) <= 4 and max(seed) < 2**40 and seed[:4] != name[:4] for seed in seeds)


def test_a_seed_is_of_a_benchmark_its_seed_its_split_what_is_drawn_and_numbers() -> None:
    assert EvalSim(EvalSimConfig(seed=7))._seed("noise", 2) == (*b"eval_sim", 7, 2, 2)
    assert KpopSim(KpopSimConfig(seed=5, split="validation"))._seed("learner", 3, 1) == (*b"kpop_sim", 5, 1, 2, 3, 1)


CLIPS = MotionConfig(source="clips", path="somewhere")


@pytest.mark.parametrize(
    ("make", "settings", "message"),
    [
        (TwoPeople, {"motion": CLIPS}, "second person"),
        (RoomImagesSet, {"motion": CLIPS}, "poses of all kinds"),
        (EvalSim, {"motion": MotionConfig(source="choreography", seed=3)}, r"either composed .* or recorded"),
        (KpopSim, {"benchmark": KpopSimConfig(name="other")}, r"benchmark\.name=other: the set is called kpop_sim"),
        (lambda children: CheckSimConfig(children=children), {"children": 0.5}, r"benchmark\.children=0\.5: .* for adults"),
    ],
)
def test_what_a_set_cannot_show_is_refused(make, settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(**settings)


def test_people_of_benchmarks_wear_garments_that_training_never_has(monkeypatch) -> None:
    kinds = [{garment for garments in wardrobe for _, garment in garments.values()} for wardrobe in (ORDINARY, HELD_BACK)]
    assert not kinds[0] & kinds[1]
    worn = []

    def recorded(figure, rng, config, wardrobe):
        worn.append(wardrobe)
        return put_on(figure, rng, config, wardrobe)

    monkeypatch.setattr("synth.body.shape.put_on", recorded)
    of_benchmarks()
    assert len(worn) > PEOPLE and all(one is HELD_BACK for one in worn)
    worn.clear()
    for split in ("train", "validation", "test"):
        of_training(split)
    assert len(worn) == 3 * PEOPLE and all(one is ORDINARY for one in worn)


def test_rooms_of_benchmarks_have_furniture_that_training_never_has(monkeypatch) -> None:
    drawn = []

    def recorded(rng, furniture):
        drawn.append(furniture)
        return original(rng, furniture)

    original = rooms.draw_room
    for module in ("synth.simulated.film", "synth.simulated.two_people", "synth.samples.sampler"):
        monkeypatch.setattr(f"{module}.draw_room", recorded)
    EvalSim(EvalSimConfig(seed=5), frames=(20, 20)).take(0)
    TwoPeople(frames=(20, 20)).take(0)
    of_benchmark = {kind for furniture in drawn for kind in furniture}
    drawn.clear()
    Sampler(SampleConfig(renderer="cpu"), 0, "train").room(0)
    of_training_set = {kind for furniture in drawn for kind in furniture}
    assert of_benchmark and of_training_set and not of_benchmark & of_training_set


def test_clutter_of_benchmarks_is_of_kinds_that_training_never_has() -> None:
    kinds = [{thing.__name__.strip("_") for thing in things} for things in (CLUTTER, BENCHMARK_CLUTTER + BARRIERS)]
    assert all(len(names) >= 15 for names in kinds) and kinds[0] & kinds[1] == {"pillar"}  # told in docs/generating.md
    assert not set(rooms.LIVING_ROOM) & set(rooms.DANCE_HALL)
