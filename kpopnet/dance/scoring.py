"""The score of a learner's dance against a teacher's: timing, posture and similarity (section 3.2), 0 to 100.

    joints -> even frames -> features -> windows of 2 s -> DTW -> S_t, S_p of each window -> S

A window's delay is the time between the middles of the learner's window and of the teacher's frames that match it. What
could not be seen does not count for or against anybody: windows of which too little is known are left out of every mean. Of
what was seen the joints that are less sure than others count for less.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from kpopnet.dance.bearing import Bearing
from kpopnet.dance.dtw import STEPS, algorithm_3, banded_distances, best_match, posture_on_path, steady_delay
from kpopnet.dance.features import Features, dance_features, feature_names
from kpopnet.dance.performance import Performance
from kpopnet.dance.resampling import resampled, resampled_confidence
from kpopnet.errors import InputError

PARTS = ("arms", "legs", "torso", "left", "right")

MATCHINGS = ("subsequence", "algorithm_3")

LEAST_KNOWN = 0.5
"""A window of which a smaller share could be compared is not scored."""


@dataclass(frozen=True)
class ScorerConfig:
    """How dances are compared.

    Attributes:
        feature: dance22 (the paper's) or raptis (that of [17]).
        heading: adds the turn of the whole body to dance22, which cannot see it otherwise.
        fps: both dances are brought to this rate by their time stamps.
        smoothing_s: standard deviation of the smoothing in time that comes with it.
        window_s: the learner's period that is scored at once; 2 s in the paper.
        hop_s: from one window to the next. The paper's follow each other; overlapping ones use all of the dance's transitions.
        band_s: how far from the expected time a match is looked for.
        context_s: the steady delay is that of so much of the dance up to the window's end.
        steady_pull: what a second of steady delay costs, in radians of a frame's distance: where a dance fits at any delay
            the learner is taken to be in time.
        pull: what a second away from the steady delay costs a window at its beginning and at its end, likewise.
        steps: slope or free, see kpopnet.dance.dtw.
        outlier_rad: differences of angles beyond it count less and less, see kpopnet.dance.dtw.frame_distance; inf: all alike.
        settling_s: so many seconds without any difference are taken to have come before the dance, when a learner's steady
            differences are learnt and taken out, see kpopnet.dance.bearing; inf: they stay.
        most_bearing_rad: up to so much.
        hands: weight of the squared differences of the hands' angles: no estimator tells them as well as the others.
        matching: subsequence, or algorithm_3 for the paper's Algorithm 3 as printed.
        alpha: slope of the timing similarity, Eq. (13).
        beta: deviation in posture at which similarity has fallen to 1/e, Eq. (14), in radians of the whole feature's norm.
        tau: deviation in time at which nothing is left, Eq. (13), in seconds.
    """

    feature: str = "dance22"
    heading: bool = False
    fps: float = 30.0
    smoothing_s: float = 0.08
    window_s: float = 2.0
    hop_s: float = 0.5
    band_s: float = 1.5
    context_s: float = 6.0
    steady_pull: float = 0.02
    pull: float = 0.6
    steps: str = "slope"
    outlier_rad: float = 0.25
    settling_s: float = 3.0
    most_bearing_rad: float = 0.25
    hands: float = 0.25
    matching: str = "subsequence"
    # By kpopnet.dance.calibration on the joints that a network found in 70 dances of kpop_sim's split train: the greatest alpha
    # that leaves a perfect copy 96 points; of beta and tau that keep standing still below 20 and another dance below 30 the
    # pair that orders most dances.
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
        if not self.settling_s > 0:
            raise InputError(f"settling_s={self.settling_s} must be positive, or inf to leave steady differences in")
        for name in ("pull", "steady_pull", "hands", "most_bearing_rad"):
            if not 0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name}={getattr(self, name)} must be 0 or more")
        if self.steps not in STEPS:
            raise InputError(f"steps={self.steps} is not one of {', '.join(STEPS)}")
        if self.matching not in MATCHINGS:
            raise InputError(f"matching={self.matching} is not one of {', '.join(MATCHINGS)}")
        if self.window_frames < 2:
            raise InputError(f"window_s={self.window_s} has no two frames at fps={self.fps}; give a longer one")

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
        feature="raptis", outlier_rad=math.inf, settling_s=math.inf, hands=1.0, alpha=0.3, beta=1.8, tau=0.6
    ),
}
"""The paper's feature with our robust distance, and what it is compared with: the feature of [17] in the plain norm of
Eq. (14), all angles alike. Both are matched in time in the same way, and in both unsure joints count for less. The second is
what the difficulty of kpop_sim was set by; whoever changes it has to set that anew. So its alpha, beta and tau stayed what they
were before those of dance22 were calibrated."""


class Windows(NamedTuple):
    """A dance's windows, each as 0 to 100; NaN where too little could be compared.

    Attributes:
        start_s: (N,) when each window starts, on the performances' clock.
        delay_s: (N,) how late the learner is; negative when early.
        timing: (N,) S_t of Eq. (13).
        posture: (N,) S_p of Eq. (14).
        similarity: (N,) S_t S_p.
        parts: name of `PARTS` to (N,) S_t and the S_p of that part's angles alone.
    """

    start_s: np.ndarray
    delay_s: np.ndarray
    timing: np.ndarray
    posture: np.ndarray
    similarity: np.ndarray
    parts: dict[str, np.ndarray]


class DanceScore(NamedTuple):
    """How well a dance was followed, 0 to 100; NaN if no window could be compared.

    Attributes:
        similarity: S of Eq. (15), the mean of the windows' S_t S_p.
        timing: the mean of their S_t.
        posture: the mean of their S_p.
        parts: name of `PARTS` to the mean of its similarity.
        scored: share of the windows of which enough was known; the others are in no mean.
        windows: where and when points were lost.
    """

    similarity: float
    timing: float
    posture: float
    parts: dict[str, float]
    scored: float
    windows: Windows


class WindowScore(NamedTuple):
    """One window: see `Windows`; `parts` is (5,) posture of each of `PARTS`."""

    delay_s: float
    timing: float
    posture: float
    parts: np.ndarray


def score_dance(teacher: Performance, learner: Performance, config: ScorerConfig = SCORERS["dance22"]) -> DanceScore:
    """How well a learner follows a teacher.

    Windows lie at multiples of `config.hop_s` from the teacher's first frame, wherever the learner danced all of one. What the
    learner does before the teacher begins or after the teacher has ended is not scored.

    Raises:
        InputError: the teacher's dance is shorter than a window, or the learner danced no whole window of it.
    """
    clock = Clock(teacher, config)
    frames = clock.danced_frames(learner)
    comparison = Comparison(clock.features(teacher, clock.teacher_frames), frames.start, config)
    comparison.add(clock.features(learner, frames))
    starts = clock.window_starts(frames)
    return summary([comparison.window(start) for start in starts], clock.time_s(starts))


class Clock:
    """The even frames that a teacher's dance and all who follow it are brought to; frame 0 is the teacher's first."""

    def __init__(self, teacher: Performance, config: ScorerConfig) -> None:
        self._config, self._start_s = config, float(teacher.times_s[0])
        self.teacher_frames = self.frames_of(teacher)
        if len(self.teacher_frames) < config.window_frames:
            raise InputError(
                f"the teacher's dance lasts {teacher.times_s[-1] - teacher.times_s[0]:.2f} s, less than a window of "
                f"{config.window_s} s; give a longer dance or a shorter window_s"
            )

    def frames_of(self, performance: Performance) -> range:
        """The frames from a performance's first sample to its last."""
        return range(self.frame_from(performance.times_s[0]), self.frame_until(performance.times_s[-1]) + 1)

    def frame_from(self, time_s: float) -> int:
        """The first frame at a time or after it."""
        return math.ceil((time_s - self._start_s) * self._config.fps - 1e-6)

    def frame_until(self, time_s: float) -> int:
        """The last frame at a time or before it."""
        return math.floor((time_s - self._start_s) * self._config.fps + 1e-6)

    def time_s(self, frames: int | range) -> np.ndarray:
        """When frames are."""
        return self._start_s + np.asarray(frames) / self._config.fps

    def danced_frames(self, learner: Performance) -> range:
        """The frames of the dance in which the learner was seen."""
        frames = self.frames_of(learner)
        return range(max(frames.start, 0), min(frames.stop, self.teacher_frames.stop))

    def features(self, performance: Performance, frames: range) -> Features:
        when = performance.times_s, self.time_s(frames), self._config.smoothing_s
        return features_of(
            resampled(performance.joints_m, *when), resampled_confidence(performance.confidence, *when), self._config
        )

    def window_starts(self, frames: range) -> range:
        """First frames of the windows that lie in the frames that somebody danced.

        Raises:
            InputError: there is none.
        """
        size, hop = self._config.window_frames, self._config.hop_frames
        starts = range(-(-frames.start // hop) * hop, frames.stop - size + 1, hop)
        if not starts:
            fps = self._config.fps
            raise InputError(
                f"the learner was seen for {max(len(frames) - 1, 0) / fps:.2f} s of a dance of "
                f"{(len(self.teacher_frames) - 1) / fps:.2f} s, in no whole window of {self._config.window_s} s; "
                "the times of both must run by one clock"
            )
        return starts


class Comparison:
    """A learner's frames against the teacher's, as they come: all at once or one by one, which is the same."""

    def __init__(self, taught: Features, first: int, config: ScorerConfig) -> None:
        """Nothing has come yet.

        Args:
            taught: the features of the whole dance.
            first: the teacher's frame of the same time as the learner's first.
            config: the scorer's.
        """
        self._taught, self._first, self._config = taught, first, config
        self._learnt = Features(*(np.full_like(array, np.nan) for array in taught))
        self._distances = np.empty((len(taught.angles_rad), 2 * config.band_frames + 1))
        angles = taught.angles_rad.shape[1]
        self._bearing = Bearing(angles, config.settling_s * config.fps, config.most_bearing_rad)
        self._delay, self._end = 0, first

    def add(self, features: Features) -> None:
        """Takes in the learner's next frames. Their bearing is learnt at the steady delay, which is asked for once a hop."""
        config, hop = self._config, self._config.hop_frames
        stop = self._end + len(features.angles_rad)
        for begin in range(self._end // hop * hop, stop, hop):
            begin, end = max(begin, self._end), min(begin + hop, stop)
            rows = rows_of(features, slice(begin - self._end, end - self._end))
            rows = self._bearing.taken_out(rows, self._taught, begin - self._delay)
            for kept, new in zip(self._learnt, rows, strict=True):
                kept[begin:end] = new
            self._distances[begin:end] = banded_distances(rows, self._taught, begin, config.band_frames, config.outlier_rad)
            if end % hop == 0:
                column = steady_delay(self._context(end), config.steady_pull / config.fps)
                self._delay = config.band_frames - column
        self._end = stop

    def window(self, start: int) -> WindowScore:
        """Scores a window whose frames have come."""
        end = start + self._config.window_frames
        return score_window(self._context(end), rows_of(self._learnt, slice(start, end)), self._taught, start, self._config)

    def _context(self, end: int) -> np.ndarray:
        return self._distances[max(end - self._config.context_frames, self._first) : end]


def features_of(joints_m: np.ndarray, confidence: np.ndarray, config: ScorerConfig) -> Features:
    """Features of (T, 15, 3) even frames with (T, 15) confidence, the hands' with their weight."""
    features = dance_features(joints_m, config.feature, config.fps, config.heading, confidence)
    hands = ["hand" in name for name in feature_names(config.feature, config.heading)]
    features.weights[:, hands] *= math.sqrt(config.hands)  # a difference has the weights of both its frames
    return features


def score_window(
    distances: np.ndarray, learner: Features, teacher: Features, start: int, config: ScorerConfig
) -> WindowScore:
    """Scores a window.

    Args:
        distances: (n, 2 * band + 1) of its frames, as of `kpopnet.dance.dtw.banded_distances`.
        learner: the features of its n frames.
        teacher: the features of the whole dance.
        start: the teacher's frame of the same time as the window's first.
        config: the scorer's.
    """
    parts = part_columns(config.feature, config.heading)
    if config.matching == "algorithm_3":
        ahead = rows_of(teacher, slice(start, start + config.window_frames + config.band_frames))
        timing, posture, half_length = algorithm_3(
            learner, ahead, config.alpha, config.beta, tau_frames=config.tau * config.fps, outlier_rad=config.outlier_rad
        )
        delay_s = (len(learner.angles_rad) / 2 - half_length) / config.fps
        return WindowScore(delay_s, 100 * timing, 100 * posture, np.full(len(PARTS), np.nan))
    expected = steady_delay(distances, config.steady_pull / config.fps)
    path = best_match(distances[-len(learner.angles_rad) :], config.steps == "slope", config.pull / config.fps, expected)
    posture, compared = posture_on_path(
        path, learner, teacher, start, config.band_frames, parts, config.outlier_rad, config.beta
    )
    posture[compared < LEAST_KNOWN] = np.nan
    if math.isnan(posture[0]):
        return WindowScore(math.nan, math.nan, math.nan, posture[1:])
    middle_learner = (len(learner.angles_rad) - 1) / 2
    middle_teacher = (path[0].sum() + path[-1].sum()) / 2 - config.band_frames
    delay_s = (middle_learner - middle_teacher) / config.fps
    return WindowScore(delay_s, 100 * timing_similarity(delay_s, config), 100 * posture[0], 100 * posture[1:])


def timing_similarity(delay_s: float, config: ScorerConfig) -> float:
    """S_t in 0..1. It is 0 from a delay of tau on, and 1 - exp(-1 / alpha) at best."""
    # Eq. (13)
    return 1 - min(1.0, math.exp((abs(delay_s) - config.tau) / (config.alpha * config.tau)))


def summary(scores: list[WindowScore], start_s: np.ndarray) -> DanceScore:
    """The score of a dance of the scores of its windows, which start at these times."""
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
    """(1 + 5, D) 1 for the columns of a feature that tell about the whole body and about each of `PARTS`, 0 for others."""
    names = feature_names(feature, heading)
    of_part = {
        "arms": lambda name: "elbow" in name or "hand" in name,
        "legs": lambda name: "knee" in name or "foot" in name,
        "torso": lambda name: not name.startswith(("left", "right")),
        "left": lambda name: name.startswith("left"),
        "right": lambda name: name.startswith("right"),
    }
    return np.array([[True] * len(names), *([of_part[part](name) for name in names] for part in PARTS)], float)


def rows_of(features: Features, rows: slice) -> Features:
    return Features(*(array[rows] for array in features))


def _mean(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan
