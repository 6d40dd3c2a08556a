"""Figures of the score of one dance: scores over time, scores of the parts, and both dancers at the worst moments."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import Windows
from kpopnet.skeleton import BONES, Joint

SIDE_COLOURS = {"RIGHT": "tab:red", "LEFT": "tab:blue"}
MIDDLE_COLOUR, TEACHER_COLOUR = "tab:green", "0.7"


def over_time(windows: Windows) -> Figure:
    """Similarity, posture and timing of every window above the learner's delay."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    scores, delay = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for name, colour in (("similarity", "black"), ("posture", "tab:orange"), ("timing", "tab:blue")):
        width = 2.0 if name == "similarity" else 1.0
        scores.plot(windows.start_s, getattr(windows, name), color=colour, linewidth=width, marker=".", label=name)
    scores.set_ylim(0, 100)
    scores.set_ylabel("of 100")
    scores.legend(ncols=3, loc="lower left", fontsize=8)
    delay.plot(windows.start_s, windows.delay_s, color="tab:blue", linewidth=1, marker=".")
    delay.axhline(0, color="black", linewidth=0.5)
    delay.set_ylabel("late by, s")
    delay.set_xlabel("start of the window, s")
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


def worst_windows(windows: Windows, window_s: float, count: int = 3) -> list[int]:
    """The windows of the least similarity, at most `count`, that do not overlap, the worst first."""
    chosen: list[int] = []
    for number in np.argsort(windows.similarity, kind="stable"):
        apart = all(abs(windows.start_s[number] - windows.start_s[one]) >= window_s for one in chosen)
        if np.isfinite(windows.similarity[number]) and apart and len(chosen) < count:
            chosen.append(int(number))
    return chosen


def moments(teacher: Performance, learner: Performance, windows: Windows, window_s: float, chosen: list[int]) -> Figure:
    """Both dancers in the middle of each chosen window, from the front and from the learner's left.

    The teacher is shown at the instant that the learner's middle frame is matched with: earlier by the delay. Both are turned
    to the front and scaled to the same trunk.
    """
    figure = Figure(figsize=(2.6 * max(len(chosen), 1) * 2, 3.6), layout="constrained")
    panels = figure.subplots(1, 2 * len(chosen), squeeze=False)[0]
    for place, number in enumerate(chosen):
        time_s = windows.start_s[number] + window_s / 2
        poses = [_upright_pose(learner, time_s), _upright_pose(teacher, time_s - windows.delay_s[number])]
        for view, panel in zip(((0, 1), (2, 1)), panels[2 * place : 2 * place + 2], strict=True):
            _draw(panel, poses[1][:, view], TEACHER_COLOUR)
            _draw(panel, poses[0][:, view], None)
            panel.set_aspect("equal")
            panel.set_xlim(-1.9, 1.9)
            panel.set_ylim(2.4, -2.1)
            panel.axis("off")
        panels[2 * place].set_title(f"{time_s:.1f} s, similarity {windows.similarity[number]:.0f}", fontsize=10)
        panels[2 * place + 1].set_title("from the left", fontsize=10)
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
    hips, shoulders = ([Joint[f"{side}_{name}"] for side in ("RIGHT", "LEFT")] for name in ("HIP", "SHOULDER"))
    return turned / max(np.linalg.norm(turned[shoulders].mean(axis=0) - turned[hips].mean(axis=0)), 1e-6)


def _draw(panel: Axes, points: np.ndarray, colour: str | None) -> None:
    """Draws (15, 2) joints as bones, in one colour or by side of the body."""
    for parent, child in BONES:
        own = SIDE_COLOURS.get(child.name.partition("_")[0], MIDDLE_COLOUR)
        width = 5 if colour else 2.5
        panel.plot(*points[[parent, child]].T, color=colour or own, linewidth=width, solid_capstyle="round")
