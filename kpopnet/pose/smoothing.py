"""Smoothing of joints over time."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

SIGMA_S = 1 / 30
"""Standard deviation of the Gaussian in time. A movement to and fro, twice a second, loses 8 % of its amplitude by it."""

LEAST_WEIGHT = 0.05
"""Weight of a joint of which the estimator is not sure at all: where all around it is unsure too, it counts."""


def smoothed(joints_m: np.ndarray, confidence: np.ndarray, fps: float) -> np.ndarray:
    """Averages each joint over the frames around it, by a Gaussian times the confidence.

    Args:
        joints_m: (T, J, 3) joints, NaN where missing.
        confidence: (T, J) in 0..1.
        fps: frames per second.

    Returns:
        (T, J, 3) float32; missing joints stay missing, and are not looked across: a joint after a gap does not know the one
        before it.
    """
    sigma = SIGMA_S * fps
    present = np.isfinite(joints_m).all(axis=-1)
    weights = np.where(present, np.maximum(confidence, LEAST_WEIGHT), 0.0)[..., None]
    values = np.where(present[..., None], joints_m, 0.0).astype(np.float64)
    out = np.full(joints_m.shape, np.nan, np.float32)
    for joint in range(joints_m.shape[1]):
        for part in _runs(present[:, joint]):
            weight = _filtered(weights[part, joint], sigma)
            out[part, joint] = _filtered(values[part, joint] * weights[part, joint], sigma) / weight
    return out


def _filtered(values: np.ndarray, sigma: float) -> np.ndarray:
    return gaussian_filter1d(values, sigma, axis=0, mode="nearest")


def _runs(present: np.ndarray) -> list[slice]:
    """The runs of True in (T,) bool."""
    edges = np.flatnonzero(np.diff(present, prepend=False, append=False))
    return [slice(start, stop) for start, stop in edges.reshape(-1, 2)]
