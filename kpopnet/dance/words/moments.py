"""Moments of a dance in which one part of the body differs in one direction, or the learner is late or early, in words.

Each window has the mean signed difference of every angle in its middle. Angles with a plain meaning get words; the others only
count in the score. What a moment costs is what its windows lose of the similarity S_t S_p, shared out between timing and
posture so that both shares make up the loss, and among the parts as each falls short.
"""

import math
from dataclasses import dataclass

import numpy as np

from kpopnet.dance.dimensions.stage import runs
from kpopnet.dance.features import FEATURES
from kpopnet.dance.noise.table import known_noise
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.window import PARTS, part_of_angles
from kpopnet.languages import Said

PHRASE_COUNTS, PHRASE_S = 8, 4.0
"""A phrase in counts, and in seconds where no beat is given: as many at 120 a minute."""

MIN_ERROR_DEG = 10.0
"""Smaller differences are no faults: teachers differ by as much from themselves."""

MIN_DELAY_S = 0.08
"""Smaller delays are not mentioned."""

MIN_POINTS = 2.5
"""What costs less of a phrase is not mentioned."""

UNCERTAINTY = 2.0
"""Standard deviations of the estimator's error within which a difference may be the estimator's."""

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


def phrase_length_s(beat_s: float | None) -> float:
    """The length of a phrase in seconds, by the seconds of a beat; None is not known."""
    return PHRASE_COUNTS * beat_s if beat_s else PHRASE_S


@dataclass(frozen=True)
class Moment:
    """A stretch of the dance in which something is wrong, in seconds on the teacher's clock."""

    start_s: float
    end_s: float
    part: str  # one of `PARTS`, "timing", or "phrase" for a cause (`kpopnet.dance.words.causes`)
    joint: str  # the joint that is wrong, such as "left elbow"; "" for all else
    direction: str  # such as "too low", "late", "mirrored"
    degrees: float  # mean signed difference, learner minus teacher, degrees; 0 for all but parts
    delay_s: float  # median delay, seconds, negative when early; 0 for all but timing
    points: float  # of the similarity of a phrase of PHRASE_S that it costs
    fault: str  # what is wrong in words, such as "left arm 25° too low"
    text: str  # with the time, such as "left arm 25° too low at 0:12"


class Losses:
    """What every window costs, in points of a phrase of PHRASE_S; each window counts as much as the teacher moves in it."""

    def __init__(self, score: DanceScore) -> None:
        windows = score.windows
        share = windows.weight * score.scorer.hop_s / PHRASE_S
        timing, posture = (np.nan_to_num(one) for one in (windows.timing, windows.posture))
        known = np.isfinite(windows.timing)
        # Shapley's shares of 100 - S_t S_p / 100; without a timing nothing of it can be told apart.
        self.timing = np.where(known, share * (100 - timing) * (100 + posture) / 200, 0.0)
        self.posture = np.where(known, share * (100 - posture) * (100 + timing) / 200, 0.0)
        short = np.array([100 - np.nan_to_num(windows.parts[name], nan=100.0) for name in PARTS])
        unseen = np.array([100 * (1 - np.nan_to_num(windows.coverage[name], nan=1.0)) for name in PARTS])
        self.parts = self.posture * np.maximum(short - unseen, 0) / np.maximum(short.sum(axis=0), 1e-9)  # (P, N)
        self.total = share * (100 - np.nan_to_num(windows.similarity, nan=100.0))


def span(score: DanceScore, run: slice) -> tuple[float, float]:
    """Start and end in seconds of the windows' middles in a run."""
    middle, half_s = score.windows.middle_s[run], score.scorer.hop_s / 2
    return float(middle[0] - half_s), float(middle[-1] + half_s)


def posture_moments(score: DanceScore, losses: Losses, explained: np.ndarray) -> list[Moment]:
    """The moments of every part, by the angle of it that is most wrong, in windows that are not (N,) explained by a cause."""
    names, parts = FEATURES[score.scorer.feature].names, part_of_angles(score.scorer.feature)
    std_rad = known_noise(score.scorer.noise).std_rad
    std_deg = np.degrees([std_rad.get(name, 0.0) for name in names])
    has_words = np.array([name in _WORDS for name in names])
    error_deg, weight = np.degrees(np.nan_to_num(score.windows.error_rad)), score.windows.error_weight
    told = has_words & (abs(error_deg) >= np.maximum(MIN_ERROR_DEG, UNCERTAINTY * std_deg)) & ~explained[:, None]
    wrong = np.where(told, weight * error_deg**2, 0.0)
    found, rows = [], np.arange(len(wrong))
    for part in np.unique(parts):
        angles = np.flatnonzero(parts == part)
        worst = angles[wrong[:, angles].argmax(axis=1)]
        # A run ends where another angle or direction becomes the worst one.
        kind = np.where(wrong[rows, worst] > 0, (2 * worst + (error_deg[rows, worst] > 0)) + 1, 0)
        for one in np.unique(kind[kind > 0]):
            angle = (one - 1) // 2
            for run in runs(kind == one):
                # What is most wrong says most about by how much: the edges of a fault lie within windows.
                weights = weight[run, angle] * abs(error_deg[run, angle])
                degrees = float(np.average(error_deg[run, angle], weights=weights))
                points = float(losses.parts[part, run].sum())
                joint, less, greater = _WORDS[names[angle]]
                direction, (start_s, end_s) = greater if degrees > 0 else less, span(score, run)
                fault = posture_text(PARTS[part], joint, degrees, direction)
                text = Said("{what} {when}", what=fault, when=at([start_s]))
                found.append(Moment(start_s, end_s, PARTS[part], joint, direction, degrees, 0.0, points, fault, text))
    return found


def posture_text(part: str, joint: str, degrees: float, direction: str) -> Said:
    """A difference in words, such as "left arm 25° too low"."""
    subject = joint if joint.endswith(("elbow", "knee")) else "body" if part == "turning" else part
    return Said("{part} {degrees}° {direction}", part=Said(subject), degrees=f"{abs(degrees):.0f}", direction=Said(direction))


def timing_moments(score: DanceScore, losses: Losses, explained: np.ndarray, beat_s: float | None) -> list[Moment]:
    """The moments in which the learner is late or early, where no cause has (N,) explained them."""
    delay_s, found = np.where(explained, 0.0, np.nan_to_num(score.windows.delay_s)), []
    for sign in (1, -1):
        for run in runs(sign * delay_s >= MIN_DELAY_S):
            start_s, end_s = span(score, run)
            # Not the mean: windows at the edge of what was left out match by chance, up to a second off.
            median_s, word = float(np.median(delay_s[run])), "late" if sign > 0 else "early"
            points, fault = float(losses.timing[run].sum()), lateness(median_s, beat_s)
            text = Said("{what} {when}", what=fault, when=from_to(start_s, end_s))
            found.append(Moment(start_s, end_s, "timing", "", word, 0.0, median_s, points, fault, text))
    return found


def lateness(delay_s: float, beat_s: float | None) -> Said:
    word = Said("late" if delay_s > 0 else "early")
    if not beat_s:
        return Said("{amount} {word}", amount=Said("{seconds} s", seconds=f"{abs(delay_s):.1f}"), word=word)
    quarters = round(4 * abs(delay_s) / beat_s)
    fractions = {0: "slightly", 1: "a quarter of a beat", 2: "half a beat", 3: "three quarters of a beat", 4: "a beat"}
    amount = Said(fractions[quarters]) if quarters in fractions else Said("{beats} beats", beats=f"{quarters / 4:g}")
    return Said("{amount} {word}", amount=amount, word=word)


def clock(seconds: float) -> str:
    """A time as minutes and seconds, such as 1:05; before time 0 as -0:05."""
    whole = math.floor(seconds + 0.5)
    return f"{'-' if whole < 0 else ''}{abs(whole) // 60}:{abs(whole) % 60:02d}"


def at(starts_s: list[float]) -> Said:
    *others, last = dict.fromkeys(clock(start_s) for start_s in starts_s)
    return Said("at {times} and {last}", times=others, last=last) if others else Said("at {time}", time=last)


def from_to(start_s: float, end_s: float) -> Said:
    start, end = clock(start_s), clock(end_s)
    return Said("at {time}", time=start) if start == end else Said("from {start} to {end}", start=start, end=end)
