"""What a report shows beside the headline: the paper's figures and table, and the worst sequence."""

import json
import math

import cv2
import numpy as np
import pytest

from kpopnet.benchmarks.document import as_json
from kpopnet.benchmarks.evaluation import EvaluateConfig, run_benchmark
from kpopnet.benchmarks.pictures import joint_bars, sequence_bars, sweep_plot
from kpopnet.benchmarks.report import metrics_json, remarks, terminal_table, write_report
from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.benchmarks.sweep import AxisConfig, SweepConfig, sweep_of
from kpopnet.benchmarks.tables import published_table, sequence_table, sweep_table
from kpopnet.benchmarks.worst import contact_sheet, film, save_video, worst_sequence
from kpopnet.camera import Camera
from kpopnet.estimators import Estimate
from kpopnet.tracker.estimator import TrackerEstimatorConfig

CAMERA = Camera.centred(80.0, 96, 72)
FRAMES = 36
POSE_M = np.stack([np.linspace(-0.4, 0.4, 15), np.linspace(0.7, -0.7, 15), np.full(15, 2.5)], axis=1).astype(np.float32)
OFF_M = {"one": 0.02, "two": 0.12, "three": 0.06}
"""How far the middle of the estimates of a sequence lies from the truth; every other frame 1 cm more or less."""


class Films:
    """Three sequences of a square that stands for a person, who moves to the right."""

    truth, about = "what was made up", "Made up."

    def __init__(self, name: str = "films", origin: Origin = Origin.SIMULATED, fps: float = 30.0) -> None:
        self.name, self.origin, self.fps = name, origin, fps

    def sequence_names(self) -> list[str]:
        return list(OFF_M)

    def read(self, name: str) -> Sequence:
        joints = POSE_M + np.linspace(0, 0.5, FRAMES)[:, None, None] * np.array([1, 0, 0])
        joints = joints.astype(np.float32)
        joints[5] = np.nan
        depth_m = np.zeros((FRAMES, CAMERA.height, CAMERA.width), np.float32)
        depth_m[:, 15:60, 30:70] = 2.5
        depth_m[0, 0, 0] = 1 + list(OFF_M).index(name)  # tells an estimator which sequence it is
        known = np.isfinite(joints).all(axis=-1)
        return Sequence(name, "", self.fps, CAMERA, depth_m, joints, known)


class Off:
    """Estimates that are off by OFF_M times a factor."""

    def __init__(self, factor: float) -> None:
        self.name, self.factor = "off", factor

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        name = list(OFF_M)[int(depth_m[0, 0, 0]) - 1]
        off_m = self.factor * OFF_M[name] + np.where(np.arange(len(depth_m)) % 2, 0.01, -0.01)
        moved = np.linspace(0, 0.5, FRAMES)[: len(depth_m), None, None] * np.array([1, 0, 0])
        joints = POSE_M + moved + off_m[:, None, None] * np.array([0, 0, 1])
        return Estimate(joints.astype(np.float32), np.ones((len(depth_m), 15), np.float32))


def labels(figure) -> list[str]:
    return [text.get_text() for panel in figure.axes for text in panel.get_legend().get_texts()]


@pytest.fixture(scope="module")
def run():
    return run_benchmark(Films(), {"near": Off(0.5), "far": Off(1.0)})


def test_sequences_have_mean_and_standard_deviation_in_table_and_bars(run):
    header, rows = sequence_table(run, ["two", "one"])
    assert header == ["sequence", "images", "near, Eq. 16", "near, within 10 cm", "far, Eq. 16", "far, within 10 cm"]
    # The unlabelled frame 5 leaves 17 frames of 1 cm more and 18 of 1 cm less.
    off_cm = [6 - 1 / 35, 12 - 1 / 35]
    deviation_cm = np.sqrt(1 - (1 / 35) ** 2)
    expected = [f"{mean:.2f} ± {deviation_cm:.2f} cm" for mean in off_cm]
    assert rows[0] == ["two", "35", expected[0], "100.0 %", expected[1], "0.0 %"]
    figure = sequence_bars(run, ["one", "two", "three"])
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
        ("eval_sim", Origin.SIMULATED, []),
        ("utd_mhad", Origin.REAL, []),
    ],
)
def test_published_figures_stand_beside_real_sets_only(name, origin, lines):
    run = run_benchmark(Films(name, origin), {"off": Off(1)}, sequences=2)
    found = [label for label in labels(joint_bars(run)) + labels(sequence_bars(run, ["one", "three"])) if "published" in label]
    assert all(any(line in label for label in found) for line in lines) and bool(found) == bool(lines)
    assert len(published_table(run)[1]) == len(lines)


def test_the_worst_sequence_is_that_with_the_fewest_joints_within_ten_centimetres(run, tmp_path):
    assert worst_sequence(run.only(["far"])) == "two"
    picture = contact_sheet(run, "two")
    assert picture.ndim == 3 and picture.std() > 10
    fps, pictures = film(run, "two")
    pictures = list(pictures)
    assert fps == 10 and len(pictures) == FRAMES / 3
    assert len({picture.shape for picture in pictures}) == 1 and all(size % 2 == 0 for size in pictures[0].shape[:2])
    assert (pictures[0] != pictures[-1]).any()
    path = tmp_path / "film.mp4"
    if not save_video(path, pictures, fps):
        assert not path.exists()
        pytest.skip("this OpenCV writes no VP9")
    reader = cv2.VideoCapture(str(path))
    frames = [picture for found, picture in iter(reader.read, (False, None)) if found]
    assert len(frames) == len(pictures) and frames[0].shape == pictures[0].shape
    assert reader.get(cv2.CAP_PROP_FPS) == fps
    assert np.abs(frames[-1][..., ::-1].astype(int) - pictures[-1]).mean() < 8


def test_what_cannot_be_written_as_a_video_leaves_nothing(tmp_path, capfd):
    assert not save_video(tmp_path / "none.mp4", [], 30)
    assert not save_video(tmp_path / "no_such_folder" / "film.mp4", [np.zeros((32, 32, 3), np.uint8)], 30)
    assert not list(tmp_path.iterdir())
    capfd.readouterr()  # what OpenCV prints


def test_stills_are_no_film(tmp_path):
    stills = run_benchmark(Films(fps=0.0), {"off": Off(1)})
    write_report(tmp_path, stills, EvaluateConfig(None, {}))
    assert not (tmp_path / "worst.mp4").exists() and (tmp_path / "worst.png").exists()
    assert "<video" not in (tmp_path / "report.html").read_text()


def test_a_sweep_has_a_table_a_plot_and_figures_and_stays_out_of_the_other_tables(tmp_path):
    base = TrackerEstimatorConfig()
    rows, columns = AxisConfig("hierarchy.epsilon_m", [0.05, 0.06]), AxisConfig("hierarchy.r_m", [0.1, 0.11, 0.12])
    sweep = sweep_of(SweepConfig(rows, columns), {"tracker": base})
    factors = np.arange(1, 7).reshape(2, 3) / 3
    estimators = {name: Off(factors[r, c]) for r, names in enumerate(sweep.names) for c, name in enumerate(names)}
    main_first = {"tracker": estimators["tracker"]} | estimators
    run = run_benchmark(Films(), main_first)
    header, cells = sweep_table(run, sweep)
    assert header[1:] == [f"{value}: {what}" for value in columns.values for what in ("mAP", "fps")]
    assert [row[0] for row in cells] == ["0.05", "0.06"]
    # With the factors 1/3, 1 and 2 the sequence that is 12 cm off is within 10 cm, is not, and is joined by another.
    assert (cells[0][1], cells[0][5], cells[1][5]) == ("1.000", "0.667", "0.333")
    assert len(sweep_plot(run, sweep).axes[0].lines) == 2
    write_report(tmp_path, run, EvaluateConfig(None, {}), sweep)
    found = json.loads((tmp_path / "metrics.json").read_text())
    assert list(found["estimators"]) == ["tracker"] and found["estimator"] == "tracker"
    assert np.shape(found["sweep"]["map_10cm"]) == np.shape(found["sweep"]["fps"]) == (2, 3)
    assert found["sweep"]["map_10cm"][0][1] == found["map_10cm"]
    assert found["sweep"]["columns"] == {"setting": "hierarchy.r_m", "values": [0.1, 0.11, 0.12]}
    assert "sweep.png" in found["pictures"] and "Table 1" in (tmp_path / "report.md").read_text()
    assert "0.06  " in terminal_table(run, sweep) and "r_m=0.12" not in terminal_table(run, sweep)


def test_metrics_json_says_which_simulated_set_it_was(run):
    real = run_benchmark(Films("other", Origin.REAL), {"off": Off(1)})
    config = EvaluateConfig(None, {})
    assert {metrics_json(real, config, [])["benchmark"][key] for key in ("seed", "version", "config_hash")} == {None}
    run.benchmark.provenance = {"seed": 3, "version": 1, "config_hash": "abc"}
    described = metrics_json(run, config, [])["benchmark"]
    assert [described[key] for key in ("seed", "version", "config_hash", "depth")] == [3, 1, "abc", "simulated"]


def test_infinite_settings_stand_in_words_and_infinite_figures_are_refused():
    described = {"config": {"limits": [math.inf, 1.5], "inner": {"beta": -math.inf}}, "mean_error_cm": 3.0}
    assert json.loads(as_json(described)) == described | {"config": {"limits": ["inf", 1.5], "inner": {"beta": "-inf"}}}
    with pytest.raises(ValueError, match="JSON"):
        as_json(described | {"mean_error_cm": math.inf})


class Told(Off):
    """Wants a true pose, and keeps what it was told."""

    starts_from_label = True

    def __init__(self) -> None:
        super().__init__(1.0)
        self.starts = []

    def estimate(self, depth_m, camera, start=None):
        self.starts.append(start)
        return super().estimate(depth_m, camera)


def test_who_wants_a_true_pose_gets_the_first_and_the_report_says_so():
    told, other = Told(), Told()
    other.starts_from_label = False
    run = run_benchmark(Films(), {"told": told, "other": other, "plain": Off(1)})
    assert [start.frame for start in told.starts] == [0] * 4 and other.starts == [None] * 4
    np.testing.assert_array_equal(told.starts[0].joints_camera_m, POSE_M)
    assert run.started_from_label == ["told"]
    assert [line for line in remarks(run) if "first true pose" in line] == [
        "told was told the first true pose of every sequence (start=label)."
    ]
