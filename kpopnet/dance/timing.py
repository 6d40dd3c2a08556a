"""What the delays of the windows tell: the tempo of a learner, and the latency of a set-up."""

import math

import numpy as np

MIN_POSTURE = 50.0
"""Windows of a lower posture score tell nothing about time: what they were matched with may be chance."""

MIN_WINDOWS = 6
"""Fewer windows tell no tempo."""


def tempo(start_s: np.ndarray, delay_s: np.ndarray, posture: np.ndarray) -> float:
    """The learner's tempo divided by the teacher's, from the slope of the delay.

    A learner at r times the teacher's tempo shows at time t what the teacher shows at r t, so the delay grows by 1 - r a
    second. The slope is the median over pairs of windows (Theil 1950), so that windows matched in a wrong place do not count.

    Args:
        start_s: (N,) start of each window, seconds.
        delay_s: (N,) delay, seconds; NaN where unknown.
        posture: (N,) posture score, 0 to 100.

    Returns:
        1 for equal tempo; NaN with fewer than MIN_WINDOWS windows of a known delay and a posture of at least MIN_POSTURE.
    """
    good = np.isfinite(delay_s) & (posture >= MIN_POSTURE)
    if good.sum() < MIN_WINDOWS:
        return math.nan
    first, second = np.triu_indices(int(good.sum()), 1)
    slopes = (delay_s[good][second] - delay_s[good][first]) / (start_s[good][second] - start_s[good][first])
    return float(1 - np.median(slopes))


def measured_latency_s(delay_s: np.ndarray, posture: np.ndarray) -> float:
    """The constant delay of a set-up, for `ScorerConfig.latency_s`, from a short dance that somebody danced on time.

    Args:
        delay_s: (N,) delays of the windows of that dance, seconds; NaN where unknown.
        posture: (N,) posture scores, 0 to 100.

    Returns:
        Median over the windows of a posture of at least MIN_POSTURE, seconds; NaN with fewer than MIN_WINDOWS of them.
    """
    good = np.isfinite(delay_s) & (posture >= MIN_POSTURE)
    return float(np.median(delay_s[good])) if good.sum() >= MIN_WINDOWS else math.nan
