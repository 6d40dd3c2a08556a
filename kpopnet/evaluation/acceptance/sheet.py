"""The acceptance sheet as a table, as Markdown, as JSON and in pictures: figures held against two gates each."""

import math
import os
import platform
import re
from collections.abc import Callable
from itertools import product
from operator import ge, le
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.evaluation.acceptance.figures import exchanges, false_people, gaps, present
from kpopnet.evaluation.acceptance.watched import Watched
from kpopnet.evaluation.poses.metrics import joint_errors_m
from kpopnet.evaluation.report import Picture, as_markdown, made_by, write_text
from kpopnet.evaluation.values import Table, Value
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.cpu import available_cores
from kpopnet.viz.drawing import ESTIMATED, TRUE, save_png, scene_tile, sheet

EMPTY_S = 600.0
"""For how long no person may be seen in the empty room."""

TILE_WIDTH_PX, TILES_PER_ROW, MOST_TILES = 320, 4, 24
BOTH, USERS, MISSED, NOT_SHOWN = "met both", "met, ours missed", "missed", "not shown"


class Line(NamedTuple):
    """A line of the sheet."""

    key: str  # of its figure
    title: str  # what a reader calls it
    unit: str  # of the figure
    compare: Callable[[float, float], bool] | None = None  # with which the figure meets a gate; None without gates
    gate: float = 0  # of an independent user of depth joints in a dance game
    ours: float = 0  # as half of what the user tolerates


LINES = (
    Line("images_in_s", "images a second from the camera", ""),
    Line("images_out_s", "images a second with an answer", "", ge, 29, 29.5),
    Line("delay_p50_ms", "delay from image to joints, median", "ms"),
    Line("delay_p95_ms", "delay, 95th percentile", "ms", le, 50, 25),
    Line("delay_p99_ms", "delay, 99th percentile", "ms"),
    Line("delay_longest_ms", "delay, longest", "ms", le, 150, 75),
    Line("processor_p95_ms", "processor time of an answer, 95th percentile", "ms"),
    Line("stale_images", "images older than 150 ms when their joints were there", ""),
    Line("availability", "time in view with joints", "%", ge, 0.99, 0.995),
    Line("false_people", "people seen in the empty room", "", le, 0, 0),
    Line("empty_s", "time for which the room was empty", "s"),
    Line("found_first_ms", "until found after coming in", "ms"),
    Line("found_again_ms", "until found again after coming back", "ms", le, 750, 375),
    Line("longest_gap_ms", "longest gap", "ms"),
    Line("exchanges", "exchanges of left and right", "", le, 0, 0),
    Line("jitter_core_mm", "jitter at rest, trunk and head", "mm", le, 20, 10),
    Line("jitter_ends_mm", "jitter at rest, hands and feet", "mm", le, 35, 17.5),
    Line("mean_error_mm", "mean error of all joints", "mm", le, 80, 40),
    Line("ends_error_mm", "mean error of hands and feet", "mm", le, 100, 50),
)

Figures = dict[str, float | int | None]


def verdict(line: Line, found: Figures) -> str:
    """How a figure stands to the gates of its line, "" for a line without gates."""
    value = found[line.key]
    if line.compare is None:
        return ""
    if value is None or (line.key == "false_people" and value == 0 and (found["empty_s"] or 0) < EMPTY_S):
        return NOT_SHOWN
    if line.compare(value, line.ours):
        return BOTH
    return USERS if line.compare(value, line.gate) else MISSED


def table(found: dict[str, Figures]) -> Table:
    """The sheet; a column for each entry, with the verdict where a line has gates."""
    rows: list[list] = []
    for line in LINES:
        sign = {ge: "≥ ", le: "≤ ", None: ""}[line.compare]
        gates = [f"{sign}{_value(line, one)}" if line.compare else "" for one in (line.gate, line.ours)]
        cells = (", ".join(filter(None, (str(_value(line, one[line.key])), verdict(line, one)))) for one in found.values())
        rows.append([line.title, *gates, *cells])
    return Table(["", "users' gate", "our gate", *found], rows)


def _value(line: Line, value: float | int | None) -> Value | str:
    stated = _stated(value)
    return stated if isinstance(stated, str) else Value(stated, line.unit, digits=1)


def _stated(value: float | int | None) -> float | int | str | None:
    """A figure, or the word for a time that is infinite."""
    return "never" if value is not None and math.isinf(value) else value


def blocks(source: str, is_simulated: bool, found: dict[str, Figures], remarks: list[str]) -> list[str | Table]:
    """The sheet with what is needed to read it."""
    origin = ["SIMULATED depth of simulated people: no real sensor and no real person."] if is_simulated else []
    return [f"Acceptance sheet: {source}", *origin, *remarks, table(found), MEANING]


MEANING = (
    f'"{BOTH}": the users\' gate and ours. "{NOT_SHOWN}": not measured, or no person was seen, but the room was not empty for '
    "ten minutes (--empty 10). What each line means: docs/check.md."
)


def machine() -> dict:
    """What the delays depend on."""
    path = Path("/proc/cpuinfo")  # of Linux
    name = re.search(r"model name\s*:\s*(.*)", path.read_text()) if path.is_file() else None
    processor = name[1].strip() if name else platform.processor() or platform.machine()
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0  # not known on this system
    return {"processor": processor, "cores": os.cpu_count(), "usable_cores": available_cores(), "load": load}


def write(folder: Path, shown: list[str | Table], found: dict[str, Figures], runs: list[Watched], about: dict) -> list[Path]:
    """Writes check.md, check.json and, where there are `moments`, check.png into a folder; returns their paths.

    `about` are other entries of the JSON file.
    """
    entries: dict[str, dict] = {name: {} for name in found}
    for line, (name, one) in product(LINES, found.items()):
        gates = {"users_gate": line.gate, "our_gate": line.ours, "verdict": verdict(line, one)} if line.compare else {}
        entries[name][line.key] = {"value": _stated(one[line.key]), **gates}
    write_json(folder / "check.json", about | {"sheet": entries} | made_by(), allow_nan=False)
    written = [folder / "check.md", folder / "check.json"]
    tiles = [tile(run, number, caption) for run in runs for number, caption in moments(run) if number in run.images]
    tiles, pictures = tiles[:MOST_TILES], []
    (folder / "check.png").unlink(missing_ok=True)  # of another run
    if tiles:
        rows = [("", tiles[first : first + TILES_PER_ROW]) for first in range(0, len(tiles), TILES_PER_ROW)]
        styles = (ESTIMATED, TRUE) if any(run.truth_m is not None for run in runs) else (ESTIMATED,)
        save_png(folder / "check.png", sheet(rows, styles, str(shown[0])))
        pictures = [Picture("check.png", "Images to look at: what was missed, and the largest error")]
        written.append(folder / "check.png")
    write_text(folder / "check.md", as_markdown([*shown, *pictures]))
    return written


def moments(run: Watched) -> list[tuple[int, str]]:
    """The images of a run that a reader should look at, and why."""
    shown = [(number, "no person is there") for number in false_people(run)]
    shown += [(number, "sides exchanged, or back") for number in exchanges(run)]
    for first, last in gaps(run):
        why = "taken for another person" if run.people_m[(first + last) // 2] else "not found"
        shown.append(((first + last) // 2, f"{why} in {last - first} images"))
    if run.truth_m is not None and (scored := run.in_view & present(run)).any():
        numbers, errors_m = np.flatnonzero(scored), joint_errors_m(run.truth_m[scored], run.joints_m[scored])
        means_m = np.nanmean(np.where(np.isfinite(errors_m), errors_m, np.nan), axis=1)
        shown.append((int(numbers[means_m.argmax()]), f"largest mean error, {1000 * means_m.max():.0f} mm"))
    return shown


def tile(run: Watched, number: int, caption: str) -> np.ndarray:
    """RGB image of one image of a run with the joints found, and the true ones where they are known."""
    depth_mm, camera = run.images[number]
    skeletons = [(joints_m, ESTIMATED) for joints_m in run.people_m[number]]
    if run.truth_m is not None and not run.empty[number]:
        skeletons.append((run.truth_m[number], TRUE))
    captions = f"{run.name}, {run.kind}, {run.times_s[number]:.2f} s", caption
    return scene_tile(depth_mm / np.float32(MM_PER_METRE), camera, skeletons, TILE_WIDTH_PX, captions)
