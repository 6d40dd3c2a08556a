"""The report of an evaluation of joints: tables, plots, pictures and metrics.json."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from films import Films, Off

from kpopnet.datasets.protocol import Origin
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.poses.figures import confidence_figure, joint_bars, sequence_bars
from kpopnet.evaluation.poses.report import pose_metrics, pose_report
from kpopnet.evaluation.poses.run import PoseRun, run_benchmark
from kpopnet.evaluation.poses.sweep import Sweep, sweep_of
from kpopnet.evaluation.poses.tables import published_on, published_table
from kpopnet.evaluation.report import write
from kpopnet.paper_tracker.tracker import PaperTrackerConfig
from kpopnet.skeleton import JOINT_NAMES


@pytest.fixture(scope="module")
def films() -> PoseRun:
    return run_benchmark(Films(), {"near": Off(0.5), "far": Off(1.0)})


def written(run: PoseRun, folder: Path, sweep: Sweep | None = None) -> tuple[dict, str]:
    """metrics.json and what is printed, after the report was written."""
    report = pose_report(run, folder, 0, sweep)
    write(report, EvaluateConfig({"name": "set"}, {}), folder)
    return json.loads((folder / "metrics.json").read_text()), report.text()


def test_the_report_holds_the_errors_their_differences_and_all_its_files(films, tmp_path):
    found, printed = written(films, tmp_path / "report")
    assert found["images"] == 105 and found["estimator"] == "near" and list(found["estimators"]) == ["near", "far"]
    # 2, 12 and 6 cm, and half of it; sequence two leaves the 10 cm.
    assert found["mean_error_cm"] == pytest.approx(np.mean([1, 6, 3]), abs=0.05) and found["map_10cm"] == 1
    far = found["differences"]["estimators"]["far"]
    assert far["mean_error_cm"]["value"] == pytest.approx(np.mean([1, 6, 3]), abs=0.05)
    assert far["within_10cm_points"]["value"] == pytest.approx(-100 / 3)
    assert found["benchmark"]["depth"] == "simulated" and found["benchmark"]["against"] == "made-up joints"
    assert found["benchmark"]["resampled"] == {"units": "sequences", "count": 3, "people": None}
    assert set(found["interval"].values()) == {None}  # three are too few
    assert set(found["per_joint"]) == set(JOINT_NAMES) and list(found["per_sequence"]) == ["one", "two", "three"]
    assert found["fps"] > 0 and "git" in found and found["config"]["benchmark"] == {"name": "set"}
    assert all((tmp_path / "report" / name).stat().st_size > 1000 for name in found["pictures"])
    page, text = (tmp_path / "report" / "report.html").read_text(), (tmp_path / "report" / "report.md").read_text()
    for report in (page, text, printed):
        assert "films: SIMULATED depth, compared with made-up joints; 105 images in 3 sequences." in report
        assert "difference from near" in report and "-33.33 points" in report
    links = re.findall(r"\[[^]]*\]\(([^)]*)\)", text)
    assert links and all((tmp_path / "report" / link).is_file() for link in links)
    assert page.count("data:image/png;base64,") == len(found["pictures"]) and page.count("<iframe sandbox=") == 3


def test_the_confidence_of_joints_that_are_all_sure_and_right_is_drawn_whole(films):
    panel = confidence_figure(films).axes[0]
    drawn = [*panel.collections, *panel.lines[1:]]
    assert len(drawn) == 4 and not any(one.get_clip_on() for one in drawn)


@pytest.mark.parametrize(
    ("name", "origin", "lines"),
    [
        ("eval", Origin.REAL, ["Kim & Kim 2018, tracker, 93.58", "CNN, depth, 95.66", "depth + ridge, 96.67"]),
        ("smmc10", Origin.REAL, ["Kim & Kim 2018, tracker, 3.88", "Kim & Kim 2015, 96.71"]),
        ("eval", Origin.SIMULATED, []),
    ],
)
def test_published_results_are_shown_on_real_sets_only(name, origin, lines):
    run = run_benchmark(Films(name, origin), {"off": Off()}, sequences=2)
    panels = [*joint_bars(run).axes, *sequence_bars(run, ["one", "three"]).axes]
    labels = [text.get_text() for panel in panels for text in panel.get_legend().get_texts()]
    found = [label for label in labels if "published" in label]
    assert all(any(line in label for label in found) for line in lines) and bool(found) == bool(lines)
    table = published_table(run.metrics, published_on(run.benchmark))
    assert len(table.rows) == len(lines) + 1
    assert table.cells()[-1][:2] == ["here: off", f"{100 * run.metrics['off']['map_14']:.1f} %"]
    assert {pose_metrics(run)["benchmark"][key] for key in ("seed", "version", "config_hash")} == {None}


def test_a_sweep_has_a_table_and_metrics_and_is_in_no_other_table(tmp_path, monkeypatch):
    sweep = sweep_of({"epsilon_m": [0.05, 0.06], "r_m": [0.1, 0.11, 0.12]}, {"tracker": PaperTrackerConfig()})
    factors = np.arange(1, 7).reshape(2, 3) / 3
    estimators = {name: Off(factors[r, c]) for r, names in enumerate(sweep.names) for c, name in enumerate(names)}
    run = run_benchmark(Films(), {"tracker": estimators["tracker"]} | estimators)
    table = sweep.table(run.metrics)
    assert table.header[1:] == [f"{value}: {what}" for value in (0.1, 0.11, 0.12) for what in ("mAP", "fps")]
    cells = table.cells()[1:]
    assert [row[0] for row in cells] == ["0.05", "0.06"]
    # Factor 1/3: all sequences are within 10 cm. Factor 1: all but the one with 12 cm. Factor 2: one sequence only.
    assert (cells[0][1], cells[0][5], cells[1][5]) == ("1.000", "0.667", "0.333")
    monkeypatch.setattr("kpopnet.evaluation.poses.report.save_plots", lambda *_: None)
    found, printed = written(run, tmp_path, sweep)
    assert list(found["estimators"]) == ["tracker"] and found["estimator"] == "tracker"
    assert np.shape(found["sweep"]["map_10cm"]) == np.shape(found["sweep"]["fps"]) == (2, 3)
    assert found["sweep"]["map_10cm"][0][1] == found["map_10cm"]
    assert found["sweep"]["columns"] == {"setting": "r_m", "values": [0.1, 0.11, 0.12]}
    assert "Table 1" in (tmp_path / "report.md").read_text()
    assert "0.06  " in printed and "r_m=0.12" not in printed
