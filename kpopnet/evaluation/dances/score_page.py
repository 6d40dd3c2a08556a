"""The score of one dance as a page that needs no other file, as JSON, and as lines of text."""

import base64
import io
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kpopnet.dance.diagnosis import RecordingFault
from kpopnet.dance.feedback import Feedback, Phrase, clock
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore, Windows
from kpopnet.dance.window import WINDOW_S
from kpopnet.evaluation.report import Block, as_html
from kpopnet.evaluation.values import Table, plain
from kpopnet.skeleton import BONES, Joint

MAX_FAULTS = 8
"""Largest number of faults in the page, the costliest first; the JSON has all."""

WORST_WINDOWS = 3
SIDE_COLOURS = {"RIGHT": "tab:red", "LEFT": "tab:blue"}
MIDDLE_COLOUR, TEACHER_COLOUR = "tab:green", "0.7"


def score_text(score: DanceScore, told: Feedback, faults: list[RecordingFault]) -> list[str]:
    """The score in lines for a terminal."""
    seen = {name: "" if coverage > 0.99 else f" (seen {coverage:.0%})" for name, coverage in score.coverage.items()}
    return [
        f"similarity {score.similarity:.0f}, timing {score.timing:.0f}, posture {score.posture:.0f} of 100",
        *_ceiling(score),
        "parts: " + ", ".join(f"{name} {value:.0f}{seen[name]}" for name, value in score.parts.items()),
        *map(fault_text, faults),
        *told.hints,
        *(fault.text for fault in told.faults[:MAX_FAULTS]),
        *map(_phrase_text, told.phrases),
    ]


def _ceiling(score: DanceScore) -> list[str]:
    """What perfect dancing scores, where an estimator's errors are known."""
    through = f"perfect dancing seen through the estimator {score.scorer.noise} scores {score.ceiling:.0f} on average"
    return [through] if score.ceiling < 100 else []


def _phrase_text(phrase: Phrase) -> str:
    """A phrase with what was not seen and its worst moments, the worst first."""
    number = "not compared" if phrase.similarity is None else f"{phrase.similarity:.0f}"
    moments = "; ".join([*phrase.unseen, *(moment.text for moment in phrase.moments)]) or "no fault stands out"
    return f"{clock(phrase.start_s)} to {clock(phrase.end_s)}, {number}: {moments}"


def fault_text(fault: RecordingFault) -> str:
    """A probable fault as a warning."""
    gain = "" if fault.corrected is None else f" (the similarity would be {fault.corrected:.0f})"
    return f"warning: {fault.text}{gain}"


def score_json(score: DanceScore, told: Feedback, faults: list[RecordingFault]) -> dict[str, Any]:
    """The score for programs: numbers, null where nothing could be compared, with feedback, warnings and settings."""
    content = score._asdict()
    return plain({"score": content, "feedback": told, "warnings": faults, "scorer": content.pop("scorer")})


def score_page(
    title: str, teacher: Performance, learner: Performance, score: DanceScore, told: Feedback, faults: list[RecordingFault]
) -> str:
    """The score, its feedback and probable faults of the recordings as one HTML page that contains its figures."""
    windows = score.windows
    compared = f"Of 100. {100 * score.scored:.0f} % of the windows of {WINDOW_S:g} s could be compared."
    blocks: list[Block] = [
        ("title", title),
        *(("text", fault_text(fault)) for fault in faults),
        ("table", _score_table(score)),
        *(("text", text) for text in (compared, *_ceiling(score), *told.hints)),
    ]
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
    if chosen := worst_windows(windows):
        caption = "The learner in colours (right red, left blue) over the teacher in grey, both turned to the front."
        figure = moments(teacher, learner, windows, chosen)
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


def over_time(windows: Windows) -> Figure:
    """Similarity, posture and timing of every window above the learner's delay."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    scores, delay = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for name, colour, width in (("similarity", "black", 2.0), ("posture", "tab:orange", 1.0), ("timing", "tab:blue", 1.0)):
        scores.plot(windows.start_s, getattr(windows, name), color=colour, linewidth=width, marker=".", label=name)
    scores.set(ylim=(0, 100), ylabel="of 100")
    scores.legend(ncols=3, loc="lower left", fontsize=8)
    delay.plot(windows.start_s, windows.delay_s, color="tab:blue", linewidth=1, marker=".")
    delay.axhline(0, color="black", linewidth=0.5)
    delay.set(ylabel="late by, s", xlabel="start of the window, s")
    for panel in (scores, delay):
        panel.grid(alpha=0.3)
    return figure


def of_parts(windows: Windows) -> Figure:
    """The posture of each part of the body in every window, as a map from red, 0, to green, 100; grey is not scored."""
    names = list(windows.parts)
    figure = Figure(figsize=(10, 0.4 * len(names) + 1.1), layout="constrained")
    panel = figure.subplots()
    panel.set_facecolor("0.8")
    hop_s = float(np.median(np.diff(windows.start_s))) if len(windows.start_s) > 1 else 1.0
    extent = (windows.start_s[0] - hop_s / 2, windows.start_s[-1] + hop_s / 2, len(names) - 0.5, -0.5)
    values = np.stack([windows.parts[name] for name in names])
    image = panel.imshow(values, cmap="RdYlGn", vmin=0, vmax=100, aspect="auto", interpolation="nearest", extent=extent)
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("start of the window, s")
    figure.colorbar(image, ax=panel, label="posture")
    return figure


def worst_windows(windows: Windows) -> list[int]:
    """The WORST_WINDOWS windows of the least similarity that do not overlap, or fewer, the worst first."""
    chosen: list[int] = []
    for number in np.argsort(windows.similarity, kind="stable"):
        apart = all(abs(windows.start_s[number] - windows.start_s[one]) >= WINDOW_S for one in chosen)
        if np.isfinite(windows.similarity[number]) and apart and len(chosen) < WORST_WINDOWS:
            chosen.append(int(number))
    return chosen


def moments(teacher: Performance, learner: Performance, windows: Windows, chosen: list[int]) -> Figure:
    """Both dancers in the middle of each chosen window, from the front and from the learner's left.

    The teacher is shown at the instant that the learner's middle frame is matched with: earlier by the delay. Both are turned
    to the front and scaled to the same trunk.
    """
    figure = Figure(figsize=(5.2 * len(chosen), 3.6), layout="constrained")
    panels = figure.subplots(1, 2 * len(chosen), squeeze=False)
    for (front, side), number in zip(panels.reshape(-1, 2), chosen, strict=True):
        time_s = windows.start_s[number] + WINDOW_S / 2
        poses = _upright_pose(teacher, time_s - windows.delay_s[number]), _upright_pose(learner, time_s)
        for panel, view in ((front, (0, 1)), (side, (2, 1))):
            _draw(panel, poses[0][:, view], TEACHER_COLOUR)
            _draw(panel, poses[1][:, view])
            panel.set(aspect="equal", xlim=(-1.9, 1.9), ylim=(2.4, -2.1))
            panel.axis("off")
        front.set_title(f"{time_s:.1f} s, similarity {windows.similarity[number]:.0f}", fontsize=10)
        side.set_title("from the left", fontsize=10)
    return figure


def _upright_pose(performance: Performance, time_s: float) -> np.ndarray:
    """(15, 3) joints of the frame nearest to a time: to the dancer's left, down, and backwards, in lengths of the trunk."""
    frame = int(np.abs(performance.times_s - time_s).argmin())
    joints_m = performance.joints_m[frame] - performance.joints_m[frame, Joint.TORSO]
    across = joints_m[Joint.LEFT_HIP] - joints_m[Joint.RIGHT_HIP]
    angle = np.arctan2(across[2], across[0])
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, z = joints_m.T
    turned = np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=1)
    hips, shoulders = turned[[Joint.RIGHT_HIP, Joint.LEFT_HIP]], turned[[Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]]
    return turned / max(np.linalg.norm(shoulders.mean(axis=0) - hips.mean(axis=0)), 1e-6)


def _draw(panel: Axes, points: np.ndarray, colour: str | None = None) -> None:
    """Draws (15, 2) joints as bones, thick in one colour, or by side of the body."""
    for parent, child in BONES:
        own = SIDE_COLOURS.get(child.name.partition("_")[0], MIDDLE_COLOUR)
        width = 5 if colour else 2.5
        panel.plot(*points[[parent, child]].T, color=colour or own, linewidth=width, solid_capstyle="round")
