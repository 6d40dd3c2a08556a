"""Joints brought to even frames by their time stamps, smoothed, short gaps closed: all by one robust local regression.

Around each instant a straight line is fitted to every joint's samples, weighted by a Gaussian in time, and once more with
samples that lie far from the first line weighted down (after LOWESS, Cleveland 1979). Frame rates may differ and frames be
missing; a joint that jumps away for a frame or two hardly moves the line.
"""

import math

import numpy as np
from numba import njit

GAP_S = 0.25
"""A joint that is missing for longer stays missing."""

OUTLIER_M = 0.15
"""A sample so far from the first line has half its weight in the second: far beyond noise and what a straight line misses
of a dance."""

TOLERANCE_S = 1e-6
"""Time stamps are written with rounding."""

_REACH = 3.0  # standard deviations of the Gaussian


def reach_s(smoothing_s: float) -> float:
    """How far away in time samples count."""
    return max(_REACH * smoothing_s, GAP_S)


def resampled(joints_m: np.ndarray, times_s: np.ndarray, at_s: np.ndarray, smoothing_s: float) -> np.ndarray:
    """The joints at other times.

    Args:
        joints_m: (T, 15, 3), NaN where missing.
        times_s: (T,) strictly increasing.
        at_s: (G,) increasing.
        smoothing_s: standard deviation of the Gaussian, above 0.

    Returns:
        (G, 15, 3) float64; NaN before the first sample of a joint, after its last, and in gaps longer than GAP_S.
    """
    return _resampled(
        np.ascontiguousarray(joints_m, np.float64), np.asarray(times_s, np.float64), np.asarray(at_s, np.float64),
        float(smoothing_s), reach_s(smoothing_s),
    )  # fmt: skip


def resampled_confidence(confidence: np.ndarray, times_s: np.ndarray, at_s: np.ndarray, smoothing_s: float) -> np.ndarray:
    """(G, 15) the mean of (T, 15) confidence around other times, weighted by the same Gaussian; 0 where no sample is near.

    Times are as of `resampled`.
    """
    return _confidence(
        np.ascontiguousarray(confidence, np.float64), np.asarray(times_s, np.float64), np.asarray(at_s, np.float64),
        float(smoothing_s), reach_s(smoothing_s),
    )  # fmt: skip


@njit(cache=True)
def _near(times, at, reach):
    """(G, 2) for each instant the first sample within reach, and the one after the last."""
    near = np.empty((len(at), 2), np.int64)
    first = stop = 0
    for g in range(len(at)):
        while first < len(times) and times[first] < at[g] - reach:
            first += 1
        stop = max(first, stop)
        while stop < len(times) and times[stop] <= at[g] + reach:
            stop += 1
        near[g] = first, stop
    return near


@njit(cache=True)
def _confidence(confidence, times, at, smoothing, reach):
    result, near = np.zeros((len(at), confidence.shape[1])), _near(times, at, reach)
    for g in range(len(at)):
        weights = 0.0
        for i in range(near[g, 0], near[g, 1]):
            weight = math.exp(-0.5 * ((times[i] - at[g]) / smoothing) ** 2)
            weights += weight
            result[g] += weight * confidence[i]
        if weights > 0:
            result[g] /= weights
    return result


@njit(cache=True)
def _resampled(joints, times, at, smoothing, reach):
    num_joints = joints.shape[1]
    result, near = np.full((len(at), num_joints, 3), np.nan), _near(times, at, reach)
    for g in range(len(at)):
        first, stop = near[g]
        for j in range(num_joints):
            before, after = np.inf, np.inf
            for i in range(first, stop):
                if not math.isnan(joints[i, j, 0]):
                    away = times[i] - at[g]
                    if away <= TOLERANCE_S:
                        before = min(before, abs(away))
                    if away >= -TOLERANCE_S:
                        after = min(after, abs(away))
            if before + after <= GAP_S:
                _line(joints[first:stop, j], times[first:stop] - at[g], smoothing, result[g, j])
    return result


@njit(cache=True)
def _line(points, away, smoothing, value):
    """The value at away = 0 of a line through the points, twice; the second time without outliers."""
    slope = np.zeros(3)
    for robust in range(2):
        s0, s1, s2 = 0.0, 0.0, 0.0
        sum_x, sum_xt = np.zeros(3), np.zeros(3)
        for i in range(len(points)):
            if math.isnan(points[i, 0]):
                continue
            weight = math.exp(-0.5 * (away[i] / smoothing) ** 2)
            if robust:
                off = 0.0
                for c in range(3):
                    off += (points[i, c] - value[c] - slope[c] * away[i]) ** 2
                weight /= 1 + off / OUTLIER_M**2
            s0 += weight
            s1 += weight * away[i]
            s2 += weight * away[i] ** 2
            for c in range(3):
                sum_x[c] += weight * points[i, c]
                sum_xt[c] += weight * away[i] * points[i, c]
        spread = s0 * s2 - s1 * s1
        for c in range(3):
            if spread > 1e-9 * s0 * s0:
                slope[c] = (s0 * sum_xt[c] - s1 * sum_x[c]) / spread
                value[c] = (s2 * sum_x[c] - s1 * sum_xt[c]) / spread
            else:
                slope[c] = 0.0
                value[c] = sum_x[c] / s0
