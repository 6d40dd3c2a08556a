"""A report is written whatever its names are, and whole or not at all."""

import base64
import csv
import io
import json
import sys

import numpy as np
import pytest

from kpopnet.evaluation.document import as_text, printable, write_document
from kpopnet.evaluation.page import as_html
from kpopnet.evaluation.table_files import named_tables, write_tables
from kpopnet.viz.drawing import with_captions

NAME = "a\udcffb"
BLOCKS = [
    ("title", f"Report of {NAME}"), ("heading", NAME), ("text", NAME), ("figure", (f"{NAME}.png", NAME)),
    ("video", ("v.mp4", NAME)), ("table", (["name", "cm"], [[NAME, "1.0"]])),
]  # fmt: skip


def test_half_of_a_surrogate_pair_in_a_name_loses_no_report(tmp_path):
    write_document(tmp_path, BLOCKS, {"config": {"path": NAME, "lr": float("inf")}, "names": {NAME: 1}})
    for name in ("report.md", "report.html"):
        assert "a\\udcffb" in (tmp_path / name).read_text(encoding="utf-8")
    assert json.loads((tmp_path / "metrics.json").read_text())["names"] == {NAME: 1}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["metrics.json", "report.html", "report.md", "tables"]


def test_a_page_contains_its_files_and_links_what_is_missing(tmp_path):
    (tmp_path / "a.png").write_bytes(b"picture")
    (tmp_path / "v.html").write_text('<!doctype html><p title="quoted">view</p>')
    blocks = [("title", "t"), ("figure", ("a.png", "A")), ("figure", ("b.png", "B")), ("view", ("v.html", 'the "view"'))]
    page = as_html(blocks, tmp_path)
    assert f'src="data:image/png;base64,{base64.b64encode(b"picture").decode()}"' in page and 'src="b.png"' in page
    assert 'srcdoc="&lt;!doctype html&gt;&lt;p title=&quot;quoted&quot;&gt;view&lt;/p&gt;"' in page
    assert 'sandbox="allow-scripts"' in page and "allow-same-origin" not in page
    assert 'href="v.html"' in as_html(blocks) and 'src="a.png"' in as_html(blocks)


def test_a_large_file_is_linked(tmp_path, monkeypatch):
    monkeypatch.setattr("kpopnet.evaluation.page.MOST_EMBEDDED_BYTES", 3)
    (tmp_path / "v.mp4").write_bytes(b"film")
    assert 'src="v.mp4"' in as_html([("title", "t"), ("video", ("v.mp4", "V"))], tmp_path)


def test_tables_become_files_for_spreadsheets_and_papers(tmp_path):
    first, second, third = ((["name", "cm"], [[cell, "1,0"]]) for cell in ("50 % & more", "b_c", "d"))
    blocks = [("title", "t"), ("table", first), ("heading", "Errors / joints"), ("table", second), ("table", third)]
    write_tables(tmp_path / "tables", blocks)
    names = ["errors_joints", "errors_joints_2", "summary"]
    assert sorted(path.stem for path in (tmp_path / "tables").glob("*.csv")) == names
    assert sorted(path.stem for path in (tmp_path / "tables").glob("*.tex")) == names
    both = [("heading", "x 2"), ("table", first), ("heading", "x"), ("table", second), ("table", third)]
    assert list(named_tables(both).values()) == [first, second, third]
    with (tmp_path / "tables" / "summary.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [["name", "cm"], ["50 % & more", "1,0"]]
    latex = (tmp_path / "tables" / "summary.tex").read_text()
    assert latex.startswith("\\begin{tabular}{lr}\n\\toprule\nname & cm \\\\\n") and r"50 \% \& more & 1,0 \\" in latex
    assert r"b\_c" in (tmp_path / "tables" / "errors_joints.tex").read_text()


def test_other_characters_are_written_as_they_are(tmp_path):
    write_document(tmp_path, [("title", "\u00e9\uc548")], {"config": {}})
    assert (tmp_path / "report.md").read_bytes() == "# \u00e9\uc548\n".encode()


def test_a_report_survives_metrics_that_json_has_no_number_for(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_document(tmp_path, [("title", "t")], {"config": {}, "error": float("nan")})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "report.md"]


def test_an_old_report_is_kept_until_the_new_one_is_whole(tmp_path, monkeypatch):
    write_document(tmp_path, [("title", "old")], {"config": {}})
    monkeypatch.setattr("os.fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(OSError, match="No space"):
        write_document(tmp_path, [("title", "new")], {"config": {}})
    assert "old" in (tmp_path / "report.md").read_text()
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_tables_can_be_printed_in_every_terminal(monkeypatch, encoding):
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding=encoding))
    print(as_text((["name", "cm"], [[f"{NAME} \uc548", "1.0"]])), printable("\u00e9"))
    sys.stdout.flush()


def test_captions_of_images_may_hold_any_text():
    assert with_captions(np.zeros((60, 90, 3), np.uint8), (NAME,)).any()
