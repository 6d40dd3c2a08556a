"""Recordings of joints as frames of points by name, and CSV files: a line for each frame, or for each point of a frame."""

import csv
import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.dance.joint_files.points import MEDIAPIPE_NAMES, NamedPoints
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_budget, check_fields, expect, names_in, parsing, read_text

TIME = "time_s"
TIMES = {TIME: 1.0, "timestamp_ms": 0.001}
"""Names of a frame's time, and seconds per unit."""

NUMBERS = ("frame", "frame_index")
"""Names of a frame's number."""

_COLUMN = re.compile(r"(.+?)[ _.:-]?(x|y|z|confidence|visibility)", re.IGNORECASE)


def numbers_in(value: Any, lengths: tuple[int, ...], where: str) -> list[float]:
    """A list of numbers or nulls, which are NaN, of one of some lengths."""
    fits = isinstance(value, list) and len(value) in lengths and all(one is None or type(one) in (int, float) for one in value)
    expect(fits, where, f"{lengths[0]} numbers in each point")
    return [np.nan if one is None else float(one) for one in value]


def joint_points(frames: list[dict], fps: float | None, where: str) -> NamedPoints:
    """A recording of frames with "joints" by name."""
    for number, frame in enumerate(frames):
        check_fields(f"{where}: frame {number}", frame, {"joints": dict} | dict.fromkeys(TIMES, float), TIMES)
    names = list(dict.fromkeys(name for frame in frames for name in frame["joints"]))
    values = np.full((len(frames), len(names), 4), np.nan)
    values[..., 3] = 1.0
    places = {name: number for number, name in enumerate(names)}
    for number, frame in enumerate(frames):
        for name, point in frame["joints"].items():
            if point is not None:
                given = numbers_in(point, (3, 4), f"{where}: frame {number}, {name[:40]}")
                values[number, places[name], : len(given)] = given
    time = next((time for time in TIMES if time in frames[0]), TIME)
    times_s = [TIMES[time] * frame[time] for frame in frames if time in frame]
    expect(len(times_s) in (0, len(frames)), where, f"{time} in all frames or in none")
    given_s = np.array(times_s, float) if times_s else None
    return NamedPoints(names, values[..., :3], given_s, np.nan_to_num(values[..., 3]), fps)


def read_csv(path: Path) -> NamedPoints:
    """Columns NAME_x, NAME_y, NAME_z of each point, NAME_confidence or NAME_visibility and a time of TIMES if known.

    Or a line for each point: columns x, y, z, the point's name, its frame and the rest. An empty cell is missing.
    """
    text = read_text(path).removeprefix("\ufeff")  # which spreadsheets write
    table = csv.reader(io.StringIO(text))
    with parsing(path, "not a CSV file"):
        header = [word.strip() for word in next(table, [])]
        rows = [(table.line_num, row) for row in table if row]
    columns: dict[str, dict[str, int]] = {}
    for number, word in enumerate(header):
        if match := _COLUMN.fullmatch(word):
            columns.setdefault(match[1], {}).setdefault(match[2].lower().replace("visibility", "confidence"), number)
    parts = ("x", "y", "z", "confidence")
    places = {
        name: [own[part] for part in parts if part in own] for name, own in columns.items() if own.keys() >= {"x", "y", "z"}
    }
    long_places = _long_places(header)
    columns_of_points = f"columns NAME_x, NAME_y, NAME_z, found {names_in(header) or 'none'}"
    expect(bool(places) or long_places is not None, f"{path}, line 1", columns_of_points)
    expect(bool(rows), str(path), "a line of numbers below the header")
    for line, row in rows:
        expect(len(row) == len(header), f"{path}, line {line}", f"{len(header)} cells as in the header, found {len(row)}")
    if long_places is not None:
        return _long_points(rows, long_places, path)
    frames, lower = [], [word.lower() for word in header]
    for line, row in rows:
        joints = {name: [_number(row[place], f"{path}, line {line}") for place in own] for name, own in places.items()}
        times = {time: _number(row[lower.index(time)], f"{path}, line {line}") for time in TIMES if time in lower}
        frames.append({"joints": joints} | times)
    number_at = next((number for number, word in enumerate(lower) if word in NUMBERS), None)
    if number_at is not None and not any(time in lower for time in TIMES):
        numbers = [row[number_at].strip() for _, row in rows]
        if all(map(str.isdecimal, numbers)):
            expect(
                len(set(numbers)) == len(numbers), str(path), "one line for each frame; give each person a file of their own"
            )
            by_number = dict(zip(numbers, frames, strict=True))
            frames = list(_with_those_between(by_number, path).values())
    return joint_points(frames, None, str(path))


_LONG = {"name": ("name", "landmark", "landmark_name", "joint", "keypoint"), "frame": (*NUMBERS, *TIMES)} | {
    axis: (f"world_{axis}", axis)
    for axis in "xyz"  # beside which plain ones are of the picture
}
"""Columns of a CSV file with a line for each point, by the names that they have."""


def _long_places(header: list[str]) -> dict[str, int] | None:
    """Where such a file's columns are; None if it is another one."""
    lower = [word.lower() for word in header]
    places = {part: lower.index(word) for part, words in _LONG.items() for word in words[::-1] if word in lower}
    if places.keys() < _LONG.keys():
        return None
    extra = {name: lower.index(name) for name in (*TIMES, "visibility", "confidence") if name in lower}
    return places | extra


def _long_points(rows: list[tuple[int, list[str]]], places: dict[str, int], path: Path) -> NamedPoints:
    """The points of a file with a line for each; those of a frame follow each other."""
    frames: dict[str, dict] = {}
    for line, row in rows:
        where = f"{path}, line {line}"
        times = {time: _number(row[places[time]], where) for time in TIMES if time in places}
        frame = frames.setdefault(row[places["frame"]].strip(), {"joints": {}} | times)
        parts = [part for part in ("x", "y", "z", "confidence", "visibility") if part in places][:4]
        name = row[places["name"]].strip()
        name = MEDIAPIPE_NAMES[int(name)] if name.isdecimal() and int(name) < len(MEDIAPIPE_NAMES) else name
        expect(name not in frame["joints"], where, f"one line for {name} in a frame; give each person a file of their own")
        frame["joints"][name] = [_number(row[places[part]], where) for part in parts]
    if not any(time in places for time in TIMES) and all(number.isdecimal() for number in frames):
        frames = _with_those_between(frames, path)
    return joint_points(list(frames.values()), None, str(path))


def _with_those_between(frames: dict[str, dict], path: Path) -> dict[str, dict]:
    """Frames by their numbers, with those before and between that have no line, since no person was found in them.

    They count from 1, or from 0 if that is there: as a time that is stated does, a number tells when the first person was seen.
    """
    by_number = {int(number): frame for number, frame in frames.items()}
    first, last = min(*by_number, 1), max(by_number)
    check_budget(path, (last - first + 1) * 33 * 32, f"frames {first} to {last} of 33 points")
    return {str(number): by_number.get(number, {"joints": {}}) for number in range(first, last + 1)}


def _number(cell: str, where: str) -> float:
    """The number in a cell; NaN for an empty one."""
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{where}: expected a number, found {cell[:40]!r}") from None
