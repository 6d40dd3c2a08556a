"""Noise in time of sequences whose noise is known."""

import numpy as np
import pytest

from synth.realism.noise import temporal_noise

STILL_STEPS = 125.0  # 2.76 m


def sequence(noise_steps: np.ndarray) -> np.ndarray:
    return (345 / (STILL_STEPS + noise_steps)).astype(np.float32)


def white(std_steps: float, shape: tuple[int, ...] = (42, 60, 80)) -> np.ndarray:
    return std_steps * np.random.default_rng(0).normal(size=shape)


@pytest.mark.parametrize("std_steps", [0.05, 0.15])
def test_white_noise_has_twice_its_variance_in_differences_and_no_correlation(std_steps: float) -> None:
    found = temporal_noise(sequence(white(std_steps)))
    assert found.variance_steps2 == pytest.approx(2 * std_steps**2, rel=0.03)
    assert found.correlation == pytest.approx(0, abs=0.03)


def test_noise_that_neighbours_share_is_correlated() -> None:
    noise = white(0.15, (42, 60, 81))
    shared = (noise[..., 1:] + noise[..., :-1]) / 2
    found = temporal_noise(sequence(shared))
    assert found.variance_steps2 == pytest.approx(0.15**2, rel=0.05)
    assert found.correlation == pytest.approx(0.5, abs=0.03)


def test_what_moves_or_is_steep_or_far_away_is_no_noise() -> None:
    still = white(0.1)
    whole = temporal_noise(sequence(still))
    moving = still.copy()
    for frame, image in enumerate(moving):
        image[10:40, frame : frame + 20] += 20  # a person who walks through the image
    found = temporal_noise(sequence(moving))
    assert found.variance_steps2 == pytest.approx(whole.variance_steps2, rel=0.1)
    steep = still + 3.0 * np.arange(80)
    assert temporal_noise(sequence(steep)) is None
    assert temporal_noise(sequence(still - 60)) is None


def test_a_sequence_without_depth_or_too_short_has_no_noise() -> None:
    assert temporal_noise(np.zeros((42, 60, 80), np.float32)) is None
    assert temporal_noise(sequence(white(0.1))[:9]) is None
