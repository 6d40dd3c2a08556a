"""Scores one window of a learner's dance: timing by Eq. (13), posture by Eq. (14), and what differs in which part of the body.

In Eq. (14) the norm of the difference of two frames' features may be taken over the whole feature (`distance=whole`, as
printed), or over the angles of one part of the body at a time (`distance=parts`):

    s_i = mean over parts of seen * exp(-(|f_part| / beta)^2)

The exponential of the paper has a cusp at 0: it costs most per degree where nobody sees a difference, and least between wrong
and very wrong. The square costs nothing there and separates the latter. A mean over parts keeps one lost limb from hiding all
others. A part that is not seen scores 0, which is never more than it could score when seen. A turn moves the whole body through
the room: who misses a turn of the teacher's has every part at the wrong place, and up to half of s_i is taken off.

With `above_standing` s_i becomes max(0, (s_i - s_0) / (1 - s_0)), where s_0 is what somebody scores who stands still in the
teacher's mean pose: a skill score, as of forecasts (Murphy 1988). What all parts that the teacher does not move contribute to
s_i and to s_0 cancels, so the parts count as much as the teacher moves them. A window in which the teacher stands still, as
before the music begins, can be copied by anybody who stands: it counts in the dance's score as much as the teacher moves
(`movement`).

An estimator's errors add to the squared distance what they would add to a perfect dancer's. The squared distances of a window
are shrunk by the factor (1 - noise / distance)+ of James and Stein (1961), pooled over its frames and parts.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from kpopnet.dance.config import ScorerConfig
from kpopnet.dance.dtw import PathDistances, algorithm_3, best_match, constant_delay, distances_on_path
from kpopnet.dance.features import OF_EARLIER_FRAMES, Features, feature_names
from kpopnet.dance.noise import angle_variance

LIMBS = ("left arm", "right arm", "left leg", "right leg")
PARTS = (*LIMBS, "torso", "turning")
"""Parts of the body that are compared; `turning`, the turn of the whole body, only with `heading`."""

MIN_COMPARED_FRACTION = 0.5
"""A window in which a smaller fraction of the matched teacher's frames could be compared has no timing and scores 0, or, with
`distance=whole`, is excluded."""

MAX_STANDING = 0.75
"""Greatest score of standing still that is taken off, which limits the factor of `above_standing` to four. A teacher who
hardly moves would otherwise leave nothing to be scored."""

MIN_MOVEMENT = 0.1
"""A window counts fully if the best that somebody who stands still in it could score is less than 1 by at least this much,
otherwise in proportion."""


class WindowScore(NamedTuple):
    """Scores of one window, 0 to 100.

    Attributes:
        delay_s: delay of the learner, seconds; negative when early. NaN where too few frames could be compared.
        timing: S_t of Eq. (13); NaN with the delay.
        posture: S_p of Eq. (14); NaN where nothing could be compared and nothing can be said.
        parts: (P,) posture of each of `PARTS`, without regard to the others; NaN where the teacher does not show the part.
        coverage: (P,) fraction in 0..1 of the part in the teacher's frames that the learner shows; NaN likewise.
        error_rad: (D,) mean signed difference of each angle, learner minus teacher, in the middle `hop_s` of the window.
        error_weight: (D,) mean weight of these differences, 0..1; 0 where there are none.
    """

    delay_s: float
    timing: float
    posture: float
    parts: np.ndarray
    coverage: np.ndarray
    error_rad: np.ndarray
    error_weight: np.ndarray

    @property
    def similarity(self) -> float:
        """S_t S_p of Eq. (15); 0 where nobody is seen to dance, NaN where nothing can be said."""
        if math.isnan(self.timing) and not math.isnan(self.posture):
            return 0.0
        return self.timing * self.posture / 100


@cache
def part_of_angles(feature: str, heading: bool) -> np.ndarray:
    """(D,) number in `PARTS` of the part that each angle of a feature belongs to."""

    def part(name: str) -> int:
        side, _, rest = name.partition("_")
        if side in ("left", "right"):
            return PARTS.index(f"{side} {'arm' if rest.startswith(('elbow', 'hand')) else 'leg'}")
        return PARTS.index("turning" if name == "turn" else "torso")

    return np.array([part(name) for name in feature_names(feature, heading)])


def timing_similarity(delay_s: float, config: ScorerConfig) -> float:
    """S_t in 0..1 of a delay in seconds: 0 for delays of at least tau."""
    # Eq. (13)
    similarity = 1 - min(1.0, math.exp((abs(delay_s) - config.tau) / (config.alpha * config.tau)))
    return similarity / (1 - math.exp(-1 / config.alpha)) if config.full_timing else similarity


def posture_similarity(squared: np.ndarray, config: ScorerConfig) -> np.ndarray:
    """The summand of Eq. (14) in 0..1 for squared distances in radians^2, of the whole feature or of parts."""
    # Eq. (14)
    return np.exp(-squared / config.beta**2) if config.distance == "parts" else np.exp(-np.sqrt(squared) / config.beta)


class Teacher(NamedTuple):
    """What windows are compared with.

    Attributes:
        features: (M, D) of the whole dance.
        standing: posture similarity in 0..1 that is taken off, see `above_standing`.
        movement: (N,) weight in 0..1 of the windows that start at multiples of `hop_frames`: how much the teacher moves; 1 for
            all without `above_standing`, and where the teacher never moves.
        turning: (M,) how much of a frame somebody who does not turn would miss, 0..1; 0 without `heading`.
        parts: (D,) see `part_of_angles`.
        variance: (D,) squared errors of the estimator's angles, radians^2.
    """

    features: Features
    standing: float
    movement: np.ndarray
    turning: np.ndarray
    parts: np.ndarray
    variance: np.ndarray


def prepared_teacher(features: Features, config: ScorerConfig) -> Teacher:
    """The teacher's (M, D) features with what the settings add."""
    names = feature_names(config.feature, config.heading)
    parts = part_of_angles(config.feature, config.heading)
    variance = angle_variance("none" if config.noise == "auto" else config.noise, config.feature, config.heading)
    starts = range(0, len(features.angles_rad) - config.window_frames + 1, config.hop_frames)
    teacher = Teacher(features, 0.0, np.ones(len(starts)), _turning(features, names, config), parts, variance)
    if not config.above_standing:
        return teacher
    standing = _standing_similarity(teacher, slice(None), names, config)
    held = [_standing_similarity(teacher, slice(start, start + config.window_frames), names, config) for start in starts]
    movement = np.clip((1 - np.array(held)) / MIN_MOVEMENT, 0, 1)
    movement = np.where(np.isnan(movement), 1.0, movement)
    return teacher._replace(
        standing=min(np.nan_to_num(standing), MAX_STANDING), movement=movement if movement.any() else teacher.movement
    )


def _turning(features: Features, names: tuple[str, ...], config: ScorerConfig) -> np.ndarray:
    """(M,) how much of the teacher's turn somebody who does not turn would miss, 0..1."""
    if "turn" not in names or config.distance == "whole":
        return np.zeros(len(features.angles_rad))
    return 1 - posture_similarity(np.nan_to_num(features.angles_rad[:, names.index("turn")]) ** 2, config)


def _standing_similarity(teacher: Teacher, rows: slice, names: tuple[str, ...], config: ScorerConfig) -> float:
    """Mean similarity in 0..1 of somebody who stands still in the mean pose of some of the teacher's frames; NaN if unknown."""
    features = Features(*(array[rows] for array in teacher.features))
    taught = np.flatnonzero(np.isfinite(features.angles_rad).any(axis=1))
    path = np.stack([np.zeros_like(taught), taught], axis=1)
    on_path = distances_on_path(path, _standing(features, names), features, 0, teacher.parts, teacher.variance)
    return _mean(_similarities(on_path.squared[:, 1], on_path, teacher.turning[rows][taught], config)[0])


def _standing(features: Features, names: tuple[str, ...]) -> Features:
    """One frame of somebody who stands still in the mean pose of (M, D) features."""
    weights = np.where(np.isnan(features.angles_rad), 0.0, features.weights)
    sine, cosine = (np.nan_to_num(weights * f(features.angles_rad)).sum(axis=0) for f in (np.sin, np.cos))
    angles = np.where([name in OF_EARLIER_FRAMES for name in names], 0.0, np.arctan2(sine, cosine))
    mean_weight = weights.sum(axis=0) / np.maximum((weights > 0).sum(axis=0), 1)
    return Features(angles[None], mean_weight[None], np.ones((1, len(names))))


def score_window(distances: np.ndarray, learner: Features, teacher: Teacher, start: int, config: ScorerConfig) -> WindowScore:
    """Scores a window.

    Args:
        distances: (n, 2 * band + 1) output of `kpopnet.dance.dtw.banded_distances` for the last n frames up to the window's
            end: the constant delay is estimated from all rows, the window is matched in its own last rows.
        learner: features of the window's frames.
        teacher: the whole dance.
        start: the teacher's frame of the same time as the window's first.
        config: the scorer's settings.
    """
    if not learner.seen.any():
        return _nobody(teacher, start, config)
    if config.matching == "algorithm_3":
        return _as_printed(learner, teacher, start, config)
    frames = len(learner.angles_rad)
    expected = constant_delay(distances, config.context_delay_penalty / config.fps)
    path = best_match(distances[-frames:], config.steps == "slope", config.window_delay_penalty / config.fps, expected)
    if not len(path):
        return _nobody(teacher, start, config)
    matched = _score_path(path, learner, teacher, start, config)
    if config.distance == "whole" or (path[:, 1] == expected).all():
        return matched
    # A wrong limb may lead the match astray. Then the other limbs are compared at the constant delay, as if it were unseen.
    straight = np.stack([np.arange(frames), np.full(frames, expected)], axis=1)
    straight = straight[np.isfinite(distances[-frames:, expected])]
    steady = _score_path(straight, learner, teacher, start, config) if len(straight) else matched
    return steady if steady.similarity > matched.similarity else matched


def _score_path(path: np.ndarray, learner: Features, teacher: Teacher, start: int, config: ScorerConfig) -> WindowScore:
    """Scores a window whose frames correspond to the teacher's by a (L, 2) path, see `kpopnet.dance.dtw.best_match`."""
    offset = start - config.band_frames
    on_path = distances_on_path(path, learner, teacher.features, offset, teacher.parts, teacher.variance)
    shifts = _subframe_shifts(on_path.squared) if config.subframe else np.zeros(len(path))
    squared = _less_noise(_squared_at(on_path.squared, shifts), on_path.noise)
    body, parts = _similarities(squared, on_path, teacher.turning[offset + path.sum(axis=1)], config)
    body = np.maximum(body - teacher.standing, 0) / (1 - teacher.standing)
    shown = np.where(on_path.taught.any(axis=1), on_path.seen.any(axis=1), np.nan)
    if config.distance == "whole":
        shown = np.isfinite(body)
    coverage = np.where(on_path.taught, on_path.seen, np.nan)
    means = _mean_over_frames(np.column_stack([body, shown, parts, coverage]), path.sum(axis=1) - path[0].sum())
    posture, compared, parts, coverage = 100 * means[0], means[1], *np.split(means[2:], 2)
    delay_s = _delay_frames(path, shifts, config) / config.fps
    timing = 100 * timing_similarity(delay_s, config)
    if not compared >= MIN_COMPARED_FRACTION:
        delay_s, timing = math.nan, math.nan
        posture = 0.0 if config.distance == "parts" and not math.isnan(compared) else math.nan
    errors = _mean_errors(on_path, path[:, 0], teacher.parts, config)
    return WindowScore(delay_s, timing, float(posture), _of_all(100 * parts), _of_all(coverage), *errors)


def _nobody(teacher: Teacher, start: int, config: ScorerConfig) -> WindowScore:
    """The score of a window in which nobody is seen."""
    shown = np.isfinite(teacher.features.angles_rad[start : start + config.window_frames]).any(axis=0)
    nothing = np.where([(shown & (teacher.parts == part)).any() for part in range(len(PARTS))], 0.0, np.nan)
    angles = len(teacher.parts)
    posture = 0.0 if config.distance == "parts" and shown.any() else math.nan
    return WindowScore(math.nan, math.nan, posture, nothing, nothing, np.full(angles, np.nan), np.zeros(angles))


def _as_printed(learner: Features, teacher: Teacher, start: int, config: ScorerConfig) -> WindowScore:
    """The score of a window by Algorithm 3 as printed, which has no parts."""
    ahead = Features(*(array[start : start + config.window_frames + config.band_frames] for array in teacher.features))
    timing, posture, half_length = algorithm_3(
        learner, ahead, config.alpha, config.beta, tau_frames=config.tau * config.fps, outlier_rad=config.outlier_rad
    )
    delay_s = (len(learner.angles_rad) / 2 - half_length) / config.fps
    unknown, angles = np.full(len(PARTS), np.nan), len(teacher.parts)
    return WindowScore(delay_s, 100 * timing, 100 * posture, unknown, unknown, np.full(angles, np.nan), np.zeros(angles))


def _delay_frames(path: np.ndarray, shifts: np.ndarray, config: ScorerConfig) -> float:
    """The learner's delay in a window in frames, of a (L, 2) path and the (L,) shifts of its pairs.

    The difference of T_t and T_l of Eq. (13), the middles of the matched stretch and of the window; with `subframe` the mean
    over the pairs, which changes smoothly with the delay.
    """
    if config.subframe:
        return float(config.band_frames - (path[:, 1] + shifts).mean())
    return config.band_frames + (config.window_frames - 1 - path[0].sum() - path[-1].sum()) / 2


def _subframe_shifts(squared: np.ndarray) -> np.ndarray:
    """(L,) how many frames, -0.5 to 0.5, each pair fits best after the matched frame, from (L, 3, P) `PathDistances.squared`.

    The squared distance to a limb that moves at constant speed is a parabola over the shift.
    """
    before, here, after = squared.sum(axis=2).T
    curvature = before + after - 2 * here
    return np.where(curvature > 1e-12, np.clip((before - after) / (2 * np.maximum(curvature, 1e-12)), -0.5, 0.5), 0.0)


def _squared_at(squared: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """(L, P) values at (L,) shifts of the parabolas through (L, 3, P) squared distances at -1, 0 and 1 frame."""
    before, here, after = squared[:, 0], squared[:, 1], squared[:, 2]
    shift = shifts[:, None]
    return np.maximum(here + shift / 2 * (after - before) + shift**2 / 2 * (before + after - 2 * here), 0)


def _less_noise(squared: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(L, P) squared distances without what the estimator's errors contribute on average, never below 0."""
    total, expected = squared.sum(), noise.sum()
    return squared * max(1 - expected / total, 0.0) if expected > 0 and total > 0 else squared


def _similarities(
    squared: np.ndarray, on_path: PathDistances, turning: np.ndarray, config: ScorerConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Similarity in 0..1 of the pairs of a path: (L,) of the body and (L, P) of its parts; NaN where the teacher shows none.

    Args:
        squared: (L, P) radians^2.
        on_path: the pairs.
        turning: (L,) see `Teacher`, of the pairs' frames.
        config: the scorer's settings.
    """
    if config.distance == "parts":
        parts = np.where(on_path.taught, on_path.seen * posture_similarity(squared, config), np.nan)
        body = np.nansum(parts, axis=1) / _or_nan(on_path.taught.sum(axis=1))
        if turning.any():
            body = body * (1 - turning * (1 - np.nan_to_num(parts[:, PARTS.index("turning")])) / 2)
        return body, parts
    # Missing angles count as the others on average, as no paper says; parts are scaled to be comparable with the body.
    angles, present = on_path.weights.shape[1], on_path.present
    of_body = squared.sum(axis=1) * angles / _or_nan(present.sum(axis=1))
    of_body[2 * present.sum(axis=1) < angles] = np.nan
    return posture_similarity(of_body, config), posture_similarity(squared * angles / _or_nan(present), config)


def _or_nan(counts: np.ndarray) -> np.ndarray:
    return np.where(counts > 0, counts, np.nan)


def _mean_over_frames(values: np.ndarray, of_frame: np.ndarray) -> np.ndarray:
    """(K,) mean over the teacher's frames of (L, K) values of pairs, NaN left out.

    Args:
        values: of each pair.
        of_frame: (L,) number of the teacher's frame in each pair, from 0 without gaps, not decreasing.
    """
    known = np.isfinite(values)
    first = np.flatnonzero(np.diff(of_frame, prepend=-1))
    sums, counts = (np.add.reduceat(one, first, axis=0) for one in (np.where(known, values, 0.0), known.astype(float)))
    frames = (counts > 0).sum(axis=0)
    return (sums / np.maximum(counts, 1)).sum(axis=0) / _or_nan(frames)


def _mean_errors(
    on_path: PathDistances, of_row: np.ndarray, parts: np.ndarray, config: ScorerConfig
) -> tuple[np.ndarray, np.ndarray]:
    """`error_rad` and `error_weight` of a window, from the pairs of a path and (L,) the learner's frame of each."""
    middle = abs(of_row - (config.window_frames - 1) / 2) <= config.hop_frames / 2
    weights = (on_path.weights * on_path.seen[:, parts])[middle]
    total = weights.sum(axis=0)
    return np.nansum(weights * on_path.signed[middle], axis=0) / _or_nan(total), total / max(middle.sum(), 1)


def _of_all(values: np.ndarray) -> np.ndarray:
    """(P,) values of all `PARTS`, NaN for the ones that the feature lacks."""
    return np.append(values, np.full(len(PARTS) - len(values), np.nan))


def _mean(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else math.nan
