"""One evaluation: sequences in several processes, estimators that fail, labels to start from, and what is resampled."""

import re

import numpy as np
import pytest
from films import FRAMES, POSE_M, Films, Off
from shard_sets import write_shard

from kpopnet.baselines.mean_pose import MeanPoseEstimator
from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.synthetic import SyntheticBenchmark
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.evaluation.poses import run as run_module
from kpopnet.evaluation.poses.report import remarks
from kpopnet.evaluation.poses.run import run_benchmark
from kpopnet.paper_extraction import PaperExtractionConfig
from kpopnet.pose.person import PersonEstimator
from kpopnet.tracker.estimator import TrackerEstimator, TrackerEstimatorConfig

MEAN_POSE = MeanPoseEstimator(POSE_M - POSE_M.mean(axis=0))


class Failing(Off):
    """Fails on the sequence named three."""

    def estimate(self, depth_m, camera):
        return super().estimate(depth_m, camera if depth_m[0, 0, 0] < 3 else 1 / 0)


def test_partial_evaluations_are_named_and_a_sequence_on_which_an_estimator_fails_is_left_out_for_all():
    run = run_benchmark(Films(), {"off": Off(), "failing": Failing()}, sequences=2)
    assert all(one.sequence_names == list(run.metrics[name]["per_sequence"]) == ["one"] for name, one in run.results.items())
    reason = "failing: ZeroDivisionError: division by zero"
    assert run.about["failed_sequences"] == {"three": reason}
    said = " ".join(remarks(run))
    assert "2 of 3 sequences, evenly spaced" in said and f"Left out because of an error: three: {reason}" in said


def test_estimates_do_not_depend_on_the_number_of_processes(tmp_path):
    write_shard(tmp_path / "set", [1, 1, 1, 2, 2, 3, 3, 3], empty=(4,))
    benchmark = SyntheticBenchmark(BenchmarkConfig("synthetic", str(tmp_path / "set")))
    estimators = {"tracker": TrackerEstimator(TrackerEstimatorConfig(start="label")), "mean_pose": MEAN_POSE}
    serial, parallel = (run_benchmark(benchmark, estimators, processes=count) for count in (1, 2))
    for name in estimators:
        np.testing.assert_array_equal(serial.results[name].estimate_m, parallel.results[name].estimate_m)
        timed = [run.metrics[name].pop("fps") for run in (serial, parallel)]
        assert min(timed) > 0 and serial.metrics[name] == parallel.metrics[name]
    assert serial.about == parallel.about and serial.about["images_without_person"] == 1


def test_a_mode_of_films_is_told_the_rate_of_each_recording():
    estimator = PersonEstimator(Off(), "realtime")
    for fps, told in ((25.0, 25.0), (0.0, 30.0), (25.0, 25.0), (None, 30.0)):
        run_benchmark(Films(fps=fps), {"realtime": estimator}, sequences=1)
        assert estimator.fps == told


def test_stills_are_estimated_one_by_one_whatever_the_estimator():
    """A fit or a tracker that knew the person from other stills would be compared with a network that does not."""
    for fps, most in ((0.0, 1), (30.0, FRAMES)):
        run_benchmark(Films(fps=fps), {"off": (off := Off())}, sequences=1)
        assert max(len(given) for given in off.given) == most


def test_an_estimator_that_starts_from_a_label_gets_the_first_and_is_not_scored_there():
    started, other = Off(starts_from_label=True), Off()
    other.sees_future = True
    run = run_benchmark(Films(), {"started": started, "other": other})
    assert [start.frame for start in started.starts] == [0] * 4 and other.starts == [None] * 4
    np.testing.assert_array_equal(started.starts[0].joints_camera_m, POSE_M)
    assert run.about["started_from_label"] == ["started"]
    assert [run.metrics[name]["images"] for name in ("started", "other")] == [3 * (FRAMES - 2), 3 * (FRAMES - 1)]
    assert np.flatnonzero(run.results["started"].given).tolist() == [0, FRAMES, 2 * FRAMES]
    sentence = "started was given the first true pose of every sequence (start=label); it is not scored in that frame."
    assert sentence in remarks(run)
    assert "other: uses images after the one it answers for; the other estimators do not." in remarks(run)


def test_labels_that_are_missing_are_reported():
    films = Films()
    films.without_labels = {"one": [3]}
    run = run_benchmark(films, {"tracker": Off(starts_from_label=True)})
    assert run.about["failed_sequences"].keys() == {"one"}
    assert run.about["failed_sequences"]["one"].startswith("tracker: start=label needs a frame with all fifteen joints")
    films.without_labels = {name: list(range(15)) for name in films.sequence_names()}
    with pytest.raises(InputError, match=r"films: no joint in any frame of .* has a label"):
        run_benchmark(films, {"off": Off()})
    films.without_labels, films.single = {}, ("one", "two", "three")
    with pytest.raises(InputError, match=r"films: started was given every true pose \(start=label\)"):
        run_benchmark(films, {"plain": Off(), "started": Off(starts_from_label=True)})


def test_all_people_in_a_room_are_resampled_together(tmp_path):
    """Errors that differ between two rooms only, with five people in each: resampling people would pretend ten units."""
    write_shard(tmp_path, list(range(10)), rooms=[0] * 5 + [1] * 5)
    run = run_benchmark(SyntheticBenchmark(BenchmarkConfig("synthetic", str(tmp_path))), {"mean_pose": MEAN_POSE})
    assert run.about["resampled"] == {"units": "rooms", "count": 2, "people": 10} and run.about["sequences"] == 10
    assert run.results["mean_pose"].unit.tolist() == ["room 0"] * 5 + ["room 1"] * 5
    assert any("2 are too few" in line for line in remarks(run))


def test_all_films_of_a_person_are_resampled_together():
    films = Films()
    films.identities = {"one": "ann", "two": "bob", "three": "bob"}
    run = run_benchmark(films, {"off": Off()})
    assert run.about["resampled"] == {"units": "people", "count": 2, "people": 2}
    assert list(run.metrics["off"]["per_person"]) == ["ann", "bob"]
    assert run.results["off"].unit.tolist() == ["ann"] * FRAMES + ["bob"] * 2 * FRAMES


def test_in_whole_scenes_the_person_is_segmented_once_for_every_estimator(monkeypatch):
    def all_but_two_frames(depth_m, camera, settings, fps):
        calls.append(len(depth_m))
        assert settings is extraction
        return np.where(np.arange(len(depth_m))[:, None, None] < FRAMES - 2, depth_m + 0, 0)

    calls: list[int] = []
    extraction = PaperExtractionConfig(epsilon_z_m=0.05)
    monkeypatch.setattr(run_module, "extract_person", all_but_two_frames)
    one, other = Off(), Off()
    run = run_benchmark(Films(is_segmented=False), {"one": one, "other": other}, extraction=extraction)
    assert calls == [30, FRAMES, FRAMES, FRAMES]  # once for the warm-up, then once per sequence
    for estimator in (one, other):
        assert [len(depth_m) for depth_m in estimator.given] == calls
        assert estimator.given[1][:-2].any() and not estimator.given[1][-2:].any()
    assert run.about["images_without_person"] == 6 and run.about["extraction_fps"] > 0
    assert any("whole scenes: extraction=paper segmented the person first" in line for line in remarks(run))
    assert run.about["extraction"] == "paper" and run_benchmark(Films(), {"off": Off()}).about["extraction"] is None
    with pytest.raises(InputError, match="extraction=paper: the depth is segmented; leave it out"):
        run_benchmark(Films(), {"off": Off()}, extraction=extraction)
    monkeypatch.undo()
    segmented = run_benchmark(Films(is_segmented=False), {"off": (real := Off())}, extraction=extraction)
    assert not segmented.about["failed_sequences"] and [len(depth_m) for depth_m in real.given] == calls


@pytest.mark.parametrize(
    ("joints", "sure", "message"),
    [
        (14, 0.5, r"mine: joints: expected \(36, 15, 3\), found \(36, 14, 3\)"),
        (15, 50, "mine: confidence: expected 0 to 1, found 50 to 50"),
        (15, np.nan, "mine: confidence: expected 0 to 1, found nan"),
    ],
)
def test_an_estimator_that_answers_in_another_form_is_named_and_leaves_the_other_sequences(joints, sure, message):
    class Mine(Off):
        def estimate(self, depth_m, camera):
            estimate = super().estimate(depth_m, camera)
            is_wrong = depth_m[0, 0, 0] == 3
            return Estimate(
                estimate.joints_camera_m[:, : joints if is_wrong else 15],
                np.full_like(estimate.confidence, sure if is_wrong else 0.5),
            )

    run = run_benchmark(Films(), {"mine": Mine()})
    assert list(run.metrics["mine"]["per_sequence"]) == ["one", "two"]
    assert re.search(message, run.about["failed_sequences"]["three"])
