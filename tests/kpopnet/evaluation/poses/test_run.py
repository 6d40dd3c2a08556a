"""One evaluation: sequences in several processes, and estimators that fail."""

import numpy as np
import pytest
from shard_sets import write_shard

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.datasets.synthetic import SyntheticBenchmark, SyntheticConfig
from kpopnet.errors import InputError
from kpopnet.evaluation.poses.report.writing import remarks
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.evaluation.registry import build_estimators
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network
from kpopnet.paper_tracker.estimator import PaperTrackerEstimatorConfig
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig

POSE_M = np.stack([np.zeros(15), np.linspace(-0.6, 0.6, 15), np.full(15, 0.1)], axis=-1)


@pytest.fixture
def benchmark(tmp_path):
    write_shard(tmp_path / "set", [1, 1, 1, 2, 2, 3, 3, 3], empty=(4,))
    return SyntheticBenchmark(SyntheticConfig(path=str(tmp_path / "set")))


class Failing:
    """Estimates the mean pose, and fails on sequences of two frames."""

    name = "failing"

    def __init__(self, error: Exception) -> None:
        self.error = error

    def estimate(self, depth_m, camera):
        if len(depth_m) == 2:
            raise self.error
        return MeanPoseEstimator(POSE_M).estimate(depth_m, camera)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (InputError("bad input"), "failing: bad input"),
        (ZeroDivisionError("division by zero"), "failing: ZeroDivisionError: division by zero"),
    ],
)
def test_an_estimator_that_fails_on_a_sequence_excludes_only_that_sequence(benchmark, error, reason):
    run = run_benchmark(benchmark, {"mean_pose": MeanPoseEstimator(POSE_M), "failing": Failing(error)})
    failed = benchmark.sequence_names()[1]
    assert run.failed == {failed: reason}
    assert all(one.sequence_names == tuple(run.metrics["failing"]["per_sequence"]) for one in run.results.values())
    assert [metrics["images"] for metrics in run.metrics.values()] == [6, 6] and len(run.frame) == 6
    assert any(failed in line and reason in line for line in remarks(run))


def test_estimates_do_not_depend_on_the_number_of_processes(benchmark, tmp_path):
    network = build_network(ModelConfig(crop_px=32, widths=[8, 8, 8, 8]))
    meta = {"step": 1, "config": {}, "metrics": {}, "mean_pose_m": POSE_M.tolist()}
    estimators = {
        "network": NetworkEstimator(save_checkpoint(tmp_path / "run", network, {}, meta, best=True)),
        "tracker": TrackerEstimator(TrackerEstimatorConfig(start="label")),
        "mean_pose": MeanPoseEstimator(POSE_M),
    }
    serial, parallel = (run_benchmark(benchmark, estimators, processes=count) for count in (1, 2))
    for name in estimators:
        np.testing.assert_array_equal(serial.results[name].estimate_m, parallel.results[name].estimate_m)
        np.testing.assert_array_equal(serial.results[name].truth_m, parallel.results[name].truth_m)
        timed = [run.metrics[name].pop("fps") for run in (serial, parallel)]
        assert min(timed) > 0 and serial.metrics[name] == parallel.metrics[name]
    assert (serial.frame == parallel.frame).all() and serial.frame.tolist() == [0, 1, 2, 0, 1, 0, 1, 2]
    assert serial.images_without_person == parallel.images_without_person == 1


def without_labels(monkeypatch, benchmark, joints: list[int], sequences: list[str]) -> None:
    """Removes the labels of some joints in some sequences of a benchmark."""
    read = benchmark.read

    def read_without_labels(name):
        sequence = read(name)
        if name in sequences:
            sequence.joints_camera_m[:, joints] = np.nan
            sequence.visible[:, joints] = False
        return sequence

    monkeypatch.setattr(benchmark, "read", read_without_labels)


def test_a_sequence_without_a_complete_label_to_start_from_is_reported(benchmark, monkeypatch):
    unlabelled = benchmark.sequence_names()[0]
    without_labels(monkeypatch, benchmark, [3], [unlabelled])
    run = run_benchmark(benchmark, {"tracker": TrackerEstimator(TrackerEstimatorConfig(start="label"))})
    assert list(run.failed) == [unlabelled]
    assert run.failed[unlabelled].startswith("tracker: start=label needs a frame with all fifteen joints")


def test_a_set_without_any_label_is_rejected(benchmark, monkeypatch):
    without_labels(monkeypatch, benchmark, list(range(15)), benchmark.sequence_names())
    with pytest.raises(InputError, match=r"synthetic: no joint in any frame of .* has a label"):
        run_benchmark(benchmark, {"mean_pose": MeanPoseEstimator(POSE_M)})


def test_all_people_in_a_room_are_resampled_together(tmp_path):
    """Errors that differ between two rooms only, with five people in each: resampling people would pretend ten units."""
    write_shard(tmp_path, list(range(10)), rooms=[0] * 5 + [1] * 5)
    rooms = SyntheticBenchmark(SyntheticConfig(path=str(tmp_path)))
    run = run_benchmark(rooms, {"mean_pose": MeanPoseEstimator(POSE_M)})
    assert run.resampled == ("rooms", 2, 10) and len(run.results["mean_pose"].sequence_names) == 10
    assert run.results["mean_pose"].unit.tolist() == [0] * 5 + [1] * 5
    assert any("2 rooms are too few" in line for line in remarks(run))


def test_one_kind_of_estimator_may_have_several_names_in_a_run():
    configs = {"slow": PaperTrackerEstimatorConfig(start="label"), "fast": PaperTrackerEstimatorConfig()}
    built = build_estimators(configs)
    assert [one.starts_from_label for one in built.values()] == [True, False] and list(built) == list(configs)
