"""A report as one HTML page that contains its figures, videos and views in 3D."""

import base64
import html
from pathlib import Path

from kpopnet.evaluation.blocks import Block

MOST_EMBEDDED_BYTES = 20_000_000
"""A larger file is linked instead of contained."""

TYPES = {".png": "image/png", ".svg": "image/svg+xml", ".mp4": "video/mp4", ".gif": "image/gif"}

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


def as_html(blocks: list[Block], folder: Path | None = None) -> str:
    """The report as an HTML page.

    Args:
        blocks: contents of the report, with a title.
        folder: that holds the files of figures, videos and views, which the page then contains; without it their names are the
            sources as they are.
    """
    title = next(content for kind, content in blocks if kind == "title")
    return PAGE.format(title=html.escape(title), body="\n".join(_element(*block, folder) for block in blocks))


def _element(kind: str, content, folder: Path | None) -> str:
    match kind:
        case "title":
            return f"<h1>{html.escape(content)}</h1>"
        case "heading":
            return f"<h2>{html.escape(content)}</h2>"
        case "text":
            return f"<p>{html.escape(content)}</p>"
        case "figure":
            return f'<p><img src="{_source(content[0], folder)}" alt="{html.escape(content[1])}"></p>'
        case "video":
            source, caption = _source(content[0], folder), html.escape(content[1])
            return f'<p><video src="{source}" controls loop muted playsinline></video><br>{caption}</p>'
        case "view":
            return _view(*content, folder)
        case "table":
            header, rows = content
            lines = ["".join(f"<th>{html.escape(cell)}</th>" for cell in header)]
            lines += ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows]
            return "<table>\n" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "\n</table>"
    raise ValueError(f"unknown kind of block: {kind}")


def _view(name: str, caption: str, folder: Path | None) -> str:
    """A page in 3D in a frame of its own, which runs its program and can reach nothing else."""
    shown = html.escape(caption)
    if folder is None or (folder / name).stat().st_size > MOST_EMBEDDED_BYTES:
        return f'<p><a href="{html.escape(name)}">{shown}</a></p>'
    page = html.escape((folder / name).read_text(encoding="utf-8"))
    return f'<p>{shown}</p>\n<iframe sandbox="allow-scripts" loading="lazy" title="{shown}" srcdoc="{page}"></iframe>'


def _source(name: str, folder: Path | None) -> str:
    """The source of an image or video: its file's content where the folder is given, else the name."""
    path = None if folder is None else folder / name
    if path is None or not path.is_file() or path.stat().st_size > MOST_EMBEDDED_BYTES:
        return html.escape(name)
    return f"data:{TYPES[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode()}"
