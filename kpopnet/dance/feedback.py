"""What a dancer can use of a score: per phrase the three worst moments with part, signed degrees and words, and what repeats.

Each window has the mean signed difference of every angle in its middle. A moment is a run of windows in which one part of the
body differs in one direction. Angles with a plain meaning get words; the others only count in the score. Everything is computed
from a `DanceScore`, so that the words during the dance are those of afterwards.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kpopnet.dance.diagnosis import RecordingFault
from kpopnet.dance.features import FEATURES
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.window import LIMBS, PARTS, part_of_angles

PHRASE_S = 4.0
"""Length of a phrase without a given beat: eight counts at 120 a minute."""

MOMENTS_PER_PHRASE = 3

MIN_ERROR_DEG = 10.0
"""Smaller differences are no faults: teachers differ by as much from themselves."""

MIN_DELAY_S = 0.12
"""Smaller delays are not mentioned."""

MIN_TEMPO_DIFFERENCE = 0.03
THROUGHOUT = 0.7
"""Fraction of the dance from which on a fault is called constant."""

EDGE_S = 0.5
"""Whatever begins or ends this near to the start or end of a phrase is said to last up to there."""

UNSEEN_BELOW = 0.5
"""A part is unseen in windows in which less of it is shown."""

_LIMB_WORDS = {
    "elbow_inclination": ("shoulder", "too low", "too high"),
    "elbow_azimuth": ("shoulder", "too far out or back", "too far across the front"),
    "hand_inclination": ("elbow", "too straight", "too bent"),
    "knee_inclination": ("hip", "too low", "too high"),
    "foot_inclination": ("knee", "too straight", "too bent"),
}
_WORDS = {
    "twist": ("", "twisted too far to the left", "twisted too far to the right"),
    "lean": ("", "leaning too far to the right", "leaning too far to the left"),
    "bend": ("", "bent too far back", "bent too far forward"),
    "turn": ("", "turned too far to the left", "turned too far to the right"),
} | {
    f"{side}_{angle}": (f"{side} {joint}", less, greater)
    for side in ("left", "right")
    for angle, (joint, less, greater) in _LIMB_WORDS.items()
}
_WORDS["right_elbow_azimuth"] = ("right shoulder", "too far across the front", "too far out or back")  # its sign is mirrored
"""An angle's name to the joint that it bends, and the words for a learner's angle less and greater than the teacher's."""


@dataclass(frozen=True)
class Moment:
    """A stretch of the dance in which something is wrong, in seconds on the teacher's clock.

    Attributes:
        part: one of `PARTS`, or "timing".
        joint: the joint that is wrong, such as "left elbow"; "" for torso, turning and timing.
        direction: such as "too low", "late".
        degrees: mean signed difference, learner minus teacher, degrees; 0 for timing.
        delay_s: mean delay, seconds, negative when early; 0 for posture.
        cost: how much is wrong, for comparison with other moments.
        fault: what is wrong in words, such as "left arm 25° too low".
        text: with the time, such as "left arm 25° too low at 0:12".
    """

    start_s: float
    end_s: float
    part: str
    joint: str
    direction: str
    degrees: float
    delay_s: float
    cost: float
    fault: str
    text: str


@dataclass(frozen=True)
class Phrase:
    """A phrase of the dance.

    Attributes:
        similarity: of its windows, None where nothing could be compared.
        unseen: who or what was not in the picture, in words.
        moments: the worst ones, the worst first; what their `text` says of the time is about the phrase alone.
    """

    start_s: float
    end_s: float
    similarity: float | None
    unseen: tuple[str, ...]
    moments: tuple[Moment, ...]


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
    """Phrases in order of time, all moments and all faults, each with the costliest first, and hints in words."""

    phrases: tuple[Phrase, ...]
    moments: tuple[Moment, ...]
    faults: tuple[Fault, ...]
    hints: tuple[str, ...]


def feedback(score: DanceScore, beat_s: float | None = None, recording: Sequence[RecordingFault] = ()) -> Feedback:
    """The feedback on a dance, or on what has been danced so far (`OnlineScorer.score_so_far`).

    With `beat_s`, a beat of the music in seconds, phrases have eight beats, and delays are given in beats. Hints whose cause
    is among the faults that `kpopnet.dance.diagnosis.diagnose` found are left out.
    """
    moments = sorted([*_posture_moments(score), *_timing_moments(score, beat_s)], key=lambda one: -one.cost)
    unseen, danced_s = list(_unseen(score)), _span(score, slice(None))
    first, middle = float(score.windows.start_s[0]), score.windows.middle_s
    phrase_s = 8 * beat_s if beat_s else PHRASE_S
    phrases = []
    for number in range(math.ceil((middle[-1] + score.scorer.hop_s / 2 - first) / phrase_s)):
        start_s, end_s = first + number * phrase_s, first + (number + 1) * phrase_s
        inside = score.windows.similarity[(middle >= start_s) & (middle < end_s)]
        similarity = float(np.nanmean(inside)) if np.isfinite(inside).any() else None
        # Windows show a phrase's ends less than its middle: the first begins half a window after the dance.
        shown_s = max(start_s, danced_s[0]), min(end_s, danced_s[1])
        common_s = [(min(one.end_s, end_s) - max(one.start_s, start_s), one) for one in moments]
        within = [one for common, one in common_s if common >= min(phrase_s, one.end_s - one.start_s) / 2]
        worst = (replace(one, text=f"{one.fault} {_when((one.start_s, one.end_s), shown_s)}") for one in within)
        hidden = (
            f"{who} {_when((begin_s, stop_s), shown_s)}"
            for who, begin_s, stop_s in unseen
            if begin_s < end_s and stop_s > start_s
        )
        phrases.append(Phrase(start_s, end_s, similarity, tuple(hidden), tuple(worst)[:MOMENTS_PER_PHRASE]))
    known = {one.about for one in recording}
    hints = tuple(text for about, text in _hints(score) if about not in known)
    return Feedback(tuple(phrases), tuple(moments), _gathered(moments, len(middle) * score.scorer.hop_s, beat_s), hints)


def _runs(flags: np.ndarray) -> list[slice]:
    """The runs of true values of (N,) flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [slice(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def _span(score: DanceScore, run: slice) -> tuple[float, float]:
    """Start and end in seconds of the windows' middles in a run."""
    middle, half_s = score.windows.middle_s[run], score.scorer.hop_s / 2
    return float(middle[0] - half_s), float(middle[-1] + half_s)


def _posture_moments(score: DanceScore) -> list[Moment]:
    """The moments of every part, by the angle of the part that costs most in each."""
    names, parts = FEATURES[score.scorer.feature].names, part_of_angles(score.scorer.feature)
    has_words = np.array([name in _WORDS for name in names])
    error_deg = np.degrees(np.nan_to_num(score.windows.error_rad))
    weight = score.windows.error_weight
    cost = np.where(has_words & (abs(error_deg) >= MIN_ERROR_DEG), weight * error_deg**2, 0.0)
    found = []
    for part in np.unique(parts):
        angles = np.flatnonzero(parts == part)
        worst = angles[cost[:, angles].argmax(axis=1)]
        rows = np.arange(len(worst))
        # A run ends where another angle or direction becomes the worst one.
        kind = np.where(cost[rows, worst] > 0, (2 * worst + (error_deg[rows, worst] > 0)) + 1, 0)
        for one in np.unique(kind[kind > 0]):
            angle = (one - 1) // 2
            for run in _runs(kind == one):
                # What is most wrong says most about by how much: the edges of a fault lie within windows.
                weights = weight[run, angle] * abs(error_deg[run, angle])
                degrees, total = float(np.average(error_deg[run, angle], weights=weights)), float(cost[run, angle].sum())
                joint, less, greater = _WORDS[names[angle]]
                direction = greater if degrees > 0 else less
                start_s, end_s = _span(score, run)
                fault = _posture_text(PARTS[part], joint, degrees, direction)
                text = f"{fault} {_at([start_s])}"
                found.append(Moment(start_s, end_s, PARTS[part], joint, direction, degrees, 0.0, total, fault, text))
    return found


def _posture_text(part: str, joint: str, degrees: float, direction: str) -> str:
    """A difference in words, such as "left arm 25° too low"."""
    subject = joint if joint.endswith(("elbow", "knee")) else "body" if part == "turning" else part
    return f"{subject} {abs(degrees):.0f}° {direction}"


def _timing_moments(score: DanceScore, beat_s: float | None) -> list[Moment]:
    """The moments in which the learner is late or early."""
    delay_s, found = np.nan_to_num(score.windows.delay_s), []
    for sign in (1, -1):
        for run in _runs(sign * delay_s >= MIN_DELAY_S):
            start_s, end_s = _span(score, run)
            mean_s, word = float(delay_s[run].mean()), "late" if sign > 0 else "early"
            # Comparable with posture: what is lost in percent, per window, of a full score.
            cost = float(np.nansum(100 - score.windows.timing[run])) * MIN_ERROR_DEG
            fault = _lateness(mean_s, beat_s)
            text = f"{fault} {_from_to(start_s, end_s)}"
            found.append(Moment(start_s, end_s, "timing", "", word, 0.0, mean_s, cost, fault, text))
    return found


def _lateness(delay_s: float, beat_s: float | None) -> str:
    word = "late" if delay_s > 0 else "early"
    if not beat_s:
        return f"{abs(delay_s):.1f} s {word}"
    quarters = round(4 * abs(delay_s) / beat_s)
    fractions = {0: "slightly", 1: "a quarter of a beat", 2: "half a beat", 3: "three quarters of a beat", 4: "a beat"}
    return f"{fractions.get(quarters, f'{quarters / 4:g} beats')} {word}"


def clock(seconds: float) -> str:
    """A time as minutes and seconds, such as 1:05."""
    whole = max(math.floor(seconds + 0.5), 0)
    return f"{whole // 60}:{whole % 60:02d}"


def _at(starts_s: list[float]) -> str:
    *others, last = dict.fromkeys(clock(start_s) for start_s in starts_s)
    return f"at {', '.join(others)} and {last}" if others else f"at {last}"


def _from_to(start_s: float, end_s: float) -> str:
    start, end = clock(start_s), clock(end_s)
    return f"at {start}" if start == end else f"from {start} to {end}"


def _when(span_s: tuple[float, float], phrase_s: tuple[float, float]) -> str:
    """Which part of a phrase a stretch of the dance takes; each has a start and an end, in seconds."""
    start_s, end_s = span_s
    before, after = start_s <= phrase_s[0] + EDGE_S, end_s >= phrase_s[1] - EDGE_S
    if before and after:
        return "throughout"
    if before:
        return f"until {clock(end_s)}"
    return f"from {clock(start_s)} on" if after else _from_to(start_s, end_s)


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
        when = "throughout" if lengths.sum() >= THROUGHOUT * dance_s else _at(starts_s)
        what = _lateness(delay_s, beat_s) if part == "timing" else _posture_text(part, joint, degrees, direction)
        fault = Fault(part, joint, direction, degrees, delay_s, tuple(starts_s), f"{what} {when}")
        faults.append((sum(one.cost for one in ones), fault))
    return tuple(fault for _, fault in sorted(faults, key=lambda pair: -pair[0]))


def _hints(score: DanceScore) -> Iterator[tuple[str, str]]:
    """What concerns the whole dance: what it is about, as `kpopnet.dance.diagnosis.RecordingFault`, and it in words."""
    if score.mirror_fits_better and not score.mirrored:
        yield "mirror", "the mirror image fits much better: did the learner mirror the teacher?"
    if abs(score.tempo - 1) >= MIN_TEMPO_DIFFERENCE:
        yield "tempo", f"{abs(score.tempo - 1):.0%} too {'fast' if score.tempo > 1 else 'slow'} throughout"
    yield from (("coverage", f"{who} {_from_to(start_s, end_s)}") for who, start_s, end_s in _unseen(score))


def _unseen(score: DanceScore) -> Iterator[tuple[str, float, float]]:
    """Who or what is not in the picture, and from when to when, in seconds."""
    coverage = {name: score.windows.coverage[name] for name in (*LIMBS, "torso")}
    missing = {name: values < UNSEEN_BELOW for name, values in coverage.items()}  # false for NaN
    shown = [missing[name] for name, values in coverage.items() if np.isfinite(values).any()]
    absent = np.all(shown, axis=0) if shown else missing["torso"]  # Algorithm 3 as printed has no parts
    subjects = {"no person in": absent}
    for kind in ("arm", "leg"):
        left, right = (missing[f"{side} {kind}"] & ~absent for side in ("left", "right"))
        subjects |= {f"{kind}s out of": left & right}
        subjects |= {f"left {kind} out of": left & ~right, f"right {kind} out of": right & ~left}
    return ((f"{who} the picture", *_span(score, run)) for who, flags in subjects.items() for run in _runs(flags))
