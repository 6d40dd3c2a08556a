"""Why a phrase is wrong: what a teacher says before any joint is named.

- late entry, stood still: the learner's limbs rest where the teacher's move.
- mirrored, another phrase, something else: the phrase fits the teacher's mirror image, another place of the dance, or no place
  better than any.
- too small, too soft: amplitude, or sharpness, of most limbs is less than the teacher's (`kpopnet.dance.dimensions.movement`).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d

from kpopnet.dance.dimensions.movement import Dynamics, spread_rad
from kpopnet.dance.dimensions.stage import runs
from kpopnet.dance.dtw import banded_distances
from kpopnet.dance.features import Features, dance_features
from kpopnet.dance.parts import OUTLIER_RAD
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.window import BAND_S, FPS, LIMBS
from kpopnet.dance.words.moments import clock
from kpopnet.languages import Said
from kpopnet.skeleton import MIRROR

STILL, MOVING, SPREAD_S, MIN_STILL_S, RESTS = 0.3, 0.4, 1.0, 1.5, 0.4
"""The learner rests where the limbs spread, within the third, less than the first, and the teacher's more than the second, of
the teacher's mean spread where they dance, most of the time; a shorter rest is not mentioned. Half of what the teacher's spread
at the time is small and no rest: a rest is below the last share of it, also without the limb that lacks most of it, since one
limb that hangs is no rest where the others dance."""

MAX_POSTURE, MAX_ELSE, ELSE_LIMB, ELSE_LIMBS = 85.0, 40.0, 40.0, 0.5
"""A phrase of a greater posture is the teacher's; of a smaller one than the second it may be none of the dance, if at least
this share of the limbs is below the third: one wrong limb beside one that is a little off is named instead."""

FITS_BETTER, NO_BETTER = 0.6, 0.85
"""Distance of two poses, beside that of the same time, at which another fit is the cause; and beside that of any time, from
which on the fit of the same time is none."""

STRIDE = 3
"""Of the frames that are compared one in this number is taken: 10 a second."""

SMALL, SOFT, REDUCED_LIMBS = 0.8, 0.9, 0.75
"""Ratio to the teacher's below which amplitude is too small, and sharpness too soft, and least share of the limbs in which it
is: who dances well keeps 0.97 of the sharpness, who smooths all movements over 0.3 s (standard deviation) 0.6 to 0.9."""

CAUSES = {
    "late entry": Said("began late"),
    "stood still": Said("stood still"),
    "mirrored": Said("mirrored"),
    "another phrase": Said("danced another phrase"),
    "something else": Said("danced something else"),
    "too small": Said("movements too small"),
    "too soft": Said("movements too soft"),
}
"""By name, in words wherever it occurs."""

MIN_LOSS = 3.0
"""Points of posture that a phrase has to lose for its dynamics to be the cause."""


class Cause(NamedTuple):
    """Why a stretch of the dance is wrong, in seconds on the teacher's clock."""

    start_s: float
    end_s: float
    name: str  # one of `CAUSES`
    text: Said  # it in words, without the time

    @property
    def explains_timing(self) -> bool:
        """Whether delays mean nothing meanwhile."""
        return self.name not in ("too small", "too soft")


def causes(score: DanceScore, phrases_s: list[tuple[float, float]]) -> Iterator[Cause]:
    """The causes of a dance of phrases that begin and end at given seconds on the teacher's clock."""
    first_s, moved = float(score.windows.start_s[0]), score.dynamics
    rests, compared = list(_rests(score, first_s)), None
    yield from rests
    for start_s, end_s in phrases_s:
        inside = (score.windows.middle_s >= start_s) & (score.windows.middle_s < end_s) & (score.windows.weight > 0)
        rested_s = sum(max(min(one.end_s, end_s) - max(one.start_s, start_s), 0) for one in rests)
        if not np.isfinite(score.windows.timing[inside]).any() or 2 * rested_s > end_s - start_s:
            continue
        rows = slice(max(round((start_s - first_s) * FPS), 0), round((end_s - first_s) * FPS))  # a phrase may begin before
        posture, found = float(np.nanmean(score.windows.posture[inside])), None
        if posture <= MAX_POSTURE:
            compared = compared or _compared(score)
            found = _elsewhere(score, compared, rows, posture, inside)
        if not found and posture <= 100 - MIN_LOSS:
            found = _reduced(moved, start_s - first_s, end_s - first_s)
        if found:
            yield Cause(start_s, end_s, *found)


def _rests(score: DanceScore, first_s: float) -> Iterator[Cause]:
    """Where the learner rests and the teacher moves."""
    frames = round(SPREAD_S * FPS)
    limbs = [spread_rad(joints_m, frames) for joints_m in score.compared_m]
    taught, danced = (np.linalg.norm(one, axis=1) for one in limbs)
    mean = _mean_of_dance(score, taught)
    moving = taught[: len(danced)] >= MOVING * mean
    begin = int(np.argmax(moving)) if moving.any() else 0
    still, half = danced < STILL * mean, frames // 2
    rests = still & (danced < RESTS * taught[: len(danced)])
    missed_most = (limbs[0][: len(danced)] ** 2 - limbs[1] ** 2).argmax(axis=1)
    others = missed_most[:, None] != np.arange(len(LIMBS))
    taught_others, danced_others = (np.linalg.norm(one[: len(danced)] * others, axis=1) for one in limbs)
    rests &= danced_others < RESTS * taught_others
    for run in runs(maximum_filter1d(still.astype(np.int8), frames) > 0):
        moves = run.start + np.flatnonzero((moving & rests)[run])
        if not len(moves) or 2 * len(moves) < moves[-1] - moves[0]:
            continue
        # Around the middle of a still second all of it is still.
        run = slice(max(int(moves[0]) - half, 0), min(int(moves[-1]) + half, len(danced)))
        seconds = (run.stop - run.start) / FPS
        if seconds >= MIN_STILL_S:
            late = run.start <= begin + half and run.stop < len(danced) - frames  # and began before the end
            text = "began {seconds} s late" if late else "stood still for {seconds} s"
            text = Said(text, seconds=f"{seconds:.0f}")
            yield Cause(first_s + run.start / FPS, first_s + run.stop / FPS, "late entry" if late else "stood still", text)


def _mean_of_dance(score: DanceScore, taught: np.ndarray) -> float:
    """The mean of (T,) values of the teacher's frames, in which those count as much as the teacher moves."""
    middle = (score.windows.middle_s - score.windows.start_s[0]) * FPS
    weight = np.where(np.isfinite(taught), np.interp(np.arange(len(taught)), middle, score.windows.weight), 0.0)
    return float(np.nan_to_num(taught) @ weight / weight.sum()) if weight.any() else 0.0


def _compared(score: DanceScore) -> list[Features]:
    """Of the whole dance: the learner's of every frame, the teacher's and its mirror image's of every STRIDE-th."""
    teacher_m, mirror = score.teacher_m, [-1.0, 1.0, 1.0]
    dances_m = score.compared_m[1], teacher_m, teacher_m[:, MIRROR] * mirror
    learner, *teachers = (dance_features(joints_m, score.scorer.feature, FPS) for joints_m in dances_m)
    return [learner, *map(_strided, teachers)]


def _elsewhere(
    score: DanceScore, compared: list[Features], rows: slice, posture: float, inside: np.ndarray
) -> tuple[str, Said] | None:
    """Which other part of the dance, or its mirror image, a phrase of frames with (N,) windows inside fits: name and text.

    None if it fits neither.
    """
    whole, teacher, mirror = compared
    learner = _strided(whole, rows)
    first, band, middle = rows.start // STRIDE, round(BAND_S * FPS / STRIDE), len(teacher.angles_rad)
    if not len(learner.angles_rad):
        return None
    everywhere = _mean_distances(learner, teacher, first, middle)
    near = float(everywhere[max(middle - band, 0) : middle + band + 1].min())
    if not np.isfinite(near):
        return None
    if _mean_distances(learner, mirror, first, band).min() < FITS_BETTER * near:
        return "mirrored", CAUSES["mirrored"]
    best = int(everywhere.argmin())
    if everywhere[best] < FITS_BETTER * near:
        # Half of a phrase may lie before the dance begins.
        at_s = float(score.windows.start_s[0]) + max(first + best - middle, 0) * STRIDE / FPS
        return "another phrase", Said("danced what belongs at {time}", time=clock(at_s))
    limbs = np.array([score.windows.parts[name][inside] for name in LIMBS])
    limbs = np.nanmean(limbs[np.isfinite(limbs).any(axis=1)], axis=1)
    several = np.mean(limbs <= ELSE_LIMB) >= ELSE_LIMBS if len(limbs) else False
    if posture <= MAX_ELSE and several and near > NO_BETTER * np.median(everywhere[np.isfinite(everywhere)]):
        return "something else", CAUSES["something else"]
    return None


def _strided(features: Features, rows: slice = slice(None)) -> Features:
    return Features(*(np.ascontiguousarray(array[rows][::STRIDE]) for array in features))


def _mean_distances(learner: Features, teacher: Features, first: int, band: int) -> np.ndarray:
    """(2 band + 1,) mean distance at each delay of the learner's frames that are known; infinite where the teacher's dance has
    not half of them.
    """
    distances = banded_distances(learner, teacher, first, band, OUTLIER_RAD)[np.isfinite(learner.angles_rad).any(axis=1)]
    return mean_of_known(distances, len(distances) / 2)


def mean_of_known(distances: np.ndarray, least: float) -> np.ndarray:
    """(B,) means of the finite ones of (T, B) distances; infinite where there are fewer than `least`, or none."""
    finite = np.isfinite(distances)
    count = finite.sum(axis=0)
    mean = np.where(finite, distances, 0).sum(axis=0) / np.maximum(count, 1)
    return np.where(count >= max(least, 1), mean, np.inf)


def _reduced(moved: Dynamics, start_s: float, end_s: float) -> tuple[str, Said] | None:
    """Whether most limbs move too little, or too softly, from one to another second after the first frame."""
    inside = (moved.start_s >= start_s) & (moved.start_s + 1 < end_s)
    for name, ratios, least in (("too small", moved.amplitude, SMALL), ("too soft", moved.sharpness, SOFT)):
        logs = np.log(ratios[inside])
        shown = np.isfinite(logs).any(axis=0)
        of_limbs = np.exp(np.nanmean(logs[:, shown], axis=0))
        if len(of_limbs) > 1 and np.mean(of_limbs < least) >= REDUCED_LIMBS:
            share = float(np.exp(np.log(of_limbs[of_limbs < least]).mean()))  # of those that are: another may move more
            return name, Said("{what}, {percent}% of the teacher's", what=CAUSES[name], percent=f"{100 * share:.0f}")
    return None
