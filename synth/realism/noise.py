"""Noise of a still surface in time, before a camera that stands still."""

from typing import NamedTuple

import numpy as np

from synth.realism.shapes import STEPS_PER_M

WINDOW = 5
"""Frames before and after a pair of frames whose means must agree where the surface is still."""

STILL_STEPS = 0.2
"""Largest difference of these means. They do not include the pair itself, so the choice does not depend on its noise."""

PASSING_STEPS = 0.75
"""Largest difference between the mean of the pair and that of the frames around: more is something that passed by. The mean
of two values with white noise is independent of their difference."""

DISTANCE_M = (2.0, 3.5)
"""Depths at which noise is compared: those of people in UTD-MHAD. Even in disparity steps, noise grows with the distance."""

FLAT_STEPS = 0.7
"""Largest difference of neighbours: on steeper surfaces, such as a floor, a sensor's lateral noise moves the depth too."""

LEAST_PIXELS = 500


class TemporalNoise(NamedTuple):
    """Differences of successive frames at still pixels.

    Attributes:
        variance_steps2: their variance, squared disparity steps.
        correlation: their correlation at a distance of one pixel along the rows.
    """

    variance_steps2: float
    correlation: float


def temporal_noise(depth_m: np.ndarray) -> TemporalNoise | None:
    """Temporal noise of a sequence; None where fewer than LEAST_PIXELS differences of still pixels are found.

    A pixel is still in a pair of frames if it lies in DISTANCE_M in all frames around, the means of the WINDOW frames before
    and after agree with each other and with that of the pair, and so do those of its four neighbours. People sway, so on
    people this is an upper bound of the sensor's noise.

    Args:
        depth_m: (T, H, W) float32 metres of a static camera, 0 where nothing was measured.
    """
    differences, products = [], []
    for first in range(0, len(depth_m) - 2 * WINDOW - 1, WINDOW):
        frames = depth_m[first : first + 2 * WINDOW + 2]
        measured = np.logical_and(frames > DISTANCE_M[0], frames < DISTANCE_M[1]).min(axis=0)
        steps = STEPS_PER_M / np.where(measured, frames, 1).astype(np.float64)
        before, after = steps[:WINDOW].mean(axis=0), steps[-WINDOW:].mean(axis=0)
        around, pair = (before + after) / 2, (steps[WINDOW] + steps[WINDOW + 1]) / 2
        still = measured & (np.abs(before - after) < STILL_STEPS) & (np.abs(pair - around) < PASSING_STEPS)
        still &= _is_flat(around, measured)
        change = steps[WINDOW + 1] - steps[WINDOW]
        differences.append(change[still])
        both = still[:, 1:] & still[:, :-1]
        products.append((change[:, 1:] * change[:, :-1])[both])
    changes, pairs = np.concatenate([np.empty(0), *differences]), np.concatenate([np.empty(0), *products])
    if len(changes) < LEAST_PIXELS or not len(pairs) or not changes.any():
        return None
    variance = np.mean(changes**2)
    return TemporalNoise(float(variance), float(pairs.mean() / variance))


def _is_flat(steps: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(H, W) bool: the four neighbours are measured and differ by less than FLAT_STEPS; false at the border."""
    flat = np.zeros(steps.shape, bool)
    middle = np.s_[1:-1, 1:-1]
    flat[middle] = True
    for beside in (np.s_[:-2, 1:-1], np.s_[2:, 1:-1], np.s_[1:-1, :-2], np.s_[1:-1, 2:]):
        flat[middle] &= measured[beside] & (np.abs(steps[beside] - steps[middle]) < FLAT_STEPS)
    return flat
