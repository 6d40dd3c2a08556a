"""The tempo of a learner and the latency of a set-up, from the delays of windows or from a metronome."""

import math

import numpy as np
from numpy.typing import ArrayLike

from kpopnet.dance.performance import numbers, poses
from kpopnet.errors import InputError, check_between
from kpopnet.skeleton import Joint

BEATS_S = 0.05, 10.0
"""Shortest and longest beat of a music, seconds."""

MIN_POSTURE = 50.0
"""Windows of a lower posture score may be matched by chance, so their delays do not count."""

MIN_WINDOWS = 6
"""Windows that a tempo or a latency needs."""

SURE_WINDOWS = 20
"""Windows of a tempo that need not be half of the dance: delays are bounded, so over 10 s chance makes no slope worth telling,
and who dances at another tempo leaves the band of delays before the half of a long dance."""

MOST_WINDOWS = 500
"""Windows whose pairs give a tempo: all pairs of a dance of two hours would take 4 GB."""

NEAR_SHARE = 1 / 3
"""Of a dance, how far apart pairs of windows are that give a tempo."""

MOST_SPREAD = 0.06
"""Median difference of the pairs' slopes from theirs beyond which they tell no tempo: who dances a fifth faster or slower soon
leaves the band of delays, and windows beyond it match by chance (docs/ledger.md)."""

HARMONICS, BEAT_STEPS = 3, 400
"""Of the mean course of a hand over a beat: waves of its Fourier series, and samples."""

TOP_SHARE = 0.1
"""The hand is up where it misses its highest point by less than this share of its way."""

MIN_BEAT_MOVEMENT_M, MIN_BEAT_SHARE, MIN_BEAT_SAMPLES = 0.15, 0.5, 60
"""For a latency: least path of the hand, share of its variance that repeats with the beat, and number of images."""


def tempo(start_s: np.ndarray, delay_s: np.ndarray, posture: np.ndarray, weight: np.ndarray) -> float:
    """The learner's tempo divided by the teacher's, from the slope of the delay.

    A learner at r times the teacher's tempo shows at time t what the teacher shows at r t, so the delay grows by 1 - r a
    second. The slope is the median over pairs of windows (Theil 1950), so that windows matched in a wrong place do not count:
    pairs that are apart by NEAR_SHARE of the dance at most, fewer than half of which go across a single pause in it.
    The (N,) start and delay of the windows are seconds, the delay NaN where unknown; those without weight do not count. NaN
    unless MIN_WINDOWS windows, and half of all or SURE_WINDOWS, have a known delay and a posture of at least MIN_POSTURE, and
    half of the slopes are within MOST_SPREAD of their median.
    """
    good = np.flatnonzero(np.isfinite(delay_s) & (posture >= MIN_POSTURE) & (weight > 0))
    if len(good) < max(MIN_WINDOWS, min((weight > 0).sum() / 2, SURE_WINDOWS)):
        return math.nan
    good = good[np.linspace(0, len(good) - 1, min(len(good), MOST_WINDOWS)).astype(int)]
    first, second = np.triu_indices(len(good), 1)
    rise_s, run_s = (one[good][second] - one[good][first] for one in (delay_s, start_s))
    near = run_s <= NEAR_SHARE * np.ptp(start_s[good])
    slopes = rise_s[near] / run_s[near]
    slope = np.median(slopes)
    return float(1 - slope) if np.median(abs(slopes - slope)) <= MOST_SPREAD else math.nan


def measured_latency_s(delay_s: ArrayLike, posture: ArrayLike, weight: ArrayLike) -> float:
    """The constant delay of a set-up, for `PartScorer.latency_s`, from a short dance that was danced on time.

    It is the median of the (N,) delays in seconds over the windows of a posture of at least MIN_POSTURE, in which the teacher
    moves: the others have no weight. NaN with fewer than MIN_WINDOWS of them.
    """
    delay_s, posture, weight = numbers("delays", delay_s), numbers("postures", posture), numbers("weights", weight)
    if not delay_s.shape == posture.shape == weight.shape:
        shapes = f"delays of shape {delay_s.shape}, postures of {posture.shape}, weights of {weight.shape}"
        raise InputError(f"{shapes}: expected one of each a window")
    good = np.isfinite(delay_s) & (posture >= MIN_POSTURE) & (weight > 0)
    return float(np.median(delay_s[good])) if good.sum() >= MIN_WINDOWS else math.nan


def beat_latency_s(joints_m: ArrayLike, times_s: ArrayLike, beat_s: float) -> float:
    """The constant delay of a set-up, from a person who raises an arm, or claps, on every beat of a metronome.

    The height of each hand and the nearness of the two repeat with the beat. Each is averaged over the beats, by a least
    squares fit of a Fourier series. The one that moves most on average counts, if enough of it repeats with the beat; its
    highest point lies on the beat, but for the delay. That is between minus and plus half a beat; NaN where no hand moves
    with the beat. The (T, 15, 3) joints are in a level camera's frame, NaN where missing; the metronome ticks at multiples of
    `beat_s` seconds on the clock of the (T,) times. Raises InputError for other shapes, times or beats.
    """
    check_between("seconds of a beat", beat_s, *BEATS_S)
    joints_m, times_s = poses(joints_m), numbers("times", times_s)
    if times_s.shape != joints_m.shape[:1] or not np.isfinite(times_s).all():
        raise InputError(f"{len(joints_m)} frames with times of shape {times_s.shape}: expected one time a frame, finite")
    left, right = joints_m[:, Joint.LEFT_HAND], joints_m[:, Joint.RIGHT_HAND]
    trunk_m = joints_m[:, Joint.TORSO, 1]
    signals = (trunk_m - left[:, 1], trunk_m - right[:, 1], -np.linalg.norm(left - right, axis=1))
    fits = [_mean_beat(signal, times_s / beat_s) for signal in signals]
    curve, moved_m, explained = max(fits, key=lambda fit: fit[1])
    if moved_m < MIN_BEAT_MOVEMENT_M or explained < MIN_BEAT_SHARE:
        return math.nan
    # An arm that is held up for a moment means the middle of it.
    highest, steps = int(curve.argmax()), np.arange(-BEAT_STEPS // 4, BEAT_STEPS // 4)
    high = curve[(highest + steps) % BEAT_STEPS] > curve.max() - TOP_SHARE * np.ptp(curve)
    phase = (highest + steps[high].mean()) / BEAT_STEPS
    return float((phase - round(phase)) * beat_s)


def _mean_beat(signal: np.ndarray, beats: np.ndarray) -> tuple[np.ndarray, float, float]:
    """The mean course over a beat, in BEAT_STEPS samples, of (T,) values at (T,) times in beats; its range; and the fraction
    of the signal's variance that repeats with the beat.
    """
    known = np.isfinite(signal)
    if known.sum() < MIN_BEAT_SAMPLES:
        return np.zeros(BEAT_STEPS), 0.0, 0.0
    waves = _waves(beats[known])
    # A straight line takes off what the learner drifts.
    columns = np.column_stack([np.ones(known.sum()), beats[known] - beats[known].mean(), waves])
    weights = np.linalg.lstsq(columns, signal[known], rcond=None)[0]
    course, rest = _waves(np.arange(BEAT_STEPS) / BEAT_STEPS) @ weights[2:], signal[known] - columns @ weights
    repeated = float(np.var(waves @ weights[2:]))
    return course, float(np.ptp(course)), repeated / (repeated + float(np.var(rest)) + 1e-12)


def _waves(beats: np.ndarray) -> np.ndarray:
    """(T, 2 HARMONICS) cosines and sines of (T,) times in beats."""
    angles = 2 * np.pi * beats[:, None] * np.arange(1, HARMONICS + 1)
    return np.concatenate([np.cos(angles), np.sin(angles)], axis=1)
