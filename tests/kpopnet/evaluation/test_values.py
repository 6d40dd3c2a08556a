"""Figures and tables as text, and as numbers for programs."""

import csv
import io

import pytest

from kpopnet.evaluation.values import Table, Value


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (Value(0.837, "%", (0.821, 0.845)), "83.7 % (82.1 to 84.5)"),
        (Value(5.554, "cm"), "5.55 cm"),
        (Value(5.554, "cm", deviation=1.0), "5.55 ± 1.00 cm"),
        (Value(-72.666, "points", (-75.33, 1.2), signed=True), "-72.67 points (-75.33 to +1.20)"),
        (Value(105), "105"),
        (Value(281.84), "281.8"),
        (Value(86.0, interval=[79.4, 91.1], digits=0), "86 (79 to 91)"),
        (Value(None, "%", (0.1, 0.2)), "-"),
        (Value(0.5, "%", None), "50.0 %"),
    ],
)
def test_a_figure_is_written_with_unit_and_interval(value, text):
    assert str(value) == text


MIXED = Table(
    ["", "a & b", "c"],
    [
        ["within_10 cm", Value(0.837, "%", (0.821, 0.845)), Value(0.5, "%")],
        ["error, mean", Value(5.5, "cm"), Value(None, "cm")],
    ],
)


def rows(table: Table) -> list[list[str]]:
    return list(csv.reader(io.StringIO(table.csv(), newline="")))


def test_csv_holds_numbers_with_their_units():
    assert rows(MIXED) == [
        ["", "unit", "a & b", "a & b low", "a & b high", "c"],
        ["within_10 cm", "%", "83.7", "82.1", "84.5", "50"],
        ["error, mean", "cm", "5.5", "", "", ""],
    ]
    one_unit = Table(["name", "images", "Eq. 16"], [["x", 3, Value(5.5, "cm", deviation=0.25)], ["y", 4, Value(None, "cm")]])
    assert rows(one_unit) == [
        ["name", "images", "Eq. 16, cm", "Eq. 16, cm deviation"],
        ["x", "3", "5.5", "0.25"],
        ["y", "4", "", ""],
    ]


def test_no_cell_of_csv_is_a_formula():
    names = ["=HYPERLINK(1)", "+1+2", "-2+3", "@SUM(1)", "\t=1", "-3.5", "a=b", "dance"]
    table = Table(["=name", "error"], [[name, Value(-1.5, "cm")] for name in names])
    found = rows(table)
    assert [row[0] for row in found] == ["'=name", *(f"'{name}" for name in names[:5]), *names[5:]] and found[1][1] == "-1.5"


def test_latex_and_html_escape_what_they_would_read_as_commands():
    latex = MIXED.latex()
    assert latex.startswith("\\begin{tabular}{lrr}\n\\toprule\n & a \\& b & c \\\\\n\\midrule\n")
    assert r"within\_10 cm & 83.7 \% (82.1 to 84.5) & 50.0 \% \\" in latex
    assert "<th>a &amp; b</th>" in MIXED.html() and "<td>83.7 % (82.1 to 84.5)</td>" in MIXED.html()


def test_text_and_markdown_are_aligned():
    lines = MIXED.text().splitlines()
    assert len(lines) == 3 and len({len(line) for line in lines}) == 1 and lines[2].startswith("error, mean ")
    assert MIXED.markdown().splitlines()[:2] == ["|  | a & b | c |", "| --- | ---: | ---: |"]


def test_a_name_makes_no_column_of_markdown():
    assert Table(["dance", "score"], [["a|b", 3]]).markdown().splitlines()[-1] == r"| a\|b | 3 |"
