"""The score of one dance as lines of text and as JSON."""

import math
from typing import Any

from kpopnet.dance.diagnosis import Diagnosis, RecordingFault
from kpopnet.dance.feedback import AS_THE_TEACHERS, RIGHT, Feedback, Phrase
from kpopnet.dance.noise.table import RECORDED, SEEN
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.words.moments import at, clock
from kpopnet.evaluation.values import plain
from kpopnet.languages import Said

MAX_FAULTS = 3
"""Largest number of faults in the text, the costliest first; the JSON has all."""


def score_text(score: DanceScore, told: Feedback, notes: list[str], beat_s: float | None = None) -> list[str]:
    """The score in lines for a terminal, with notes on it; with a beat in seconds also the rhythm."""
    uncertain = f" ± {score.uncertainty:.0f}" if score.uncertainty > 0 else ""
    return [
        Said(
            "similarity {similarity}, timing {timing}, posture {posture} of 100",
            similarity=f"{score.similarity:.0f}{uncertain}",
            timing="–" if math.isnan(score.timing) else f"{score.timing:.0f}",
            posture=f"{score.posture:.0f}",
        ),
        Said("parts: {parts}", parts=[_part(name, value, score.coverage[name]) for name, value in score.parts.items()]),
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
    figures = _figures(score.stage.figures)
    remarks = [Said("{what} {when}", what=text, when=at([at_s])) for at_s, text in score.stage_remarks()]
    return [Said("on the stage, beside timing and posture: {figures}", figures=_listed([figures, *remarks]))] if figures else []


def _movement_text(score: DanceScore, beat_s: float | None) -> list[str]:
    beats_s = score.beats_s(beat_s)
    figures, free, rhythm = _figures(score.dynamics.figures), _figures(score.free(beats_s)), score.rhythm(beats_s)
    figures += [Said("rhythm {figure}, {how}", figure=f"{rhythm.figure:.0f}", how=str(rhythm))] if rhythm else []
    texts = {"movement, beside timing and posture: {figures}": figures, "free parts: {figures}": free}
    return [Said(text, figures=shown) for text, shown in texts.items() if shown]


def _part(name: str, value: float, coverage: float) -> Said:
    seen = "" if coverage > 0.99 else Said(" (seen {percent}%)", percent=f"{100 * coverage:.0f}")
    return Said("{part} {figure}{seen}", part=Said(name), figure=f"{value:.0f}", seen=seen)


def _figures(figures: dict[str, float]) -> list[Said]:
    return [Said("{what} {figure}", what=Said(name), figure=f"{value:.0f}") for name, value in figures.items()]


def _listed(texts: list) -> Any:
    """Texts, or lists of them, with semicolons in between."""
    return texts[0] if len(texts) == 1 else Said("{first}; {rest}", first=texts[0], rest=_listed(texts[1:]))


def score_notes(score: DanceScore, diagnosis: Diagnosis) -> list[str]:
    """What was corrected in the recordings, what is probably wrong with them, and what the score's uncertainty is."""
    within = Said(
        "± {points}: on true joints 95 % of simulated dances seen by {estimator} score within it",
        points=f"{score.uncertainty:.0f}",
        estimator=score.scorer.noise.removesuffix(SEEN).removesuffix(RECORDED),
    )
    sides = Said(AS_THE_TEACHERS) if diagnosis.mirrored else ""
    notes = [str(diagnosis), sides, *map(_fault_text, diagnosis.faults), within if score.uncertainty > 0 else ""]
    return [note for note in notes if note]


def _phrase_text(phrase: Phrase) -> str:
    """A phrase with what was not seen and its worst moments, the worst first."""
    if phrase.similarity is None:
        nothing = Said("not compared")
    elif phrase.similarity >= RIGHT:
        nothing = Said("no fault stands out")
    else:
        nothing = Said("differences throughout, of which none stands out")
    return Said(
        "{start} to {end}, {figure}: {what}",
        start=clock(phrase.start_s),
        end=clock(phrase.end_s),
        figure="–" if phrase.similarity is None else f"{phrase.similarity:.0f}",
        what=_listed([*phrase.unseen, *(moment.text for moment in phrase.moments)] or [nothing]),
    )


def _fault_text(fault: RecordingFault) -> str:
    """A probable fault as a warning."""
    told = Said("warning: {fault}", fault=fault.text)
    if fault.corrected is None:
        return told
    return Said("{warning} (the similarity would be {figure})", warning=told, figure=f"{fault.corrected:.0f}")


def score_json(score: DanceScore, told: Feedback, diagnosis: Diagnosis, beat_s: float | None = None) -> dict[str, Any]:
    """The score for programs: numbers, null where nothing could be compared, with feedback, warnings and settings."""
    content, found, beats_s, moved = score._asdict(), diagnosis.correction, score.beats_s(beat_s), score.dynamics
    rhythm = score.rhythm(beats_s)
    content |= {"stage": score.stage.figures, "dynamics": {"figures": moved.figures, "ratios": moved.ratios}}
    content |= {"rhythm": rhythm._asdict() if rhythm else None, "free": score.free(beats_s)}
    del content["teacher_m"], content["learner_m"], content["is_free"]
    done = None if found is None else found._asdict() | {"as_recorded": diagnosis.as_recorded, "corrected": diagnosis.corrected}
    about = {"feedback": told, "corrections": done, "warnings": diagnosis.faults, "scorer": content.pop("scorer")}
    return plain({"score": content} | about)
