import numpy as np
import pytest

from kpopnet.evaluation.intervals import DRAWS, Bootstrap, percentiles


def interval(values: np.ndarray, unit: np.ndarray, seed: int) -> np.ndarray:
    bootstrap = Bootstrap(unit, seed)
    return np.array(bootstrap.interval(values, np.ones_like(values)))


def test_the_interval_over_rooms_contains_the_truth_in_95_of_100_evaluations():
    """Values of mean 0; rooms differ by twice as much as the frames of a room."""
    room, hits = np.repeat(np.arange(6), 12), 0
    for trial in range(400):
        rng = np.random.default_rng([7, trial])
        values = 2 * rng.normal(size=6)[room] + rng.normal(size=len(room))
        low, high = interval(values[:, None], room, seed=trial)
        hits += low <= 0 <= high
    assert 0.92 <= hits / 400 <= 0.98  # a standard error of 1.1 percent


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


def test_few_units_that_count_or_equal_ones_give_no_interval():
    rng = np.random.default_rng(3)
    hits, shown = rng.integers(1, 10, (20, 1)).astype(float), np.full((20, 1), 10.0)
    for counted in (20, 5, 4, 1):
        below = shown * (np.arange(20) < counted)[:, None]
        found = Bootstrap(np.arange(20), 0).interval(hits * (below > 0), below)
        assert (found is None) == (counted < 5), counted
    shown[5:] = hits[5:] = 0
    draws = Bootstrap(np.arange(20), 0).ratios(hits, shown)
    ends = np.percentile(draws[np.isfinite(draws)], percentiles(5))
    assert Bootstrap(np.arange(20), 0).interval(hits, shown) == pytest.approx(ends), "with the quantiles of five units"
    for always in (0.0, 1.0, 0.1):
        assert Bootstrap(np.arange(20), 0).interval(always * shown, shown) is None, always
    for unit in (np.zeros(4), np.zeros(0)):
        assert Bootstrap(unit, 0).interval(np.ones((len(unit), 3)), np.ones((len(unit), 3))) is None


def test_a_resample_holds_as_many_units_as_the_set():
    assert (Bootstrap(np.arange(6), 0).sums(np.ones((6, 1))) == 6).all()
