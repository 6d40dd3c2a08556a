"""Constant differences of a learner's angles are estimated and limited, and mistakes are not taken for them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.dance.angle_bias import MAX_RESIDUAL_RAD, AngleBias
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
def test_a_constant_bias_is_subtracted(offsets: list[float]) -> None:
    learner = features(DANCE + offsets)
    bias = AngleBias(3, 2 * FPS, 0.25)
    left = apart(bias.subtracted(learner, features(DANCE), 0).angles_rad, DANCE)
    np.testing.assert_allclose(left[0], np.abs(offsets), atol=0.01)  # the estimate starts at 0
    # After n frames 60 / (n + 60) of it is left, or less.
    assert (left <= np.abs(offsets) * 61 / (60 + np.arange(1, 601))[:, None] + 1e-9).all()
    np.testing.assert_allclose(bias.bias_rad, offsets, atol=0.02)


def test_the_bias_is_limited_and_can_be_switched_off() -> None:
    learner, teacher = features(DANCE + 0.6), features(DANCE)
    for max_bias_rad in (0.25, 0.0):
        left = apart(AngleBias(3, FPS, max_bias_rad).subtracted(learner, teacher, 0).angles_rad, DANCE)
        np.testing.assert_allclose(left[-1], 0.6 - max_bias_rad, atol=1e-9)
    assert AngleBias(3, math.inf, 0.25).subtracted(learner, teacher, 0) is learner


def test_a_mistake_hardly_changes_the_bias() -> None:
    mistaken = DANCE.copy()
    mistaken[300:330] += 2.0
    bias = AngleBias(3, 2 * FPS, 0.25)
    bias.subtracted(features(mistaken), features(DANCE), 0)
    assert np.abs(bias.bias_rad).max() < 30 * MAX_RESIDUAL_RAD / 330


def test_missing_angles_and_angles_without_weight_do_not_change_the_bias() -> None:
    gaps = DANCE + 0.1
    gaps[:, 1] = np.nan
    bias = AngleBias(3, FPS, 0.25)
    corrected = bias.subtracted(features(gaps), features(DANCE), 0).angles_rad
    assert np.isnan(corrected[:, 1]).all() and np.isfinite(corrected[:, [0, 2]]).all()
    assert bias.bias_rad[1] == 0 < bias.bias_rad[0]
    unweighted = AngleBias(3, FPS, 0.25)
    unweighted.subtracted(features(DANCE + 0.1, weight=0.0), features(DANCE), 0)
    unweighted.subtracted(features(DANCE + 0.1), features(DANCE), len(DANCE))  # the teacher has ended
    assert not unweighted.bias_rad.any()


@pytest.mark.parametrize("cut", [1, 7, 599])
def test_frame_by_frame_gives_the_same_as_all_frames_at_once(cut: int) -> None:
    learner, teacher = features(DANCE + np.array((0.1, -0.2, 0.4))), features(DANCE)
    whole = AngleBias(3, FPS, 0.25).subtracted(learner, teacher, 0).angles_rad
    bias = AngleBias(3, FPS, 0.25)
    parts = [
        bias.subtracted(Features(*(array[begin : begin + cut] for array in learner)), teacher, begin).angles_rad
        for begin in range(0, len(DANCE), cut)
    ]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
