"""One report for all benchmarks: report.html, report.md, tables as CSV and LaTeX, metrics.json, and text for a terminal."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.intervals import FEWEST_UNITS
from kpopnet.evaluation.values import Table
from kpopnet.runtime.atomic_write import atomic_path, remove_unfinished, write_json, write_whole
from kpopnet.runtime.provenance import git_revision
from kpopnet.viz.view_page import Shown, cloud_frames, sampled_cloud, view_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # slow to import, and only some reports have plots


class Heading(str):
    """A block that begins a section."""


class Picture(NamedTuple):
    """A block: a figure or, in a file .html, a view in 3D."""

    file: str  # its name, relative to the report
    caption: str


Block = str | Table | Picture
"""A part of a report; a plain string is a paragraph, or the title if it is the first of a page."""

SIMULATED = "No real sensor recorded this depth: these results do not predict the errors on real depth."

MOST_EMBEDDED_BYTES = 20_000_000
"""A larger file is linked instead of contained."""

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
img {{ max-width: 100%; background: #fff; }}
iframe {{ width: 100%; height: 32rem; border: 1px solid var(--line); border-radius: 6px; }}
</style>
{body}
</html>
"""


@dataclass
class Report:
    """What a benchmark says of its estimators."""

    title: str
    remarks: list[str]  # needed to interpret the figures; the first names the benchmark and the origin of depth and truth
    blocks: list[Block]  # the rest
    printed: list[Table]  # those that are printed too
    clock: str  # how the speed was measured
    metrics: dict  # contents of metrics.json, to which `write` adds files, settings, revision and date

    def text(self) -> str:
        """For a terminal."""
        return as_text(["\n".join(self.remarks), *self.printed]) + "\n"


def future_remark(later: Sequence[str]) -> list[str]:
    """The sentence on the estimators whose joints depend on later images, if there are any."""
    return [f"{', '.join(later)}: uses images after the one it answers for; the other estimators do not."] if later else []


def interval_remarks(units: str, number: int, note: str = "") -> list[str]:
    """How many units ("sequences", "rooms") were resampled for the intervals, with a note, and when there is none."""
    if number < FEWEST_UNITS:
        return [f"No intervals: they would resample {units}, and {number} are too few to know how much they vary."]
    return [
        f"Ranges in parentheses: 95 % bootstrap intervals; {number} {units} were resampled{note}.",
        f"A figure to which fewer than {FEWEST_UNITS} {units} contribute has no interval, nor one that is equal in all.",
    ]


def made_by() -> dict:
    """The code that makes a file of figures, and when."""
    return {"git": git_revision(), "made": datetime.now(UTC).isoformat(timespec="seconds")}


def write(report: Report, config: EvaluateConfig, folder: Path) -> None:
    """Writes the report into the folder, which holds its figures and views. Each file appears whole or not at all.

    report.html contains figures and views, but for large ones, so it can be passed on alone. A half of a surrogate pair, which
    stands in the name of a file for a byte that is no UTF-8, becomes a backslash escape. Raises ValueError if a metric is NaN
    or infinite; all but metrics.json is written all the same.
    """
    settings = asdict(config)
    made = {
        "files": config.files(),
        "config": json.loads(json.dumps(settings), parse_constant=lambda name: str(float(name))),  # "inf": JSON has no number
        "config_hash": hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:12],
        **made_by(),
    }
    git = made["git"]
    files = (
        f"{name} {' '.join(f'{setting}={file}' for setting, file in paths.items()) or 'no file'}"
        for name, paths in made["files"].items()
    )
    code = f"{git['revision'][:12]}{' with uncommitted changes' if git['dirty'] else ''}" if git else "unknown"
    how = (
        f"Files read by the estimators: {', '.join(files) or 'none'}; configuration {made['config_hash']}; code {code}; "
        f"{made['made']}. All metrics: metrics.json. {report.clock}"
    )
    blocks = [report.title, *report.remarks, *report.blocks, Heading("How this report was made"), how]
    for place in (folder, folder / "tables"):
        remove_unfinished(place, ".*.[0-9]*-[0-9]*.tmp")  # of this report's evaluations, which were killed
    write_text(folder / "report.md", as_markdown(blocks))
    write_text(folder / "report.html", as_html(blocks, folder))
    for name, table in _named_tables(blocks).items():
        (folder / "tables").mkdir(exist_ok=True)
        write_text(folder / "tables" / f"{name}.csv", table.csv())
        write_text(folder / "tables" / f"{name}.tex", table.latex())
    write_json(folder / "metrics.json", report.metrics | made, allow_nan=False)


def write_text(path: Path, text: str) -> None:
    """Writes UTF-8 with backslash escapes for half surrogate pairs; the file appears whole or not at all."""
    write_whole(path, text.encode(errors="backslashreplace"))


def _named_tables(blocks: list[Block]) -> dict[str, Table]:
    """The tables by the heading above them, with a number from the second one on."""
    name, tables = "summary", {}
    for block in blocks:
        if isinstance(block, Heading):
            name = re.sub(r"[^a-z0-9]+", "_", block.lower()).strip("_")[:60] or "table"
        elif isinstance(block, Table):
            numbered = (name if number == 1 else f"{name}_{number}" for number in count(1))
            tables[next(one for one in numbered if one not in tables)] = block
    return tables


def as_text(blocks: Iterable[str | Table]) -> str:
    """Texts and tables for a terminal."""
    return "\n\n".join(block.text() if isinstance(block, Table) else block for block in blocks)


def as_markdown(blocks: Sequence[Block]) -> str:
    def element(block: Block) -> str:
        if isinstance(block, str):
            return f"## {block}" if isinstance(block, Heading) else block
        if isinstance(block, Table):
            return block.markdown()
        return f"{'' if block.file.endswith('.html') else '!'}[{block.caption}]({block.file})"

    return "# " + "\n\n".join(map(element, blocks)) + "\n"


def as_html(blocks: Sequence[Block], folder: Path | None = None) -> str:
    """A page that contains the files in `folder`, or links them without it."""
    title, body = html.escape(str(blocks[0])), "\n".join(_element(block, folder) for block in blocks[1:])
    return PAGE.format(title=title, body=f"<h1>{title}</h1>\n{body}")


def _element(block: Block, folder: Path | None) -> str:
    if isinstance(block, str):
        tag = "h2" if isinstance(block, Heading) else "p"
        return f"<{tag}>{html.escape(block)}</{tag}>"
    if isinstance(block, Table):
        return block.html()
    name, caption = map(html.escape, block)
    path = None if folder is None else folder / block.file
    content = path.read_bytes() if path and path.is_file() and path.stat().st_size <= MOST_EMBEDDED_BYTES else None
    if not block.file.endswith(".html"):
        source = name if content is None else f"data:image/png;base64,{base64.b64encode(content).decode()}"
        return f'<p><img src="{source}" alt="{caption}"></p>'
    if content is None:
        return f'<p><a href="{name}">{caption}</a></p>'
    page = html.escape(content.decode())  # in a frame of its own, whose program reaches nothing else
    return f'<p>{caption}</p>\n<iframe sandbox="allow-scripts" loading="lazy" title="{caption}" srcdoc="{page}"></iframe>'


def save_plots(folder: Path, plots: dict[str, "Figure"]) -> None:
    """Writes every plot as NAME.png, for the page, and NAME.svg, for papers."""
    for name, plot in plots.items():
        for kind, settings in (("png", {"dpi": 110}), ("svg", {})):
            with atomic_path(folder / f"{name}.{kind}") as part:
                plot.savefig(part, format=kind, **settings)


def save_view(
    path: Path, title: str, camera: Camera, fps: float | None, depth: np.ndarray, people: list[Shown], pages: int = 1
) -> None:
    """Writes a page that shows a sequence in 3D: people over the (T, H, W) depth, metres or uint16 millimetres, as points.

    True people are references: drawn thin, with dense points around them. Stills, of 0 `fps`, and frames of an unknown rate
    are shown a second each. `pages` share the points that one page may hold.
    """
    shown, true = cloud_frames(len(depth)), [one.joints_camera_m for one in people if one.reference]
    clouds = [
        sampled_cloud(frame, depth_in_metres(depth[frame]), camera, [one[frame] for one in true], pages * len(shown))
        for frame in shown
    ]
    write_text(path, view_page(title, camera, np.arange(len(depth)) / (fps or 1.0), people, clouds))
