"""Writes a report, given as a list of blocks, as Markdown and as HTML; its tables and metrics as files for programs."""

import json
import math
import sys
from pathlib import Path
from typing import Any

from kpopnet.evaluation.blocks import Block, Table
from kpopnet.evaluation.page import as_html
from kpopnet.evaluation.table_files import write_tables
from kpopnet.runtime.atomic_write import atomic_path


def write_document(folder: Path, blocks: list[Block], metrics: dict) -> None:
    """Writes report.md, report.html, metrics.json and the tables (kpopnet.evaluation.table_files) into the folder.

    Each file appears whole or not at all. report.html contains its figures, videos and 3D views, but for large ones
    (kpopnet.evaluation.page), so it can be passed on alone.
    A half of a surrogate pair, which stands in the name of a file for a byte that is no UTF-8, becomes a backslash escape.

    Args:
        folder: output folder; it already holds the figures, videos and views.
        blocks: contents of the report, with a title.
        metrics: contents of metrics.json.

    Raises:
        ValueError: see `as_json`; the report is written all the same.
    """
    _write(folder / "report.md", as_markdown(blocks))
    _write(folder / "report.html", as_html(blocks, folder))
    write_tables(folder / "tables", blocks)
    _write(folder / "metrics.json", as_json(metrics))


def _write(path: Path, text: str) -> None:
    with atomic_path(path) as part:
        part.write_bytes(writable(text).encode())


def writable(text: str, encoding: str = "utf-8") -> str:
    """The text with backslash escapes, which are ASCII, for what cannot be written in an encoding."""
    return text.encode(encoding, "backslashreplace").decode(encoding)


def printable(text: str) -> str:
    """`writable` in the encoding of the terminal."""
    return writable(text, getattr(sys.stdout, "encoding", None) or "ascii")


def describe_files(files: dict[str, dict[str, str]]) -> str:
    """The result of `EvaluateConfig.files` as a sentence."""
    per_estimator = (
        f"{estimator} {' '.join(f'{setting}={file}' for setting, file in paths.items()) or 'no file'}"
        for estimator, paths in files.items()
    )
    return f"Files read by the estimators: {', '.join(per_estimator) or 'none'}"


def describe_revision(git: dict | None) -> str:
    """The result of `kpopnet.runtime.provenance.git_revision` as text."""
    return f"{git['revision'][:12]}{' with uncommitted changes' if git['dirty'] else ''}" if git else "unknown"


def as_json(metrics: dict) -> str:
    """The text of metrics.json. Infinite or NaN settings, which JSON cannot represent, become strings.

    Raises:
        ValueError: a metric is NaN or infinite.
    """
    return json.dumps(metrics | {"config": _non_finite_as_text(metrics["config"])}, indent=2, allow_nan=False) + "\n"


def _non_finite_as_text(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _non_finite_as_text(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_non_finite_as_text(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def as_text(table: Table) -> str:
    """The table as plain text that can be printed: the first column is left-aligned, the others are right-aligned."""
    header, rows = table
    widths = [max(len(row[column]) for row in [header, *rows]) for column in range(len(header))]
    return printable(
        "\n".join(
            "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
            for row in [header, *rows]
        )
    )


def as_markdown(blocks: list[Block]) -> str:
    """The report as Markdown."""
    out = []
    for kind, content in blocks:
        match kind:
            case "title":
                out.append(f"# {content}")
            case "heading":
                out.append(f"## {content}")
            case "text":
                out.append(content)
            case "figure":
                out.append(f"![{content[1]}]({content[0]})")
            case "video" | "view":
                out.append(f"[{content[1]}]({content[0]})")
            case "table":
                header, rows = content
                rule = ["---", *["---:"] * (len(header) - 1)]
                out.append("\n".join("| " + " | ".join(row) + " |" for row in [header, rule, *rows]))
    return "\n\n".join(out) + "\n"
