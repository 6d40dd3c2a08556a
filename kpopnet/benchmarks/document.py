"""A report as a list of blocks, written as Markdown and as HTML beside all its figures; and a table for the terminal."""

import html
import json
import math
from pathlib import Path
from typing import Any

Table = tuple[list[str], list[list[str]]]
"""A header and rows of as many cells."""

Block = tuple[str, Any]
"""Its kind and content: title, heading and text a string; picture and video a file's name, beside the report, and what it
shows; table a Table.
"""


def write_document(folder: Path, blocks: list[Block], described: dict) -> None:
    """Writes report.md, report.html and metrics.json into the folder.

    Args:
        folder: where; pictures and videos lie there already.
        blocks: of the report, with a title.
        described: what metrics.json is to hold.

    Raises:
        ValueError: see `as_json`.
    """
    (folder / "metrics.json").write_text(as_json(described))
    (folder / "report.md").write_text(as_markdown(blocks))
    (folder / "report.html").write_text(as_html(blocks, next(content for kind, content in blocks if kind == "title")))


def files_in_words(files: dict[str, dict[str, str]]) -> str:
    """Of `EvaluateConfig.files` what each estimator read."""
    named = (
        f"{estimator} {' '.join(f'{setting}={file}' for setting, file in read.items()) or 'no file'}"
        for estimator, read in files.items()
    )
    return f"Read by estimators: {', '.join(named) or 'nothing'}"


def revision_in_words(git: dict | None) -> str:
    """What `kpopnet.checkpoint.git_revision` found."""
    return f"{git['revision'][:12]}{' with changes' if git['dirty'] else ''}" if git else "unknown"


def as_json(described: dict) -> str:
    """What metrics.json holds. Settings may be infinite, for which JSON has no word: they stand there in words.

    Raises:
        ValueError: a figure that is no number, or an infinite one.
    """
    return json.dumps(described | {"config": _finite(described["config"])}, indent=2, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def as_text(table: Table) -> str:
    """The table in columns, the first flush left, the others right."""
    header, rows = table
    widths = [max(len(row[column]) for row in [header, *rows]) for column in range(len(header))]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in [header, *rows]
    )


def as_markdown(blocks: list[Block]) -> str:
    out = []
    for kind, content in blocks:
        match kind:
            case "title":
                out.append(f"# {content}")
            case "heading":
                out.append(f"## {content}")
            case "text":
                out.append(content)
            case "picture":
                out.append(f"![{content[1]}]({content[0]})")
            case "video":
                out.append(f"[{content[1]}]({content[0]})")
            case "table":
                header, rows = content
                rule = ["---", *["---:"] * (len(header) - 1)]
                out.append("\n".join("| " + " | ".join(row) + " |" for row in [header, rule, *rows]))
    return "\n\n".join(out) + "\n"


PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: #222; }}
table {{ border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto; }}
td, th {{ padding: .25rem .8rem; border-bottom: 1px solid #ddd; text-align: right; }}
td:first-child, th:first-child {{ text-align: left; }}
img, video {{ max-width: 100%; }}
</style>
{body}
</html>
"""


def as_html(blocks: list[Block], title: str) -> str:
    out = []
    for kind, content in blocks:
        match kind:
            case "title":
                out.append(f"<h1>{html.escape(content)}</h1>")
            case "heading":
                out.append(f"<h2>{html.escape(content)}</h2>")
            case "text":
                out.append(f"<p>{html.escape(content)}</p>")
            case "picture":
                out.append(f'<p><img src="{html.escape(content[0])}" alt="{html.escape(content[1])}"></p>')
            case "video":
                source, shown = (html.escape(text) for text in content)
                out.append(f'<p><video src="{source}" controls loop muted></video><br>{shown}</p>')
            case "table":
                header, rows = content
                lines = ["".join(f"<th>{html.escape(cell)}</th>" for cell in header)]
                lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
                out.append("<table>\n" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "\n</table>")
    return PAGE.format(title=html.escape(title), body="\n".join(out))
