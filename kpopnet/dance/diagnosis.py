"""Says why a recording may be unfit for its score: sides swapped, axes left-handed, a mirrored dance, a clock that is off.

Each supposed fault is corrected and the dance is scored again. A fault is reported only if its correction gains a lot: a poor
dancer gains nothing from any of them. It is corrected only if the gain is larger still and no dancer could have made it.
"""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from kpopnet.dance.dtw import banded_distances
from kpopnet.dance.performance import MAX_DURATION_S, Performance, check_dance
from kpopnet.dance.scoring import Scorer, Stretches, TimeGrid, check_free, check_scorer, score_dance
from kpopnet.dance.window import WINDOW_S
from kpopnet.dance.words.causes import mean_of_known
from kpopnet.errors import InputError, check_number, check_one_of, check_type
from kpopnet.languages import Said
from kpopnet.skeleton import MIRROR, Joint

CORRECTIONS = ("as_recorded", "mirrored", "swapped", "reflected")
"""What can be done to the joints of a recording. `swapped` exchanges the names of left and right, `reflected` turns left-handed
axes into right-handed ones, and `mirrored`, both together, makes the dance of a person in a mirror."""

MIN_GAIN, MIN_CORRECTED = 15.0, 40.0
"""A fault is reported if its correction raises the similarity by at least the first, in points, to at least the second."""

SURE_GAIN, LOSING, SURE_DELAY_S, SURE_RATE = 30.0, 0.1, 1.0, 1.15
"""It is corrected if that gains at least the first, in points, and at most this fraction of the windows loses: who mirrors a
part of the dance makes a mistake. A shorter delay may be the dancer's, who is late or early; a rate that is nearer to 1 too,
who dances too fast or too slowly."""

SEARCH_FPS, SEARCH_S = 5.0, 30.0
"""Frame rate of the search for the best clock, and the greatest delay that it looks at."""

COMMON_FPS = (24.0, 25.0, 30.0, 50.0, 60.0, 100.0, 120.0)
"""Rates at which dances are recorded."""

MIN_DELAY_S = 0.1
BACKWARD_KNEES = -0.2
"""Mean bend of the knees to the front, as a fraction of the size of the bend, below which they bend backwards."""


class RecordingFault(NamedTuple):
    """A probable fault of a recording."""

    text: str  # the fault, its probable causes, and which option of `kpopnet score` corrects it
    corrected: float | None  # similarity of the dance with all probable faults corrected; None where the fault costs nothing
    about: str  # "mirror", "sides", "tempo", "delay" or "format"; `kpopnet.dance.feedback` leaves out hints about the same


class Correction(NamedTuple):
    """Corrections of both dancers' joints, of CORRECTIONS, and what the learner's times are multiplied by, then lessened by."""

    teacher: str = "as_recorded"
    learner: str = "as_recorded"
    rate: float = 1.0
    late_s: float = 0.0

    @property
    def sure(self) -> "Correction":
        """What of it corrects a recording, and not a dancer."""
        rate = self.rate if max(self.rate, 1 / self.rate) >= SURE_RATE else 1.0
        return self._replace(rate=rate, late_s=self.late_s if abs(self.late_s) >= SURE_DELAY_S else 0.0)

    @property
    def rest(self) -> "Correction":
        """What of it may be the dancer's."""
        return Correction(rate=self.rate / self.sure.rate, late_s=self.late_s - self.sure.late_s)

    @property
    def done(self) -> list[Said]:
        """Each correction in words."""
        both = ("teacher", self.teacher), ("learner", self.learner)
        done = [Said(f"the {name} {one}") for name, one in both if one != "as_recorded"]
        if self.rate != 1:
            done.append(Said("the learner's times multiplied by {factor}", factor=f"{self.rate:.3g}"))
        if self.late_s:
            clock = "the learner's clock {seconds} s earlier" if self.late_s > 0 else "the learner's clock {seconds} s later"
            done.append(Said(clock, seconds=f"{abs(self.late_s):.2f}"))
        return done


AS_RECORDED = Correction()


class Diagnosis(NamedTuple):
    """Two recorded dances, corrected where their faults were sure."""

    teacher: Performance
    learner: Performance
    faults: list[RecordingFault]  # those that are left
    correction: Correction | None = None  # what was corrected; None for nothing
    as_recorded: float = 0.0  # the similarity before the correction, 0 to 100
    corrected: float = 0.0  # and after it
    mirrored: bool = False  # whether the learner was mirrored, by this correction or by an option

    def __str__(self) -> str:
        """What was corrected, with both scores, "" if nothing was."""
        if self.correction is None:
            return ""
        return Said(
            "as it stands {before}, with {corrections} {after}: scored so; --as-is keeps it",
            before=f"{self.as_recorded:.0f}",
            corrections=self.correction.done,
            after=f"{self.corrected:.0f}",
        )


def corrected(performance: Performance, correction: str) -> Performance:
    """A performance after one of CORRECTIONS; raises InputError for another correction."""
    check_one_of("correction", correction, CORRECTIONS)
    check_dance(performance, "the dance to correct")
    joints_m, confidence = performance.joints_m, performance.confidence
    if correction in ("mirrored", "swapped"):
        joints_m, confidence = joints_m[:, MIRROR], confidence[:, MIRROR]
    if correction in ("mirrored", "reflected"):
        joints_m = joints_m * np.array([-1.0, 1.0, 1.0])
    return Performance(joints_m, performance.times_s, confidence, performance.estimator)


def composed(first: str, second: str) -> str:
    """The one of CORRECTIONS that is two of them, one after the other: each undoes itself, two different ones are the third.

    That is the exclusive or of their places in CORRECTIONS.
    """
    return CORRECTIONS[CORRECTIONS.index(first) ^ CORRECTIONS.index(second)]


def delayed(performance: Performance, late_s: float, rate: float = 1.0) -> Performance:
    """A performance whose times, from the first on, are multiplied by a rate and then lessened by a delay in seconds."""
    check_dance(performance, "the dance to delay")
    check_number("late_s", late_s)
    check_number("rate", rate)
    start_s = performance.times_s[0]
    times_s = start_s + rate * (performance.times_s - start_s) - late_s
    return Performance(performance.joints_m, times_s, performance.confidence, performance.estimator)


def diagnose(
    teacher: Performance,
    learner: Performance,
    scorer: Scorer,
    as_is: bool = False,
    free_s: Stretches = (),
    given: Correction = AS_RECORDED,
) -> Diagnosis:
    """What is probably wrong with the recordings of two dances, and the dances without what is surely wrong, unless `as_is`.

    The stretches `free_s` are not compared, as in `score_dance`. Options have `given` the dances some corrections already; an
    option that is named takes the place of theirs. Raises InputError for what is no dance, scorer, stretch or correction.
    """
    check_dance(teacher, "the teacher's dance")
    check_dance(learner, "the learner's dance")
    check_scorer(scorer)
    check_type("given", given, Correction)
    free_s = check_free(free_s)
    wrong = {name: knees_bend_backwards(one) for name, one in (("teacher", teacher), ("learner", learner))}
    if all(wrong.values()):
        text = (
            "the knees of both dancers bend backwards: left and right are swapped in both files, or their axes are left-"
            "handed; the score is that of two dances in a mirror"
        )
        return Diagnosis(teacher, learner, [RecordingFault(Said(text), None, "sides")])
    pair = _Pair(teacher, learner, scorer, free_s)
    score = cache(pair.score)  # without a fault all the corrections below are equal
    plain = score(Correction())
    best = min(_guesses(wrong, teacher, learner), key=lambda one: pair.fit(one)[1])
    best = best._replace(late_s=best.late_s + pair.fit(best)[0])
    best = best._replace(late_s=best.late_s + score(best).delay_s)
    if abs(best.late_s) < MIN_DELAY_S:
        best = best._replace(late_s=0.0)
    fitted = score(best)
    if not fitted.gains(plain, MIN_GAIN):
        text = "the {dancer}'s knees bend backwards: left and right are swapped in the file, or its axes are left-handed"
        names = [name for name, backwards in wrong.items() if backwards]
        faults = [RecordingFault(Said(text, dancer=Said(name)), None, "sides") for name in names]
        return Diagnosis(teacher, learner, faults)
    without_sure = score(best.sure)
    corrects = not as_is and without_sure.gains(plain, SURE_GAIN) and without_sure.losing(plain) <= LOSING
    rest, now = (best.rest, without_sure) if corrects else (best, plain)
    told = _descriptions(rest, teacher, learner, given) if fitted.gains(now, MIN_GAIN) else ()
    faults = [RecordingFault(text, fitted.similarity, about) for about, text in told]
    if not corrects:
        return Diagnosis(teacher, learner, faults)
    return Diagnosis(*pair.after(best.sure), faults, best.sure, plain.similarity, now.similarity)


class _Result(NamedTuple):
    """What a correction makes of the score: as of a dance of which no window is covered."""

    similarity: float = 0.0  # 0 to 100
    windows: np.ndarray = np.zeros(0)  # (N,) their similarity, 0 where unknown
    weight: np.ndarray = np.zeros(0)  # (N,) how much the teacher moves in them, as of `kpopnet.dance.scoring.Windows`
    delay_s: float = 0.0  # the learner's median delay where the teacher moves; 0 if unknown

    def gains(self, before: "_Result", points: float) -> bool:
        return self.similarity >= max(MIN_CORRECTED, before.similarity + points)

    def losing(self, before: "_Result") -> float:
        """The fraction of the windows that score MIN_GAIN less than before; each counts as much as in the score."""
        if not before.weight.any():
            return 0.0
        return float(np.average(before.windows >= self.windows + MIN_GAIN, weights=before.weight))


class _Pair(NamedTuple):
    """Two recorded dances, and how they are scored."""

    teacher: Performance
    learner: Performance
    scorer: Scorer
    free_s: Stretches

    def after(self, guess: Correction) -> tuple[Performance, Performance]:
        """Both performances without the supposed faults."""
        learner = delayed(corrected(self.learner, guess.learner), guess.late_s, guess.rate)
        return corrected(self.teacher, guess.teacher), learner

    def score(self, guess: Correction) -> _Result:
        """The score without the supposed faults."""
        try:
            score = score_dance(*self.after(guess), self.scorer, free_s=self.free_s)
        except InputError:
            return _Result()
        windows = score.windows
        delay_s = windows.delay_s[np.isfinite(windows.delay_s) & (windows.weight > 0)]
        median_s = float(np.median(delay_s)) if len(delay_s) else 0.0
        return _Result(float(np.nan_to_num(score.similarity)), np.nan_to_num(windows.similarity), windows.weight, median_s)

    def fit(self, guess: Correction) -> tuple[float, float]:
        """The delay in seconds at which the learner's frames are nearest to the teacher's, and their mean distance there."""
        teacher, learner = self.after(guess)
        grid, band = TimeGrid(teacher, self.scorer.feature, SEARCH_FPS, self.free_s), round(SEARCH_S * SEARCH_FPS)
        frames = grid.frames_of(learner)
        features = grid.features(*grid.resampled(learner, frames))
        distances = banded_distances(features, grid.teacher, frames.start, band, self.scorer.outlier_rad)
        mean = mean_of_known(distances, max(min(len(frames), len(grid.frames)) / 2, round(WINDOW_S * SEARCH_FPS)))
        column = int(mean.argmin()) if np.isfinite(mean).any() else band
        return (band - column) / SEARCH_FPS, float(mean[column])


def knees_bend_backwards(performance: Performance) -> bool:
    """Whether knees bend to the back: then the names of left and right are swapped, or the axes are left-handed."""
    joints_m = check_dance(performance, "the dance").joints_m
    hips_m = joints_m[:, [Joint.RIGHT_HIP, Joint.LEFT_HIP]]
    down = hips_m.mean(axis=1) - joints_m[:, [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]].mean(axis=1)
    front = np.cross(down, hips_m[:, 1] - hips_m[:, 0])
    front /= np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-9)
    feet_m = joints_m[:, [Joint.RIGHT_FOOT, Joint.LEFT_FOOT]]
    bend_m = joints_m[:, [Joint.RIGHT_KNEE, Joint.LEFT_KNEE]] - (hips_m + feet_m) / 2
    forward_m, size_m = (bend_m * front[:, None]).sum(axis=-1), np.linalg.norm(bend_m, axis=-1)
    known = np.isfinite(forward_m)
    return bool(forward_m[known].sum() < BACKWARD_KNEES * size_m[known].sum())


def _guesses(wrong: dict[str, bool], teacher: Performance, learner: Performance) -> Iterator[Correction]:
    """What may be wrong, the simplest first: nothing but a delay; the joints; the learner's or the teacher's frame rate.

    Dances of clocks that have no time in common are supposed to begin together.
    """
    apart = learner.times_s[0] > teacher.times_s[-1] - WINDOW_S or learner.times_s[-1] < teacher.times_s[0] + WINDOW_S
    plain = Correction(late_s=float(learner.times_s[0] - teacher.times_s[0]) if apart else 0.0)
    yield plain
    whose = "teacher" if wrong["teacher"] else "learner"
    yield from (plain._replace(**{whose: one}) for one in (("swapped", "reflected") if wrong[whose] else ("mirrored",)))
    learner_fps, teacher_fps = _fps(learner), _fps(teacher)
    rates = {round(learner_fps / fps, 3) for fps in COMMON_FPS} | {round(fps / teacher_fps, 3) for fps in COMMON_FPS}
    most = min(5, MAX_DURATION_S / max(float(np.ptp(learner.times_s)), 1.0))
    yield from (plain._replace(rate=rate) for rate in sorted(rates) if 0.2 <= rate <= most and abs(rate - 1) > 0.01)


def _fps(performance: Performance) -> float:
    return 1 / float(np.median(np.diff(performance.times_s))) if len(performance) > 1 else 1.0


def _descriptions(
    guess: Correction, teacher: Performance, learner: Performance, given: Correction
) -> Iterator[tuple[str, str]]:
    """The faults of a guess: what each is about, and its text, with the option in place of the one `given` already."""
    faults = {
        "mirrored": (
            "mirror", "dances mirrored: a left-handed dancer, one who faces the teacher as a mirror, or a mirrored video"
        ),
        "swapped": ("sides", "has left and right swapped among the joints: the knees bend backwards"),
        "reflected": ("sides", "has left-handed axes: the knees bend backwards"),
    }  # fmt: skip
    for name, correction, before in (("teacher", guess.teacher, given.teacher), ("learner", guess.learner, given.learner)):
        if correction in faults:
            about, fault = faults[correction]
            text, option = "the {dancer} {fault}. To correct it: {option}", f"--correct-{name} {composed(before, correction)}"
            yield about, Said(text, dancer=Said(name), fault=Said(fault), option=option)
    if guess.rate != 1:
        text = (
            "the learner's clock runs wrong: the dance fits if its times are multiplied by {factor}. Was the learner "
            "recorded at {learner_fps} frames a second, not {learner_stated} (--learner-fps), or the "
            "teacher at {teacher_fps}, not {teacher_stated} (--teacher-fps)?"
        )
        learner_fps, teacher_fps = _fps(learner), _fps(teacher)
        rates = {"learner_fps": learner_fps / guess.rate, "learner_stated": learner_fps}
        rates |= {"teacher_fps": teacher_fps * guess.rate, "teacher_stated": teacher_fps, "factor": guess.rate}
        yield "tempo", Said(text, **{name: f"{rate:.3g}" for name, rate in rates.items()})
    if guess.late_s:
        text = (
            "the learner is {seconds} s {word} throughout: the clocks start at different instants of the music, or the set-up "
            "has a latency. To correct it: {option}"
        )
        word, option = Said("late" if guess.late_s > 0 else "early"), f"--late {given.late_s + guess.late_s:.2f}"
        yield "delay", Said(text, seconds=f"{abs(guess.late_s):.2f}", word=word, option=option)
