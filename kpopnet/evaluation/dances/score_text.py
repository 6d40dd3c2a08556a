"""The score of one dance as lines of text and as JSON."""

from typing import Any

import numpy as np

from kpopnet.dance.diagnosis import Diagnosis, RecordingFault
from kpopnet.dance.dimensions.movement import Rhythm
from kpopnet.dance.feedback import Feedback, Phrase
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.words.moments import clock
from kpopnet.evaluation.values import plain

MAX_FAULTS = 3
"""Largest number of faults in the text, the costliest first; the JSON has all."""


def rhythm_to(score: DanceScore, beat_s: float | None) -> Rhythm | None:
    """The learner's rhythm to a beat in seconds; None without one, or where it cannot be told."""
    return score.rhythm(np.arange(0, score.windows.middle_s[-1] + 4 * beat_s, beat_s)) if beat_s else None


def score_text(score: DanceScore, told: Feedback, notes: list[str], beat_s: float | None = None) -> list[str]:
    """The score in lines for a terminal, with notes on it; with a beat in seconds also the rhythm."""
    uncertain = f" ± {score.uncertainty:.0f}" if score.uncertainty > 0 else ""
    seen = {name: "" if coverage > 0.99 else f" (seen {coverage:.0%})" for name, coverage in score.coverage.items()}
    return [
        f"similarity {score.similarity:.0f}{uncertain}, timing {score.timing:.0f}, posture {score.posture:.0f} of 100",
        "parts: " + ", ".join(f"{name} {value:.0f}{seen[name]}" for name, value in score.parts.items()),
        *notes,
        *told.hints,
        *(fault.text for fault in told.faults[:MAX_FAULTS]),
        *told.praise,
        *_stage_text(score),
        *_movement_text(score, beat_s),
        *map(_phrase_text, told.phrases),
    ]


def _stage_text(score: DanceScore) -> list[str]:
    """What similarity, timing and posture do not contain."""
    figures = ", ".join(f"{name} {value:.0f}" for name, value in score.stage.figures.items())
    remarks = [f"{text} at {clock(at_s)}" for at_s, text in score.stage_remarks()]
    return [f"on the stage, not counted: {'; '.join([figures, *remarks])}"] if figures else []


def _movement_text(score: DanceScore, beat_s: float | None) -> list[str]:
    figures, rhythm = [f"{name} {value:.0f}" for name, value in score.dynamics.figures.items()], rhythm_to(score, beat_s)
    figures += [f"rhythm {rhythm.figure:.0f}, {rhythm}"] if rhythm else []
    return [f"movement, not counted: {', '.join(figures)}"] if figures else []


def score_notes(score: DanceScore, diagnosis: Diagnosis) -> list[str]:
    """What was corrected in the recordings, what is probably wrong with them, and what the score's uncertainty is."""
    within = f"± {score.uncertainty:.0f}: on true joints 95 % of simulated dances seen by {score.scorer.noise} score within it"
    notes = [str(diagnosis), *map(_fault_text, diagnosis.faults), within if score.uncertainty > 0 else ""]
    return [note for note in notes if note]


def _phrase_text(phrase: Phrase) -> str:
    """A phrase with what was not seen and its worst moments, the worst first."""
    number = "not compared" if phrase.similarity is None else f"{phrase.similarity:.0f}"
    moments = "; ".join([*phrase.unseen, *(moment.text for moment in phrase.moments)]) or "no fault stands out"
    return f"{clock(phrase.start_s)} to {clock(phrase.end_s)}, {number}: {moments}"


def _fault_text(fault: RecordingFault) -> str:
    """A probable fault as a warning."""
    gain = "" if fault.corrected is None else f" (the similarity would be {fault.corrected:.0f})"
    return f"warning: {fault.text}{gain}"


def score_json(score: DanceScore, told: Feedback, diagnosis: Diagnosis, beat_s: float | None = None) -> dict[str, Any]:
    """The score for programs: numbers, null where nothing could be compared, with feedback, warnings and settings."""
    content, found, rhythm = score._asdict(), diagnosis.correction, rhythm_to(score, beat_s)
    moved = score.dynamics
    content |= {"stage": score.stage.figures, "dynamics": {"figures": moved.figures, "ratios": moved.ratios}}
    content |= {"rhythm": rhythm._asdict() if rhythm else None}
    del content["teacher_m"], content["learner_m"]
    done = None if found is None else found._asdict() | {"as_recorded": diagnosis.as_recorded, "corrected": diagnosis.corrected}
    about = {"feedback": told, "corrections": done, "warnings": diagnosis.faults, "scorer": content.pop("scorer")}
    return plain({"score": content} | about)
