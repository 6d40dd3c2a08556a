"""The latency of a set-up, from a person who moves on the beat, and the tempo of a dance."""

import tracemalloc

import numpy as np
import pytest

from kpopnet.dance.timing import beat_latency_s, tempo
from kpopnet.skeleton import Joint

BEAT_S = 1.0


def moving(late_s: float, kind: str, seconds: float = 10.0, noise_m: float = 0.02):
    """(T, 15, 3) joints of a person who raises an arm or claps late, and (T,) times of irregular images."""
    rng = np.random.default_rng(5)
    times_s = np.cumsum(rng.uniform(0.02, 0.06, round(seconds / 0.04)))
    near = (1 + np.cos(2 * np.pi * (times_s - late_s) / BEAT_S)) / 2  # 1 on the beat
    joints_m = np.zeros((len(times_s), 15, 3))
    joints_m[:, :, 2] = 2.5
    joints_m[:, Joint.RIGHT_HAND], joints_m[:, Joint.LEFT_HAND] = [-0.3, 0.3, 2.5], [0.3, 0.3, 2.5]
    if kind == "wave":
        joints_m[:, Joint.LEFT_HAND, 1] -= np.minimum(near, 0.8)  # the arm stays up for a moment
    elif kind == "clap":
        for hand, side in ((Joint.LEFT_HAND, 0.3), (Joint.RIGHT_HAND, -0.3)):
            joints_m[:, hand, 0] = side * (1 - near**2)
    joints_m += rng.normal(0, noise_m, joints_m.shape)
    joints_m[rng.random(joints_m.shape[:2]) < 0.05] = np.nan
    return joints_m + np.array([0, 0, 0.02]) * times_s[:, None, None], times_s


@pytest.mark.parametrize("kind", ["wave", "clap"])
@pytest.mark.parametrize("late_s", [-0.2, 0.4])
def test_the_delay_of_a_hand_that_moves_on_the_beat_is_measured(kind, late_s):
    assert beat_latency_s(*moving(late_s, kind), BEAT_S) == pytest.approx(late_s, abs=0.02)


def test_who_does_not_move_on_the_beat_tells_nothing():
    assert np.isnan(beat_latency_s(*moving(0.1, "stands"), BEAT_S))
    joints_m, times_s = moving(0.1, "wave")
    assert np.isnan(beat_latency_s(joints_m, times_s * 1.37, BEAT_S))  # to a beat of their own
    assert np.isnan(beat_latency_s(joints_m[:20], times_s[:20], BEAT_S))
    assert np.isnan(beat_latency_s(np.full_like(joints_m, np.nan), times_s, BEAT_S))


def test_the_tempo_of_a_dance_of_two_hours_takes_little_memory():
    start_s, rng = 0.5 * np.arange(14400), np.random.default_rng(0)
    tracemalloc.start()
    found = tempo(start_s, -0.02 * start_s + rng.normal(0, 0.1, len(start_s)), *np.full((2, len(start_s)), 90.0))
    assert found == pytest.approx(1.02, abs=1e-4) and tracemalloc.get_traced_memory()[1] < 50e6
    tracemalloc.stop()
