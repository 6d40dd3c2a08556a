"""Reads CSV files of named points: a header, then one line a frame."""

import csv
import io
import re
from pathlib import Path

import numpy as np

from kpopnet.dance.joint_files.named_points import NamedPoints
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_budget, names_in, read_text

MAX_COLUMNS = 2000
TIME = "time_s"
_COLUMN = re.compile(r"(.+?)[ _.:-]?(x|y|z|confidence)", re.IGNORECASE)


def read_csv_points(path: Path) -> NamedPoints:
    """Reads a CSV file: columns NAME_x, NAME_y, NAME_z of each point, NAME_confidence and time_s if known; others are ignored.

    The names are those of COCO, of a Kinect, or of `kpopnet.skeleton.Joint`; an empty cell is a missing coordinate.

    Raises:
        InputError: the file is not such a table; the message names the line.
    """
    text = read_text(path).removeprefix("\ufeff")  # which spreadsheets write
    rows = csv.reader(io.StringIO(text))
    try:
        header = [word.strip() for word in next(rows, [])]
        if not 1 < len(header) <= MAX_COLUMNS:
            raise InputError(f"{path}, line 1: {len(header)} columns; expected a header with commas, of 2 to {MAX_COLUMNS}")
        columns = _columns(header)
        names = [name for name, axes in columns.items() if {"x", "y", "z"} <= axes.keys()]
        if not names:
            raise InputError(f"{path}, line 1: expected columns NAME_x, NAME_y, NAME_z; found {names_in(header)}")
        lines = text.count("\n")
        check_budget(path, 8 * lines * len(header), f"{lines} frames of {len(header)} columns")
        used = {number for name in names for number in columns[name].values()}
        used |= {header.index(TIME)} if TIME in header else set()
        values = np.full((lines + 1, len(header)), np.nan)
        frames = 0
        for row in rows:
            if row:
                where = f"{path}, line {rows.line_num}"
                if len(row) != len(header):
                    raise InputError(f"{where}: {len(row)} cells; expected {len(header)}, as in the header")
                for number in used:
                    values[frames, number] = _number(row[number], where)
                frames += 1
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error})") from error
    if not frames:
        raise InputError(f"{path}: no line of numbers below the header")
    return _points(names, columns, values[:frames], header)


def _points(names: list[str], columns: dict[str, dict[str, int]], values: np.ndarray, header: list[str]) -> NamedPoints:
    """The recording that (T, C) numbers under a header are."""
    points = np.stack([values[:, [columns[name][axis] for axis in "xyz"]] for name in names], axis=1)
    confidence = np.ones(points.shape[:2])
    for number, name in enumerate(names):
        if (column := columns[name].get("confidence")) is not None:
            confidence[:, number] = np.nan_to_num(values[:, column])
    return NamedPoints(names, points, values[:, header.index(TIME)] if TIME in header else None, confidence)


def _columns(header: list[str]) -> dict[str, dict[str, int]]:
    """Numbers of the columns of each name's x, y, z and confidence."""
    found: dict[str, dict[str, int]] = {}
    for number, word in enumerate(header):
        if match := _COLUMN.fullmatch(word):
            found.setdefault(match[1], {}).setdefault(match[2].lower(), number)
    return found


def _number(cell: str, where: str) -> float:
    """The number in a cell; NaN for an empty one."""
    try:
        return float(cell) if cell.strip() else np.nan
    except ValueError:
        raise InputError(f"{where}: expected a number, found {cell[:40]!r}") from None
