"""The report of an evaluation of joints: tables, plots, pictures and metrics.json."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from films import Films, Off
from shard_sets import write_shard

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.data.cube import person_centre
from kpopnet.datasets.protocol import BenchmarkConfig, Origin
from kpopnet.datasets.synthetic import SyntheticBenchmark
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.poses.figures import joint_bars, sequence_bars
from kpopnet.evaluation.poses.report import pose_metrics, pose_report, remarks
from kpopnet.evaluation.poses.run import PoseRun, run_benchmark
from kpopnet.evaluation.poses.sweep import Sweep, sweep_of
from kpopnet.evaluation.poses.tables import by_part, difference_table, published_on, published_table
from kpopnet.evaluation.report import write
from kpopnet.paper_tracker.tracker import PaperTrackerConfig
from kpopnet.skeleton import JOINT_NAMES


class Shifted:
    """Estimates a fixed pose at the centre of the silhouette; frame k is displaced by k times a known distance."""

    name = "shifted"

    def __init__(self, pose_m: np.ndarray, step_m: float) -> None:
        self.pose_m, self.step_m = pose_m, step_m

    def estimate(self, depth_m, camera):
        joints = np.full((len(depth_m), 15, 3), np.nan, np.float32)
        for k, image in enumerate(depth_m):
            if image.any():
                joints[k] = self.pose_m + person_centre(image, camera) + [0, 0, self.step_m * k]
        return Estimate(joints, np.isfinite(joints).all(-1).astype(np.float32))


@pytest.fixture(scope="module")
def stills(tmp_path_factory) -> PoseRun:
    """Errors of 0, 6, 12 cm in the first and last sequence; 0 cm and one frame without a person in the middle one."""
    folder = tmp_path_factory.mktemp("stills")
    write_shard(folder, [1, 1, 1, 2, 2, 3, 3, 3], empty=(4,), rooms=[0, 0, 0, 1, 1, 2, 2, 2])
    benchmark = SyntheticBenchmark(BenchmarkConfig("synthetic", str(folder)))
    sequence = benchmark.read(benchmark.sequence_names()[0])
    pose_m = sequence.joints_camera_m[0] - person_centre(sequence.depth_m[0], sequence.camera)
    return run_benchmark(benchmark, {"shifted": Shifted(pose_m, 0.06), "mean_pose": MeanPoseEstimator(pose_m)})


@pytest.fixture(scope="module")
def films() -> PoseRun:
    return run_benchmark(Films(), {"near": Off(0.5), "far": Off(1.0)})


def written(run: PoseRun, folder: Path, sweep: Sweep | None = None) -> tuple[dict, str]:
    """metrics.json and what is printed, after the report was written."""
    report = pose_report(run, folder, 0, sweep)
    write(report, EvaluateConfig({"name": "set"}, {}), folder)
    return json.loads((folder / "metrics.json").read_text()), report.text()


def test_metrics_json_describes_the_benchmark_and_holds_the_errors(stills, tmp_path):
    found, printed = written(stills, tmp_path / "report")
    assert found["images"] == 8 and found["estimator"] == "shifted"
    assert found["mean_error_cm"] == pytest.approx((2 * (0 + 6 + 12) + 0) / 7, abs=0.1)
    assert found["map_10cm"] == pytest.approx(5 / 8)
    assert found["missing"] == {"joints": 15, "of_labelled_joints": 120, "images_without_estimate": 1}
    assert found["estimators"]["shifted"]["mean_error_cm"] == found["mean_error_cm"]
    assert found["estimators"]["mean_pose"]["mean_error_cm"] == found["mean_pose_error_cm"] == pytest.approx(0, abs=0.1)
    assert found["benchmark"]["depth"] == "simulated" and found["benchmark"]["against"] == "synthetic truth"
    assert found["benchmark"]["images_without_person"] == 1
    assert found["benchmark"]["resampled"] == {"units": "rooms", "count": 3, "people": 3}
    assert set(found["per_joint"]) == set(JOINT_NAMES) and len(found["per_sequence"]) == 3 and found["by_yaw"]
    assert found["fps"] > 0 and "git" in found and found["config"]["benchmark"] == {"name": "set"}
    assert all((tmp_path / "report" / name).stat().st_size > 1000 for name in found["pictures"])
    assert set(found["interval"].values()) == {None} and len(found["per_person"]) == 3  # three rooms are too few
    page, text = (tmp_path / "report" / "report.html").read_text(), (tmp_path / "report" / "report.md").read_text()
    for report in (page, text, printed):
        assert "synthetic: SIMULATED depth, compared with synthetic truth; 8 images in 3 sequences." in report
    links = re.findall(r"\[[^]]*\]\(([^)]*)\)", text)
    assert len(links) == 8 and all((tmp_path / "report" / link).is_file() for link in links)
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == 5 and all(source.startswith("data:image/png;base64,") for source in sources)
    assert page.count("<iframe sandbox=") == 3


def test_partial_evaluations_and_failed_sequences_are_named(tmp_path):
    films = Films()
    films.damaged = {"three": InputError("damaged.mat: not <whole>")}
    found, printed = written(run_benchmark(films, {"off": Off()}, sequences=2), tmp_path)
    assert found["benchmark"]["failed_sequences"] == {"three": "damaged.mat: not <whole>"}
    assert "2 of 3 sequences, evenly spaced" in printed and "three: damaged.mat: not <whole>" in printed
    assert "three: damaged.mat: not &lt;whole&gt;" in (tmp_path / "report.html").read_text()


def test_table_and_bars_show_mean_and_standard_deviation_of_each_sequence(films):
    table = by_part("per_sequence", films.metrics, ["two", "one"])
    assert table.header == ["sequence", "images", "near, Eq. 16", "near, within 10 cm", "far, Eq. 16", "far, within 10 cm"]
    # Without the unlabelled frame 5, 17 frames have an error 1 cm larger and 18 frames 1 cm smaller.
    expected = [f"{mean - 1 / 35:.2f} ± {np.sqrt(1 - (1 / 35) ** 2):.2f} cm" for mean in (6, 12)]
    assert table.cells()[1] == ["two", "35", expected[0], "100.0 %", expected[1], "0.0 %"]
    figure = sequence_bars(films, ["one", "two", "three"])
    assert [tick.get_text() for tick in figure.axes[0].get_xticklabels()] == ["one", "two", "three"]
    drawn = {container.get_label(): container.lines[0].get_ydata() for container in figure.axes[0].containers}
    assert drawn["far"] == pytest.approx([2 - 1 / 35, 12 - 1 / 35, 6 - 1 / 35], abs=1e-4)
    assert drawn["near"] == pytest.approx([1 - 1 / 35, 6 - 1 / 35, 3 - 1 / 35], abs=1e-4)


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


def test_a_sweep_has_a_table_and_metrics_and_is_in_no_other_table(tmp_path):
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
    found, printed = written(run, tmp_path, sweep)
    assert list(found["estimators"]) == ["tracker"] and found["estimator"] == "tracker"
    assert np.shape(found["sweep"]["map_10cm"]) == np.shape(found["sweep"]["fps"]) == (2, 3)
    assert found["sweep"]["map_10cm"][0][1] == found["map_10cm"]
    assert found["sweep"]["columns"] == {"setting": "r_m", "values": [0.1, 0.11, 0.12]}
    assert "Table 1" in (tmp_path / "report.md").read_text()
    assert "0.06  " in printed and "r_m=0.12" not in printed


def test_differences_from_the_first_estimator_are_in_every_report(films, tmp_path):
    found, printed = written(films, tmp_path)
    assert found["differences"]["from"] == "near" and list(found["differences"]["estimators"]) == ["far"]
    # 2, 12 and 6 cm against half of it; sequence two leaves the 10 cm.
    figures = found["differences"]["estimators"]["far"]
    assert figures["mean_error_cm"]["value"] == pytest.approx(np.mean([1, 6, 3]), abs=0.05)
    assert figures["within_10cm_points"]["value"] == pytest.approx(-100 / 3)
    row = difference_table(films).cells()[1]
    assert row[0] == "far" and row[1:] == ["-33.33 points", "+3.33 cm"]
    for text in ((tmp_path / "report.md").read_text(), (tmp_path / "report.html").read_text(), printed):
        assert "difference from near" in text and row[1] in text
    assert films.without(["far"]).differences == {} and "3 are too few" in remarks(films)[-1]
