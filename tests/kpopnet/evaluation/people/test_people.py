"""All people's joints and identities: matching on made-up estimates, and the program on a film of people of cones."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from simulated_files import write_simulated
from two_people_files import CAMERA, draw_two_people, write_two_people

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.simulated import StoredSequence
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.engine import Timed
from kpopnet.evaluation.people.metrics import MatchedSequence, by_kind, causes, figures, match, wrong_joints
from kpopnet.evaluation.people.report import evaluate_people, follower, matched_people
from kpopnet.evaluation.registry import BestConfig, MeanPoseConfig, RealtimeConfig
from kpopnet.evaluation.report import write
from kpopnet.paper_extraction import PaperExtractionConfig
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


def test_an_exchange_of_identities_is_two_switches_and_no_error_of_joints(truth_m: np.ndarray) -> None:
    exchanged = truth_m.copy()
    exchanged[6:] = truth_m[6:, ::-1]
    found = matched(truth_m, exchanged)
    assert [np.flatnonzero(person).tolist() for person in found.switches().T] == [[6], [6]]
    one = figures([found], 0)
    assert one["switches"] == 2 and one["map_10cm"] == 1
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
    assert one["people_recall"] == pytest.approx(13 / 20) and one["people_precision"] == pytest.approx(13 / 15)
    assert one["false"] == 2 and one["switches"] == 0
    assert one["map_10cm"] == pytest.approx(13 / 20) and one["mean_error_cm"] == 0
    assert one["mota"] == pytest.approx(1 - 9 / 20) and one["idf1"] == pytest.approx(2 * 13 / (20 + 15))


def test_hidden_people_and_those_at_the_border_are_neither_missed_nor_false(truth_m: np.ndarray) -> None:
    seen_px = np.full((FRAMES, 2), 100)
    seen_px[3:6, 0] = 49
    lost = truth_m.copy()
    lost[3:6, 0] = np.nan
    for estimates_m in (truth_m, lost):
        one = figures([matched(truth_m, estimates_m, seen_px)], 0)
        assert (one["seen"], one["hidden"], one["people_recall"], one["false"], one["mota"]) == (17, 3, 1, 0, 1)
    leaving = truth_m.copy()
    leaving[4:, 1] += np.float32((5, 0, 0))
    one = figures([matched(leaving, leaving)], 0)
    assert (one["seen"], one["hidden"], one["false"]) == (14, 0, 0)
    seen_px[:] = 100
    seen_px[4:, 1] = 0
    one = figures([matched(leaving, leaving, seen_px)], 0)  # what is found where nothing of the person shows is false
    assert (one["seen"], one["hidden"], one["false"]) == (14, 0, 6)


def test_everybody_found_in_an_image_that_shows_nobody_is_false(truth_m: np.ndarray) -> None:
    """Both left the room for four images; the tracker keeps them where they are in three. Later one is behind the other."""
    seen_px, estimates_m = np.full((FRAMES, 2), 100), truth_m.copy()
    seen_px[1:5], seen_px[7, 1], estimates_m[1] = 0, 0, np.nan
    one = figures([matched(truth_m, estimates_m, seen_px)], 0)
    assert (one["empty_images"], one["empty_images_with_people"], one["empty_share"]) == (4, 3, 3 / 4)
    assert (one["seen"], one["false"], one["people_precision"]) == (11, 6, 11 / 17)


def test_nobody_found_is_everybody_missed(truth_m: np.ndarray) -> None:
    found = matched(truth_m, np.empty((FRAMES, 0, 15, 3)))
    one = figures([found], 0)
    assert one["people_recall"] == one["map_10cm"] == one["idf1"] == 0
    assert one["people_precision"] is None and one["mean_error_cm"] is None
    for name in ("people_recall", "map_10cm", "mota", "idf1"):
        low, high = by_kind([found, matched(truth_m, truth_m)] * 3, 0)["all"]["interval"][name]
        assert low < 0.2 and high > 0.8 and one["interval"][name] is None


def test_a_person_is_found_whose_centre_is_within_30_cm(truth_m: np.ndarray) -> None:
    for offset_m, recall in ((0.29, 1), (0.31, 0)):
        one = figures([matched(truth_m[:, :1], truth_m[:, :1] + np.float32((0, 0, offset_m)))], 0)
        assert one["people_recall"] == recall and one["false"] == (1 - recall) * FRAMES and one["map_10cm"] == 0
    moved_limb = truth_m[:, :1].copy()
    moved_limb[:, :, 0] += np.float32((0, 0, 3))  # the centre by 3 m / 15
    one = figures([matched(truth_m[:, :1], moved_limb)], 0)
    assert one["people_recall"] == 1 and one["map_10cm"] == pytest.approx(14 / 15)


def test_half_of_the_whole_body_is_judged_although_the_border_cuts_it(truth_m: np.ndarray) -> None:
    cut = replace(sequence(truth_m + np.float32((0, 2, 0)), np.tile((50, 49), (FRAMES, 1))), alone_px=None)
    cut = replace(cut, whole_px=np.full((FRAMES, 2), 100))
    found = match(cut, np.empty((0, FRAMES, 15, 3)), np.empty(0, int), 1.0)
    assert found.seen.all(axis=0).tolist() == [True, False] and found.hidden.all(axis=0).tolist() == [False, True]


def test_faults_are_named_by_their_cause(truth_m: np.ndarray) -> None:
    def named(estimates_m: np.ndarray) -> dict[str, int]:
        found = matched(truth_m, estimates_m)
        assert (wrong_joints(found) == wrong_joints(found)[0]).all()
        return causes(truth_m[0], found, 0)

    assert named(truth_m) == {}
    assert named(truth_m[:, :1]) == {"not found": 1}
    assert named(np.concatenate([truth_m, truth_m[:, :1] + np.float32((0, 0, 2))], axis=1)) == {"false person": 1}
    wrong = truth_m.copy()
    wrong[:, 1, 3:5] += np.float32((0, 0, 0.2))
    assert named(wrong) == {"wrong joints": 2}
    halves = truth_m[:, :1].copy()
    halves[:, 0, 7:] = truth_m[:, 1, 7:]
    assert named(halves) == {"two as one": 2, "false person": 1}  # its centre is between the two
    mostly_first = truth_m[:, :1].copy()
    mostly_first[:, 0, 12:] = truth_m[:, 1, 12:]
    assert named(mostly_first) == {"two as one": 1, "wrong joints": 3}


def test_a_mode_of_its_own_follows_and_estimators_of_one_person_are_refused() -> None:
    followed = {config: follower("one", config()).__self__.mode for config in (RealtimeConfig, BestConfig)}
    assert followed == {RealtimeConfig: "realtime", BestConfig: "best"}
    with pytest.raises(InputError, match="estimator mean: estimates one person"):
        follower("mean", MeanPoseConfig())
    with pytest.raises(InputError, match="start, model"):
        follower("tracker", TrackerEstimatorConfig(start="label"))


def test_the_report_of_a_film_has_tables_pictures_and_figures(tmp_path: Path) -> None:
    write_two_people(tmp_path / "set", frames=30)
    benchmark = BenchmarkConfig("two_people", str(tmp_path / "set"))
    config = EvaluateConfig(benchmark, {"tracker": TrackerEstimatorConfig()}, processes=1)
    report = evaluate_people(config, tmp_path / "out")
    write(report, config, tmp_path / "out")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert (
        metrics["switches"] == 0 and metrics["false"] == 0 and metrics["mean_error_cm"] < 12 and metrics["people_recall"] > 0.7
    )
    assert metrics["estimators"]["tracker"]["all"]["fps"] > 0 and metrics["benchmark"]["failed_sequences"] == {}
    assert "two_people: SIMULATED depth" in report.text() and "No intervals" in report.text()
    assert "CLEAR MOT" in (tmp_path / "out" / "report.md").read_text()
    assert (tmp_path / "out" / "people.png").exists() and (tmp_path / "out" / "worst.png").exists()
    assert 'srcdoc="&lt;!doctype html' in (tmp_path / "out" / "report.html").read_text()
    assert metrics["benchmark"]["extraction"] == "finder" and "extraction=finder finds the people" in report.text()
    with pytest.raises(InputError, match="leave"):
        evaluate_people(EvaluateConfig(benchmark, scorer={"paper": None}), tmp_path / "other")


def test_images_of_any_number_of_people_before_any_camera_are_reported(tmp_path: Path) -> None:
    """With the extraction that was asked for: in an image alone no person has moved, so Algorithm 1 finds none."""
    depth_mm, joints_m, pixels = draw_two_people(1)
    image = StoredSequence("room_0", "single image", 30.0, CAMERA, ("ann", "bob"), depth_mm, joints_m)
    both = replace(image, whole_px=pixels, seen_px=pixels)
    empty = replace(image, people=(), joints_m=joints_m[:, :0], whole_px=pixels[:, :0], seen_px=pixels[:, :0])
    portrait = Camera.centred(300.0, 120, 200)
    empty = replace(empty, kind="empty room", camera=portrait, depth=np.full((1, 200, 120), 3000, np.uint16))
    write_simulated(tmp_path / "set", "rooms", {"room_0": both, "room_1": empty, "room_2": both})
    benchmark = BenchmarkConfig("rooms", str(tmp_path / "set"))
    settings = {"processes": 1, "extraction": PaperExtractionConfig()}
    report = evaluate_people(EvaluateConfig(benchmark, {"tracker": TrackerEstimatorConfig()}, **settings), tmp_path / "out")
    assert report.metrics["benchmark"]["extraction"] == "paper"
    figures_of = report.metrics["estimators"]["tracker"]
    assert figures_of["single image"]["seen"] == 4 and figures_of["single image"]["people_recall"] == 0
    assert figures_of["empty room"]["empty_images"] == 1 and figures_of["empty room"]["people_recall"] is None
    assert (tmp_path / "out" / "worst.png").exists() and not (tmp_path / "out" / "worst.html").exists()


def test_another_identity_while_too_little_of_a_person_shows_is_no_switch(truth_m: np.ndarray) -> None:
    seen_px = np.full((FRAMES, 2), 100)
    seen_px[3:6, 0] = 49
    found = matched(truth_m, truth_m, seen_px)
    identity = found.identity.copy()
    identity[4, 0] = 9
    assert not replace(found, identity=identity).switches().any()
    identity[5:, 0] = 9
    assert np.argwhere(replace(found, identity=identity).switches()).tolist() == [[6, 0]]


def test_who_is_half_hidden_excuses_an_estimate_half_a_metre_around(truth_m: np.ndarray) -> None:
    seen_px = np.tile((49, 100), (FRAMES, 1))
    for offset_m, false in ((0.45, 0), (0.55, 1)):
        estimates_m = truth_m.copy()
        estimates_m[:, 0] += np.float32((0, 0, offset_m))
        assert (matched(truth_m, estimates_m, seen_px).false == false).all()


def test_an_estimate_beside_one_person_alone_is_not_two_as_one(truth_m: np.ndarray) -> None:
    estimates_m = truth_m.copy()
    estimates_m[:, 0] += np.float32((0, 0, 0.4))
    assert causes(truth_m[0], matched(truth_m, estimates_m), 0) == {"not found": 1, "false person": 1}


def test_an_empty_room_brings_no_advice_about_cameras_and_units(truth_m: np.ndarray, caplog) -> None:
    one, follow = SimpleNamespace(read=lambda _: sequence(truth_m)), follower("tracker", TrackerEstimatorConfig())
    found = matched_people(one, {"tracker": Timed(follow)}, "a")["tracker"]
    assert len(found.identities) == 0 and not caplog.text
    assert follow(sequence(truth_m).depth, CAMERA, 30.0) == [] and "no person was found" in caplog.text


def test_who_is_behind_the_camera_is_not_judged(truth_m: np.ndarray) -> None:
    found = matched(truth_m * np.float32([1, 1, -1]), np.empty((FRAMES, 0, 15, 3)))
    assert not found.seen.any() and not found.hidden.any()


def test_an_estimate_of_no_person_is_fifteen_wrong_joints(truth_m: np.ndarray) -> None:
    estimates_m = np.concatenate([truth_m, truth_m[:, :1] + np.float32((0, 0, 2))], axis=1)
    estimates_m[:, 1, 3:5] += np.float32((0, 0, 0.2))
    assert (wrong_joints(matched(truth_m, estimates_m)) == 2 + 15).all()


def test_who_is_out_of_view_is_not_hidden(truth_m):
    seen_px, leaving = np.full((FRAMES, 2), 100), truth_m.copy()
    seen_px[3:6, 0] = 49
    leaving[4:, 1] += np.float32((5, 0, 0))
    estimates_m = leaving.copy()
    estimates_m[4:, 1] = np.nan
    one = figures([matched(leaving, estimates_m, seen_px)], 0)
    assert (one["hidden"], one["hidden_map_10cm"], one["hidden_mean_error_cm"]) == (3, 1, 0)
