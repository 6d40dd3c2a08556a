"""Resamples joints at given times, smooths them and closes short gaps, all by one robust local linear regression.

At each output time a straight line is fitted to every joint's samples, weighted by a Gaussian in time. It is then refitted with
lower weights for samples far from the first line (after LOWESS, Cleveland 1979). Frame rates may differ and frames may be
missing. A joint that jumps away for one or two frames hardly moves the line.
"""

import math

import numpy as np
from numba import njit

from kpopnet.errors import InputError

MAX_GAP_S = 0.25
"""Longer gaps in a joint's samples are not closed."""

OUTLIER_M = 0.15
"""A sample at this distance from the first line has half its weight in the second fit. The distance is far beyond noise and
beyond the deviation of a dance from a straight line."""

TIME_TOLERANCE_S = 1e-6
"""Allows for rounding of stored time stamps."""

_KERNEL_RADIUS = 3.0  # standard deviations of the Gaussian


def kernel_radius_s(smoothing_s: float) -> float:
    """Greatest distance in time, in seconds, of a sample with weight, for a Gaussian of standard deviation `smoothing_s`."""
    return max(_KERNEL_RADIUS * smoothing_s, MAX_GAP_S)


def resampled(joints_m: np.ndarray, times_s: np.ndarray, at_s: np.ndarray, smoothing_s: float) -> np.ndarray:
    """The joints at given times.

    Args:
        joints_m: (T, 15, 3), NaN where missing.
        times_s: (T,) seconds, strictly increasing.
        at_s: (G,) output times, seconds, increasing.
        smoothing_s: standard deviation of the Gaussian, seconds, above 0.

    Returns:
        (G, 15, 3) float64; NaN before the first sample of a joint, after its last, and in gaps longer than MAX_GAP_S.

    Raises:
        InputError: there is not one time for every frame.
    """
    _check_lengths(joints_m, times_s, at_s)
    return _resampled(
        np.ascontiguousarray(joints_m, np.float64), np.asarray(times_s, np.float64), np.asarray(at_s, np.float64),
        float(smoothing_s), kernel_radius_s(smoothing_s),
    )  # fmt: skip


def resampled_confidence(confidence: np.ndarray, times_s: np.ndarray, at_s: np.ndarray, smoothing_s: float) -> np.ndarray:
    """Mean confidence around given times, weighted by the Gaussian of `resampled`.

    Args:
        confidence: (T, 15) in 0..1.
        times_s: See `resampled`.
        at_s: See `resampled`.
        smoothing_s: See `resampled`.

    Returns:
        (G, 15) float64; 0 where no sample lies within the kernel.

    Raises:
        InputError: there is not one time for every frame.
    """
    _check_lengths(confidence, times_s, at_s)
    return _confidence(
        np.ascontiguousarray(confidence, np.float64), np.asarray(times_s, np.float64), np.asarray(at_s, np.float64),
        float(smoothing_s), kernel_radius_s(smoothing_s),
    )  # fmt: skip


def _check_lengths(samples: np.ndarray, times_s: np.ndarray, at_s: np.ndarray) -> None:
    if np.shape(times_s) != np.shape(samples)[:1] or np.ndim(at_s) != 1:
        raise InputError(f"{len(samples)} samples at times of shape {np.shape(times_s)}: expected one time a sample")


@njit(cache=True)
def _kernel_ranges(times, at, radius):
    """(G, 2) for each output time the number of the first sample within the radius, and one past the last."""
    ranges = np.empty((len(at), 2), np.int64)
    first = stop = 0
    for g in range(len(at)):
        while first < len(times) and times[first] < at[g] - radius:
            first += 1
        stop = max(first, stop)
        while stop < len(times) and times[stop] <= at[g] + radius:
            stop += 1
        ranges[g] = first, stop
    return ranges


@njit(cache=True)
def _confidence(confidence, times, at, smoothing, radius):
    result, ranges = np.zeros((len(at), confidence.shape[1])), _kernel_ranges(times, at, radius)
    for g in range(len(at)):
        weights = 0.0
        for i in range(ranges[g, 0], ranges[g, 1]):
            weight = math.exp(-0.5 * ((times[i] - at[g]) / smoothing) ** 2)
            weights += weight
            result[g] += weight * confidence[i]
        if weights > 0:
            result[g] /= weights
    return result


@njit(cache=True)
def _resampled(joints, times, at, smoothing, radius):
    num_joints = joints.shape[1]
    result, ranges = np.full((len(at), num_joints, 3), np.nan), _kernel_ranges(times, at, radius)
    for g in range(len(at)):
        first, stop = ranges[g]
        for j in range(num_joints):
            before, after = np.inf, np.inf
            for i in range(first, stop):
                if not math.isnan(joints[i, j, 0]):
                    offset = times[i] - at[g]
                    if offset <= TIME_TOLERANCE_S:
                        before = min(before, abs(offset))
                    if offset >= -TIME_TOLERANCE_S:
                        after = min(after, abs(offset))
            if before + after <= MAX_GAP_S:
                _fit_line(joints[first:stop, j], times[first:stop] - at[g], smoothing, result[g, j])
    return result


@njit(cache=True)
def _fit_line(points, offsets, smoothing, value):
    """Writes the value at offset 0 of the robust regression line into `value`: (n, 3) points at (n,) offsets in seconds."""
    slope = np.zeros(3)
    for robust in range(2):
        s0, s1, s2 = 0.0, 0.0, 0.0
        sum_x, sum_xt = np.zeros(3), np.zeros(3)
        for i in range(len(points)):
            if math.isnan(points[i, 0]):
                continue
            weight = math.exp(-0.5 * (offsets[i] / smoothing) ** 2)
            if robust:
                squared_m2 = 0.0
                for c in range(3):
                    squared_m2 += (points[i, c] - value[c] - slope[c] * offsets[i]) ** 2
                weight /= 1 + squared_m2 / OUTLIER_M**2
            s0 += weight
            s1 += weight * offsets[i]
            s2 += weight * offsets[i] ** 2
            for c in range(3):
                sum_x[c] += weight * points[i, c]
                sum_xt[c] += weight * offsets[i] * points[i, c]
        determinant = s0 * s2 - s1 * s1
        for c in range(3):
            if determinant > 1e-9 * s0 * s0:
                slope[c] = (s0 * sum_xt[c] - s1 * sum_x[c]) / determinant
                value[c] = (s2 * sum_x[c] - s1 * sum_xt[c]) / determinant
            else:
                slope[c] = 0.0
                value[c] = sum_x[c] / s0
