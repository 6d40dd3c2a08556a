"""Steady differences of a learner's angles: learnt, limited, and not mistaken for how they dance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.dance.bearing import STEP_RAD, Bearing
from kpopnet.dance.features import Features

FPS = 30
SECONDS = np.arange(20 * FPS) / FPS
DANCE = np.stack([np.sin(2 * SECONDS), 3.1 + 0.4 * np.cos(1.3 * SECONDS), np.cos(0.7 * SECONDS)], axis=1)


def features(angles_rad: np.ndarray, weight: float = 1.0) -> Features:
    wrapped = np.arctan2(np.sin(angles_rad), np.cos(angles_rad))
    return Features(wrapped, np.full(wrapped.shape, weight), np.ones_like(wrapped))


def apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.abs(np.arctan2(np.sin(a - b), np.cos(a - b)))


@given(st.lists(st.floats(-0.2, 0.2), min_size=3, max_size=3))
@settings(deadline=None)
def test_steady_differences_are_taken_out(off: list[float]) -> None:
    learner = features(DANCE + off)
    bearing = Bearing(3, 2 * FPS, 0.25)
    left = apart(bearing.taken_out(learner, features(DANCE), 0).angles_rad, DANCE)
    np.testing.assert_allclose(left[0], np.abs(off), atol=0.01)  # nothing is known at first
    # After n frames 60 / (n + 60) of it is left, or less.
    assert (left <= np.abs(off) * 61 / (60 + np.arange(1, 601))[:, None] + 1e-9).all()
    np.testing.assert_allclose(bearing.steady_rad, off, atol=0.02)


def test_no_more_is_taken_out_than_the_limit_and_nothing_where_nothing_is_learnt() -> None:
    learner, teacher = features(DANCE + 0.6), features(DANCE)
    for most in (0.25, 0.0):
        left = apart(Bearing(3, FPS, most).taken_out(learner, teacher, 0).angles_rad, DANCE)
        np.testing.assert_allclose(left[-1], 0.6 - most, atol=1e-9)
    assert Bearing(3, math.inf, 0.25).taken_out(learner, teacher, 0) is learner


def test_a_mistake_teaches_little() -> None:
    mistaken = DANCE.copy()
    mistaken[300:330] += 2.0
    once = Bearing(3, 2 * FPS, 0.25)
    once.taken_out(features(mistaken), features(DANCE), 0)
    assert np.abs(once.steady_rad).max() < 30 * STEP_RAD / 330


def test_what_is_missing_or_weighs_nothing_teaches_nothing() -> None:
    gaps = DANCE + 0.1
    gaps[:, 1] = np.nan
    bearing = Bearing(3, FPS, 0.25)
    found = bearing.taken_out(features(gaps), features(DANCE), 0).angles_rad
    assert np.isnan(found[:, 1]).all() and np.isfinite(found[:, [0, 2]]).all()
    assert bearing.steady_rad[1] == 0 < bearing.steady_rad[0]
    nothing = Bearing(3, FPS, 0.25)
    nothing.taken_out(features(DANCE + 0.1, weight=0.0), features(DANCE), 0)
    nothing.taken_out(features(DANCE + 0.1), features(DANCE), len(DANCE))  # the teacher has ended
    assert not nothing.steady_rad.any()


@pytest.mark.parametrize("cut", [1, 7, 599])
def test_frame_by_frame_is_all_at_once(cut: int) -> None:
    learner, teacher = features(DANCE + np.array((0.1, -0.2, 0.4))), features(DANCE)
    whole = Bearing(3, FPS, 0.25).taken_out(learner, teacher, 0).angles_rad
    bearing = Bearing(3, FPS, 0.25)
    parts = [
        bearing.taken_out(Features(*(array[begin : begin + cut] for array in learner)), teacher, begin).angles_rad
        for begin in range(0, len(DANCE), cut)
    ]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
