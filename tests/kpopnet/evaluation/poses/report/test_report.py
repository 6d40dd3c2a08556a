import json
import re
from dataclasses import asdict
from html.parser import HTMLParser

import h5py
import numpy as np
import pytest
from shard_sets import write_shard

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.baselines.tree_walk.model import TreeWalkEstimatorConfig
from kpopnet.camera import Camera
from kpopnet.data.cube import person_centre
from kpopnet.datasets.synthetic import SyntheticBenchmark, SyntheticConfig
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.poses.report.figures import example_frames
from kpopnet.evaluation.poses.report.writing import remarks, terminal_table, write_report
from kpopnet.evaluation.poses.run import run_benchmark, unlike_training
from kpopnet.evaluation.registry import NetworkEstimatorConfig
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network
from kpopnet.ridge import RidgeConfig
from kpopnet.skeleton import JOINT_NAMES, Joint
from kpopnet.tracker.estimator import TrackerEstimatorConfig
from kpopnet.tracker.fit.refine import FittedEstimator
from kpopnet.viz.drawing import (
    BACKGROUND,
    ESTIMATED,
    TRUE,
    depth_rgb,
    draw_skeleton,
    person_tile,
    person_view,
    probability_rgb,
    save_png,
)
from synth.samples.observe import ExtractionConfig
from synth.samples.writer import FreezeConfig
from synth.sensor.model import SensorConfig


class Shifted:
    """Estimates a fixed pose at the centre of the silhouette; frame k is displaced by k times a known distance."""

    name = "shifted"

    def __init__(self, poses: np.ndarray, step_m: float) -> None:
        self.poses, self.step_m, self.calls = poses, step_m, []

    def estimate(self, depth_m, camera):
        self.calls.append(len(depth_m))
        joints = np.full((len(depth_m), 15, 3), np.nan, np.float32)
        for k, image in enumerate(depth_m):
            if image.any():
                joints[k] = self.poses + person_centre(image, camera) + [0, 0, self.step_m * k]
        return Estimate(joints, np.isfinite(joints).all(-1).astype(np.float32))


@pytest.fixture
def benchmark(tmp_path):
    write_shard(tmp_path / "set", [1, 1, 1, 2, 2, 3, 3, 3], empty=(4,), rooms=[0, 0, 0, 1, 1, 2, 2, 2])
    return SyntheticBenchmark(SyntheticConfig(path=str(tmp_path / "set")))


@pytest.fixture
def pose(benchmark):
    """(15, 3) joints relative to the centre of the person, the same in every sample."""
    sequence = benchmark.read(benchmark.sequence_names()[0])
    return sequence.joints_camera_m[0] - person_centre(sequence.depth_m[0], sequence.camera)


def config(**changes) -> EvaluateConfig:
    return EvaluateConfig(benchmark={"name": "synthetic"}, estimator={"shifted": {}}, **changes)


def test_metrics_json_describes_the_benchmark_and_holds_the_errors(benchmark, pose, tmp_path):
    estimators = {"shifted": Shifted(pose, 0.06), "mean_pose": MeanPoseEstimator(pose)}
    run = run_benchmark(benchmark, estimators)
    write_report(tmp_path / "report", run, config())
    found = json.loads((tmp_path / "report" / "metrics.json").read_text())
    assert found["images"] == 8 and found["estimator"] == "shifted"
    # Errors of 0, 6, 12 cm in the first and last sequence; 0 cm and one frame without a person in the middle one.
    assert found["mean_error_cm"] == pytest.approx((2 * (0 + 6 + 12) + 0) / 7, abs=0.1)
    assert found["map_10cm"] == pytest.approx(5 / 8)
    assert found["missing"] == {"joints": 15, "of_labelled_joints": 120, "images_without_estimate": 1}
    assert found["estimators"]["shifted"]["mean_error_cm"] == found["mean_error_cm"]
    assert found["estimators"]["mean_pose"]["mean_error_cm"] == pytest.approx(0, abs=0.1)
    assert found["benchmark"]["depth"] == "simulated" and found["benchmark"]["against"] == "synthetic truth"
    assert found["benchmark"]["images_without_person"] == 1
    assert set(found["per_joint"]) == set(JOINT_NAMES) and len(found["per_sequence"]) == 3 and found["by_yaw"]
    assert len(found["config_hash"]) == 12 and found["fps"] > 0 and "git" in found
    assert all((tmp_path / "report" / figure).stat().st_size > 1000 for figure in found["pictures"])
    assert found["benchmark"]["resampled"] == {"units": "rooms", "count": 3, "people": 3}
    assert found["map_14"] == found["estimators"]["shifted"]["paper_joints"]["map_10cm"]
    assert found["differences"]["estimators"]["mean_pose"] == run.differences["mean_pose"]
    low, high = found["interval"]["mean_error_cm"]
    assert low < found["mean_error_cm"] < high


def test_reports_name_origin_and_truth_and_link_only_existing_figures(benchmark, pose, tmp_path):
    run = run_benchmark(benchmark, {"shifted": Shifted(pose, 0.06)}, sequences=2)
    write_report(tmp_path, run, config(sequences=2))
    page, text = (tmp_path / "report.html").read_text(), (tmp_path / "report.md").read_text()
    for report in (page, text, terminal_table(run)):
        assert "SIMULATED depth, compared with synthetic truth" in report
        assert "2 of 3 sequences, evenly spaced" in report and "synthetic:" in report
    links = re.findall(r"\[[^]]*\]\(([^)]*)\)", text)
    assert len(links) == 8 and all((tmp_path / link).is_file() for link in links)
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert len(sources) == 6 and all(source.startswith("data:image/png;base64,") for source in sources)
    assert page.count("<iframe sandbox=") == 2
    parser = TagBalance()
    parser.feed(page)
    assert not parser.open


def test_a_report_lists_the_files_of_each_estimator(benchmark, pose, tmp_path):
    run = run_benchmark(benchmark, {"shifted": Shifted(pose, 0)})
    settings = {
        "ridge_network": NetworkEstimatorConfig(checkpoint="runs/ridge/best"),
        "tracker": TrackerEstimatorConfig(network="runs/tracker/best", model="person.json"),
        "plain": TrackerEstimatorConfig(),
        "tree_walk": TreeWalkEstimatorConfig(path="walks/mine"),
    }
    write_report(tmp_path, run, EvaluateConfig({}, settings, checkpoint="of/none"))
    assert json.loads((tmp_path / "metrics.json").read_text())["files"] == {
        "ridge_network": {"checkpoint": "runs/ridge/best"},
        "tracker": {"network": "runs/tracker/best", "model": "person.json"},
        "plain": {},
        "tree_walk": {"path": "walks/mine"},
    }
    assert (
        "Files read by the estimators: ridge_network checkpoint=runs/ridge/best, tracker network=runs/tracker/best "
        "model=person.json, plain no file, tree_walk path=walks/mine; configuration"
    ) in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("sensor", "extraction", "settings"),
    [
        ("kinect_v1", {}, []),
        (
            "kinect_2",
            {"erode": 0.0},
            ["sensor.name=kinect_2 (kinect_v1 in training)", "extraction.erode=0.0 (0.25 in training)"],
        ),
    ],
)
def test_a_set_that_differs_from_the_training_set_is_reported(tmp_path, sensor, extraction, settings):
    write_shard(tmp_path / "set", [1, 2])
    frozen_with = FreezeConfig(SensorConfig(sensor), ExtractionConfig(**extraction), RidgeConfig(epsilon_r=0.1))
    with h5py.File(tmp_path / "set" / "shard_00000.h5", "a") as file:
        file.attrs["config"] = json.dumps({"freeze": asdict(frozen_with)})
    trained = {"sensor": asdict(SensorConfig()), "extraction": asdict(ExtractionConfig()), "ridge": asdict(RidgeConfig())}
    meta = {"step": 1, "config": trained, "metrics": {}, "mean_pose_m": np.zeros((15, 3)).tolist()}
    network = build_network(ModelConfig(crop_px=32, widths=[8, 8, 8, 8]))
    estimator = NetworkEstimator(save_checkpoint(tmp_path / "run", network, {}, meta, best=True))
    mean_pose = MeanPoseEstimator(np.zeros((15, 3), np.float32))
    set_ = SyntheticBenchmark(SyntheticConfig(path=str(tmp_path / "set")))
    assert unlike_training(set_, FittedEstimator(estimator)) == unlike_training(set_, estimator) == settings
    run = run_benchmark(set_, {"network": estimator, "mean_pose": mean_pose})
    lines = [line for line in remarks(run) if "differs from the training set of network" in line]
    assert len(lines) == bool(settings)
    assert all(setting in lines[0] for setting in settings)
    write_report(tmp_path / "report", run, config())
    found = json.loads((tmp_path / "report" / "metrics.json").read_text())
    assert found["benchmark"]["unlike_training"] == ({"network": settings} if settings else {})


class TagBalance(HTMLParser):
    """Fails on a tag closed out of order; `open` lists the tags that were not closed."""

    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_a_sequence_that_cannot_be_read_does_not_affect_the_others(benchmark, pose, tmp_path, monkeypatch):
    broken, read = benchmark.sequence_names()[1], benchmark.read

    def read_damaged(name):
        if name == broken:
            raise InputError("damaged.mat: not <whole>")
        return read(name)

    monkeypatch.setattr(benchmark, "read", read_damaged)
    run = run_benchmark(benchmark, {"shifted": Shifted(pose, 0)})
    assert run.failed == {broken: "damaged.mat: not <whole>"}
    assert run.results["shifted"].sequence_names == tuple(n for n in benchmark.sequence_names() if n != broken)
    write_report(tmp_path, run, config())
    assert f"{broken}: damaged.mat: not &lt;whole&gt;" in (tmp_path / "report.html").read_text()
    assert f"{broken}: damaged.mat" in terminal_table(run)
    monkeypatch.setattr(benchmark, "read", lambda name: read_damaged(broken))
    with pytest.raises(InputError, match=r"none of its 3 sequences.*damaged\.mat"):
        run_benchmark(benchmark, {"shifted": Shifted(pose, 0)})


def test_one_untimed_call_then_one_call_per_sequence(benchmark, pose):
    estimator = Shifted(pose, 0)
    run_benchmark(benchmark, {"shifted": estimator})
    assert estimator.calls == [3, 3, 2, 3]


def test_examples_are_the_best_the_median_and_the_worst(benchmark, pose):
    run = run_benchmark(benchmark, {"shifted": Shifted(pose, 0.06)})
    examples = example_frames(run, seed=0)
    assert examples["worst"][0] == 4  # no person detected in this frame
    assert set(examples["best"][:3]) == {0, 3, 5} and set(examples["worst"][1:3]) == {2, 7}
    assert all(len(set(frames)) == len(frames) for frames in examples.values())
    assert examples == example_frames(run, seed=0)


def test_mean_pose_follows_the_person_and_is_missing_in_an_empty_frame(benchmark, pose):
    sequence = benchmark.read(benchmark.sequence_names()[1])
    estimate = MeanPoseEstimator(pose).estimate(sequence.depth_m, sequence.camera)
    centre = person_centre(sequence.depth_m[0], sequence.camera)
    np.testing.assert_allclose(estimate.joints_camera_m[0], centre + pose, atol=1e-6)
    assert np.isnan(estimate.joints_camera_m[1]).all()
    assert (estimate.confidence == [[1.0] * 15, [0.0] * 15]).all()


CAMERA = Camera.centred(100.0, 80, 60)


def single_joint(joint: Joint, at) -> np.ndarray:
    joints = np.full((15, 3), np.nan)
    joints[joint] = at
    return joints


@pytest.mark.parametrize("scale", [1, 4])
def test_a_joint_is_drawn_at_its_projection_in_the_colour_of_its_side(scale):
    for joint, colour in (
        (Joint.RIGHT_HAND, ESTIMATED.right),
        (Joint.LEFT_FOOT, ESTIMATED.left),
        (8, ESTIMATED.middle),
    ):
        image = np.zeros((60 * scale, 80 * scale, 3), np.uint8)
        draw_skeleton(image, single_joint(joint, CAMERA.back_project(np.array([61, 22, 2.0]))), CAMERA, ESTIMATED)
        rows, columns = np.nonzero(image.any(axis=-1))
        assert (rows.mean(), columns.mean()) == pytest.approx(((22.5) * scale - 0.5, (61.5) * scale - 0.5), abs=0.6)
        assert tuple(image[round(rows.mean()), round(columns.mean())]) == colour


def test_bones_connect_joints_and_true_and_estimated_skeletons_differ():
    joints = np.full((15, 3), np.nan)
    joints[Joint.LEFT_ELBOW], joints[Joint.LEFT_HAND] = CAMERA.back_project(np.array([[10, 30, 2.0], [70, 30, 2.0]]))
    images = []
    for style in (TRUE, ESTIMATED):
        image = np.zeros((60, 80, 3), np.uint8)
        draw_skeleton(image, joints, CAMERA, style)
        assert tuple(image[30, 40]) == style.left
        images.append(image)
    assert (images[0] != images[1]).any()


def test_an_image_that_cannot_be_written_is_an_input_error(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder.png").mkdir()
    for path in (tmp_path / "file" / "a.png", tmp_path / "folder.png"):
        with pytest.raises(InputError, match=rf"{path}: the image cannot be written \("):
            save_png(path, np.zeros((4, 4, 3), np.uint8))
    save_png(tmp_path / "new" / "a.png", np.zeros((4, 4, 3), np.uint8))
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.png", "file", "folder.png", "new"]


def test_joints_that_cannot_be_projected_are_not_drawn():
    image = np.zeros((60, 80, 3), np.uint8)
    joints = np.full((15, 3), np.nan)
    joints[0], joints[1] = (0, 0, -1), (0, 0, 0)
    joints[2], joints[3] = (1e9, 0, 1), (np.inf, 0, 1)
    draw_skeleton(image, joints, CAMERA, ESTIMATED)
    assert not image.any()


def test_near_depth_is_lighter_than_far_and_missing_depth_is_background():
    depth = np.zeros((4, 6), np.float32)
    depth[1, 1:5] = 2.0, 2.2, 2.4, 2.6
    greys = depth_rgb(depth)
    assert tuple(greys[0, 0]) == BACKGROUND
    assert (np.diff(greys[1, 1:5, 0].astype(int)) < 0).all() and greys[1, 4, 0] > BACKGROUND[0]
    assert (depth_rgb(np.zeros((4, 6), np.float32)) == BACKGROUND).all()
    assert probability_rgb(np.array([[0.0, 1.0]])).sum(-1).tolist() == [[0, 765]]


def test_person_view_has_a_consistent_camera_even_across_the_image_border():
    depth = np.zeros((60, 80), np.float32)
    depth[0:40, 60:80] = 2.0
    view, camera = person_view(depth, CAMERA)
    assert view.shape[0] == view.shape[1] == camera.width == camera.height
    whole, part = CAMERA.points(depth)[depth > 0], camera.points(view)[view > 0]
    np.testing.assert_allclose(part, whole, atol=1e-6)
    joints = np.full((15, 3), np.nan)
    empty, _ = person_view(np.zeros((60, 80), np.float32), CAMERA, (joints,))
    assert not empty.any()


def test_tiles_have_one_size_whatever_they_contain():
    joints = single_joint(Joint.HEAD, (0, 0, 2))
    shapes = {
        person_tile(depth, CAMERA, ((joints, TRUE), (joints * np.nan, ESTIMATED)), 96, ("a", "b" * 80)).shape
        for depth in (np.zeros((60, 80), np.float32), np.full((60, 80), 2, np.float32))
    }
    assert shapes == {(96 + 36, 96, 3)}
