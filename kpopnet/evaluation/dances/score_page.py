"""The score of one dance as a page that needs no other file, as JSON, and as lines of text."""

import base64
import io
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kpopnet.dance.diagnosis import Fault
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore, ScorerConfig
from kpopnet.evaluation.dances.score_figures import moments, of_parts, over_time, worst_windows
from kpopnet.evaluation.document import Block, as_html


def score_text(score: DanceScore, faults: list[Fault], window_s: float) -> list[str]:
    """The score in lines for a terminal."""
    lines = [
        f"similarity {score.similarity:.0f}, timing {score.timing:.0f}, posture {score.posture:.0f} of 100",
        "parts: " + ", ".join(f"{name} {value:.0f}" for name, value in score.parts.items()),
    ]
    lines += [_window_text(score, number) for number in worst_windows(score.windows, window_s, 1)]
    return [*lines, *map(fault_text, faults)]


def fault_text(fault: Fault) -> str:
    """A probable fault as a warning."""
    gain = "" if fault.corrected is None else f" (the similarity would be {fault.corrected:.0f})"
    return f"warning: {fault.text}{gain}"


def _window_text(score: DanceScore, number: int) -> str:
    windows = score.windows
    return (
        f"worst from {windows.start_s[number]:.1f} s: similarity {windows.similarity[number]:.0f}, "
        f"delay {1000 * windows.delay_s[number]:+.0f} ms"
    )


def score_json(score: DanceScore, faults: list[Fault], config: ScorerConfig) -> dict[str, Any]:
    """The score for programs: numbers, null where nothing could be compared, with the warnings and the scorer's settings."""
    return _plain({"score": score, "warnings": faults, "scorer": asdict(config)})


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
    title: str, teacher: Performance, learner: Performance, score: DanceScore, faults: list[Fault], window_s: float
) -> str:
    """The score as one HTML page that contains its figures.

    Args:
        title: of the page.
        teacher: the reference dance.
        learner: the scored dance.
        score: of the learner.
        faults: probable faults of the recordings.
        window_s: length of a window, seconds.
    """
    header = ["", "similarity", "timing", "posture"]
    whole = ["whole body", *(f"{value:.0f}" for value in (score.similarity, score.timing, score.posture))]
    rows = [whole, *([name, f"{value:.0f}", "", ""] for name, value in score.parts.items())]
    windows = score.windows
    blocks: list[Block] = [("title", title)]
    blocks += [("text", fault_text(fault)) for fault in faults]
    blocks += [
        ("table", (header, rows)),
        ("text", f"Of 100. {100 * score.scored:.0f} % of the windows of {window_s:g} s could be compared."),
        ("heading", "Over time"),
        ("figure", (_embedded(over_time(windows)), "similarity, posture, timing and delay of every window")),
        ("heading", "Parts of the body"),
        ("figure", (_embedded(of_parts(windows)), "similarity of every part in every window")),
    ]
    if chosen := worst_windows(windows, window_s):
        caption = "The learner in colours (right red, left blue) over the teacher in grey, both turned to the front."
        figure = moments(teacher, learner, windows, window_s, chosen)
        blocks += [("heading", "Worst moments"), ("text", caption), ("figure", (_embedded(figure), "both dancers"))]
    return as_html(blocks, title)


def _embedded(figure: Figure) -> str:
    """A figure as the source of an image: its PNG in base64."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"
