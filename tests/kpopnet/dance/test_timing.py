"""The latency of a set-up, from a person who moves on the beat, and the tempo of a dance."""

import tracemalloc

import numpy as np
import pytest
from dance_people import FPS, dance_joints_m

from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.dance.timing import beat_latency_s, measured_latency_s, tempo
from kpopnet.skeleton import Joint

BEAT_S = 1.0


def clapping(late_s: float, noise_m: float = 0.02):
    """(250, 15, 3) joints of a person who claps late, and (250,) times of irregular images."""
    rng = np.random.default_rng(5)
    times_s = np.cumsum(rng.uniform(0.02, 0.06, 250))
    apart = 1 - ((1 + np.cos(2 * np.pi * (times_s - late_s) / BEAT_S)) / 2) ** 2  # 0 on the beat
    joints_m = np.full((len(times_s), 15, 3), (0, 0, 2.5))
    joints_m[:, Joint.RIGHT_HAND, 0], joints_m[:, Joint.LEFT_HAND, 0] = -0.3 * apart, 0.3 * apart
    joints_m += rng.normal(0, noise_m, joints_m.shape)
    joints_m[rng.random(joints_m.shape[:2]) < 0.05] = np.nan
    return joints_m + np.array([0, 0, 0.02]) * times_s[:, None, None], times_s


@pytest.mark.parametrize("late_s", [-0.2, 0.4])
def test_the_delay_of_hands_that_clap_on_the_beat_is_measured(late_s):
    assert beat_latency_s(*clapping(late_s), BEAT_S) == pytest.approx(late_s, abs=0.02)


def test_who_does_not_move_on_the_beat_tells_nothing():
    joints_m, times_s = clapping(0.1)
    assert np.isnan(beat_latency_s(joints_m, times_s * 1.37, BEAT_S))  # to a beat of their own
    assert np.isnan(beat_latency_s(joints_m[:20], times_s[:20], BEAT_S))


def test_the_tempo_of_a_dance_of_two_hours_takes_little_memory():
    start_s, rng = 0.5 * np.arange(14400), np.random.default_rng(0)
    tracemalloc.start()
    found = tempo(start_s, -0.02 * start_s + rng.normal(0, 0.1, len(start_s)), *np.full((2, len(start_s)), 90.0))
    assert found == pytest.approx(1.02, abs=1e-4) and tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()


@pytest.mark.parametrize("ratio", [0.95, 1.0, 1.06])
@pytest.mark.parametrize("pause_s", [0.0, 0.5])
def test_a_pause_is_no_tempo(ratio, pause_s):
    start_s = 0.5 * np.arange(36)
    delay_s = (1 - ratio) * start_s + pause_s * (start_s > 9)
    assert tempo(start_s, delay_s, *np.full((2, len(start_s)), 90.0)) == pytest.approx(ratio, abs=1e-6)


@pytest.mark.parametrize(("dance", "ratio", "told"), [(1, 1.15, True), (2, 1.25, False), (4, 0.7, False)])
def test_a_tempo_whose_windows_match_by_chance_is_not_told(dance, ratio, told):
    """Copies at another tempo, of which the last two soon leave the band of delays: 1.13 and 0.89 would be told."""
    joints_m = dance_joints_m(dance, 15.0)
    times_s = np.arange(len(joints_m)) / FPS
    found = score_dance(Performance(joints_m, times_s), Performance(joints_m, times_s / ratio)).tempo
    assert found == pytest.approx(ratio, abs=0.02) if told else np.isnan(found)


def test_a_latency_is_measured_where_the_window_is_no_chance_match():
    delay_s, weight = np.repeat([0.27, 1.1], [20, 30]), np.ones(50)
    assert measured_latency_s(delay_s, np.repeat([80.0, 30.0], [20, 30]), weight) == pytest.approx(0.27)
    assert np.isnan(measured_latency_s(delay_s[:5], np.full(5, 90.0), np.ones(5)))  # five windows are too few


@pytest.mark.parametrize("hand", [Joint.LEFT_HAND, Joint.RIGHT_HAND])
def test_the_delay_of_either_arm_that_is_up_on_the_beat_is_measured(hand):
    times_s = np.arange(300) / 30
    joints_m = np.random.default_rng(0).normal((0, 0, 2.5), 0.01, (300, 15, 3))
    joints_m[:, hand, 1] -= 0.5 * ((1 + np.cos(2 * np.pi * (times_s - 0.15))) / 2) ** 2
    assert beat_latency_s(joints_m, times_s, 1.0) == pytest.approx(0.15, abs=0.02)


def test_windows_without_weight_and_too_few_known_ones_tell_no_tempo():
    start_s = 0.5 * np.arange(36)
    delay_s, ones = -0.05 * start_s, np.ones(36)
    assert tempo(start_s, np.where(start_s < 12, delay_s, 0.3 * start_s), 90 * ones, 1.0 * (start_s < 12)) == pytest.approx(
        1.05
    )
    assert np.isnan(tempo(start_s, np.where(np.arange(36) < 10, delay_s, np.nan), 90 * ones, ones))  # 10 of 36
