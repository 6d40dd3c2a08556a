"""The score of one dance as a page that needs no other file, as JSON, and as lines of text."""

import base64
import io
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kpopnet.dance.diagnosis import RecordingFault
from kpopnet.dance.feedback import Feedback, Phrase, clock
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore
from kpopnet.dance.window import WINDOW_S
from kpopnet.evaluation.dances.score_figures import moments, of_parts, over_time, worst_windows
from kpopnet.evaluation.report import Block, as_html
from kpopnet.evaluation.values import Table

MAX_FAULTS = 8
"""Largest number of faults in the page, the costliest first; the JSON has all."""


def score_text(score: DanceScore, told: Feedback, faults: list[RecordingFault]) -> list[str]:
    """The score in lines for a terminal."""
    parts = (f"{name} {value:.0f}{_seen(score.coverage[name])}" for name, value in score.parts.items())
    return [
        f"similarity {score.similarity:.0f}, timing {score.timing:.0f}, posture {score.posture:.0f} of 100",
        *_ceiling(score),
        "parts: " + ", ".join(parts),
        *map(fault_text, faults),
        *told.hints,
        *(fault.text for fault in told.faults[:MAX_FAULTS]),
        *map(_phrase_text, told.phrases),
    ]


def _seen(coverage: float) -> str:
    return "" if coverage > 0.99 else f" (seen {coverage:.0%})"


def _ceiling(score: DanceScore) -> list[str]:
    """What perfect dancing scores, where an estimator's errors are known."""
    through = f"perfect dancing seen through the estimator {score.scorer.noise} scores {score.ceiling:.0f} on average"
    return [through] if score.ceiling < 100 else []


def _phrase_text(phrase: Phrase) -> str:
    """A phrase with its worst moments, the worst first."""
    number = "not compared" if phrase.similarity is None else f"{phrase.similarity:.0f}"
    moments = "; ".join(moment.text for moment in phrase.moments) or "no fault stands out"
    return f"{clock(phrase.start_s)} to {clock(phrase.end_s)}, {number}: {moments}"


def fault_text(fault: RecordingFault) -> str:
    """A probable fault as a warning."""
    gain = "" if fault.corrected is None else f" (the similarity would be {fault.corrected:.0f})"
    return f"warning: {fault.text}{gain}"


def score_json(score: DanceScore, told: Feedback, faults: list[RecordingFault]) -> dict[str, Any]:
    """The score for programs: numbers, null where nothing could be compared, with feedback, warnings and settings."""
    content = score._asdict()
    return _plain({"score": content, "feedback": told, "warnings": faults, "scorer": content.pop("scorer")})


def _plain(value: Any) -> Any:
    """Nested named tuples, dataclasses, dicts and arrays as JSON; what is not finite becomes null."""
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if is_dataclass(value) and not isinstance(value, type):
        return _plain(asdict(value))
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def score_page(
    title: str, teacher: Performance, learner: Performance, score: DanceScore, told: Feedback, faults: list[RecordingFault]
) -> str:
    """The score, its feedback and probable faults of the recordings as one HTML page that contains its figures."""
    windows, window_s = score.windows, WINDOW_S
    blocks: list[Block] = [("title", title)]
    blocks += [("text", fault_text(fault)) for fault in faults]
    blocks += [("table", _score_table(score))]
    blocks += [("text", f"Of 100. {100 * score.scored:.0f} % of the windows of {window_s:g} s could be compared.")]
    blocks += [("text", text) for text in (*_ceiling(score), *told.hints)]
    if told.faults:
        blocks += [("heading", "What to mend, the costliest first")]
        blocks += [("text", fault.text) for fault in told.faults[:MAX_FAULTS]]
    blocks += [
        ("heading", "Phrase by phrase"),
        *(("text", _phrase_text(phrase)) for phrase in told.phrases),
        ("heading", "Over time"),
        ("figure", (_embedded(over_time(windows)), "similarity, posture, timing and delay of every window")),
        ("heading", "Parts of the body"),
        ("figure", (_embedded(of_parts(windows)), "posture of every part in every window")),
    ]
    if chosen := worst_windows(windows, window_s):
        caption = "The learner in colours (right red, left blue) over the teacher in grey, both turned to the front."
        figure = moments(teacher, learner, windows, window_s, chosen)
        blocks += [("heading", "Worst windows"), ("text", caption), ("figure", (_embedded(figure), "both dancers"))]
    return as_html(blocks)


def _score_table(score: DanceScore) -> Table:
    """The scores of the whole body and of each part, and how much of it was seen."""
    whole = [f"{value:.0f}" for value in (score.similarity, score.timing, score.posture)]
    rows: list = [["whole body", *whole, f"{score.completeness:.0%}"]]
    rows += [[name, "", "", f"{value:.0f}", f"{score.coverage[name]:.0%}"] for name, value in score.parts.items()]
    return Table(["", "similarity", "timing", "posture", "seen"], rows)


def _embedded(figure: Figure) -> str:
    """A figure as the source of an image: its PNG in base64."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"
