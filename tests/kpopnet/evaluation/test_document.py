"""A report is written whatever its names are, and whole or not at all."""

import io
import json
import sys

import numpy as np
import pytest

from kpopnet.evaluation.document import as_text, printable, write_document
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
    assert sorted(path.name for path in tmp_path.iterdir()) == ["metrics.json", "report.html", "report.md"]


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
