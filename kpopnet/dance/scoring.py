"""Scores a learner's dance against a teacher's: timing, posture and similarity (section 3.2), 0 to 100.

    joints -> uniform frame rate -> features -> windows of 2 s -> DTW -> S_t, S_p of each window -> S

The delay of a window is the time between the middle of the learner's window and the middle of the teacher's frames that match
it. Our scorer (`kpopnet.dance.parts`) counts all windows of the teacher's dance: where the learner is not seen, or what of the
learner is not seen, scores 0. The paper's (`kpopnet.dance.paper`) knows no missing joints and leaves such windows out instead.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kpopnet.dance.dimensions.movement import FIGURES as DYNAMICS
from kpopnet.dance.dimensions.movement import Dynamics, Rhythm, dynamics, rhythm
from kpopnet.dance.dimensions.stage import DIMENSIONS, StageScore, stage_score
from kpopnet.dance.dtw import banded_distances
from kpopnet.dance.features import FEATURES, OF_EARLIER_FRAMES, Features, dance_features
from kpopnet.dance.noise.steady import FEATURE
from kpopnet.dance.noise.table import known_noise, noise_between
from kpopnet.dance.paper import PaperScorer, PaperTeacher
from kpopnet.dance.parts import PartScorer, PartTeacher
from kpopnet.dance.performance import Performance, as_performance, numbers, resampled, with_derived_torso
from kpopnet.dance.timing import BEATS_S, MIN_POSTURE, tempo
from kpopnet.dance.window import BAND_FRAMES, FPS, PARTS, WINDOW_FRAMES, WINDOW_S, WindowScore, not_compared
from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.languages import Said
from kpopnet.skeleton import MIRROR, NUM_JOINTS

Scorer = PartScorer | PaperScorer
Stretches = Sequence[tuple[float, float]]
"""Begin and end of parts of a dance, seconds on the teacher's clock."""

FIGURES = ("similarity", "timing", "posture", *DIMENSIONS, *DYNAMICS, "rhythm")
"""What a total may consist of."""

OURS = PartScorer()
SCORERS: dict[str, Scorer] = {"dance22": OURS, "paper": PaperScorer()} | {
    name: PaperScorer(name) for name in FEATURES if name not in ("dance22", FEATURE)
}
SCORERS["raptis"] = PaperScorer("raptis", alpha=0.2, beta=0.6, tau=0.4)
"""By name: ours; the paper's with its own feature; the paper's with each other feature, such as `raptis`, that of [17].

Settings of these three were chosen by one rule on the same dances (tools/calibrate_scorers.py)."""

MOST_WEIGHT = 1e6
"""Of a figure in a total: more than anybody needs, and sums of such are finite."""

MIRROR_MARGIN = 10.0
"""Points by which the mirrored comparison has to be better before it is preferred, or hinted at."""


def check_weights(weights: Mapping[str, float]) -> None:
    """Raises InputError for a name that is none of `FIGURES`, or weights that are negative or all 0; none at all are right."""
    if not isinstance(weights, Mapping):
        raise InputError(f"weights: expected numbers by name, such as {{'similarity': 1}}, got {weights!r:.80}")
    for name, weight in weights.items():
        check_one_of("weights", name, FIGURES)
        check_between(name, weight, 0, MOST_WEIGHT)
    if weights and not any(weights.values()):
        raise InputError("weights: expected one above 0")


def check_free(free_s: Stretches) -> list[tuple[float, float]]:
    """The stretches; raises InputError for one that does not end after its begin, and for anything but pairs of numbers."""
    try:
        checked = [(float(begin_s), float(end_s)) for begin_s, end_s in free_s]
    except (TypeError, ValueError):
        raise InputError(f"free: expected pairs of seconds, such as [(12, 20)], got {free_s!r:.80}") from None
    for begin_s, end_s in checked:
        if not begin_s < end_s:
            raise InputError(f"free from {begin_s:g} to {end_s:g} s: expected an end after the begin")
    return checked


def check_beat(beat_s: float | None) -> None:
    """Raises InputError for a beat that no music has; None is not known, nor is 0."""
    if beat_s is not None and beat_s != 0:
        check_between("seconds of a beat", beat_s, *BEATS_S)


class Windows(NamedTuple):
    """Scores of a dance's windows, 0 to 100.

    All arrays have N rows, one a window; those without a remark are as in `kpopnet.dance.window.WindowScore`.
    """

    start_s: np.ndarray  # (N,) start of each window, seconds on the teacher's clock
    delay_s: np.ndarray
    timing: np.ndarray
    posture: np.ndarray
    similarity: np.ndarray
    weight: np.ndarray  # (N,) weight in 0..1 in the scores of the dance, see `kpopnet.dance.parts.PartTeacher.movement`
    parts: dict[str, np.ndarray]  # by the name of one of `PARTS`, (N,) each
    coverage: dict[str, np.ndarray]  # likewise
    error_rad: np.ndarray
    error_weight: np.ndarray

    @property
    def middle_s(self) -> np.ndarray:
        """(N,) middle of each window, seconds on the teacher's clock."""
        return self.start_s + (WINDOW_FRAMES - 1) / 2 / FPS


class DanceScore(NamedTuple):
    """Scores of a learner's dance, 0 to 100; NaN if no window could be compared. Means over the windows are weighted."""

    similarity: float  # S of Eq. (15), the mean of the windows' S_t S_p
    timing: float  # the mean of S_t over the windows in which the learner was seen
    posture: float  # the mean of the windows' S_p
    # name of `PARTS` to the mean posture of that part alone, without regard to time and to the other parts; nothing is taken
    # off for standing still. Parts that the teacher does not show are left out.
    parts: dict[str, float]
    scored: float  # fraction of the windows that could be compared
    windows: Windows
    coverage: dict[str, float]  # name of `PARTS` to the fraction in 0..1 of what the teacher dances that the learner shows
    mirrored: bool  # whether the learner was compared as the teacher's mirror image
    mirror_fits_better: bool  # whether the learner fits the teacher's mirror image clearly better than the teacher
    tempo: float  # the learner's tempo divided by the teacher's; NaN where unknown, as mostly beyond 0.8 to 1.2
    # points, above or below the similarity, within which the score on true joints lies in 95 % of simulated dances, where the
    # noise of an estimator was set; 0 for true joints, NaN where it was not measured
    uncertainty: float
    scorer: Scorer
    teacher_m: np.ndarray  # (T, 15, 3) joints at the uniform frames that were compared, FPS a second, metres
    learner_m: np.ndarray  # (T, 15, 3) likewise
    is_free: np.ndarray  # (T,) whether the teacher leaves free what is danced

    @property
    def _delays_s(self) -> np.ndarray:
        """(T,) the learner's delay at each frame, seconds, between the windows of a posture that is no chance match."""
        known, frames = self.windows.posture >= MIN_POSTURE, np.arange(len(self.learner_m))
        known &= np.isfinite(self.windows.delay_s)
        middle = (self.windows.middle_s - self.windows.start_s[0]) * FPS
        return np.interp(frames, middle[known], self.windows.delay_s[known]) if known.any() else np.zeros(len(frames))

    @property
    def compared_m(self) -> list[np.ndarray]:
        """(T, 15, 3) joints of teacher and learner as `teacher_m` and `learner_m`, NaN in free parts."""
        return [np.where(self.is_free[: len(one), None, None], np.nan, one) for one in (self.teacher_m, self.learner_m)]

    @property
    def all_free(self) -> bool:
        """Whether nothing was compared since the teacher leaves it free: no window's middle lies elsewhere."""
        middle = ((self.windows.middle_s - self.windows.start_s[0]) * FPS).astype(int)
        return bool(self.is_free[middle].all())

    def beats_s(self, beat_s: float | None) -> np.ndarray | None:
        """(B,) times of the dance's beats, from the seconds of one: its multiples on the teacher's clock. None without one."""
        check_beat(beat_s)
        if not beat_s:
            return None
        first = math.floor(self.windows.start_s[0] / beat_s)
        return beat_s * np.arange(first, math.ceil(self.windows.middle_s[-1] / beat_s) + 4)

    @property
    def stage(self) -> StageScore:
        """Place, height, lean and facing, which similarity, timing and posture do not contain; computed anew at each call."""
        return stage_score(*self._within(~self.is_free), self._delays_s)

    @property
    def dynamics(self) -> Dynamics:
        """Amplitude, energy and sharpness of the limbs' movements, likewise."""
        return self._dynamics(~self.is_free)

    def rhythm(self, beats_s: np.ndarray | None) -> Rhythm | None:
        """The learner's accents against beats at (B,) seconds on the teacher's clock, likewise; None where there is none."""
        return self._rhythm(beats_s, ~self.is_free)

    def free(self, beats_s: np.ndarray | None = None) -> dict[str, float]:
        """Figures, 0 to 100, of what the teacher leaves free, where known: energy, and with beats as for `rhythm` rhythm."""
        danced = self._rhythm(beats_s, self.is_free)
        figures = self._dynamics(self.is_free).figures | ({"rhythm": danced.figure} if danced else {})
        return {name: figure for name, figure in figures.items() if name in ("energy", "rhythm")}

    def figures(self, beats_s: np.ndarray | None = None) -> dict[str, float]:
        """Those of FIGURES that are known, 0 to 100, by name: the rhythm only with beats, as for `rhythm`."""
        figures = {"similarity": self.similarity, "timing": self.timing, "posture": self.posture}
        danced = self.rhythm(beats_s)
        figures |= self.stage.figures | self.dynamics.figures | ({"rhythm": danced.figure} if danced else {})
        return {name: figure for name, figure in figures.items() if math.isfinite(figure)}

    def counted(self, weights: Mapping[str, float], beats_s: np.ndarray | None = None) -> dict[str, float]:
        """The weights above 0 whose `figures` are known; raises as `check_weights`."""
        check_weights(weights)
        figures = self.figures(beats_s)
        return {name: weight for name, weight in weights.items() if weight and name in figures}

    def total(self, weights: Mapping[str, float], beats_s: np.ndarray | None = None) -> float:
        """The mean of `figures`, weighted as a teacher wants it; of those that are known, NaN if none is; raises likewise."""
        counted, figures = self.counted(weights, beats_s), self.figures(beats_s)
        return _mean(np.array([figures[name] for name in counted]), np.array(list(counted.values()), float))

    def _dynamics(self, inside: np.ndarray) -> Dynamics:
        matched = np.rint(np.arange(len(self.learner_m)) - self._delays_s * FPS).astype(int)
        return dynamics(*self._within(inside), matched)

    def _rhythm(self, beats_s: np.ndarray | None, inside: np.ndarray) -> Rhythm | None:
        if beats_s is None:
            return None
        at_s = numbers("beats", beats_s)
        if at_s.ndim != 1:
            raise InputError(f"beats of shape {at_s.shape}: expected the times of beats, as DanceScore.beats_s(0.5) gives them")
        if not (np.isfinite(at_s).all() and (np.diff(at_s) > 0).all()):
            raise InputError("beats: expected finite times that increase, as DanceScore.beats_s(0.5) gives them")
        return rhythm(*self._within(inside), at_s - self.windows.start_s[0]) if len(at_s) else None

    def _within(self, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The (T, 15, 3) joints of teacher and learner at some of the frames, NaN at the others."""
        shown = inside[: len(self.learner_m), None, None]
        return np.where(shown, self.teacher_m[: len(shown)], np.nan), np.where(shown, self.learner_m, np.nan)

    def stage_remarks(self) -> list[tuple[float, Said]]:
        """What is most wrong on the stage, in words, with the time at which it begins, seconds on the teacher's clock."""
        return [(float(self.windows.start_s[0]) + at_s, text) for at_s, text in self.stage.remarks()]

    @property
    def completeness(self) -> float:
        """Fraction in 0..1 of what the teacher dances that the learner shows, the mean over the parts."""
        return sum(self.coverage.values()) / len(self.coverage) if self.coverage else math.nan


def score_dance(
    teacher: Performance | np.ndarray,
    learner: Performance | np.ndarray,
    scorer: Scorer = OURS,
    *,
    fps: float | None = None,
    unobserved_is_nan: bool = False,
    free_s: Stretches = (),
) -> DanceScore:
    """Scores a learner against a teacher whose clock is the same.

    Windows start at multiples of the scorer's `hop_s` from the teacher's first frame. Frames of the learner outside the
    teacher's dance are not scored. Dances may be given as (T, 15, 3) joints in metres in the camera frame with their `fps`.
    With `unobserved_is_nan` a learner of whom no joint is known scores NaN, for evaluations that count such dances. In the
    stretches `free_s` all may dance what they like: windows whose middle lies in one are not compared (`DanceScore.free`).

    Raises InputError if the teacher's dance is shorter than a window, or the learner's recording covers no whole window of it;
    or no joint is known in one of the dances; or joints are given without `fps`.
    """
    teacher, learner = as_performance(teacher, fps, "teacher"), as_performance(learner, fps, "learner")
    if isinstance(scorer, PartScorer) and scorer.noise == "auto" and learner.estimator != "none":
        scorer = replace(scorer, noise=learner.estimator)
    scorer = beside(scorer, teacher)
    if not unobserved_is_nan:
        check_observed(learner.is_observed, len(learner), "learner")
    learner = Performance(learner.joints_m, learner.times_s - scorer.latency_s, learner.confidence)
    if derives_torso(scorer, teacher, learner.torso_is_derived):
        teacher, learner = derived_torso(teacher), derived_torso(learner)
    grid = TimeGrid(teacher, scorer.feature, free_s=free_s)
    grid.check_overlap(grid.frames_of(learner))
    joints, prepared, scores = grid.resampled(learner, grid.frames), scorer.teacher(grid.teacher), []
    for mirrored in (False, True):
        comparison = Comparison(grid, prepared, mirrored)
        comparison.add(*joints, len(grid.frames))
        comparison.keep_windows(len(grid.frames))
        scores.append(comparison.summary())
    return preferred(*scores)


def check_scorer(scorer: object) -> None:
    """Raises InputError for anything but a scorer."""
    if not isinstance(scorer, Scorer):
        raise InputError(f"scorer: expected one such as kpopnet.dance.scoring.SCORERS['dance22'], got {scorer!r:.80}")


def beside(scorer: Scorer, teacher: Performance) -> Scorer:
    """A scorer with the noise of its learners' estimator against this teacher's joints.

    Raises InputError as `noise_between`, and for anything but a scorer.
    """
    check_scorer(scorer)
    return replace(scorer, noise=noise_between(teacher.estimator, scorer.noise)) if isinstance(scorer, PartScorer) else scorer


def derives_torso(scorer: Scorer, teacher: Performance, of_learner: bool) -> bool:
    """Whether the torso of both dances is derived before they are compared, since that of the teacher or `of_learner` is.

    A bend of the back that only one of them can show would be a difference of definitions. Of a learner whose estimator's noise
    is known, the webcam's, that difference to a teacher's own torso is a part of the noise.
    """
    return teacher.torso_is_derived or (of_learner and scorer.noise in ("none", "auto"))


def derived_torso(dance: Performance) -> Performance:
    """A dance whose torso is the mean of shoulders and hips."""
    joints_m, confidence = with_derived_torso(dance.joints_m, dance.confidence)
    return Performance(joints_m, dance.times_s, confidence)


def check_observed(is_observed: bool, frames: int, whose: str) -> None:
    """Raises InputError for a dance in none of whose frames a joint is known."""
    if not is_observed:
        raise InputError(
            f"the {whose}'s dance: no joint is known in any of its {frames} frames; was a person found in the recording?"
        )


class TimeGrid:
    """The uniformly spaced times at which two dances are resampled; frame 0 is the teacher's first.

    `frames` are the numbers of the T frames within the teacher's dance, `teacher` the teacher's features at these, `teacher_m`
    (T, 15, 3) the joints, metres, and `is_free` (T,) whether they lie in a free stretch.
    """

    def __init__(self, teacher: Performance, feature: str, fps: float = FPS, free_s: Stretches = ()) -> None:
        check_observed(teacher.is_observed, len(teacher), "teacher")
        self._feature, self._fps, self._start_s = feature, fps, float(teacher.times_s[0])
        self.frames = self.frames_of(teacher)
        if len(self.frames) < round(WINDOW_S * fps):
            raise InputError(
                f"the teacher's dance lasts {teacher.times_s[-1] - teacher.times_s[0]:.2f} s, less than a window of "
                f"{WINDOW_S} s; give a longer dance"
            )
        joints = self.resampled(teacher, self.frames)
        self.teacher_m, self.teacher = joints[0], self.features(*joints)
        times_s, self.is_free = self.time_s(self.frames), np.zeros(len(self.frames), bool)
        for begin_s, end_s in check_free(free_s):
            self.is_free |= (times_s >= begin_s) & (times_s < end_s)
        # What is not taught neither costs nor attracts a match; nor do changes and turns that began in it.
        earlier = np.array([name in OF_EARLIER_FRAMES for name in FEATURES[feature].names])
        recent = np.convolve(self.is_free, np.ones(FEATURES[feature].history_frames(fps)))[: len(self.is_free)] > 0
        self.teacher.angles_rad[self.is_free] = np.nan
        self.teacher.angles_rad[np.ix_(recent, earlier)] = np.nan

    def frames_of(self, performance: Performance) -> range:
        """The frames between a performance's first sample and its last."""
        return range(self.frame_from(performance.times_s[0]), self.frame_until(performance.times_s[-1]) + 1)

    def frame_from(self, time_s: float) -> int:
        """The first frame at or after a time in seconds."""
        return math.ceil((time_s - self._start_s) * self._fps - 1e-6)

    def frame_until(self, time_s: float) -> int:
        """The last frame at or before a time in seconds."""
        return math.floor((time_s - self._start_s) * self._fps + 1e-6)

    def time_s(self, frames: int | range) -> np.ndarray:
        """Times of frames in seconds, on the teacher's clock."""
        return self._start_s + np.asarray(frames) / self._fps

    def resampled(self, performance: Performance, frames: range) -> tuple[np.ndarray, np.ndarray]:
        """(G, 15, 3) joints and (G, 15) confidence of a performance at these frames; missing outside the recording."""
        return resampled(performance.joints_m, performance.confidence, performance.times_s, self.time_s(frames))

    def features(self, joints_m: np.ndarray, confidence: np.ndarray) -> Features:
        """Features of (T, 15, 3) joints at uniform frames with (T, 15) confidence."""
        return dance_features(joints_m, self._feature, self._fps, confidence)

    def check_overlap(self, learner: range) -> None:
        """Raises InputError if the learner's recorded frames cover no whole window of the teacher's dance."""
        common = range(max(learner.start, 0), min(learner.stop, self.frames.stop))
        if len(common) < WINDOW_FRAMES:
            raise InputError(
                f"the learner was recorded for {max(len(common) - 1, 0) / FPS:.2f} s of a dance of "
                f"{(len(self.frames) - 1) / FPS:.2f} s, in no whole window of {WINDOW_S} s; "
                "the times of both must be on the same clock"
            )


class Comparison:
    """Compares a learner, or if `mirrored` the learner's mirror image, with a teacher, window by window.

    The result is the same for frames that are added at once or one by one. `kept` are the windows of the dance's score, which
    start at multiples of the scorer's `hop_s`.
    """

    def __init__(self, grid: TimeGrid, teacher: PartTeacher | PaperTeacher, mirrored: bool) -> None:
        self._grid, self._teacher, self.mirrored = grid, teacher, mirrored
        self._hop_frames = round(teacher.scorer.hop_s * FPS)
        self._learner = Features(*(np.full_like(array, np.nan) for array in teacher.features))
        # Filled, so that all memory is taken before the dance begins, not page by page while it is scored in real time.
        self._distances = np.full((len(grid.frames), 2 * BAND_FRAMES + 1), np.nan)
        self._end, self.kept = 0, list[WindowScore]()
        # Of similarity and posture of the windows that were kept: sums of weighted values, of their limits, and of weights.
        self._sums = np.zeros((2, 3))

    def add(self, joints_m: np.ndarray, confidence: np.ndarray, new: int) -> None:
        """Adds the learner's next frames, the last `new` of (T, 15, 3) joints; the first of all is the teacher's frame 0.

        The frames before are those that the features of the new ones look back on.
        """
        if self.mirrored:
            joints_m, confidence = joints_m.take(MIRROR, axis=1) * [-1.0, 1.0, 1.0], confidence[:, MIRROR]
        self._add(self._grid.features(joints_m, confidence).at(slice(-new, None)))

    def _add(self, features: Features) -> None:
        begin, self._end = self._end, self._end + len(features.angles_rad)
        for stored, one in zip(self._learner, features, strict=True):
            stored[begin : self._end] = one
        teacher = self._teacher.features, begin, BAND_FRAMES, self._teacher.scorer.outlier_rad
        self._distances[begin : self._end] = banded_distances(features, *teacher)

    def add_missing(self, frames: int) -> None:
        """Adds frames in which no person was seen."""
        missing = np.full((frames, self._learner.angles_rad.shape[1]), np.nan)
        self._add(Features(missing, missing, np.zeros_like(missing), np.full((frames, NUM_JOINTS, 3), np.nan)))

    def remove(self, frames: int) -> None:
        """Removes the last frames."""
        self._end -= frames

    def window(self, start: int, frames: int = WINDOW_FRAMES) -> WindowScore:
        """Scores the window that starts at a frame; all of its frames must have been added."""
        if self._grid.is_free[start + (frames - 1) // 2]:
            return not_compared(self._learner.angles_rad.shape[1])
        stop = start + frames
        learner = self._learner.at(slice(start, stop))
        return self._teacher.window(self._distances[:stop], learner, start, self._learner.confidence[:stop])

    def keep_windows(self, frames: int) -> bool:
        """Scores and keeps the windows in the teacher's first `frames` that are not kept yet; whether one ends with them."""
        starts = range(len(self.kept) * self._hop_frames, frames - WINDOW_FRAMES + 1, self._hop_frames)
        for start in starts:
            window, weight = self.window(start), float(self._teacher.movement[len(self.kept)])
            self.kept.append(window)
            for sums, value, most in zip(
                self._sums, (window.similarity, window.posture), (window.limit, window.most), strict=True
            ):
                if not math.isnan(value):
                    sums += weight * value, weight * most, weight
        return bool(starts) and starts[-1] + WINDOW_FRAMES == frames

    @property
    def so_far(self) -> float:
        """S of Eq. (15) of the windows that were kept, 0 to 100; NaN before the first one."""
        return self.similarity_and_posture[0]

    @property
    def similarity_and_posture(self) -> tuple[float, float]:
        """Those of the windows that were kept, 0 to 100, as of `DanceScore`; NaN before the first one."""
        similarity, posture = (float(min(total, most) / weight) if weight else math.nan for total, most, weight in self._sums)
        return similarity, posture

    def summary(self) -> DanceScore:
        """The score of the windows that were kept."""
        count, scorer = len(self.kept), self._teacher.scorer
        spread = known_noise(scorer.noise).spread
        start_s = self._grid.time_s(range(0, count * self._hop_frames, self._hop_frames))
        weight = self._teacher.movement[:count]
        names = ("delay_s", "timing", "posture", "similarity", "expected", "most", "limit", "error_rad", "error_weight")
        delay_s, timing, posture, similarity, expected, most, limit, *errors = (
            np.array([getattr(one, name) for one in self.kept]) for name in names
        )
        parts, most_of, coverage = (
            dict[str, np.ndarray](zip(PARTS, np.array([getattr(one, name) for one in self.kept]).T, strict=True))
            for name in ("parts", "parts_most", "coverage")
        )
        # Means are limited, not what they are of, or errors of the estimator would lower them.
        shown_parts = {name: np.minimum(one, most_of[name]) for name, one in parts.items()}
        whole = delay_s, timing, np.minimum(posture, most), np.minimum(similarity, limit)
        windows = Windows(start_s, *whole, weight, shown_parts, coverage, *errors)
        kept = np.where(np.isfinite(posture), expected, np.nan)
        scored = float(np.isfinite(delay_s).mean())
        shown = [name for name in PARTS if np.isfinite(parts[name]).any()]
        return DanceScore(
            similarity=min(_mean(similarity, weight), _mean(limit, weight)) if scored else math.nan,  # Eq. (15)
            timing=_mean(timing, weight),
            posture=min(_mean(posture, weight), _mean(most, weight)) if scored else math.nan,
            parts={name: min(_mean(parts[name], weight), _mean(most_of[name], weight)) for name in shown},
            scored=scored,
            windows=windows,
            coverage={name: _mean(coverage[name], weight) for name in shown},
            mirrored=self.mirrored,
            mirror_fits_better=False,
            tempo=tempo(start_s, delay_s, posture, weight),
            uncertainty=200 * (math.nan if spread is None else spread) * _mean((1 - kept) / kept, weight),
            scorer=scorer,
            teacher_m=self._grid.teacher_m,
            learner_m=self._learner.joints_m[: self._end],
            is_free=self._grid.is_free,
        )


def mirror_fits_better(direct: tuple[float, float], mirrored: tuple[float, float]) -> bool:
    """Whether the learner's mirror image fits clearly better, of similarity and posture of both comparisons, 0 to 100.

    Who is late has no similarity, on either side, but for windows that fit at another delay by chance, and posture, which
    disregards the delay. Where both sides have much the same posture the timing tells them apart.
    """
    similarity, posture = (of_mirrored - of_direct for of_direct, of_mirrored in zip(direct, mirrored, strict=True))
    return posture > 0 and max(similarity, posture) > MIRROR_MARGIN


def preferred(direct: DanceScore, mirrored: DanceScore) -> DanceScore:
    """The score that the scorer's `mirrored` asks for, of the learner and of the learner's mirror image."""
    fits_better = mirror_fits_better(*((one.similarity, one.posture) for one in (direct, mirrored)))
    use = {"false": False, "true": True, "auto": fits_better}[direct.scorer.mirrored]
    return (mirrored if use else direct)._replace(mirror_fits_better=fits_better)


def _mean(values: np.ndarray, weight: np.ndarray) -> float:
    """The weighted mean of the known values; NaN if none of them has weight."""
    known = np.isfinite(values) & (weight > 0)
    return float(np.average(values[known], weights=weight[known])) if known.any() else math.nan
