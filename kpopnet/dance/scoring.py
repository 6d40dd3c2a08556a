"""Scores a learner's dance against a teacher's: timing, posture and similarity (section 3.2), 0 to 100.

    joints -> uniform frame rate -> features -> windows of 2 s -> DTW -> S_t, S_p of each window -> S

The delay of a window is the time between the middle of the learner's window and the middle of the teacher's frames that match
it. Missing joints change no score: windows in which too few frames could be compared are excluded from every mean. Joints with
a lower confidence than the others have less weight.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from kpopnet.dance.angle_bias import AngleBias
from kpopnet.dance.dtw import STEPS, algorithm_3, banded_distances, best_match, constant_delay, posture_on_path
from kpopnet.dance.features import Features, dance_features, feature_names
from kpopnet.dance.performance import Performance, as_performance
from kpopnet.dance.resampling import resampled, resampled_confidence
from kpopnet.errors import InputError

PARTS = ("arms", "legs", "torso", "left", "right")

MATCHINGS = ("subsequence", "algorithm_3")

MIN_COMPARED_FRACTION = 0.5
"""A window in which a smaller fraction of the matched teacher's frames could be compared is not scored."""


@dataclass(frozen=True)
class ScorerConfig:
    """Settings of the comparison of two dances.

    Attributes:
        feature: dance22 (the paper's) or raptis (that of [17]).
        heading: adds the turn of the whole body to dance22, which does not contain it otherwise.
        fps: frame rate to which both dances are resampled by their time stamps, frames per second.
        smoothing_s: standard deviation of the Gaussian of that resampling, seconds.
        window_s: length of the learner's window that is scored at once, seconds; 2 s in the paper.
        hop_s: time from the start of one window to the next, seconds. The paper's windows do not overlap; overlapping ones
            use all of the dance's transitions.
        band_s: greatest delay, early or late, at which a match is searched for, seconds.
        context_s: length of the stretch, up to the window's end, from which the constant delay is estimated, seconds.
        context_delay_penalty: cost of a second of constant delay, in radians of the mean frame distance: where a dance
            fits equally well at any delay, the learner counts as on time.
        window_delay_penalty: cost of a second between the constant delay and the delay at the begin and end of a window's
            match, in radians of the mean frame distance; the begin and the end contribute half each.
        steps: step pattern, slope or free, see kpopnet.dance.dtw.
        outlier_rad: scale of the Cauchy loss: differences of angles far beyond it count by their logarithm, see
            kpopnet.dance.dtw.frame_distance; radians; inf gives the plain norm.
        bias_prior_s: zero-bias prior of a learner's angle biases, in seconds of pseudo-observations, see
            kpopnet.dance.angle_bias; inf: biases are not subtracted.
        max_angle_bias_rad: limit of each angle bias, radians.
        hand_weight: weight of the squared differences of the hands' angles: every estimator is less accurate for hands
            than for the other joints.
        matching: subsequence, or algorithm_3 for the paper's Algorithm 3 as printed.
        alpha: slope of the timing similarity, Eq. (13).
        beta: posture difference at which similarity has fallen to 1/e, Eq. (14), in radians of the whole feature's norm.
        tau: delay at which the timing similarity reaches 0, Eq. (13), in seconds.
    """

    feature: str = "dance22"
    heading: bool = False
    fps: float = 30.0
    smoothing_s: float = 0.08
    window_s: float = 2.0
    hop_s: float = 0.5
    band_s: float = 1.5
    context_s: float = 6.0
    context_delay_penalty: float = 0.02
    window_delay_penalty: float = 0.6
    steps: str = "slope"
    outlier_rad: float = 0.25
    bias_prior_s: float = 3.0
    max_angle_bias_rad: float = 0.25
    hand_weight: float = 0.25
    matching: str = "subsequence"
    # Chosen by kpopnet.evaluation.dances.calibration on joints that a network estimated in 70 dances of kpop_sim's split train:
    # the greatest alpha that leaves a perfect copy 96 points; of the pairs of beta and tau that keep standing still below 20
    # and another dance below 30, the pair that orders most dances.
    alpha: float = 0.31
    beta: float = 0.7
    tau: float = 0.4

    def __post_init__(self) -> None:
        feature_names(self.feature, self.heading)
        positive = ("fps", "window_s", "hop_s", "band_s", "context_s", "alpha", "beta", "tau")
        for name in positive:
            if not 0 < getattr(self, name) < math.inf:
                raise InputError(f"{name}={getattr(self, name)} must be a positive number")
        if not 0.02 <= self.smoothing_s <= 0.5:
            raise InputError(f"smoothing_s={self.smoothing_s}: expected 0.02 to 0.5 seconds")
        if not self.outlier_rad > 0:
            raise InputError(f"outlier_rad={self.outlier_rad} must be positive, or inf for the plain norm")
        if not self.bias_prior_s > 0:
            raise InputError(f"bias_prior_s={self.bias_prior_s} must be positive, or inf to leave angle biases in")
        for name in ("window_delay_penalty", "context_delay_penalty", "hand_weight", "max_angle_bias_rad"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name}={getattr(self, name)} must be 0 or more")
        if self.steps not in STEPS:
            raise InputError(f"steps={self.steps} is not one of {', '.join(STEPS)}")
        if self.matching not in MATCHINGS:
            raise InputError(f"matching={self.matching} is not one of {', '.join(MATCHINGS)}")
        if self.window_frames < 2:
            raise InputError(f"window_s={self.window_s} contains fewer than two frames at fps={self.fps}; give a longer one")

    @property
    def window_frames(self) -> int:
        return round(self.window_s * self.fps)

    @property
    def context_frames(self) -> int:
        return max(round(self.context_s * self.fps), self.window_frames)

    @property
    def hop_frames(self) -> int:
        return max(round(self.hop_s * self.fps), 1)

    @property
    def band_frames(self) -> int:
        return max(round(self.band_s * self.fps), 1)


SCORERS = {
    "dance22": ScorerConfig(),
    "raptis": ScorerConfig(
        feature="raptis", outlier_rad=math.inf, bias_prior_s=math.inf, hand_weight=1.0, alpha=0.3, beta=1.8, tau=0.6
    ),
}
"""`dance22` is the paper's feature with our robust distance. `raptis` is the baseline: the feature of [17] with the plain norm
of Eq. (14) and equal weights of all angles. Both are matched in time in the same way. In both, joints of low confidence have
less weight. The difficulty of kpop_sim was calibrated with `raptis`; if its settings change, that calibration must be repeated.
So its alpha, beta and tau are still those from before the calibration of dance22."""


class Windows(NamedTuple):
    """Scores of a dance's windows, 0 to 100; NaN where too few frames could be compared.

    Attributes:
        start_s: (N,) start of each window, seconds on the performances' clock.
        delay_s: (N,) delay of the learner, seconds; negative when early.
        timing: (N,) S_t of Eq. (13).
        posture: (N,) S_p of Eq. (14).
        similarity: (N,) S_t S_p.
        parts: name of `PARTS` to (N,) S_t S_p, with the S_p of that part's angles only.
    """

    start_s: np.ndarray
    delay_s: np.ndarray
    timing: np.ndarray
    posture: np.ndarray
    similarity: np.ndarray
    parts: dict[str, np.ndarray]


class DanceScore(NamedTuple):
    """Scores of a learner's dance, 0 to 100; NaN if no window could be compared.

    Attributes:
        similarity: S of Eq. (15), the mean of the windows' S_t S_p.
        timing: the mean of the windows' S_t.
        posture: the mean of the windows' S_p.
        parts: name of `PARTS` to the mean of its similarity.
        scored: fraction of the windows that could be scored; the others are excluded from every mean.
        windows: the scores of each window, by part of the body.
    """

    similarity: float
    timing: float
    posture: float
    parts: dict[str, float]
    scored: float
    windows: Windows


class WindowScore(NamedTuple):
    """Scores of one window, as in `Windows`.

    Attributes:
        delay_s: delay of the learner, seconds; negative when early.
        timing: S_t of Eq. (13), 0 to 100.
        posture: S_p of Eq. (14), 0 to 100.
        parts: (5,) posture S_p of each of `PARTS`, 0 to 100.
    """

    delay_s: float
    timing: float
    posture: float
    parts: np.ndarray


def score_dance(
    teacher: Performance | np.ndarray,
    learner: Performance | np.ndarray,
    config: ScorerConfig = SCORERS["dance22"],
    *,
    fps: float | None = None,
    unobserved_is_nan: bool = False,
) -> DanceScore:
    """Scores a learner against a teacher.

    Windows start at multiples of `config.hop_s` from the teacher's first frame. Those that the learner's recording covers
    completely are scored. Frames of the learner before the teacher's first frame or after the last one are not scored.

    Args:
        teacher: the reference dance, or its (T, 15, 3) joints in metres in the camera frame.
        learner: the dance to score, on the same clock, or its joints.
        config: the scorer's settings.
        fps: frames per second of dances that are given as joints.
        unobserved_is_nan: a learner of whom no joint is known scores NaN, for evaluations that count such dances.

    Raises:
        InputError: The teacher's dance is shorter than a window, or the learner's recording covers no whole window of it; or
            no joint is known in one of the dances; or joints are given without `fps`.
    """
    teacher, learner = as_performance(teacher, fps, "teacher"), as_performance(learner, fps, "learner")
    if not unobserved_is_nan:
        _check_observed(learner, "learner")
    grid = TimeGrid(teacher, config)
    frames = grid.overlapping_frames(learner)
    comparison = Comparison(grid.features(teacher, grid.teacher_frames), frames.start, config)
    comparison.add(grid.features(learner, frames))
    starts = grid.window_starts(frames)
    return summary([comparison.window(start) for start in starts], grid.time_s(starts))


def _check_observed(dance: Performance, whose: str) -> None:
    if not dance.is_observed:
        raise InputError(
            f"the {whose}'s dance: no joint is known in any of its {len(dance)} frames; was a person found in the recording?"
        )


class TimeGrid:
    """The uniformly spaced times at which a teacher's and a learner's dance are resampled; frame 0 is the teacher's first.

    Attributes:
        teacher_frames: numbers of the frames within the teacher's dance.
    """

    def __init__(self, teacher: Performance, config: ScorerConfig) -> None:
        _check_observed(teacher, "teacher")
        self._config, self._start_s = config, float(teacher.times_s[0])
        self.teacher_frames = self.frames_of(teacher)
        if len(self.teacher_frames) < config.window_frames:
            raise InputError(
                f"the teacher's dance lasts {teacher.times_s[-1] - teacher.times_s[0]:.2f} s, less than a window of "
                f"{config.window_s} s; give a longer dance or a shorter window_s"
            )

    def frames_of(self, performance: Performance) -> range:
        """The frames between a performance's first sample and its last."""
        return range(self.frame_from(performance.times_s[0]), self.frame_until(performance.times_s[-1]) + 1)

    def frame_from(self, time_s: float) -> int:
        """The first frame at or after a time in seconds."""
        return math.ceil((time_s - self._start_s) * self._config.fps - 1e-6)

    def frame_until(self, time_s: float) -> int:
        """The last frame at or before a time in seconds."""
        return math.floor((time_s - self._start_s) * self._config.fps + 1e-6)

    def time_s(self, frames: int | range) -> np.ndarray:
        """Times of frames in seconds, on the performances' clock."""
        return self._start_s + np.asarray(frames) / self._config.fps

    def overlapping_frames(self, learner: Performance) -> range:
        """The frames of the teacher's dance that lie within the learner's recording."""
        frames = self.frames_of(learner)
        return range(max(frames.start, 0), min(frames.stop, self.teacher_frames.stop))

    def features(self, performance: Performance, frames: range) -> Features:
        """Weighted features of a performance, resampled at these frames."""
        times = performance.times_s, self.time_s(frames), self._config.smoothing_s
        return weighted_features(
            resampled(performance.joints_m, *times), resampled_confidence(performance.confidence, *times), self._config
        )

    def window_starts(self, frames: range) -> range:
        """First frames of the windows that lie completely within the given frames.

        Raises:
            InputError: No window does.
        """
        size, hop = self._config.window_frames, self._config.hop_frames
        starts = range(-(-frames.start // hop) * hop, frames.stop - size + 1, hop)
        if not starts:
            fps = self._config.fps
            raise InputError(
                f"the learner was recorded for {max(len(frames) - 1, 0) / fps:.2f} s of a dance of "
                f"{(len(self.teacher_frames) - 1) / fps:.2f} s, in no whole window of {self._config.window_s} s; "
                "the times of both must be on the same clock"
            )
        return starts


class Comparison:
    """Compares a learner's frames with a teacher's; the result is the same for frames added at once or one by one."""

    def __init__(self, teacher: Features, first: int, config: ScorerConfig) -> None:
        """Starts without frames of the learner.

        Args:
            teacher: features of the whole dance.
            first: the teacher's frame of the same time as the learner's first.
            config: the scorer's settings.
        """
        self._teacher, self._first, self._config = teacher, first, config
        self._learner = Features(*(np.full_like(array, np.nan) for array in teacher))
        # Filled, so that all memory is taken before the dance begins, not page by page while it is scored in real time.
        self._distances = np.full((len(teacher.angles_rad), 2 * config.band_frames + 1), np.nan)
        num_angles = teacher.angles_rad.shape[1]
        self._angle_bias = AngleBias(num_angles, config.bias_prior_s * config.fps, config.max_angle_bias_rad)
        self._delay, self._end = 0, first

    def add(self, features: Features) -> None:
        """Adds the learner's next frames. The angle bias is estimated at the constant delay, which is updated once per hop."""
        config, hop = self._config, self._config.hop_frames
        stop = self._end + len(features.angles_rad)
        for begin in range(self._end // hop * hop, stop, hop):
            begin, end = max(begin, self._end), min(begin + hop, stop)
            rows = select_rows(features, slice(begin - self._end, end - self._end))
            rows = self._angle_bias.subtracted(rows, self._teacher, begin - self._delay)
            for stored, new in zip(self._learner, rows, strict=True):
                stored[begin:end] = new
            self._distances[begin:end] = banded_distances(rows, self._teacher, begin, config.band_frames, config.outlier_rad)
            if end % hop == 0:
                column = constant_delay(self._context(end), config.context_delay_penalty / config.fps)
                self._delay = config.band_frames - column
        self._end = stop

    def window(self, start: int) -> WindowScore:
        """Scores the window that starts at a frame; all of its frames must have been added."""
        end = start + self._config.window_frames
        return score_window(
            self._context(end), select_rows(self._learner, slice(start, end)), self._teacher, start, self._config
        )

    def _context(self, end: int) -> np.ndarray:
        return self._distances[max(end - self._config.context_frames, self._first) : end]


def weighted_features(joints_m: np.ndarray, confidence: np.ndarray, config: ScorerConfig) -> Features:
    """Features of (T, 15, 3) joints at uniform frames with (T, 15) confidence; `config.hand_weight` applied to the hands'."""
    features = dance_features(joints_m, config.feature, config.fps, config.heading, confidence)
    hands = ["hand" in name for name in feature_names(config.feature, config.heading)]
    features.weights[:, hands] *= math.sqrt(config.hand_weight)  # a difference has the weights of both frames
    return features


def score_window(distances: np.ndarray, learner: Features, teacher: Features, start: int, config: ScorerConfig) -> WindowScore:
    """Scores a window.

    Args:
        distances: (n, 2 * band + 1) output of `kpopnet.dance.dtw.banded_distances` for the last n frames up to the window's
            end: the constant delay is estimated from all rows, the window is matched in its own last rows.
        learner: features of the window's frames.
        teacher: features of the whole dance.
        start: the teacher's frame of the same time as the window's first.
        config: the scorer's settings.
    """
    parts = part_columns(config.feature, config.heading)
    if config.matching == "algorithm_3":
        ahead = select_rows(teacher, slice(start, start + config.window_frames + config.band_frames))
        timing, posture, half_length = algorithm_3(
            learner, ahead, config.alpha, config.beta, tau_frames=config.tau * config.fps, outlier_rad=config.outlier_rad
        )
        delay_s = (len(learner.angles_rad) / 2 - half_length) / config.fps
        return WindowScore(delay_s, 100 * timing, 100 * posture, np.full(len(PARTS), np.nan))
    expected = constant_delay(distances, config.context_delay_penalty / config.fps)
    path = best_match(
        distances[-len(learner.angles_rad) :], config.steps == "slope", config.window_delay_penalty / config.fps, expected
    )
    posture, compared = posture_on_path(
        path, learner, teacher, start, config.band_frames, parts, config.outlier_rad, config.beta
    )
    posture[compared < MIN_COMPARED_FRACTION] = np.nan
    if math.isnan(posture[0]):
        return WindowScore(math.nan, math.nan, math.nan, posture[1:])
    middle_learner = (len(learner.angles_rad) - 1) / 2
    middle_teacher = (path[0].sum() + path[-1].sum()) / 2 - config.band_frames
    delay_s = (middle_learner - middle_teacher) / config.fps
    return WindowScore(delay_s, 100 * timing_similarity(delay_s, config), 100 * posture[0], 100 * posture[1:])


def timing_similarity(delay_s: float, config: ScorerConfig) -> float:
    """S_t in 0..1 of a delay in seconds: 0 for delays of at least tau, 1 - exp(-1 / alpha) without delay."""
    # Eq. (13)
    return 1 - min(1.0, math.exp((abs(delay_s) - config.tau) / (config.alpha * config.tau)))


def summary(scores: list[WindowScore], start_s: np.ndarray) -> DanceScore:
    """Combines the scores of the windows, which start at (N,) times in seconds, into the score of the dance."""
    delay_s, timing, posture = (np.array([getattr(s, name) for s in scores]) for name in ("delay_s", "timing", "posture"))
    parts = timing[:, None] * np.array([score.parts for score in scores]) / 100
    similarity = timing * posture / 100
    # Eq. (15)
    return DanceScore(
        _mean(similarity),
        _mean(timing),
        _mean(posture),
        {name: _mean(parts[:, i]) for i, name in enumerate(PARTS)},
        float(np.isfinite(similarity).mean()),
        Windows(start_s, delay_s, timing, posture, similarity, {name: parts[:, i] for i, name in enumerate(PARTS)}),
    )


@cache
def part_columns(feature: str, heading: bool) -> np.ndarray:
    """(1 + 5, D) mask of a feature's columns, 1 or 0: those of the whole body, then those of each of `PARTS`."""
    names = feature_names(feature, heading)
    of_part = {
        "arms": lambda name: "elbow" in name or "hand" in name,
        "legs": lambda name: "knee" in name or "foot" in name,
        "torso": lambda name: not name.startswith(("left", "right")),
        "left": lambda name: name.startswith("left"),
        "right": lambda name: name.startswith("right"),
    }
    return np.array([[True] * len(names), *([of_part[part](name) for name in names] for part in PARTS)], float)


def select_rows(features: Features, rows: slice) -> Features:
    return Features(*(array[rows] for array in features))


def _mean(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else math.nan
