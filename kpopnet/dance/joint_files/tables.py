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

TIME_ALIASES = {"time": TIME, "time_ms": "timestamp_ms"}
"""Other names of such a column of numbers in CSV files that have none of these, in small letters."""

NUMBERS = ("frame", "frame_index")
"""Names of a frame's number."""

PEOPLE = ("identity", "body_id", "person_id", "person")
"""Names of a column that tells people apart."""

EACH_A_FILE = "give each person a file of their own"

PARTS = ("x", "y", "z", "confidence")

_COLUMN = re.compile(r"(.+?)[ _.:-]?(x|y|z|confidence|visibility)", re.IGNORECASE)

_WORLD = re.compile(r"^world[ _.:-]?|[ _.:-]?world$", re.IGNORECASE)
"""What tells a point's name in the world from that in the picture."""

_WHOLE = re.compile(r"\d+(\.0*)?")
"""The number of a frame, also as 5.0: some programs write whole numbers so."""

_LONG = {
    "name": ("name", "landmark", "landmark_name", "joint", "keypoint"),
    "frame": (*NUMBERS, *TIMES),
    **{axis: (f"world_{axis}", axis) for axis in "xyz"},  # beside which plain ones are of the picture
    "confidence": ("confidence", "visibility"),
}
"""Columns of a CSV file with a line for each point, by the names that they have, the first of which counts."""


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

    Or a line for each point: columns x, y, z, the point's name, its frame and the rest. An empty cell is missing. Where there
    are columns world_x and x, or NAME_world_x and NAME_x, the latter say where MediaPipe's points are in the picture.
    """
    text = read_text(path)
    header_line = text.partition("\n")[0]
    if "," not in header_line and (separator := next((one for one in ";\t" if one in header_line), "")):
        text = text.replace(",", ".").replace(separator, ",")  # of a spreadsheet, where a comma may be the decimal point
    table = csv.reader(io.StringIO(text))
    with parsing(path, "not a CSV file"):
        header = [word.strip() for word in next(table, [])]
        rows = [(f"{path}, line {table.line_num}", row) for row in table if row]
    lower = [word.lower() for word in header]
    if not TIMES.keys() & {*lower}:
        aliased = {at for at, word in enumerate(lower) if word in TIME_ALIASES and _are_numbers(rows, at)}
        lower = [TIME_ALIASES[word] if at in aliased else word for at, word in enumerate(lower)]
    (wide, wide_picture), long = _with_picture(_wide_places(header)), _long_places(lower)
    in_picture = [lower.index(axis) for axis in "xy" if axis in lower] if long and "world_x" in lower else []
    expect(bool(wide or long), f"{path}, line 1", f"columns NAME_x, NAME_y, NAME_z, found {names_in(header) or 'none'}")
    expect(bool(rows), str(path), "a line of numbers below the header")
    for where, row in rows:
        expect(len(row) == len(header), where, f"{len(header)} cells as in the header, found {len(row)}")
    times = {time: lower.index(time) for time in TIMES if time in lower}
    _check_one_person(rows, lower, header)
    frame_at = long["frame"] if long else next((number for number, word in enumerate(lower) if word in NUMBERS), None)
    # Frames that have no line are known by the numbers of the others, unless times are stated.
    numbered = frame_at is not None and not times and all(_WHOLE.fullmatch(row[frame_at].strip()) for _, row in rows)
    frames: dict[str, dict] = {}
    for where, row in rows:
        of_frame = row[frame_at].strip() if frame_at is not None and (long or numbered) else where
        time_of = {time: _number(row[at], where) for time, at in times.items()}
        frame = frames.setdefault(of_frame, {"joints": {}, "picture": {}} | time_of)
        named = _named(row, long) if long else wide
        for name, places in named.items():
            expect(name not in frame["joints"], where, f"one line for {name} in a frame; {EACH_A_FILE}")
            frame["joints"][name] = [_number(row[place], where) for place in places]
        for name, places in (dict.fromkeys(named, in_picture) if long else wide_picture).items():
            if len(places) == 2:
                frame["picture"][name] = [*(_number(row[place], where) for place in places), np.nan]
    ordered = _with_those_between(frames, path) if numbered else [*frames.values()]
    found = joint_points(ordered, None, str(path))
    picture = joint_points([{"joints": frame["picture"]} for frame in ordered], None, str(path))
    known = np.isfinite(shares := picture.points[..., :2])
    # Others are pixels, of a picture whose size the file does not state.
    are_shares = picture.names == found.names and known.any() and np.median(shares[known]) <= 1
    return found._replace(image=shares) if are_shares else found


def _are_numbers(rows: list[tuple[str, list[str]]], at: int) -> bool:
    try:
        return all(np.isfinite(float(row[at])) for _, row in rows)
    except (ValueError, IndexError):
        return False


def _check_one_person(rows: list[tuple[str, list[str]]], lower: list[str], header: list[str]) -> None:
    """Raises InputError where a column of PEOPLE tells two apart in one frame; later a person may have another number."""
    moments = [at for at, word in enumerate(lower) if word in (*TIMES, *NUMBERS)]
    for at in (at for at, word in enumerate(lower) if word in PEOPLE and moments):
        seen: dict[tuple[str, ...], str] = {}
        for where, row in rows:
            who = row[at].strip()
            first = seen.setdefault(tuple(row[one] for one in moments), who) if who else who
            expect(first == who, f"{where}, column {header[at]}", f"one person, found {first} and {who}; {EACH_A_FILE}")


def _wide_places(header: list[str]) -> dict[str, list[int]]:
    """Columns of x, y, z and, if known, confidence of each point of a file with a line for each frame."""
    columns: dict[str, dict[str, int]] = {}
    for number, word in enumerate(header):
        if match := _COLUMN.fullmatch(word):
            columns.setdefault(match[1], {}).setdefault(match[2].lower().replace("visibility", "confidence"), number)
    return {name: [own[part] for part in PARTS if part in own] for name, own in columns.items() if own.keys() >= {*"xyz"}}


def _with_picture(wide: dict[str, list[int]]) -> tuple[dict[str, list[int]], dict[str, list[int]]]:
    """The columns of points, and those of x and y in the picture of points that have columns in the world, too."""
    of_world = {plain: name for name in wide if (plain := _WORLD.sub("", name)) in wide and plain != name}
    others = {name: places for name, places in wide.items() if name not in of_world.values()}
    world = {plain: wide[name][:3] + (wide[name][3:] or wide[plain][3:]) for plain, name in of_world.items()}
    return others | world, {plain: wide[plain][:2] for plain in of_world}


def _long_places(lower: list[str]) -> dict[str, int]:
    """Columns of a file with a line for each point, by _LONG; none of another one."""
    places = {part: lower.index(word) for part, words in _LONG.items() for word in words[::-1] if word in lower}
    return places if places.keys() >= {"name", "frame", *"xyz"} else {}


def _named(row: list[str], places: dict[str, int]) -> dict[str, list[int]]:
    """The point of a line: its name, in place of which a number counts MediaPipe's, and its columns."""
    name = row[places["name"]].strip()
    name = MEDIAPIPE_NAMES[int(name)] if name.isdecimal() and int(name) < len(MEDIAPIPE_NAMES) else name
    return {name: [places[part] for part in PARTS if part in places]}


def _with_those_between(frames: dict[str, dict], path: Path) -> list[dict]:
    """Frames by their numbers, with those before and between that have no line, since no person was found in them.

    They count from 1, or from 0 if that is there: as a time that is stated does, a number tells when the first person was seen.
    """
    by_number = {int(number.partition(".")[0]): frame for number, frame in frames.items()}
    first, last = min(*by_number, 1), max(by_number)
    check_budget(path, (last - first + 1) * 33 * 32, f"frames {first} to {last} of 33 points")
    return [by_number.get(number, {"joints": {}, "picture": {}}) for number in range(first, last + 1)]


def _number(cell: str, where: str) -> float:
    """The number in a cell; NaN for an empty one."""
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{where}: expected a number, found {cell[:40]!r}") from None
