"""Everybody's joints and identities: matching on made-up estimates, and the program on a film of people of cones."""

import json
from pathlib import Path

import numpy as np
import pytest
from two_people_files import CAMERA, write_two_people

from kpopnet.datasets.simulated import SimulatedConfig, StoredSequence
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.people.metrics import NOBODY, MatchedSequence, by_kind, figures, match
from kpopnet.evaluation.people.report import evaluate_people, follower
from kpopnet.evaluation.registry import MeanPoseConfig
from kpopnet.evaluation.report import write
from kpopnet.extraction import HumanExtractionConfig
from kpopnet.tracker.estimator import TrackerEstimatorConfig

FRAMES = 10


def sequence(joints_m: np.ndarray, seen_px: int | np.ndarray = 100) -> StoredSequence:
    people = joints_m.shape[:2]
    depth_mm = np.zeros((len(joints_m), CAMERA.height, CAMERA.width), np.uint16)
    seen = np.broadcast_to(seen_px, people)
    alone_px = np.full(people, 100)
    return StoredSequence("a", "made up", 30.0, CAMERA, ("b", "c"), depth_mm, joints_m, alone_px=alone_px, seen_px=seen)


@pytest.fixture
def truth_m() -> np.ndarray:
    """(10, 2, 15, 3) joints of two people a metre apart, small enough to be inside the image."""
    body = np.random.default_rng(0).uniform(-0.3, 0.3, (15, 3))
    return np.stack([body + np.array((x, 0, 3)) for x in (-0.5, 0.5)])[None].repeat(FRAMES, axis=0).astype(np.float32)


def matched(truth_m: np.ndarray, estimates_m: np.ndarray, seen_px: int | np.ndarray = 100) -> MatchedSequence:
    return match(sequence(truth_m, seen_px), estimates_m.swapaxes(0, 1), np.arange(estimates_m.shape[1]) + 7, 1.0)


def test_perfect_estimates_have_no_fault(truth_m: np.ndarray) -> None:
    one = figures([matched(truth_m, truth_m[:, ::-1])], 0)
    assert one["within_10cm"] == one["mota"] == one["idf1"] == 1 and one["seen"] == 2 * FRAMES
    assert one["missed"] == one["false"] == one["switches"] == one["mean_error_cm"] == 0


def test_an_exchange_of_identities_is_two_switches_and_no_error_of_joints(truth_m: np.ndarray) -> None:
    exchanged = truth_m.copy()
    exchanged[6:] = truth_m[6:, ::-1]
    found = matched(truth_m, exchanged)
    assert [np.flatnonzero(person).tolist() for person in found.switches().T] == [[6], [6]]
    one = figures([found], 0)
    assert one["switches"] == 2 and one["within_10cm"] == 1
    assert one["mota"] == pytest.approx(1 - 2 / 20) and one["idf1"] == pytest.approx(0.6)


def test_a_person_keeps_an_identity_that_is_within_reach_although_another_is_nearer(truth_m: np.ndarray) -> None:
    estimates_m = np.stack([truth_m[:, 0] + np.float32((0.2, 0, 0)), truth_m[:, 0]], axis=1)
    estimates_m[0, 1] = np.nan
    found = matched(truth_m[:, :1], estimates_m)
    assert (found.identity == 7).all() and found.false.tolist() == [0] + [1] * (FRAMES - 1)


def test_missed_people_count_as_missed_joints_and_false_people_as_false(truth_m: np.ndarray) -> None:
    estimates_m = truth_m.copy()
    estimates_m[:5, 0] = np.nan
    estimates_m[8:, 1] += 2
    one = figures([matched(truth_m, estimates_m)], 0)
    assert one["missed"] == pytest.approx(7 / 20) and one["false"] == 2 and one["switches"] == 0
    assert one["within_10cm"] == pytest.approx(13 / 20) and one["mean_error_cm"] == 0
    assert one["mota"] == pytest.approx(1 - 9 / 20) and one["idf1"] == pytest.approx(2 * 13 / (20 + 15))


def test_hidden_people_and_those_at_the_border_are_neither_missed_nor_false(truth_m: np.ndarray) -> None:
    seen_px = np.full((FRAMES, 2), 100)
    seen_px[3:6, 0] = 49
    lost = truth_m.copy()
    lost[3:6, 0] = np.nan
    for estimates_m in (truth_m, lost):
        one = figures([matched(truth_m, estimates_m, seen_px)], 0)
        assert (one["seen"], one["hidden"], one["missed"], one["false"], one["mota"]) == (17, 3, 0, 0, 1)
    leaving = truth_m.copy()
    leaving[4:, 1] += np.float32((5, 0, 0))
    one = figures([matched(leaving, leaving)], 0)
    assert (one["seen"], one["hidden"], one["false"]) == (14, 0, 0)


def test_nobody_found_is_everybody_missed(truth_m: np.ndarray) -> None:
    found = matched(truth_m, np.empty((FRAMES, 0, 15, 3)))
    assert (found.identity == NOBODY).all() and found.identified() == 0
    one = figures([found], 0)
    assert one["missed"] == 1 and one["within_10cm"] == 0 and one["mean_error_cm"] is None and one["idf1"] == 0
    pair = by_kind([found, matched(truth_m, truth_m)] * 3, 0)["all"]["interval"]["within_10cm"]
    assert pair[0] < 0.2 and pair[1] > 0.8 and one["interval"]["within_10cm"] is None


def test_estimators_of_one_person_are_refused() -> None:
    with pytest.raises(InputError, match="estimator mean: estimates one person"):
        follower("mean", MeanPoseConfig())
    with pytest.raises(InputError, match="start, model"):
        follower("tracker", TrackerEstimatorConfig(start="label"))


def test_the_report_of_a_film_has_tables_pictures_and_figures(tmp_path: Path) -> None:
    write_two_people(tmp_path / "set", frames=30)
    benchmark = SimulatedConfig("two_people", str(tmp_path / "set"))
    config = EvaluateConfig(benchmark, {"tracker": TrackerEstimatorConfig()}, processes=1)
    report = evaluate_people(config, tmp_path / "out")
    write(report, config, tmp_path / "out")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["switches"] == 0 and metrics["false"] == 0 and metrics["missed"] < 0.3 and metrics["mean_error_cm"] < 12
    assert metrics["estimators"]["tracker"]["all"]["fps"] > 0 and metrics["benchmark"]["failed_sequences"] == {}
    assert "two_people: SIMULATED depth" in report.text() and "No intervals" in report.text()
    assert "CLEAR MOT" in (tmp_path / "out" / "report.md").read_text()
    assert (tmp_path / "out" / "people.png").exists()
    assert 'srcdoc="&lt;!doctype html' in (tmp_path / "out" / "report.html").read_text()
    for given in ({"scorer": {"paper": None}}, {"extraction": HumanExtractionConfig(epsilon_z_m=0.05)}):
        with pytest.raises(InputError, match="leave"):
            evaluate_people(EvaluateConfig(benchmark, **given), tmp_path / "other")
