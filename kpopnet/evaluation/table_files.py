"""The tables of a report as files: CSV for programs and spreadsheets, LaTeX for papers."""

import csv
import io
import re
from collections import Counter
from pathlib import Path

from kpopnet.evaluation.blocks import Block, Table
from kpopnet.runtime.atomic_write import atomic_path

LATEX = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "✗": r"$\times$", "±": r"$\pm$", **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}  # fmt: skip
"""What LaTeX reads as a command."""


def write_tables(folder: Path, blocks: list[Block]) -> None:
    """Writes every table as NAME.csv and NAME.tex, named by the heading above it, with a number from the second one on."""
    named = named_tables(blocks)
    if named:
        folder.mkdir(exist_ok=True)
    for name, table in named.items():
        for suffix, text in ((".csv", as_csv(table)), (".tex", as_latex(table))):
            with atomic_path(folder / f"{name}{suffix}") as part:
                part.write_bytes(text.encode("utf-8", "backslashreplace"))


def named_tables(blocks: list[Block]) -> dict[str, Table]:
    """The tables by the name of their file."""
    heading, number, tables = "summary", Counter[str](), {}
    for kind, content in blocks:
        if kind == "heading":
            heading = re.sub(r"[^a-z0-9]+", "_", content.lower()).strip("_")[:60] or "table"
        elif kind == "table":
            number[heading] += 1
            name = heading if number[heading] == 1 else f"{heading}_{number[heading]}"
            while name in tables:
                name += "_"
            tables[name] = content
    return tables


def as_csv(table: Table) -> str:
    """The table as comma-separated values, with a header."""
    stream = io.StringIO(newline="")
    csv.writer(stream).writerows([table[0], *table[1]])
    return stream.getvalue()


def as_latex(table: Table) -> str:
    """The table as a tabular of LaTeX with the lines of the package booktabs."""
    header, rows = ([[_escaped(cell) for cell in row] for row in part] for part in ([table[0]], table[1]))
    lines = [" & ".join(row) + r" \\" for row in (*header, *rows)]
    columns = "l" + "r" * (len(table[0]) - 1)
    body = ["\\toprule", lines[0], "\\midrule", *lines[1:], "\\bottomrule"]
    return "\n".join([f"\\begin{{tabular}}{{{columns}}}", *body, "\\end{tabular}"]) + "\n"


def _escaped(text: str) -> str:
    return "".join(LATEX.get(letter, letter) for letter in text)
