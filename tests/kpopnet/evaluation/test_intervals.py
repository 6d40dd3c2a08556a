import numpy as np
import pytest
from scipy.stats import ttest_1samp

from kpopnet.evaluation.intervals import DRAWS, Bootstrap, crossed_interval, mean_interval, percentiles


def rooms(rng, count: int, frames: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, 1) values with mean 0 whose rooms differ by `spread`, while frames of a room differ by 1; and their room (N,)."""
    room = np.repeat(np.arange(count), frames)
    return (spread * rng.normal(size=count)[room] + rng.normal(size=len(room)))[:, None], room


def interval(values: np.ndarray, unit: np.ndarray, seed: int = 0) -> np.ndarray:
    bootstrap = Bootstrap(unit, seed)
    return np.array(bootstrap.interval(bootstrap.ratios(values, np.ones_like(values))))


def coverage(count: int, spread: float, by_frame: bool = False, trials: int = 400) -> float:
    """Share of simulated evaluations whose interval contains the true mean."""
    hits = 0
    for trial in range(trials):
        values, room = rooms(np.random.default_rng([7, trial]), count, 12, spread)
        low, high = interval(values, np.arange(len(room)) if by_frame else room, seed=trial)
        hits += low <= 0 <= high
    return hits / trials


@pytest.mark.parametrize(("count", "spread"), [(6, 2.0), (30, 2.0), (30, 0.0)])
def test_the_interval_over_rooms_contains_the_truth_in_95_of_100_evaluations(count, spread):
    assert 0.92 <= coverage(count, spread) <= 0.98  # 400 evaluations: a standard error of 1.1 percent


def test_resampling_frames_of_correlated_rooms_claims_far_too_much():
    assert coverage(8, 2.0, by_frame=True, trials=50) < 0.6
    values, room = rooms(np.random.default_rng(1), 30, 12, 2.0)
    by_room, by_frame = (np.diff(interval(values, unit)) for unit in (room, np.arange(len(room))))
    assert by_room > 2.5 * by_frame


def test_equal_frames_in_a_room_add_no_information():
    values, room = rooms(np.random.default_rng(2), 20, 1, 1.0)
    np.testing.assert_allclose(interval(values, room), interval(np.repeat(values, 9, axis=0), np.repeat(room, 9)))


def test_a_resample_weighs_rooms_by_their_frames():
    """Against a direct resampling of rooms of different sizes, at the same percentiles."""
    rng = np.random.default_rng(5)
    values, unit = rng.uniform(0, 0.2, (60, 15)), np.repeat([0, 4, 9, 2, 11, 7], [20, 5, 15, 3, 7, 10])
    values[:20] += 0.1
    parts = [values[unit == k] for k in np.unique(unit)]
    draws = np.random.default_rng(99).integers(0, 6, (DRAWS, 6))
    means = [sum(parts[k].sum() for k in draw) / sum(parts[k].size for k in draw) for draw in draws]
    assert interval(values, unit, seed=7) == pytest.approx(np.percentile(means, percentiles(6)), rel=0.03)
    assert (interval(values, unit, seed=7) == interval(values, unit, seed=7)).all()


def test_percentiles_widen_for_few_units_and_are_the_usual_ones_for_many():
    assert percentiles(100_000) == pytest.approx((2.5, 97.5), abs=1e-3)
    tails = [percentiles(units)[0] for units in (2, 5, 10, 40, 200)]
    assert tails == sorted(tails) and tails[0] < 1e-6 and 2.2 < tails[-1] < 2.5


def test_one_unit_or_nothing_to_count_gives_no_interval():
    for unit, counted in ((np.zeros(4), 1.0), (np.arange(4), 0.0), (np.zeros(0), 1.0)):
        values = np.ones((len(unit), 3))
        bootstrap = Bootstrap(unit, 0)
        assert bootstrap.interval(bootstrap.ratios(values, counted * values)) is None


def test_an_interval_is_given_from_five_units_on():
    """Four units or trainings print no interval, five do, in every kind of interval."""
    rng = np.random.default_rng(8)
    for count in (2, 3, 4, 5):
        values = rng.normal(size=(count, 1))
        few, many = Bootstrap(np.arange(count), 0), Bootstrap(np.arange(9), 1)
        given = [few.interval(few.ratios(values, np.ones_like(values))), mean_interval(values[:, 0])]
        given += [crossed_interval(many.sums(rng.normal(size=(9, count))), few, many)]
        given += [crossed_interval(few.sums(rng.normal(size=(count, 9))), many, few)]
        assert [one is not None for one in given] == [count >= 5] * 4


def test_the_interval_of_a_mean_is_students():
    values = np.random.default_rng(3).normal(2, 5, 7)
    assert mean_interval(values) == pytest.approx(list(ttest_1samp(values, 0).confidence_interval(0.95)))


@pytest.mark.parametrize(("of_training", "of_person"), [(1.0, 1.0), (1.0, 0.2), (0.1, 1.0)])
def test_a_crossed_interval_contains_the_truth_of_other_trainings_and_other_people(of_training, of_person):
    """Five trainings judged by twenty people: whichever of both differs more, and never too narrow."""
    hits, trials = 0, 150
    for trial in range(trials):
        rng = np.random.default_rng([11, trial])
        shared = of_training * rng.normal(size=5) + of_person * rng.normal(size=(20, 1))
        units, trainings = Bootstrap(np.arange(20), trial), Bootstrap(np.arange(5), trial + 1)
        low, high = crossed_interval(units.sums(shared + 0.3 * rng.normal(size=(20, 5))) / 20, trainings, units)
        hits += low <= 0 <= high
    assert hits / trials >= 0.92  # 150 evaluations: a standard error of 1.8 percent
