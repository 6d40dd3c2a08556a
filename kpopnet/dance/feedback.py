"""What a dancer can use of a score: per phrase the cause, or else the worst moments; what repeats; what is right.

A phrase with a cause (`kpopnet.dance.words.causes`) is not told in degrees of joints. Everything is ranked by the points that
it costs, and computed from a `DanceScore`, so that the words during the dance are those of afterwards.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kpopnet.dance.diagnosis import RecordingFault
from kpopnet.dance.dimensions.stage import runs
from kpopnet.dance.scoring import DanceScore, check_beat
from kpopnet.dance.window import LIMBS
from kpopnet.dance.words.causes import CAUSES, causes
from kpopnet.dance.words.moments import (
    MIN_DELAY_S,
    MIN_POINTS,
    PHRASE_S,
    Losses,
    Moment,
    at,
    clock,
    from_to,
    lateness,
    phrase_length_s,
    posture_moments,
    posture_text,
    span,
    timing_moments,
)
from kpopnet.errors import InputError, check_number
from kpopnet.languages import Said

MOMENTS_PER_PHRASE = 3

LEAST_WEIGHT = 0.5
"""Of the windows of a phrase together, below which it has no score: the teacher stands."""

MIN_TEMPO_DIFFERENCE = 0.03
THROUGHOUT = 0.7
"""Fraction of the dance from which on a fault is called constant."""

EDGE_S = 0.5
"""Whatever begins or ends this near to the start or end of a phrase is said to last up to there."""

UNSEEN_BELOW = 0.5
"""A part is unseen in windows in which less of it is shown."""

RIGHT, RIGHT_WINDOWS = 90.0, 0.8
"""A part, or the timing, that scores this much in this share of the windows is praised."""


@dataclass(frozen=True)
class Phrase:
    """A phrase of the dance."""

    start_s: float
    end_s: float
    similarity: float | None  # of its windows, None where nothing could be compared, or the teacher hardly moves
    unseen: tuple[str, ...]  # who or what was not in the picture, in words
    moments: tuple[Moment, ...]  # the worst ones, the worst first; what their `text` says of the time is about the phrase alone


AS_THE_TEACHERS = "compared as in a mirror: left and right are as the teacher has them"


@dataclass(frozen=True)
class Fault:
    """One fault wherever it occurs: moments of equal part, joint and direction."""

    part: str
    joint: str
    direction: str
    degrees: float
    delay_s: float
    starts_s: tuple[float, ...]
    text: str


@dataclass(frozen=True)
class Feedback:
    """Phrases in order of time, all moments and all faults, each with the costliest first, and hints and praise in words."""

    phrases: tuple[Phrase, ...]
    moments: tuple[Moment, ...]
    faults: tuple[Fault, ...]
    hints: tuple[str, ...]
    praise: tuple[str, ...]


def feedback(score: DanceScore, beat_s: float | None = None, recording: Sequence[RecordingFault] = ()) -> Feedback:
    """The feedback on a dance, or on what has been danced so far (`OnlineScorer.score_so_far`).

    With `beat_s`, a beat of the music in seconds, phrases have eight beats from time 0 on, where `DanceScore.beats_s` has one,
    and delays are given in beats. Hints whose cause is among the faults that `kpopnet.dance.diagnosis.diagnose` found are left
    out. Raises InputError for what is no score, beat or list of faults.
    """
    _check_score(score)
    check_beat(beat_s)
    if not isinstance(recording, Sequence) or not all(isinstance(one, RecordingFault) for one in recording):
        raise InputError(f"recording: expected the faults of a diagnosis, as diagnose(...).faults, got {recording!r:.80}")
    unseen, danced_s, middle = list(_unseen(score)), span(score, slice(None)), score.windows.middle_s
    phrase_s = phrase_length_s(beat_s)
    phrases_s = _phrases_s(score, phrase_s, on_beat=bool(beat_s))
    moments, phrases = _moments(score, phrases_s, beat_s), []
    for start_s, end_s in phrases_s:
        known = (middle >= start_s) & (middle < end_s) & np.isfinite(score.windows.similarity)
        similarity, weight = score.windows.similarity[known], score.windows.weight[known]
        total = float(np.average(similarity, weights=weight)) if weight.sum() >= LEAST_WEIGHT else None
        # Windows show a phrase's ends less than its middle: the first begins half a window after the dance.
        shown_s = max(start_s, danced_s[0]), min(end_s, danced_s[1])
        common_s = [(min(one.end_s, end_s) - max(one.start_s, start_s), one) for one in moments]
        within = [one for common, one in common_s if common >= min(phrase_s, one.end_s - one.start_s) / 2]
        worst = (
            replace(one, text=Said("{what} {when}", what=one.fault, when=_when((one.start_s, one.end_s), shown_s)))
            for one in within
        )
        hidden = (
            Said("{what} {when}", what=who, when=_when((begin_s, stop_s), shown_s))
            for who, begin_s, stop_s in unseen
            if begin_s < end_s and stop_s > start_s
        )
        phrases.append(Phrase(start_s, end_s, total, tuple(hidden), tuple(worst)[:MOMENTS_PER_PHRASE]))
    known = {one.about for one in recording}
    hints = tuple(text for about, text in _hints(score) if about not in known)
    faults = _gathered(moments, len(middle) * score.scorer.hop_s, beat_s)
    return Feedback(tuple(phrases), tuple(moments), faults, hints, tuple(_praise(score)))


def moments_since(score: DanceScore, since_s: float) -> list[Moment]:
    """The moments that end later than a second of the dance, the costliest first: what is said while it goes on.

    Causes are looked for only in the phrases that end later: with all of them it would take the square of the dance's length.
    """
    _check_score(score)
    check_number("since_s", since_s)
    phrases_s = [one for one in _phrases_s(score, PHRASE_S) if one[1] > since_s]
    return [one for one in _moments(score, phrases_s, None) if one.end_s > since_s]


def _check_score(score: object) -> None:
    if not isinstance(score, DanceScore):
        why = "; before the first window there is no score so far" if score is None else ""
        raise InputError(f"score: expected a DanceScore, as score_dance makes, got {type(score).__name__}{why}")


def _phrases_s(score: DanceScore, phrase_s: float, on_beat: bool = False) -> list[tuple[float, float]]:
    """Begin and end of the phrases of a length that have windows, counted from time 0 if they are on the beat, else from the
    teacher's first frame.
    """
    origin_s = 0.0 if on_beat else float(score.windows.start_s[0])
    first, last = (math.floor((score.windows.middle_s[at] - origin_s) / phrase_s) for at in (0, -1))
    return [(origin_s + number * phrase_s, origin_s + (number + 1) * phrase_s) for number in range(first, last + 1)]


def _moments(score: DanceScore, phrases_s: list[tuple[float, float]], beat_s: float | None) -> list[Moment]:
    """Causes, and what they do not explain, the costliest first."""
    losses, middle, found = Losses(score), score.windows.middle_s, []
    untimed = unposed = np.zeros(len(middle), bool)
    for cause in causes(score, phrases_s):
        inside = (middle >= cause.start_s) & (middle < cause.end_s)
        points = float((losses.total if cause.explains_timing else losses.posture)[inside].sum())
        unposed, untimed = unposed | inside, untimed | (inside & cause.explains_timing)
        text = Said("{what} {when}", what=cause.text, when=from_to(cause.start_s, cause.end_s))
        found.append(Moment(cause.start_s, cause.end_s, "phrase", "", cause.name, 0.0, 0.0, points, cause.text, text))
    found += [*posture_moments(score, losses, unposed), *timing_moments(score, losses, untimed, beat_s)]
    return sorted((one for one in found if one.points >= MIN_POINTS), key=lambda one: -one.points)


def _when(span_s: tuple[float, float], phrase_s: tuple[float, float]) -> Said:
    """Which part of a phrase a stretch of the dance takes; each has a start and an end, in seconds."""
    start_s, end_s = span_s
    before, after = start_s <= phrase_s[0] + EDGE_S, end_s >= phrase_s[1] - EDGE_S
    if before and after:
        return Said("throughout")
    if before:
        return Said("until {time}", time=clock(end_s))
    return Said("from {time} on", time=clock(start_s)) if after else from_to(start_s, end_s)


def _gathered(moments: list[Moment], dance_s: float, beat_s: float | None) -> tuple[Fault, ...]:
    """The moments of equal part, joint and direction as one fault each, the costliest first."""
    by_kind: dict[tuple[str, str, str], list[Moment]] = {}
    for one in sorted(moments, key=lambda moment: moment.start_s):
        by_kind.setdefault((one.part, one.joint, one.direction), []).append(one)
    faults = []
    for (part, joint, direction), ones in by_kind.items():
        lengths = np.array([one.end_s - one.start_s for one in ones])
        degrees = float(np.average([one.degrees for one in ones], weights=lengths))
        delay_s = float(np.average([one.delay_s for one in ones], weights=lengths))
        starts_s = [one.start_s for one in ones]
        when = Said("throughout") if lengths.sum() >= THROUGHOUT * dance_s else at(starts_s)
        what = lateness(delay_s, beat_s) if part == "timing" else posture_text(part, joint, degrees, direction)
        what = CAUSES[direction] if part == "phrase" else what
        fault = Fault(part, joint, direction, degrees, delay_s, tuple(starts_s), Said("{what} {when}", what=what, when=when))
        faults.append((sum(one.points for one in ones), fault))
    return tuple(fault for _, fault in sorted(faults, key=lambda pair: -pair[0]))


def _praise(score: DanceScore) -> Iterator[str]:
    """What is right nearly throughout: the limbs that the teacher moves, and the timing."""
    windows, moved = score.windows, score.dynamics.ratios
    parts, weight = windows.parts, windows.weight
    right = [name for name in LIMBS if name in moved and _mostly(parts[name] >= RIGHT, parts[name], weight)]
    if right:
        yield Said("right nearly throughout: {parts}", parts=[Said(name) for name in right])
    if score.timing >= RIGHT and _mostly(abs(windows.delay_s) < MIN_DELAY_S, windows.delay_s, weight):
        yield "on time nearly throughout"


def _mostly(good: np.ndarray, values: np.ndarray, weight: np.ndarray) -> bool:
    """Whether (N,) flags hold in RIGHT_WINDOWS of the windows, of which half have known values; each counts by its weight."""
    known = np.isfinite(values)
    of_known = weight[known].sum()
    return bool(of_known > 0 and 2 * of_known >= weight.sum() and weight[known & good].sum() >= RIGHT_WINDOWS * of_known)


def _hints(score: DanceScore) -> Iterator[tuple[str, str]]:
    """What concerns the whole dance: what it is about, as `kpopnet.dance.diagnosis.RecordingFault`, and it in words."""
    if score.mirror_fits_better and not score.mirrored:
        yield "mirror", "the mirror image fits much better: did the learner mirror the teacher?"
    if score.mirrored:
        yield "mirrored", AS_THE_TEACHERS
    if abs(score.tempo - 1) >= MIN_TEMPO_DIFFERENCE:
        text = "{percent}% too fast throughout" if score.tempo > 1 else "{percent}% too slow throughout"
        yield "tempo", Said(text, percent=f"{100 * abs(score.tempo - 1):.0f}")
    if centred := score.stage.centred:
        text = "place and height are not graded: as recorded, the hips never move ({dancers})"
        yield "place", Said(text, dancers=[Said(name) for name in centred])
    for who, start_s, end_s in _unseen(score):
        yield "coverage", Said("{what} {when}", what=who, when=from_to(start_s, end_s))


def _unseen(score: DanceScore) -> Iterator[tuple[Said, float, float]]:
    """Who or what is not in the picture, and from when to when, in seconds."""
    coverage = {name: score.windows.coverage[name] for name in (*LIMBS, "torso")}
    missing = {name: values < UNSEEN_BELOW for name, values in coverage.items()}  # false for NaN
    # What the teacher does not show at the time says nothing, and one limb that is missing is no person who is; but for
    # Algorithm 3 as printed, which has no parts.
    absent = np.all([missing[name] | np.isnan(values) for name, values in coverage.items()], axis=0)
    has_parts = sum(np.isfinite(values).any() for values in coverage.values()) > 1
    absent &= np.sum([*missing.values()], axis=0) >= (2 if has_parts else 1)
    subjects = {"no person in": absent}
    for kind in ("arm", "leg"):
        left, right = (missing[f"{side} {kind}"] & ~absent for side in ("left", "right"))
        subjects |= {f"{kind}s out of": left & right}
        subjects |= {f"left {kind} out of": left & ~right, f"right {kind} out of": right & ~left}
    return ((Said(f"{who} the picture"), *span(score, run)) for who, flags in subjects.items() for run in runs(flags))
