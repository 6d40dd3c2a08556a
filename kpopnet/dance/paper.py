"""The paper's scorer: Eqs. (13) to (15) with a weighted norm, matched with the paper's steps wherever a window fits best.

docs/learning_the_score.md lists what it adds to the equations, which leave it open, and what each addition is worth. What is
missing is left out: missing angles count as the others on average, and a window in which less than half of the matched frames
could be compared is excluded.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numba import njit

from kpopnet.dance.dtw import banded_distances, best_match, distances_on_path
from kpopnet.dance.features import FEATURES, Features
from kpopnet.dance.window import (
    BAND_FRAMES,
    FPS,
    PARTS,
    WINDOW_FRAMES,
    WINDOW_S,
    WindowScore,
    check_settings,
    not_compared,
    nothing_seen,
    or_nan,
    part_of_angles,
    timing_similarity,
    window_score,
)
from kpopnet.errors import check_one_of


@dataclass(frozen=True)
class PaperScorer:
    """The paper's scorer.

    Attributes:
        feature: dance22, the paper's 22-D feature; raptis, the 19-D feature of its reference [17]; or another dance feature.
        as_printed: Algorithm 3 exactly as printed, with its faults, instead of the search for the best subsequence that the
            paper's text describes.
        alpha: slope of the timing similarity, Eq. (13).
        beta: distance of two poses at which their similarity has fallen to 1/e, Eq. (14), radians.
        tau: delay at which the timing similarity reaches 0, Eq. (13), seconds.
    """

    feature: str = "dance22"
    as_printed: bool = False
    # Chosen by tools/calibrate_scorers.py; the paper gives none.
    alpha: float = 0.31
    beta: float = 0.4
    tau: float = 0.5

    hop_s: ClassVar[float] = WINDOW_S  # windows that do not overlap: the paper does not say
    mirrored: ClassVar[str] = "false"
    latency_s: ClassVar[float] = 0.0
    noise: ClassVar[str] = "none"
    outlier_rad: ClassVar[float] = math.inf

    def __post_init__(self) -> None:
        check_settings(self.alpha, self.beta, self.tau)
        check_one_of("feature", self.feature, FEATURES)

    def teacher(self, features: Features) -> "PaperTeacher":
        return PaperTeacher(self, features)


@dataclass(frozen=True)
class PaperTeacher:
    """A teacher's dance that windows of a learner are compared with; `features` has (M, D) angles."""

    scorer: PaperScorer
    features: Features

    @cached_property
    def movement(self) -> np.ndarray:
        """(N,) weight of each window: all count the same."""
        return np.ones(len(range(0, len(self.features.angles_rad) - WINDOW_FRAMES + 1, WINDOW_FRAMES)))

    def window(self, distances: np.ndarray, learner: Features, start: int, confidence: np.ndarray) -> WindowScore:
        """Scores a window of n frames, see `kpopnet.dance.parts.PartTeacher.window`."""
        parts, frames = part_of_angles(self.scorer.feature), len(learner.angles_rad)
        nothing = nothing_seen(self.features, parts, start)._replace(posture=math.nan, parts=np.full(len(PARTS), np.nan))
        if not learner.confidence.any():
            return nothing
        if self.scorer.as_printed:
            return self._as_printed(learner, start)
        path = best_match(distances[-frames:], False, 0.0, BAND_FRAMES)
        if not len(path):
            return nothing
        on_path = distances_on_path(path, learner, self.features, start - BAND_FRAMES, parts)
        squared, present, angles = on_path.squared[:, 1], on_path.present, len(parts)
        of_body = squared.sum(axis=1) * angles / or_nan(present.sum(axis=1))
        of_body[2 * present.sum(axis=1) < angles] = np.nan
        # The summand of Eq. (14), of the body and of each part, whose distance is scaled to be comparable with the body's.
        body, of_parts = (np.exp(-np.sqrt(one) / self.scorer.beta) for one in (of_body, squared * angles / or_nan(present)))
        pairs = np.column_stack([body, np.isfinite(body), of_parts])
        # T_l - T_t of Eq. (13): between the middles of the window and of the matched stretch, without frames that miss joints.
        compared = path[np.isfinite(body)] if np.isfinite(body).any() else path
        delay_s = (BAND_FRAMES - (compared[0, 1] + compared[-1, 1]) / 2) / FPS
        timing = 100 * timing_similarity(delay_s, self.scorer.alpha, self.scorer.tau)
        score = window_score(pairs, on_path, path, parts, WINDOW_FRAMES, delay_s, timing)
        return score._replace(posture=math.nan) if math.isnan(score.delay_s) else score

    def _as_printed(self, learner: Features, start: int) -> WindowScore:
        """The score of a window by Algorithm 3 as printed, which has no parts.

        The paper does not say how long its input is: here from the window's start to 1.5 s after its end.
        """
        ahead = self.features.at(slice(start, start + WINDOW_FRAMES + BAND_FRAMES))
        timing, posture, half_length = algorithm_3(learner, ahead, self.scorer.alpha, self.scorer.beta, self.scorer.tau * FPS)
        delay_s = (len(learner.angles_rad) / 2 - half_length) / FPS
        unknown = not_compared(learner.angles_rad.shape[1])
        return unknown._replace(delay_s=delay_s, timing=100 * timing, posture=100 * posture)


def algorithm_3(
    learner: Features, teacher: Features, alpha: float, beta: float, tau_frames: float
) -> tuple[float, float, float]:
    """Algorithm 3 as printed in the paper.

    Faults of the printed algorithm: DTW[0, j] is infinite except for j = 0, so the path starts at the teacher's first frame and
    argmin_j DTW[1, j] is always 1, although the text describes the search for a subsequence. DTW[n + 1, j] does not exist;
    DTW[n, j] is read here. T_t is half a length, not the middle time of Eq. (13), so a learner who dances at the right speed
    but late counts as on time. S_p is the exponential of a mean, where Eq. (14) is the mean of exponentials, and it divides by
    half the length.

    Takes (n, D) and (m, D) features, alpha of Eq. (13), beta of Eq. (14) in radians, and tau of Eq. (13) in frames; returns
    S_t in 0..1, S_p in 0..1 and T_t in frames.
    """
    n, m = len(learner.angles_rad), len(teacher.angles_rad)
    distances = np.full((n + 1, m + 1), np.inf)
    banded = banded_distances(learner, teacher, 0, max(n, m), math.inf)
    for i in range(1, n + 1):
        distances[i, 1:] = banded[i - 1, max(n, m) - i + 1 : max(n, m) - i + 1 + m]
    warped = _dtw_as_printed(distances)
    start = int(np.argmin(warped[1, 1:])) + 1
    end = int(np.argmin(warped[n, 1:])) + 1
    half_length = (end - start + 1) / 2
    timing = timing_similarity(half_length - n / 2, alpha, tau_frames)
    return timing, math.exp(-warped[n, end] / (beta * half_length)), half_length


@njit(cache=True)
def _dtw_as_printed(distances):
    n, m = distances.shape[0] - 1, distances.shape[1] - 1
    warped = np.full((n + 1, m + 1), np.inf)
    warped[0, 0] = 0
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            warped[i, j] = distances[i, j] + min(warped[i - 1, j], warped[i, j - 1], warped[i - 1, j - 1])
    return warped
