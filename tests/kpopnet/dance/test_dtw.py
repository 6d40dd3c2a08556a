"""Matching in time against exhaustive search, and the distance of two frames."""

import functools
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.dance.dtw import banded_distances, best_match, frame_distance
from kpopnet.dance.features import Features
from kpopnet.dance.paper import algorithm_3

COSTS = arrays(
    float, st.tuples(st.integers(1, 6), st.sampled_from([1, 3, 5, 7])),
    elements=st.sampled_from([0.0, 0.3, 0.7, 1.0, 1.9, np.inf]),
)  # fmt: skip


def plain(angles_rad, weights=1.0) -> Features:
    angles_rad = np.asarray(angles_rad, float)
    ones = np.ones_like(angles_rad)
    return Features(angles_rad, weights * ones, ones, np.full((len(ones), 15, 3), np.nan))


def slow_match(distances, slope, penalty, expected):
    """The least cost of all paths by exhaustive search; column = teacher's frame minus learner's frame plus band."""
    n, columns = distances.shape
    endpoint_cost = penalty * n / 2

    def at(i, k):
        return distances[i, k] if 0 <= i < n and 0 <= k < columns else math.inf

    @functools.cache
    def cost_from(i, k):
        if slope:  # both longer steps pass (i + 1, k); two cells of one of the learner's frames count half each
            both = at(i + 1, k)
            steps = ((i + 1, k, both), (i + 2, k - 1, both + at(i + 2, k - 1)), (i + 1, k + 1, (both + at(i + 1, k + 1)) / 2))
        else:
            steps = ((i + 1, k, at(i + 1, k)), (i + 1, k - 1, at(i + 1, k - 1)), (i, k + 1, at(i, k + 1)))
        ends_here = endpoint_cost * abs(k - expected) if i == n - 1 else math.inf
        return min([ends_here, *(cost + cost_from(row, column) for row, column, cost in steps if cost < math.inf)])

    return min(distances[0, k] + endpoint_cost * abs(k - expected) + cost_from(0, k) for k in range(columns))


def cost_of(path, distances, slope, penalty, expected):
    """The cost of a path, computed from its cells."""
    n = len(distances)
    total = penalty * n / 2 * (abs(path[0][1] - expected) + abs(path[-1][1] - expected))
    if not slope:
        return total + sum(distances[i, k] for i, k in path)
    rows = [i for i, _ in path]
    return total + sum(distances[i, k] / rows.count(i) for i, k in path)


@settings(max_examples=80, deadline=None)
@given(COSTS, st.booleans(), st.sampled_from([0.0, 0.1, 1.0]), st.integers(0, 6))
def test_the_best_match_is_the_best_of_all_paths(distances, slope, penalty, expected):
    expected = min(expected, distances.shape[1] - 1)
    least_cost = slow_match(distances, slope, penalty, expected)
    path = best_match(distances, slope, penalty, expected)
    if least_cost == math.inf:
        assert len(path) == 0
        return
    assert path[0, 0] == 0 and path[-1, 0] == len(distances) - 1
    assert cost_of(path.tolist(), distances, slope, penalty, expected) == pytest.approx(least_cost)
    learner, teacher = np.diff(path[:, 0]), np.diff(path.sum(axis=1))
    assert ((learner >= 0) & (learner <= 1) & (teacher >= 0) & (teacher <= 1) & (learner + teacher > 0)).all()
    if slope:
        for steps in (learner, teacher):  # neither waits for two steps in a row
            assert not any(a == 0 and b == 0 for a, b in itertools.pairwise(steps))


def test_beyond_the_teachers_dance_distances_are_infinite():
    teacher, learner = plain(np.zeros((10, 3))), plain(np.zeros((4, 3)))
    distances = banded_distances(learner, teacher, 8, 2, math.inf)
    assert np.isfinite(distances).tolist() == [[j < 10 for j in range(6 + i, 11 + i)] for i in range(4)]
    assert len(best_match(banded_distances(learner, teacher, 50, 2, math.inf), True, 0.0, 2)) == 0


def test_frames_that_the_teacher_lacks_neither_attract_nor_repel():
    teacher, learner = plain([[0.0], [1.0], [math.nan], [3.0]]), plain([[0.0], [math.nan]])
    distances = banded_distances(learner, teacher, 1, 1, math.inf)
    assert distances[0].tolist() == [0, 1, 0]
    assert distances[1].tolist() == [math.pi] * 3


@pytest.mark.parametrize(
    ("a", "b", "weights", "distance"),
    [
        ([3.1, 0, 0], [-3.1, 0, 0], 1, 2 * math.pi - 6.2), ([3.1, 0, 0], [-3.1, 0, 0], [0.25, 1, 1], math.pi - 3.1),
        ([0.5, 0, math.nan], [0, 0, 0], 1, 0.5 * math.sqrt(3 / 2)), ([0.5, math.nan, math.nan], [0, 0, 0], 1, math.nan),
    ],
)  # fmt: skip
def test_differences_are_wrapped_and_weighted_and_missing_ones_excluded(a, b, weights, distance):
    found = frame_distance(plain([a], weights), 0, plain([b]), 0, math.inf)
    assert found == pytest.approx(distance, nan_ok=True)


def slow_algorithm_3(learner, teacher, alpha, beta, tau):
    """The printed algorithm, with indices from 1."""
    n, m = len(learner), len(teacher)
    warped = {(0, 0): 0.0} | {(i, 0): math.inf for i in range(1, n + 1)} | {(0, j): math.inf for j in range(1, m + 1)}
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            norm = math.dist(learner[i - 1], teacher[j - 1])
            warped[i, j] = norm + min(warped[i - 1, j], warped[i, j - 1], warped[i - 1, j - 1])
    start = min(range(1, m + 1), key=lambda j: warped[1, j])
    end = min(range(1, m + 1), key=lambda j: warped[n, j])
    half = (end - start + 1) / 2
    timing = 1 - min(1, math.exp((abs(half - n / 2) - tau) / (alpha * tau)))
    return timing, math.exp(-warped[n, end] / (beta * half)), start


def test_algorithm_3_is_as_printed_with_its_faults():
    rng = np.random.default_rng(2)
    teacher, learner = rng.uniform(-1, 1, (30, 3)), rng.uniform(-1, 1, (20, 3))
    timing, posture, start = slow_algorithm_3(learner, teacher, 0.3, 2.0, 10)
    printed = algorithm_3(plain(learner), plain(teacher), 0.3, 2.0, 10)
    assert printed[:2] == pytest.approx((timing, posture))
    assert start == 1  # for any data
    late = algorithm_3(plain(teacher[5:25]), plain(teacher), 0.3, 2.0, 10)
    assert late[1] < 0.9  # a perfect copy that is late is not found
