"""Resamples joints at given times, smooths them and closes short gaps, all by one robust local linear regression.

At each output time a straight line is fitted to every joint's samples, weighted by a Gaussian in time. It is then refitted with
lower weights for samples far from the first line (after LOWESS, Cleveland 1979). Frame rates may differ and frames may be
missing. A joint that jumps away for one or two frames hardly moves the line.
"""

import math

import numpy as np
from numba import njit

SMOOTHING_S = 0.08
"""Standard deviation of the Gaussian. Twice as much or half as much orders no more dances (docs/ledger.md, Dance score)."""

MAX_GAP_S = 0.25
"""Longer gaps in a joint's samples are not closed."""

KERNEL_RADIUS_S = max(3.0 * SMOOTHING_S, MAX_GAP_S)
"""Greatest distance in time of a sample with weight."""

OUTLIER_M = 0.15
"""A sample at this distance from the first line has half its weight in the second fit. The distance is far beyond noise and
beyond the deviation of a dance from a straight line."""

TIME_TOLERANCE_S = 1e-6
"""Allows for rounding of stored time stamps."""


def resampled(
    joints_m: np.ndarray, confidence: np.ndarray, times_s: np.ndarray, at_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The (T, 15, 3) joints, NaN where missing, and their (T, 15) confidence at (G,) increasing times, all in seconds.

    Joints are NaN before a joint's first sample, after its last, and in gaps longer than MAX_GAP_S. Confidence is the mean
    weighted by the Gaussian, 0 where no sample lies within KERNEL_RADIUS_S.
    """
    arrays = (np.ascontiguousarray(one, np.float64) for one in (joints_m, confidence, times_s, at_s))
    return _resampled(*arrays)


@njit(cache=True)
def _resampled(joints, confidence, times, at):
    num_joints = joints.shape[1]
    joints_at, confidence_at = np.full((len(at), num_joints, 3), np.nan), np.zeros((len(at), num_joints))
    first = stop = 0  # samples within the kernel's radius
    for g in range(len(at)):
        while first < len(times) and times[first] < at[g] - KERNEL_RADIUS_S:
            first += 1
        stop = max(first, stop)
        while stop < len(times) and times[stop] <= at[g] + KERNEL_RADIUS_S:
            stop += 1
        weights = 0.0
        for i in range(first, stop):
            weight = math.exp(-0.5 * ((times[i] - at[g]) / SMOOTHING_S) ** 2)
            weights += weight
            confidence_at[g] += weight * confidence[i]
        if weights > 0:
            confidence_at[g] /= weights
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
                _fit_line(joints[first:stop, j], times[first:stop] - at[g], joints_at[g, j])
    return joints_at, confidence_at


@njit(cache=True)
def _fit_line(points, offsets, value):
    """Writes the value at offset 0 of the robust regression line into `value`: (n, 3) points at (n,) offsets in seconds."""
    slope = np.zeros(3)
    for robust in range(2):
        s0, s1, s2 = 0.0, 0.0, 0.0
        sum_x, sum_xt = np.zeros(3), np.zeros(3)
        for i in range(len(points)):
            if math.isnan(points[i, 0]):
                continue
            weight = math.exp(-0.5 * (offsets[i] / SMOOTHING_S) ** 2)
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
