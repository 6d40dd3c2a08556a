"""Our scorer: the paper's 22-D feature with the turn of the body, compared part by part.

    s_i = mean over parts of seen * exp(-(|f_part| / beta)^2)

stands for the summand of Eq. (14). The exponential of the paper has a cusp at 0: it costs most per degree where a person sees
no difference, and least between wrong and very wrong. The square costs nothing there and separates the latter. A mean over
parts keeps one lost limb from hiding all others. A part that is not seen scores 0, which is never more than it could score
when seen. A turn moves the whole body through the room: a learner who misses a turn of the teacher's has every part at the
wrong place, and up to half of s_i is taken off.

Then s_i becomes max(0, (s_i - s_0) / (1 - s_0)), where s_0 is the score of standing still in the teacher's mean pose: a skill
score, as of forecasts (Murphy 1988). What all parts that the teacher does not move contribute to s_i and to s_0 cancels, so the
parts count as much as the teacher moves them. A window in which the teacher stands still, as before the music begins, can be
copied by standing: it counts in the dance's score as much as the teacher moves (`PartTeacher.movement`).

An estimator's errors are taken out: the similarities of each part are divided by what perfect dancing would keep of that part
in the window, by its confidence (docs/dance_scoring.md). The quotient of two means is nearly unbiased, unlike the mean of
quotients of frames. A window may exceed 100; only what is shown is limited: to its timing, and to what the learner's steady
differences leave (`kpopnet.dance.noise.steady`), for such a quotient excuses many faults.
"""

import math
from dataclasses import dataclass, replace
from numbers import Real
from typing import ClassVar

import numpy as np
from numba import njit

from kpopnet.dance.dtw import best_match, constant_delay, distances_on_path
from kpopnet.dance.features import FEATURES, OF_EARLIER_FRAMES, Features
from kpopnet.dance.noise.sight import path_distances, segment_differences
from kpopnet.dance.noise.steady import FEATURE, steady_similarity, steady_squared
from kpopnet.dance.noise.table import NOISE, doubt, kept_by_noise, known_noise, steady_by_noise
from kpopnet.dance.window import (
    BAND_FRAMES,
    FPS,
    PARTS,
    WINDOW_FRAMES,
    WindowScore,
    check_settings,
    nothing_seen,
    part_of_angles,
    timing_similarity,
    window_score,
)
from kpopnet.errors import InputError, check_one_of
from kpopnet.skeleton import NUM_JOINTS

HOP_S = 0.5
"""Time from the start of one window to the next: overlapping windows use all of the dance's transitions."""

CONTEXT_S = 6.0
"""Length of the stretch, up to the window's end, from which the constant delay is estimated (docs/ledger.md, Dance score)."""

_TURNING = PARTS.index("turning")
_PARTS_OF = part_of_angles(FEATURE)
"""(D,) number in `PARTS` of each angle's part."""

HOP_FRAMES, CONTEXT_FRAMES = round(HOP_S * FPS), round(CONTEXT_S * FPS)

CONTEXT_DELAY_PENALTY = 0.02
"""Cost of a second of constant delay, in radians of the mean frame distance: where a dance fits equally well at any delay, the
learner counts as on time. With 0.05 standing still counted as on time in one of seven training dances, with 0.02 in none."""

WINDOW_DELAY_PENALTY = 0.6
"""Cost of a second between the constant delay and the delay at the begin and end of a window's match, in radians of the mean
frame distance; the begin and the end contribute half each."""

OUTLIER_RAD = 0.25
"""Of the matching in time: scale of the Cauchy loss; differences of angles far beyond it count by their logarithm
(`kpopnet.dance.dtw.frame_distance`)."""

MAX_STANDING = 0.75
"""Greatest score of standing still that is taken off, which limits the factor 1 / (1 - s_0) to four. A teacher who hardly moves
would otherwise leave nothing to be scored."""

MIN_MOVEMENT = 0.1
"""A window has full weight if standing still in its mean pose scores at least this much less than 1, otherwise in
proportion."""


@dataclass(frozen=True)
class PartScorer:
    """Our scorer, which compares two dances part by part.

    Attributes:
        mirrored: true for a learner who mirrors the teacher, as in front of a mirror; auto takes what fits better; false.
        latency_s: constant delay of the set-up (camera, display), taken off the learner's clock, seconds; measured by
            kpopnet.dance.timing.measured_latency_s.
        noise: name of the estimator of the learner's joints whose known errors are taken out of the score (tracker, network,
            fitted_network, realtime, best, webcam); none for true joints; auto for that of each estimator in an evaluation,
            for that of the learner's `Performance` in `score_dance`, elsewhere none.
        alpha: slope of the timing similarity, Eq. (13).
        beta: posture difference of one part's angles at which its similarity has fallen to 1/e, radians.
        tau: delay at which the timing similarity reaches 0, Eq. (13), seconds.
    """

    mirrored: str = "false"
    latency_s: float = 0.0
    noise: str = "auto"
    # Chosen by tools/calibrate_scorers.py. Of beta 0.3, 0.4 and 0.5 it is 0.4 with which the fewest learners with one fault,
    # made of ten recorded dances of the split train, score outside what a teacher would say (the intervals of
    # tests/kpopnet/dance/test_learners.py): 6, 5 and 6 of 210.
    alpha: float = 0.31
    beta: float = 0.4
    tau: float = 0.4

    feature: ClassVar[str] = FEATURE
    hop_s: ClassVar[float] = HOP_S
    outlier_rad: ClassVar[float] = OUTLIER_RAD

    def __post_init__(self) -> None:
        object.__setattr__(self, "mirrored", str(self.mirrored).lower())  # Hydra reads true and false as bool
        check_settings(self.alpha, self.beta, self.tau)
        if not isinstance(self.latency_s, Real) or not abs(self.latency_s) <= 5:
            raise InputError(f"latency_s={self.latency_s!r}: expected -5 to 5 seconds")
        check_one_of("mirrored", self.mirrored, ("false", "true", "auto"))
        check_one_of("noise", self.noise, ("auto", *NOISE))

    def teacher(self, features: Features) -> "PartTeacher":
        """The teacher's (M, D) features with what windows are compared with."""
        starts = range(0, len(features.angles_rad) - WINDOW_FRAMES + 1, HOP_FRAMES)
        turn_rad = np.nan_to_num(features.angles_rad[:, FEATURES[FEATURE].names.index("turn")])
        turning = 1 - self.posture(turn_rad**2)
        teacher = PartTeacher(self, features, 0.0, np.ones(len(starts)), turning)
        held = [teacher.standing_similarity(slice(start, start + WINDOW_FRAMES)) for start in starts]
        movement = np.clip((1 - np.array(held)) / MIN_MOVEMENT, 0, 1)
        moves = np.nan_to_num(movement).any()
        movement = np.where(np.isnan(movement), 1.0, movement)
        standing = min(np.nan_to_num(teacher.standing_similarity(slice(None))), MAX_STANDING)
        return replace(teacher, standing=standing, movement=movement if moves else teacher.movement)

    def timing(self, delay_s: float) -> float:
        """S_t of Eq. (13) in 0..1, divided by its value without delay, so that a dancer on time loses nothing."""
        return timing_similarity(delay_s, self.alpha, self.tau) / (1 - math.exp(-1 / self.alpha))

    def posture(self, squared: np.ndarray) -> np.ndarray:
        """Similarity in 0..1 of squared distances of parts, radians^2."""
        return np.exp(-squared / self.beta**2)


@dataclass(frozen=True)
class PartTeacher:
    """A teacher's dance that windows of a learner are compared with."""

    scorer: PartScorer  # the scorer's settings
    features: Features  # (M, D) of the whole dance
    standing: float  # s_0, the similarity in 0..1 of standing still
    # (N,) weight in 0..1 of each window in the dance's score: how much the teacher moves in it; 1 for all where the teacher
    # never moves
    movement: np.ndarray
    turning: np.ndarray  # (M,) how much of a frame a learner who does not turn would miss, 0..1

    def standing_similarity(self, rows: slice) -> float:
        """Mean similarity in 0..1 of standing still in the mean pose of some of the teacher's frames; NaN if unknown."""
        features = self.features.at(rows)
        taught = np.flatnonzero(np.isfinite(features.angles_rad).any(axis=1))
        path = np.stack([np.zeros_like(taught), taught], axis=1)
        on_path = distances_on_path(path, _standing(features), features, 0, _PARTS_OF)
        parts = np.where(on_path.taught, on_path.seen * self.scorer.posture(on_path.squared[:, 1]), np.nan)
        similarity = _of_body(parts, self.turning[rows][taught])
        finite = similarity[np.isfinite(similarity)]
        return float(finite.mean()) if len(finite) else math.nan

    def window(self, distances: np.ndarray, learner: Features, start: int, confidence: np.ndarray) -> WindowScore:
        """Scores the window of (n, D) features whose first frame has the time of the teacher's frame `start`.

        `distances` are the (.., 2 BAND_FRAMES + 1) `banded_distances` up to the window's end: the constant delay is estimated
        from the last CONTEXT_S, the window is matched in the last n rows. `confidence` (.., D) is the learner's up to the
        window's end: that of the last CONTEXT_S says how much the estimator's errors cost.
        """
        if not learner.confidence.any():
            return nothing_seen(self.features, _PARTS_OF, start)
        frames, distances = len(learner.angles_rad), distances[-CONTEXT_FRAMES:]
        expected = constant_delay(distances, CONTEXT_DELAY_PENALTY / FPS)
        path = best_match(distances[-frames:], True, WINDOW_DELAY_PENALTY / FPS, expected)
        if not len(path):
            return nothing_seen(self.features, _PARTS_OF, start)
        unsure = doubt(_least_of_parts(confidence[-CONTEXT_FRAMES:], _PARTS_OF))
        score = self._on_path(path, learner, start, unsure)
        # A wrong limb may lead the match astray. Then the other limbs are compared at the constant delay, as if it were unseen.
        straight = np.stack([np.arange(frames), np.full(frames, expected)], axis=1)
        straight = straight[np.isfinite(distances[-frames:, expected])]
        if len(straight) and not (path[:, 1] == expected).all():
            at_constant_delay = self._on_path(straight, learner, start, unsure)
            if at_constant_delay.similarity > score.similarity:
                score, path = at_constant_delay, straight
        return self._limited(score, path, learner, start, unsure)

    def _on_path(self, path: np.ndarray, learner: Features, start: int, unsure: np.ndarray) -> WindowScore:
        """Scores a window whose frames correspond to the teacher's by a (L, 2) path, see `kpopnet.dance.dtw.best_match`.

        `unsure` (P,) is the `doubt` of the parts.
        """
        offset, noise = start - BAND_FRAMES, known_noise(self.scorer.noise)
        on_path = path_distances(path, learner, self.features, offset, _PARTS_OF, noise.sees_depth)
        turning = self.turning[offset + path.sum(axis=1)]
        body, shown, parts, shift, expected = _similarities(
            on_path, kept_by_noise(noise.loss, unsure), turning, self.scorer.beta
        )
        # The mean delay of the pairs changes smoothly with the learner's, unlike that of the middles in Eq. (13).
        delay_s = (BAND_FRAMES - float(path[:, 1].mean()) - shift) / FPS
        pairs, timing = np.column_stack([self._skill(body), shown, parts]), 100 * self.scorer.timing(delay_s)
        return window_score(pairs, on_path, path, _PARTS_OF, HOP_FRAMES, delay_s, timing, expected)

    def _limited(self, score: WindowScore, path: np.ndarray, learner: Features, start: int, unsure: np.ndarray) -> WindowScore:
        """The score of a window, matched by the path, with what steady differences and missing joints leave at most."""
        noise, taught = known_noise(self.scorer.noise), np.isfinite(score.parts)
        if not noise.steady or not taught.any():
            return score
        seen, shown = learner.at(path[:, 0]), self.features.at(start - BAND_FRAMES + path.sum(axis=1))
        squared = steady_squared(segment_differences(seen, shown, noise.sees_depth))
        most = steady_similarity(squared, steady_by_noise(noise.steady, unsure), self.scorer.beta)
        most *= shares_without_missing(seen.confidence, shown.angles_rad, _PARTS_OF)
        body = self._skill(most[taught].mean(keepdims=True))
        return score._replace(most=100 * float(body[0]), parts_most=100 * most)

    def _skill(self, similarity: np.ndarray) -> np.ndarray:
        """Similarities in 0..1, without what standing still has."""
        return np.maximum(similarity - self.standing, 0) / (1 - self.standing)


@njit(cache=True)
def _least_of_parts(values, parts):
    """(n, P) the least of (n, D) values of each part's angles; `parts` (D,) numbers the part of each."""
    least = np.full((len(values), parts.max() + 1), np.inf)
    for frame in range(len(values)):
        for angle, part in enumerate(parts):
            least[frame, part] = min(least[frame, part], values[frame, angle])
    return least


@njit(cache=True)
def shares_without_missing(confidence, taught_rad, parts):
    """(P,) share of L pairs in which the learner, of (L, D) confidence, misses no angle of a part that the teacher shows."""
    pairs, missing = len(confidence), np.zeros(parts.max() + 1)
    for pair in range(pairs):
        lacking = np.zeros(len(missing))
        for angle, part in enumerate(parts):
            if confidence[pair, angle] == 0 and not math.isnan(taught_rad[pair, angle]):
                lacking[part] = 1
        missing += lacking
    return 1 - missing / pairs


@njit(cache=True)
def _similarities(on_path, kept_if_seen, turning, beta):
    """What the L pairs of a path have in common: (L,) similarity of the body, whether anything of it is seen, (L, P) similarity
    of the parts, the mean delay within a frame, in frames, and the body's similarity that perfect dancing keeps.

    Takes the `PathDistances`, the (P,) similarity that the estimator's errors leave to each part of a perfect dancer, (L,) how
    much of each pair's frame is turning, and the scorer's beta.
    """
    pairs, count = on_path.taught.shape
    shown, shifts = np.full(pairs, np.nan), 0.0
    parts, kept = np.full((pairs, count), np.nan), np.full((pairs, count), np.nan)
    for pair in range(pairs):
        before, here, after = on_path.squared[pair]
        shift = _subframe_shift(before.sum(), here.sum(), after.sum())
        shifts += shift
        for part in range(count):
            if on_path.taught[pair, part]:
                seen, squared = on_path.seen[pair, part], _squared_at(before[part], here[part], after[part], shift)
                parts[pair, part] = seen * math.exp(-squared / beta**2)
                # What is unseen stays a loss: the estimator's errors excuse only what is seen.
                kept[pair, part] = 1 - seen * (1 - kept_if_seen[part])
                shown[pair] = 1.0 if seen > 0 or shown[pair] == 1 else 0.0
    expected = _known_mean(_of_body(kept, turning).reshape(-1, 1))[0]
    parts /= _known_mean(kept)
    return _of_body(parts, turning), shown, parts, shifts / pairs, expected


@njit(cache=True)
def _of_body(parts, turning):
    """(L,) similarity of the body of (L, P) similarities of parts; `turning` (L,) is that of the pairs' frames."""
    body = np.full(len(parts), np.nan)
    for pair in range(len(parts)):
        total, known = 0.0, 0
        for part in range(parts.shape[1]):
            if math.isfinite(parts[pair, part]):
                total, known = total + parts[pair, part], known + 1
        if known:
            turned = parts[pair, _TURNING] if math.isfinite(parts[pair, _TURNING]) else 0.0
            body[pair] = total / known * (1 - turning[pair] * (1 - turned) / 2)
    return body


@njit(cache=True)
def _known_mean(values):
    """(P,) mean over the L pairs of what is known of (L, P) values; NaN where nothing is."""
    means = np.full(values.shape[1], np.nan)
    for part in range(values.shape[1]):
        total, known = 0.0, 0
        for pair in range(len(values)):
            if math.isfinite(values[pair, part]):
                total, known = total + values[pair, part], known + 1
        if known:
            means[part] = total / known
    return means


def _standing(features: Features) -> Features:
    """One frame of a person who stands still in the mean pose of (M, D) features."""
    weights = np.where(np.isnan(features.angles_rad), 0.0, features.weights)
    sine, cosine = (np.nan_to_num(weights * f(features.angles_rad)).sum(axis=0) for f in (np.sin, np.cos))
    names = FEATURES[FEATURE].names
    angles = np.where([name in OF_EARLIER_FRAMES for name in names], 0.0, np.arctan2(sine, cosine))
    mean_weight = weights.sum(axis=0) / np.maximum((weights > 0).sum(axis=0), 1)
    return Features(angles[None], mean_weight[None], np.ones((1, len(names))), np.full((1, NUM_JOINTS, 3), np.nan))


@njit(cache=True)
def _subframe_shift(before, here, after):
    """How many frames, -0.5 to 0.5, a pair fits best after the matched frame: the minimum of a parabola through its squared
    distances at -1, 0 and 1 frame.
    """
    curvature = before + after - 2 * here
    return min(max((before - after) / (2 * curvature), -0.5), 0.5) if curvature > 1e-12 else 0.0


@njit(cache=True)
def _squared_at(before, here, after, shift):
    """The value at a shift of the parabola through squared distances at -1, 0 and 1 frame."""
    return max(here + shift / 2 * (after - before) + shift**2 / 2 * (before + after - 2 * here), 0.0)
