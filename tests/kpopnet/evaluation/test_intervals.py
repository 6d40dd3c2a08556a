import numpy as np
import pytest

from kpopnet.evaluation.intervals import DRAWS, Bootstrap, percentiles


def rooms(rng, count: int, frames: int, spread: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, 1) values with mean 0 whose rooms differ by `spread`, while frames of a room differ by 1; and their room (N,)."""
    room = np.repeat(np.arange(count), frames)
    return (spread * rng.normal(size=count)[room] + rng.normal(size=len(room)))[:, None], room


def interval(values: np.ndarray, unit: np.ndarray, seed: int = 0) -> np.ndarray:
    bootstrap = Bootstrap(unit, seed)
    return np.array(bootstrap.interval(bootstrap.ratios(values, np.ones_like(values))))


def test_the_interval_over_rooms_contains_the_truth_in_95_of_100_evaluations():
    hits = 0
    for trial in range(400):
        values, room = rooms(np.random.default_rng([7, trial]), 6, 12, 2.0)
        low, high = interval(values, room, seed=trial)
        hits += low <= 0 <= high
    assert 0.92 <= hits / 400 <= 0.98  # a standard error of 1.1 percent


def test_resampling_frames_of_correlated_rooms_claims_far_too_much():
    values, room = rooms(np.random.default_rng(1), 30, 12, 2.0)
    by_room, by_frame = (np.diff(interval(values, unit)) for unit in (room, np.arange(len(room))))
    assert by_room > 2.5 * by_frame


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
