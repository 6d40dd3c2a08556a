"""How the limbs move: amplitude, energy and sharpness beside the teacher's, and the accents against the beats of the music.

A limb moves as the directions of its two bones in the torso's frame do, so that the camera, the body's size and its way on the
stage count nothing. Within a stretch of WINDOW_S, at the frames that the windows matched in time,

- amplitude is the deviation of the directions from their mean, radians;
- energy is the root of their mean squared speed, radians per second;
- sharpness is energy divided by amplitude: of two movements of equal size the sharp one is faster, and then rests.

A figure, 0 to 100, is the mean of exp(-(log ratio / LOG_SCALE)^2) over stretches and limbs, each weighted by the teacher's
amplitude. None of them is part of the similarity of the dance.

Accents are where the limbs' speed is least, as in the beat alignment of AIST++ (Li et al. 2021). Where the teacher's lie
within a beat is what the learner's are held against: a dancer may arrive on the beat or start with it.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d, uniform_filter1d

from kpopnet.dance.features import limb_directions
from kpopnet.dance.performance import poses
from kpopnet.dance.window import FPS, WINDOW_FRAMES
from kpopnet.errors import InputError
from kpopnet.languages import Said

LIMBS = ("right arm", "left arm", "right leg", "left leg")
"""In the order of `kpopnet.dance.features.limb_directions`."""

LOG_SCALE = math.log(1.6)
"""A ratio of 1.6, or of 1 / 1.6, to the teacher leaves 37 points of a figure."""

FLOOR_RAD, FLOOR_RAD_S = 0.05, 0.2
"""Added to amplitude and energy, so that trembling beside a limb that rests has no ratio."""

LEAST_AMPLITUDE = 0.2
"""A limb that the teacher moves less has no figure, radians."""

LAG = 4
"""Frames over which speed is measured: short beside an accent, long beside an estimator's trembling."""

HOP_FRAMES = round(0.5 * FPS)
ACCENT_SMOOTHING, ACCENT_DEPTH = 0.05 * FPS, 0.3
"""Standard deviation in frames by which speed is smoothed, and least depth of an accent as a fraction of the mean speed."""

MIN_ACCENTS, MIN_ALIGNMENT = 6, 0.3
"""Number of accents, and length of the mean direction of the teacher's on the circle of a beat, that a rhythm needs."""

STEADY_S = 0.05
"""Spread of the accents beyond the teacher's, seconds, from which on a learner is called unsteady."""


class Dynamics(NamedTuple):
    """How large, fast and sharp a learner moves."""

    figures: dict[str, float]  # "amplitude", "energy" and "sharpness", 0 to 100; empty where no limb could be compared
    # by limb and by name of a figure, the learner's divided by the teacher's, the geometric mean over the dance
    ratios: dict[str, dict[str, float]]
    start_s: np.ndarray  # (N,) begin of each stretch, seconds after the first frame
    amplitude: np.ndarray  # (N, 4) ratio of each of `LIMBS`, NaN where the teacher hardly moves it or it is not seen
    sharpness: np.ndarray  # (N, 4) likewise


class Rhythm(NamedTuple):
    """A learner's accents against the beats."""

    # 0 to 100: how near the accents are to the teacher's place in the beat, from accents anywhere to the teacher's
    figure: float
    ahead_s: float  # mean distance by which accents come before the teacher's place in the beat, seconds; negative behind
    spread_s: float  # standard deviation of that distance, of which the teacher's is subtracted, seconds

    def __str__(self) -> str:
        steadily = Said("steadily" if self.spread_s < STEADY_S else "unsteadily")
        if abs(self.ahead_s) < 0.04:
            return Said("{steadily} on the beat", steadily=steadily)
        text = "{steadily} {seconds} s ahead of the beat" if self.ahead_s > 0 else "{steadily} {seconds} s behind the beat"
        return Said(text, steadily=steadily, seconds=f"{abs(self.ahead_s):.2f}")


def dynamics(teacher_m: np.ndarray, learner_m: np.ndarray, matched: np.ndarray) -> Dynamics:
    """Compares the limbs of (T, 15, 3) joints at FPS frames a second, with the (T,) teacher's frame of each.

    Raises InputError for other shapes.
    """
    teacher_m, learner_m = poses(teacher_m), poses(learner_m)
    if np.shape(matched) != learner_m.shape[:1]:
        raise InputError(f"{len(learner_m)} frames matched with those of shape {np.shape(matched)}: expected one a frame")
    taught, danced = limb_directions(teacher_m), limb_directions(learner_m)
    starts = np.arange(0, len(danced) - WINDOW_FRAMES + 1, HOP_FRAMES)
    logs, weights = [], []
    for start in starts:
        begin = int(np.clip(matched[start + WINDOW_FRAMES // 2] - WINDOW_FRAMES // 2, 0, len(taught) - WINDOW_FRAMES))
        of_teacher = _amplitude_and_energy(taught[begin : begin + WINDOW_FRAMES])
        ratio = _amplitude_and_energy(danced[start : start + WINDOW_FRAMES]) + _FLOORS
        log = np.log(ratio / (of_teacher + _FLOORS))
        logs.append(np.stack([log[0], log[1], log[1] - log[0]]))
        weights.append(np.where(of_teacher[0] >= LEAST_AMPLITUDE, of_teacher[0], np.nan))
    log, weight = np.reshape(logs, (-1, 3, 4)), np.reshape(weights, (-1, 1, 4))
    known = np.isfinite(log * weight)
    weight, log = np.where(known, weight, 0.0), np.where(known, log, 0.0)
    total = weight.sum(axis=(0, 2))
    figures, ratios = {}, {}
    if (total > 0).all():
        mean = (weight * np.exp(-((log / LOG_SCALE) ** 2))).sum(axis=(0, 2)) / total
        figures = dict(zip(FIGURES, (100 * mean).tolist(), strict=True))
        of_limb = np.exp((weight * log).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-9))
        shown = [number for number in range(4) if weight[:, 0, number].any()]
        ratios = {LIMBS[number]: dict(zip(FIGURES, of_limb[:, number].tolist(), strict=True)) for number in shown}
    ratio = np.where(known, np.exp(log), np.nan)
    return Dynamics(figures, ratios, starts / FPS, ratio[:, 0], ratio[:, 2])


FIGURES: tuple[str, ...] = ("amplitude", "energy", "sharpness")
_FLOORS = np.array([[FLOOR_RAD], [FLOOR_RAD_S]])


def _amplitude_and_energy(directions: np.ndarray) -> np.ndarray:
    """(2, 4) amplitude in radians and energy in radians per second of (T, 4, 6) directions; NaN where a frame is missing."""
    amplitude = np.sqrt(directions.var(axis=0).sum(axis=1))
    steps = (directions[LAG:] - directions[:-LAG]) * FPS / LAG
    return np.stack([amplitude, np.sqrt((steps**2).mean(axis=0).sum(axis=1))])


def spread_rad(joints_m: np.ndarray, frames: int) -> np.ndarray:
    """(T, 4) amplitude of each limb within a number of frames around each; NaN where one of them is missing."""
    directions = limb_directions(joints_m).reshape(len(joints_m), -1)
    known = np.isfinite(directions).all(axis=1)
    directions[~known] = 0.0
    mean, squared = (uniform_filter1d(one, frames, axis=0) for one in (directions, directions**2))
    spread = np.sqrt(np.maximum(squared - mean**2, 0).reshape(len(joints_m), 4, -1).sum(axis=2))
    return np.where(minimum_filter1d(known.astype(np.int8), frames)[:, None] > 0, spread, np.nan)


def accents_s(joints_m: np.ndarray) -> np.ndarray:
    """Times in seconds after the first frame at which the limbs of (T, 15, 3) joints move least."""
    from scipy.signal import find_peaks  # slow to import

    if len(joints_m := poses(joints_m)) < 2:
        return np.zeros(0)
    directions = limb_directions(joints_m).reshape(len(joints_m), -1)
    speed = np.linalg.norm(np.gradient(directions, axis=0), axis=1) * FPS  # of all limbs together, radians per second
    known = np.isfinite(speed)
    if not known.any():
        return np.zeros(0)
    frames = np.arange(len(speed))
    smooth = gaussian_filter1d(np.interp(frames, frames[known], speed[known]), ACCENT_SMOOTHING)
    accents = find_peaks(-smooth, prominence=ACCENT_DEPTH * smooth.mean())[0]
    accents = accents[known[accents] & (accents > 0) & (accents < len(smooth) - 1)]
    before, here, after = smooth[accents - 1], smooth[accents], smooth[accents + 1]
    return (accents + (before - after) / (2 * np.maximum(before + after - 2 * here, 1e-9))) / FPS


def rhythm(teacher_m: np.ndarray, learner_m: np.ndarray, beats_s: np.ndarray) -> Rhythm | None:
    """The learner's accents against beats at (B,) increasing times in seconds after the first frame, two or more.

    None where too few accents are seen, or the teacher's do not lie at one place in the beat. Joints are as for `dynamics`.
    """
    if len(beats_s) < 2:
        return None
    taught, danced = (_in_beats(accents_s(joints_m), beats_s) for joints_m in (teacher_m, learner_m))
    if min(len(taught), len(danced)) < MIN_ACCENTS:
        return None
    own, of_learner = np.exp(2j * np.pi * taught).mean(), np.exp(2j * np.pi * danced).mean()
    if abs(own) < MIN_ALIGNMENT:
        return None
    beat_s = float(np.median(np.diff(beats_s)))
    behind = np.angle(of_learner / own) / (2 * math.pi)
    variance = _variance(danced, of_learner) - _variance(taught, own)
    figure = 100 * (of_learner / own).real  # the mean cosine of the distance to the teacher's place in the beat
    return Rhythm(float(min(max(figure, 0.0), 100.0)), float(-behind * beat_s), math.sqrt(max(variance, 0.0)) * beat_s)


def _in_beats(times_s: np.ndarray, beats_s: np.ndarray) -> np.ndarray:
    """Times in beats, of those within the beats."""
    inside = times_s[(times_s >= beats_s[0]) & (times_s <= beats_s[-1])]
    return np.interp(inside, beats_s, np.arange(len(beats_s)))


def _variance(beats: np.ndarray, mean: complex) -> float:
    """Of (N,) times in beats about their circular mean, in beats^2."""
    off = beats - np.angle(mean) / (2 * math.pi)
    return float(np.mean(((off + 0.5) % 1 - 0.5) ** 2))
