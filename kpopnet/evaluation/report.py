"""One report for all benchmarks: report.html, report.md, tables as CSV and LaTeX, metrics.json, and text for a terminal."""

import base64
import hashlib
import html
import json
import math
import re
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.intervals import FEWEST_UNITS
from kpopnet.evaluation.values import Table
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.runtime.provenance import git_revision

Block = tuple[str, Any]
"""Kind and content of a part of a report: a title, heading or text with its string; a table with its Table; a figure, video or
view (a page in 3D) with the name of its file, relative to the report, and a caption."""

SIMULATED = "No real sensor recorded this depth: these results do not predict the errors on real depth."

MOST_EMBEDDED_BYTES = 20_000_000
"""A larger file is linked instead of contained."""

TYPES = {".png": "image/png", ".mp4": "video/mp4"}

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}</title>
<style>
:root {{ color-scheme: light dark; --back: #fff; --text: #222; --line: #ddd; }}
@media (prefers-color-scheme: dark) {{ :root {{ --back: #17181c; --text: #e8eaee; --line: #3a3e47; }} }}
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: var(--text);
  background: var(--back); overflow-wrap: anywhere; }}
table {{ border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto; overflow-wrap: normal; }}
td, th {{ padding: .25rem .8rem; border-bottom: 1px solid var(--line); text-align: right; }}
td:first-child, th:first-child {{ text-align: left; }}
img, video {{ max-width: 100%; background: #fff; }}
iframe {{ width: 100%; height: 32rem; border: 1px solid var(--line); border-radius: 6px; }}
</style>
{body}
</html>
"""


@dataclass
class Report:
    """What a benchmark says of its estimators.

    Attributes:
        title: of the report.
        remarks: what is needed to interpret the figures; the first names benchmark, origin of the depth and of the truth.
        blocks: the rest.
        printed: the tables that are printed too.
        clock: how the speed was measured.
        metrics: contents of metrics.json, to which `write` adds files, settings, revision and date.
    """

    title: str
    remarks: list[str]
    blocks: list[Block]
    printed: list[Table]
    clock: str
    metrics: dict

    def text(self) -> str:
        """For a terminal."""
        return printable("\n\n".join(["\n".join(self.remarks), *(table.text() for table in self.printed)]) + "\n")


def interval_remarks(units: str, count: int, note: str = "", fewest: int | None = None) -> list[str]:
    """How many units ("sequences", "rooms") were resampled for the intervals, with a note, and when these are too few.

    `fewest` is the number of units of the row that has the fewest, where rows differ.
    """
    if count < 2:
        return [f"No intervals: they would resample {units}, and there is only {count}."]
    lines = [f"Ranges in parentheses: 95 % bootstrap intervals; {count} {units} were resampled{note}."]
    if count < FEWEST_UNITS:
        lines.append(f"The intervals cannot be trusted: {count} {units} are too few to know how much they vary.")
    elif fewest is not None and fewest < FEWEST_UNITS:
        lines.append(f"Intervals of fewer than {FEWEST_UNITS} {units} cannot be trusted; some rows have {fewest}.")
    return lines


def write(report: Report, config: EvaluateConfig, folder: Path) -> None:
    """Writes the report into the folder, which holds its figures, videos and views. Each file appears whole or not at all.

    report.html contains figures, videos and views, but for large ones, so it can be passed on alone. A half of a surrogate
    pair, which stands in the name of a file for a byte that is no UTF-8, becomes a backslash escape.

    Raises:
        ValueError: a metric is NaN or infinite; all but metrics.json is written all the same.
    """
    settings, git = asdict(config), git_revision()
    made = {
        "files": config.files(),
        "config": _non_finite_as_text(settings),
        "config_hash": hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:12],
        "git": git,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    files = (
        f"{name} {' '.join(f'{setting}={file}' for setting, file in paths.items()) or 'no file'}"
        for name, paths in made["files"].items()
    )
    code = f"{git['revision'][:12]}{' with uncommitted changes' if git['dirty'] else ''}" if git else "unknown"
    blocks: list[Block] = [
        ("title", report.title),
        *(("text", line) for line in report.remarks),
        *report.blocks,
        ("heading", "How this report was made"),
        (
            "text",
            f"Files read by the estimators: {', '.join(files) or 'none'}; configuration {made['config_hash']}; code {code}; "
            f"{made['made']}. All metrics: metrics.json. {report.clock}",
        ),
    ]
    _write(folder / "report.md", as_markdown(blocks))
    _write(folder / "report.html", as_html(blocks, folder))
    for name, table in _named_tables(blocks).items():
        (folder / "tables").mkdir(exist_ok=True)
        _write(folder / "tables" / f"{name}.csv", table.csv())
        _write(folder / "tables" / f"{name}.tex", table.latex())
    _write(folder / "metrics.json", json.dumps(report.metrics | made, indent=2, allow_nan=False) + "\n")


def _write(path: Path, text: str) -> None:
    with atomic_path(path) as part:
        part.write_bytes(writable(text).encode())


def writable(text: str, encoding: str = "utf-8") -> str:
    """The text with backslash escapes, which are ASCII, for what cannot be written in an encoding."""
    return text.encode(encoding, "backslashreplace").decode(encoding)


def printable(text: str) -> str:
    """`writable` in the encoding of the terminal."""
    return writable(text, getattr(sys.stdout, "encoding", None) or "ascii")


def _non_finite_as_text(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _non_finite_as_text(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_non_finite_as_text(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _named_tables(blocks: list[Block]) -> dict[str, Table]:
    """The tables by the heading above them, with a number from the second one on."""
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


def as_markdown(blocks: list[Block]) -> str:
    """The blocks as Markdown."""
    marks = {"title": "# ", "heading": "## ", "text": ""}
    out = []
    for kind, content in blocks:
        if kind in marks:
            out.append(marks[kind] + content)
        elif kind == "table":
            out.append(content.markdown())
        else:
            out.append(f"{'!' if kind == 'figure' else ''}[{content[1]}]({content[0]})")
    return "\n\n".join(out) + "\n"


def as_html(blocks: list[Block], folder: Path | None = None) -> str:
    """The blocks, the first of them a title, as a page that contains the files in `folder`, or links them without it."""
    return PAGE.format(title=html.escape(blocks[0][1]), body="\n".join(_element(*block, folder) for block in blocks))


def _element(kind: str, content: Any, folder: Path | None) -> str:
    tags = {"title": "h1", "heading": "h2", "text": "p"}
    if kind in tags:
        return f"<{tags[kind]}>{html.escape(content)}</{tags[kind]}>"
    if kind == "table":
        return content.html()
    name, caption = content[0], html.escape(content[1])
    path = None if folder is None else folder / name
    contained = path is not None and path.is_file() and path.stat().st_size <= MOST_EMBEDDED_BYTES
    if kind == "view":  # in a frame of its own, which runs its program and can reach nothing else
        if not contained:
            return f'<p><a href="{html.escape(name)}">{caption}</a></p>'
        page = html.escape(path.read_text(encoding="utf-8"))
        return f'<p>{caption}</p>\n<iframe sandbox="allow-scripts" loading="lazy" title="{caption}" srcdoc="{page}"></iframe>'
    source = html.escape(name)
    if contained:
        source = f"data:{TYPES[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode()}"
    if kind == "video":
        return f'<p><video src="{source}" controls loop muted playsinline></video><br>{caption}</p>'
    return f'<p><img src="{source}" alt="{caption}"></p>'


def save_plots(folder: Path, plots: dict[str, Figure]) -> None:
    """Writes every plot as NAME.png, for the page, and NAME.svg, for papers."""
    for name, plot in plots.items():
        plot.savefig(folder / f"{name}.png", dpi=110)
        plot.savefig(folder / f"{name}.svg")


def save_video(path: Path, images: Iterable[np.ndarray], fps: float) -> bool:
    """Writes RGB images of one size, with even width and height, as VP9 in MP4, which browsers can play.

    Returns:
        Whether this build of OpenCV could write the video and read it again. Otherwise no file is left at the path.
    """
    writer, count = None, 0
    for image in images:
        if writer is None:
            height, width = image.shape[:2]
            writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*"vp09"), fps, (width, height))
            if not writer.isOpened():
                break
        writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        count += 1
    if writer is not None:
        writer.release()
    reader = cv2.VideoCapture(str(path))
    readable = count > 0 and reader.read()[0]
    reader.release()
    if not readable:
        path.unlink(missing_ok=True)
    return readable
