"""Figures with their unit and interval, and tables of them: as text, Markdown, HTML, LaTeX and CSV."""

import csv
import html
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass, is_dataclass
from typing import Any

import numpy as np

NO_VALUE = "-"
DIGITS = {"%": 1, "mm": 1, "cm": 2, "points": 2, "": 1}
"""Digits after the point, by unit."""

LATEX = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "✗": r"$\times$", "±": r"$\pm$", **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}  # fmt: skip
"""What LaTeX reads as a command."""


@dataclass(frozen=True)
class Value:
    """A figure of a table."""

    value: float | None  # in its unit, but a fraction in 0..1 where the unit is %; None where it is undefined
    unit: str = ""  # %, mm, cm, points (percentage points) or nothing
    interval: Sequence[float] | None = None  # its ends, likewise
    deviation: float | None = None  # standard deviation, likewise
    digits: int | None = None  # after the point; None for those of the unit. A whole number has none
    signed: bool = False  # whether a positive number gets a plus sign

    def __str__(self) -> str:
        if self.value is None:
            return NO_VALUE
        deviation = "" if self.deviation is None else f" ± {self._text(self.deviation)}"
        unit = f" {self.unit}" if self.unit else ""
        between = " ({} to {})".format(*map(self._text, self.interval)) if self.interval else ""
        return f"{self._text(self.value)}{deviation}{unit}{between}"

    def numbers(self) -> tuple[float | None, ...]:
        """Value, ends of the interval and deviation in the unit that is shown; None where there is none."""
        scale = 100 if self.unit == "%" else 1
        every = self.value, *(self.interval or (None, None)), self.deviation
        return tuple(None if number is None or self.value is None else scale * number for number in every)

    def _text(self, number: float) -> str:
        if isinstance(number, int):
            return str(number)
        scale = 100 if self.unit == "%" else 1
        digits = DIGITS[self.unit] if self.digits is None else self.digits
        return f"{scale * number:{'+' if self.signed else ''}.{digits}f}"


def plain(value: Any) -> Any:
    """Nested named tuples, dataclasses, dicts and arrays as JSON has them; what is not finite becomes None."""
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, dict):
        return {name: plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def _as_text(cell: str) -> str:
    """A cell that no spreadsheet runs as a formula: a name may begin as one does."""
    if not cell.startswith(("=", "+", "-", "@", "\t", "\r")):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


@dataclass(frozen=True)
class Table:
    """Rows with as many cells as the header; a cell is text, a whole number or a Value."""

    header: list[str]
    rows: list[list[str | int | Value]]

    def cells(self) -> list[list[str]]:
        """The header and the rows as text."""
        return [self.header, *([str(cell) for cell in row] for row in self.rows)]

    def text(self) -> str:
        """For a terminal: the first column is left-aligned, the others are right-aligned."""
        lines = self.cells()
        first, *others = (max(map(len, column)) for column in zip(*lines, strict=True))
        padded = ([row[0].ljust(first), *map(str.rjust, row[1:], others)] for row in lines)
        return "\n".join("  ".join(row) for row in padded)

    def markdown(self) -> str:
        header, *rows = ([cell.replace("|", r"\|") for cell in row] for row in self.cells())
        rule = ["---", *["---:"] * (len(header) - 1)]
        return "\n".join("| " + " | ".join(row) + " |" for row in (header, rule, *rows))

    def html(self) -> str:
        header, *rows = self.cells()
        lines = ["".join(f"<th>{html.escape(cell)}</th>" for cell in header)]
        lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
        return "<table>\n" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "\n</table>"

    def latex(self) -> str:
        """A tabular with the lines of the package booktabs."""
        escaped = ([cell.translate(str.maketrans(LATEX)) for cell in row] for row in self.cells())
        header, *rows = (" & ".join(row) + r" \\" for row in escaped)
        columns = "l" + "r" * (len(self.header) - 1)
        body = [f"\\begin{{tabular}}{{{columns}}}", "\\toprule", header, "\\midrule", *rows, "\\bottomrule", "\\end{tabular}"]
        return "\n".join(body) + "\n"

    def csv(self) -> str:
        """Comma-separated, each number by itself: a Value has columns for its number, interval and deviation, if known.

        Units stand in the header, or in a column of their own where the rows of a column differ in unit.
        """
        columns: list[list[str]] = []
        for name, cells in zip(self.header, zip(*self.rows, strict=True), strict=True):
            values = [cell if isinstance(cell, Value) else Value(None) for cell in cells]
            units = [value.unit for value in values]
            if not any(isinstance(cell, Value) for cell in cells):
                columns.append([name, *map(str, cells)])
                continue
            if len(set(units)) > 1 and ["unit", *units] not in columns:
                columns.append(["unit", *units])
            title = f"{name}, {units[0]}" if len(set(units)) == 1 and units[0] else name
            numbers_of = zip(*(value.numbers() for value in values), strict=True)
            for what, numbers in zip(("", " low", " high", " deviation"), numbers_of, strict=True):
                if not what or any(number is not None for number in numbers):
                    columns.append([title + what, *("" if number is None else f"{number:.6g}" for number in numbers)])
        stream = io.StringIO(newline="")
        csv.writer(stream).writerows([_as_text(cell) for cell in row] for row in zip(*columns, strict=True))
        return stream.getvalue()
