"""A report is written whatever its names are, and each file whole or not at all."""

import base64
import json
import math
from dataclasses import dataclass

import pytest

from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.report import Heading, Picture, Report, as_html, write
from kpopnet.evaluation.values import Table, Value

NAME = "a\udcffb"
TABLE = Table(["name", "error"], [[NAME, Value(1.0, "cm")]])
BLOCKS = [NAME, Picture(f"{NAME}.png", NAME), TABLE]
CONFIG = EvaluateConfig({"limit": math.inf}, {})


def report(title: str = "Report", blocks: list = BLOCKS, metrics: dict | None = None) -> Report:
    return Report(title, ["SIMULATED"], blocks, [TABLE], "By a clock.", {"names": {NAME: 1}} if metrics is None else metrics)


def test_half_of_a_surrogate_pair_in_a_name_loses_no_report(tmp_path):
    write(report(NAME), CONFIG, tmp_path)
    for name in ("report.md", "report.html"):
        assert "a\\udcffb" in (tmp_path / name).read_text(encoding="utf-8")
    found = json.loads((tmp_path / "metrics.json").read_text())
    assert found["names"] == {NAME: 1} and found["config"]["benchmark"] == {"limit": "inf"} and len(found["config_hash"]) == 12
    assert sorted(path.name for path in tmp_path.iterdir()) == ["metrics.json", "report.html", "report.md", "tables"]


def test_a_page_contains_its_files_and_links_what_is_missing_or_large(tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(b"picture")
    (tmp_path / "v.html").write_text('<!doctype html><p title="quoted">view</p>')
    blocks = ["t", Picture("a.png", "A"), Picture("b.png", "B"), Picture("v.html", 'the "view"')]
    page = as_html(blocks, tmp_path)
    assert f'src="data:image/png;base64,{base64.b64encode(b"picture").decode()}"' in page and 'src="b.png"' in page
    assert 'srcdoc="&lt;!doctype html&gt;&lt;p title=&quot;quoted&quot;&gt;view&lt;/p&gt;"' in page
    assert 'sandbox="allow-scripts"' in page and "allow-same-origin" not in page
    monkeypatch.setattr("kpopnet.evaluation.report.MOST_EMBEDDED_BYTES", 3)
    for large in (as_html(blocks), as_html(blocks, tmp_path)):
        assert 'href="v.html"' in large and 'src="a.png"' in large


def test_tables_become_files_named_by_the_heading_above(tmp_path):
    tables = [Table(["name", "cm"], [[name, 1]]) for name in "abcd"]
    headed = [Heading("Errors / joints"), *tables[1:3], Heading("errors joints 2"), tables[3]]
    write(report(blocks=[tables[0], *headed]), CONFIG, tmp_path)
    found = {path.stem: path.read_text().splitlines()[1] for path in (tmp_path / "tables").glob("*.csv")}
    assert found == {"summary": "a,1", "errors_joints": "b,1", "errors_joints_2": "c,1", "errors_joints_2_2": "d,1"}
    assert {path.stem for path in (tmp_path / "tables").glob("*.tex")} == found.keys()


def test_old_figures_are_kept_until_the_new_ones_are_whole(tmp_path):
    (tmp_path / ".left.png.host.1-0.tmp").touch()  # of an evaluation that was killed
    (tmp_path / ".notes.tmp").touch()  # of another program
    write(report("old"), CONFIG, tmp_path)
    with pytest.raises(ValueError, match="JSON"):  # which has no number for it
        write(report("other", metrics={"error": math.inf}), CONFIG, tmp_path)
    assert "names" in json.loads((tmp_path / "metrics.json").read_text()) and len(list(tmp_path.iterdir())) == 5
    assert [path.name for path in tmp_path.glob(".*")] == [".notes.tmp"]


@dataclass
class Reads:
    checkpoint: str | None = None
    network: str | None = None
    model: str | None = None


def test_a_report_lists_the_files_of_each_estimator(tmp_path):
    settings = {"ridge": Reads("runs/ridge/best"), "tracker": Reads(None, "runs/best", "me.json"), "plain": Reads()}
    write(report(), EvaluateConfig({}, settings, checkpoint="of/none"), tmp_path)
    files = {"ridge": {"checkpoint": "runs/ridge/best"}, "tracker": {"network": "runs/best", "model": "me.json"}, "plain": {}}
    assert json.loads((tmp_path / "metrics.json").read_text())["files"] == files
    sentence = "estimators: ridge checkpoint=runs/ridge/best, tracker network=runs/best model=me.json, plain no file; config"
    assert sentence in (tmp_path / "report.md").read_text()
