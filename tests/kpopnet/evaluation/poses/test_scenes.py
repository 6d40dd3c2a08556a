"""Benchmarks whose depth shows whole scenes: the person is segmented first, once for all estimators."""

import numpy as np
import pytest
from shard_sets import write_shard
from slopes import joints_m, slope_m

from kpopnet.camera import CAMERAS, Camera
from kpopnet.datasets.protocol import Origin, Sequence
from kpopnet.datasets.synthetic import SyntheticBenchmark, SyntheticConfig
from kpopnet.estimator import Estimate
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.poses import sequence as pose_sequence
from kpopnet.evaluation.poses.report.figures import crop_around_joints, examples_sheet
from kpopnet.evaluation.poses.report.writing import metrics_json, remarks
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.extraction import HumanExtractionConfig

CAMERA = CAMERAS["eval"]


class Recorder:
    """An estimator that records its input and always estimates the same pose."""

    name = "recorder"

    def __init__(self) -> None:
        self.depths: list[np.ndarray] = []

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        self.depths.append(depth_m)
        return Estimate(np.tile(joints_m(0), (len(depth_m), 1, 1)).astype(np.float32), np.ones((len(depth_m), 15), np.float32))


class Scenes:
    """A benchmark of two sequences of three frames each, which show a slope with a hole that moves."""

    name, origin, truth, about = "scenes", Origin.SIMULATED, "made-up joints", "Made up."

    def sequence_names(self) -> list[str]:
        return ["one", "two"]

    def read(self, name: str) -> Sequence:
        joints = np.stack([joints_m(frame) for frame in range(3)]).astype(np.float32)
        depth_m = np.stack([slope_m(frame) for frame in range(3)])
        return Sequence(name, "", 30.0, CAMERA, depth_m, joints, np.ones((3, 15), bool), is_segmented=False)


def test_every_estimator_gets_the_segmented_person_extracted_once(monkeypatch):
    def segment_first_two_frames(depth_m, camera, config):
        calls.append(len(depth_m))
        assert config is extraction
        person_m = np.where((depth_m > 2) & (depth_m < 3), depth_m, 0)
        person_m[2:] = 0
        return person_m

    calls: list[int] = []
    extraction = HumanExtractionConfig(epsilon_z_m=0.05)
    monkeypatch.setattr(pose_sequence, "extract_person", segment_first_two_frames)
    one, other = Recorder(), Recorder()
    run = run_benchmark(Scenes(), {"one": one, "other": other}, extraction=extraction)
    assert calls == [3, 3, 3]  # once for the warm-up, then once per sequence
    for given_m, its in zip((one.depths, other.depths), (one, other), strict=True):
        assert [len(depth_m) for depth_m in given_m] == [3, 3, 3], its
        assert given_m[1][:2].any() and not given_m[1][2].any()
        assert given_m[1][given_m[1] > 0].min() > 2 and given_m[1].max() < 3
    assert run.images_without_person == 2 and run.extraction_fps > 0
    assert any("whole scenes: the person was segmented first" in line for line in remarks(run))
    assert metrics_json(run, EvaluateConfig(None, {}), [])["benchmark"]["extraction_fps"] == run.extraction_fps
    assert run.metrics["one"]["mean_error_cm"] == pytest.approx(1.0, abs=1e-3)  # 0, 1 and 2 cm
    assert examples_sheet(run, 0).std() > 10


def test_segmented_depth_is_not_extracted_again(tmp_path, monkeypatch):
    monkeypatch.setattr(pose_sequence, "extract_person", None)
    write_shard(tmp_path, [1, 2])
    run = run_benchmark(SyntheticBenchmark(SyntheticConfig(path=str(tmp_path))), {"recorder": Recorder()})
    assert run.extraction_fps is None and not any("whole scenes" in line for line in remarks(run))


def test_crop_around_joints_keeps_the_depth_near_the_joints():
    depth = slope_m(0)
    kept = crop_around_joints(depth, CAMERA, joints_m(0))
    points = CAMERA.points(depth)
    near = (np.abs(points[..., 2] - 2.5) < 0.3) & (np.abs(points[..., 0]) < 0.6) & (np.abs(points[..., 1]) < 1.0)
    far = np.abs(points[..., 2] - 2.5) > 0.4
    assert (kept[near] == depth[near]).all() and not kept[far].any()
