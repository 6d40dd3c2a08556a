"""What both scorers share: the frame rate, the window, the parts of the body, Eq. (13), and the score of one window."""

import math
from functools import cache
from numbers import Real
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.dance.dtw import PathDistances
from kpopnet.dance.features import FEATURES, Features
from kpopnet.errors import InputError

FPS = 30.0
"""Frame rate to which both dances are resampled by their time stamps: that of the paper's Kinect."""

WINDOW_S = 2.0
"""Length of the learner's window that is scored at once, as in the paper (section 3.2)."""

BAND_S = 1.5
"""Greatest delay, early or late, at which a match is searched for."""

WINDOW_FRAMES, BAND_FRAMES = round(WINDOW_S * FPS), round(BAND_S * FPS)

LIMBS = ("left arm", "right arm", "left leg", "right leg")
PARTS = (*LIMBS, "torso", "turning")
"""Parts of the body that are compared; `turning` is the turn of the whole body."""

MIN_COMPARED_FRACTION = 0.5
"""A window in which a smaller fraction of the matched teacher's frames could be compared has no timing."""


class WindowScore(NamedTuple):
    """Scores of one window: 0 to 100, and through an estimator more than 100 where its errors are less than usual."""

    delay_s: float  # delay of the learner, seconds; negative when early. NaN where too few frames could be compared
    timing: float  # S_t of Eq. (13); NaN with the delay
    posture: float  # S_p of Eq. (14); NaN where nothing could be compared and nothing can be said
    # (P,) posture of each of `PARTS`, without regard to the others; NaN where the teacher does not show the part
    parts: np.ndarray
    coverage: np.ndarray  # (P,) fraction in 0..1 of the part in the teacher's frames that the learner shows; NaN likewise
    # (D,) mean signed difference of each angle, learner minus teacher, in the middle of the window, for the time from one
    # window to the next
    error_rad: np.ndarray
    error_weight: np.ndarray  # (D,) mean weight of these differences, 0..1; 0 where there are none
    expected: float  # posture in 0..1, before it was divided by it, of perfect dancing through the estimator; 1 for true joints
    # posture, and that of each of `PARTS`, that steady differences through a known estimator leave at most, 0 to 100
    most: float = 100.0
    parts_most: np.ndarray = np.full(len(PARTS), 100.0)

    @property
    def limit(self) -> float:
        """What timing and steady differences leave of `similarity` at most: errors below the usual ones excuse neither."""
        return self.timing * self.most / 100 if math.isfinite(self.timing) else self.similarity

    @property
    def similarity(self) -> float:
        """S_t S_p of Eq. (15); 0 where no person is seen to dance, NaN where nothing can be said."""
        if math.isnan(self.timing) and not math.isnan(self.posture):
            return 0.0
        # Eq. (15)
        return self.timing * self.posture / 100


@cache
def part_of_angles(feature: str) -> np.ndarray:
    """(D,) number in `PARTS` of the part that each angle of a feature belongs to."""

    def part(name: str) -> int:
        side, _, rest = name.partition("_")
        if side in ("left", "right"):
            return PARTS.index(f"{side} {'arm' if rest.startswith(('elbow', 'hand')) else 'leg'}")
        return PARTS.index("turning" if name == "turn" else "torso")

    return np.array([part(name) for name in FEATURES[feature].names])


def check_settings(alpha: float, beta: float, tau: float) -> None:
    """Raises InputError unless the settings of Eqs. (13) and (14) are positive numbers."""
    for name, value in {"alpha": alpha, "beta": beta, "tau": tau}.items():
        if not isinstance(value, Real) or not 0 < value < math.inf:
            raise InputError(f"{name}={value!r} must be a positive number")


def timing_similarity(delay_s: float, alpha: float, tau_s: float) -> float:
    """S_t in 0..1 of a delay in seconds: 0 for delays of at least tau."""
    # Eq. (13)
    return 1 - math.exp(min(0.0, (abs(delay_s) - tau_s) / (alpha * tau_s)))


def nothing_seen(teacher: Features, parts: np.ndarray, start: int) -> WindowScore:
    """The score of a window that starts at a frame of the teacher's (M, D) features and in which no person is seen."""
    shown = np.isfinite(teacher.angles_rad[start : start + WINDOW_FRAMES]).any(axis=0)
    nothing = np.where([(shown & (parts == part)).any() for part in range(len(PARTS))], 0.0, np.nan)
    posture = 0.0 if shown.any() else math.nan
    return WindowScore(math.nan, math.nan, posture, nothing, nothing, np.full(len(parts), np.nan), np.zeros(len(parts)), 1.0)


def not_compared(angles: int) -> WindowScore:
    """The score of a window in which nothing is compared; `angles` is D, the number of the feature's angles."""
    unknown = np.full(len(PARTS), np.nan)
    return WindowScore(math.nan, math.nan, math.nan, unknown, unknown, np.full(angles, np.nan), np.zeros(angles), 1.0)


def window_score(
    pairs: np.ndarray,
    on_path: PathDistances,
    path: np.ndarray,
    parts: np.ndarray,
    hop_frames: int,
    delay_s: float,
    timing: float,
    expected: float = 1.0,
) -> WindowScore:
    """The score of a window from what the L pairs of its (L, 2) path, see `kpopnet.dance.dtw.best_match`, have in common.

    `pairs` are (L, 2 + P): similarity of the body in 0..1, whether it could be compared, similarity of each part. `parts` (D,)
    numbers the part of each angle. Errors are averaged over `hop_frames`, the frames from one window to the next; `delay_s`,
    `timing` (S_t, 0 to 100) and `expected` are those of `WindowScore`.
    """
    coverage = np.where(on_path.taught, on_path.seen, np.nan)
    # The sum of Eq. (14), over the teacher's frames.
    means = _mean_over_frames(np.column_stack([pairs, coverage]), path)
    posture, compared, compared_parts = 100 * means[0], means[1], coverage.shape[1]
    if not compared >= MIN_COMPARED_FRACTION:
        delay_s, timing, posture = math.nan, math.nan, math.nan if math.isnan(compared) else 0.0
    of_parts, coverage = np.full((2, len(PARTS)), np.nan)
    of_parts[:compared_parts], coverage[:compared_parts] = means[2:].reshape(2, -1)
    errors = _mean_errors(on_path, path, parts, hop_frames / 2)
    return WindowScore(delay_s, timing, float(posture), 100 * of_parts, coverage, *errors, expected)


@njit(cache=True)
def _mean_over_frames(values, path):
    """(K,) mean over the teacher's frames of (L, K) values of the pairs of a (L, 2) path, NaN left out."""
    pairs, means = len(path), np.empty(values.shape[1])
    for k in range(values.shape[1]):
        total, frames, of_frame, known = 0.0, 0, 0.0, 0
        for pair in range(pairs):
            if math.isfinite(values[pair, k]):
                of_frame, known = of_frame + values[pair, k], known + 1
            is_last = pair + 1 == pairs or path[pair + 1, 0] + path[pair + 1, 1] != path[pair, 0] + path[pair, 1]
            if is_last and known:
                total, frames = total + of_frame / known, frames + 1
                of_frame, known = 0.0, 0
        means[k] = total / frames if frames else np.nan
    return means


@njit(cache=True)
def _mean_errors(on_path, path, parts, within):
    """(D,) mean signed differences, weighted, and their (D,) mean weights, of pairs at most `within` frames from the middle."""
    errors_rad, weights, middle = np.zeros(len(parts)), np.zeros(len(parts)), 0
    for pair in range(len(path)):
        if abs(path[pair, 0] - (WINDOW_FRAMES - 1) / 2) > within:
            continue
        middle += 1
        for angle in range(len(parts)):
            weight = on_path.weights[pair, angle] * on_path.seen[pair, parts[angle]]
            weights[angle] += weight
            if weight > 0:  # then the difference is known
                errors_rad[angle] += weight * on_path.signed[pair, angle]
    for angle in range(len(parts)):
        errors_rad[angle] = errors_rad[angle] / weights[angle] if weights[angle] > 0 else np.nan
        weights[angle] /= max(middle, 1)
    return errors_rad, weights


def or_nan(counts: np.ndarray) -> np.ndarray:
    """Numbers above 0, NaN instead of the others."""
    return np.where(counts > 0, counts, np.nan)
