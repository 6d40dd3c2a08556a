"""Evaluation of dance scores: from a folder of dances to Table 2, with and without estimators."""

import csv
import json
import os
import shutil
import socket
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest
from dance_people import dance_joints_m, noisy

from kpopnet.camera import Camera
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS
from kpopnet.datasets.dances.dance_set import KpopConfig, KpopSet
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.evaluation.dances import pose_cache
from kpopnet.evaluation.dances.pose_cache import PoseCache
from kpopnet.evaluation.dances.ranking import similarities
from kpopnet.evaluation.dances.report import (
    agreement_table,
    dance_metrics,
    evaluate_dances,
    learners_table,
    mean_error_cm,
    paired_table,
    rank_table,
    remarks,
    score_by_rank,
    table_2,
    timelines,
)
from kpopnet.evaluation.dances.run import run_dances
from kpopnet.evaluation.registry import BestConfig, NetworkEstimatorConfig, RealtimeConfig
from kpopnet.evaluation.report import write
from kpopnet.pose.person import PersonEstimator
from kpopnet.tracker.estimator import TrackerEstimatorConfig

CAMERA = Camera.centred(20.0, 24, 20)
SECONDS, FPS = 4.0, 20.0
TIMES_S = np.arange(SECONDS * FPS) / FPS
LEARNERS = ("ann", "bob", "cho", "dee")
SCORERS_TOLD = {name: SCORERS[name] for name in ("dance22", "raptis")}


def dance_m(noise_m: float, seed: int) -> np.ndarray:
    """(T, 15, 3) joints in metres of one dance, with noise."""
    return noisy(dance_joints_m(0, SECONDS, FPS), noise_m, seed).astype(np.float32)


def write_dance(folder: Path, name: str, noises_m: tuple[float, ...]) -> None:
    write_teacher(folder / name, Performance(dance_m(0, 0), TIMES_S))
    for number, (learner, noise_m) in enumerate(zip(LEARNERS, noises_m, strict=True)):
        depth = PackedDepth(CAMERA)
        for frame in range(len(TIMES_S)):
            image = np.zeros((CAMERA.height, CAMERA.width), np.float32)
            image[4:16, 8:14] = 2 + 0.001 * (frame % 7) + 0.01 * number
            depth.add(image)
        write_learner(folder / name, learner, TIMES_S, dance_m(noise_m, number + 7), depth)
    write_labels(folder / name, LEARNERS)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A set of two dances; in the second, bob and cho are labelled in the wrong order."""
    write_dance(tmp_path / "set", "mama", (0.0, 0.04, 0.09, 0.16))
    write_dance(tmp_path / "set", "papa", (0.0, 0.09, 0.04, 0.16))
    return tmp_path / "set"


@dataclass(frozen=True)
class FakeConfig:
    offset_m: float = 0.0
    weights: str | None = None


class Fake:
    """Returns the true joints of the learner whose depth it gets."""

    name = "fake"
    calls = 0

    def __init__(self, config: FakeConfig) -> None:
        self.config = config

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        type(self).calls += 1
        number = round((depth_m[0].max() - 2) / 0.01)
        noise_m = (0.0, 0.04, 0.09, 0.16)[number]
        joints_m = dance_m(noise_m, number + 7)[: len(depth_m)] + np.float32(self.config.offset_m)
        confidence = np.ones(joints_m.shape[:2], np.float32)
        return Estimate(joints_m, confidence)


@pytest.fixture
def fake(monkeypatch) -> type[Fake]:
    Fake.calls = 0
    monkeypatch.setattr(pose_cache, "build_estimators", lambda configs: {n: Fake(c) for n, c in configs.items()})
    return Fake


def run(folder: Path, estimators: dict, **changed):
    fixed = {"poses": folder / "poses", "count": None, "seed": 0, "processes": 1}
    return run_dances(KpopSet(folder), estimators, **fixed | {"scorers": {"dance22": SCORERS["dance22"]}} | changed)


def test_scores_on_true_joints_follow_the_labels(folder):
    found = run(folder, {}, scorers=SCORERS)
    assert found.sources == ["truth"] and found.scorers == list(SCORERS)
    agreed = found.agreements["truth", "dance22"]
    assert agreed.concordance == 50 and agreed.wrong == ("papa",) and agreed.kendall_tau == pytest.approx((1 + 4 / 6) / 2)
    best = found.scores["truth", "dance22"]["mama"][0]
    assert best.name == "ann" and best.score.similarity > 90 and best.error_m is None
    table = rank_table(found)
    means = [cell.value for cell in table.rows[0][1:]]
    assert table.header == ["joints", *(f"rank {k}" for k in range(1, 5))] and means[0] > 90 and means[0] > means[1] > means[3]


def test_an_estimator_is_scored_beside_the_truth_and_its_poses_are_cached(folder, fake):
    found = run(folder, {"fake": FakeConfig(0.1)}, scorers=SCORERS_TOLD)
    assert found.sources == ["truth", "fake"] and found.fps["fake"] > 0
    # The same offset of all joints does not change the score.
    one, other = (found.scores[source, "dance22"]["mama"] for source in ("truth", "fake"))
    for a, b in zip(one, other, strict=True):
        assert b.score.similarity == pytest.approx(a.score.similarity, abs=0.5)
    assert other[2].error_m == pytest.approx(0.1 * np.sqrt(3), rel=1e-3)
    calls = fake.calls
    write_dance(folder, "papa", (0.0, 0.09, 0.04, 0.2))  # the same depth, other true joints
    again = run(folder, {"fake": FakeConfig(0.1)}, scorers={"raptis": SCORERS["raptis"]})
    assert fake.calls == calls and again.agreements["fake", "raptis"] == found.agreements["fake", "raptis"]
    with h5py.File(folder / "mama" / "ann.h5", "a") as file:
        file["times_s"][:] = TIMES_S + 0.3
    corrected = run(folder, {"fake": FakeConfig(0.1)}).scores["fake", "dance22"]["mama"][0].score
    assert fake.calls == calls and corrected.timing < other[0].score.timing - 10
    run(folder, {"fake": FakeConfig(0.2)})
    assert fake.calls > calls


def test_an_estimator_that_finds_no_joint_is_reported_and_not_scored(folder, fake, monkeypatch, caplog):
    monkeypatch.setattr(fake, "estimate", lambda self, depth_m, camera: Estimate.missing(len(depth_m)))
    found = run(folder, {"fake": FakeConfig()})
    assert all(np.isnan(one.score.similarity) for one in found.scores["fake", "dance22"]["mama"])
    assert "mama, ann: fake found no joint in any frame; not scored" in caplog.text
    assert any("no joint of 8 of 8 learners was found" in line for line in remarks(found))


def test_a_mode_of_films_is_told_the_rate_which_names_its_poses(folder, monkeypatch):
    estimator = PersonEstimator(Fake(FakeConfig()), "realtime")
    monkeypatch.setattr(estimator, "estimate", Fake(FakeConfig()).estimate)
    monkeypatch.setattr(pose_cache, "build_estimators", lambda configs: dict.fromkeys(configs, estimator))
    cache, dance = PoseCache(folder / "poses", "realtime", FakeConfig()), KpopSet(folder).dance("mama")
    cache.poses(dance, dance.learners[0])
    rate = round(1 / np.median(np.diff(TIMES_S)), 1)
    assert estimator.fps == pytest.approx(rate) and f".{rate:g}fps.npz" in cache.path(dance, dance.learners[0]).name


def test_what_means_nothing_in_a_set_is_not_claimed_of_it_and_dances_without_labels_are_told(folder):
    assert run(folder, {}).agreements["truth", "dance22"].interval["concordance"]
    (folder / "manifest.json").write_text(json.dumps({"simulated": True, "ordered": False, "independent": False}))
    (folder / "unranked").mkdir()
    shutil.copy(next(folder.glob("*/teacher.h5")), folder / "unranked")
    found = run(folder, {}, scorers=SCORERS_TOLD)
    told = " ".join(remarks(found))
    assert "mean nothing" in told and "no interval is given" in told and "86 of 100" not in told
    assert "1 dances without labels.csv" in told
    assert set(found.agreements["truth", "dance22"].interval.values()) == {None}
    assert paired_table(found).rows[0][-1].value is None


@pytest.mark.parametrize(("stated", "told"), [(5, "2 of 5 dances"), (1, "of 2 dances"), (-1, "of 2 dances")])
def test_a_set_has_at_least_the_dances_that_are_there_whatever_its_manifest_says(folder, stated, told):
    (folder / "manifest.json").write_text(json.dumps({"dances": stated}))
    found = run(folder, {})
    assert told in remarks(found)[0] and dance_metrics(found)["benchmark"]["dances_in_set"] == max(stated, 2)


def test_the_cache_folder_depends_on_settings_and_on_all_files_of_a_model(tmp_path, fake):
    model = tmp_path / "model"
    model.mkdir()
    folders = {PoseCache(tmp_path, "fake", FakeConfig(0.3, str(model))).folder}
    for name in ("trees.safetensors", "model.safetensors", "meta.json"):
        for text in ("one", "two"):
            (model / name).write_text(text)
            folders.add(PoseCache(tmp_path, "fake", FakeConfig(weights=str(model))).folder)
    assert len(folders) == 7
    (model / "state.pt").write_text("needed for further training only")
    moved = model.rename(tmp_path / "elsewhere")
    assert PoseCache(tmp_path, "fake", FakeConfig(weights=str(moved))).folder in folders
    kinds = [PoseCache(tmp_path, "mine", settings()).folder for settings in (RealtimeConfig, BestConfig)]
    assert kinds[0] != kinds[1]  # though their settings are equal


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc tells which processes have ended")
def test_what_a_killed_evaluation_left_beside_its_poses_is_removed(folder, fake):
    cache, dance = PoseCache(folder / "poses", "fake", FakeConfig()), KpopSet(folder).dance("mama")
    left, written = (f".mama.ann.npz.{socket.gethostname()}.{process}-1.tmp" for process in (99999999, os.getpid()))
    for name in (left, written):
        (cache.folder / name).touch()
    cache.poses(dance, dance.learners[0])
    assert {path.name for path in cache.folder.iterdir()} == {written, cache.path(dance, dance.learners[0]).name}


def test_a_folder_of_poses_that_cannot_be_made_is_told_before_anything_is_estimated(folder, fake):
    (folder / "poses").touch()
    with pytest.raises(OSError, match="poses"):
        run(folder, {"fake": FakeConfig()})
    assert fake.calls == 0


def test_a_faulty_dance_does_not_affect_the_others(folder, fake):
    (folder / "mama" / "labels.csv").write_text("")
    found = run(folder, {"fake": FakeConfig()})
    assert "labels.csv" in found.failed["mama"] and list(found.scores["fake", "dance22"]) == ["papa"]
    (folder / "papa" / "dee.h5").write_bytes(b"truncated")
    with pytest.raises(InputError, match=r"none of 2 gave figures; .*labels\.csv"):
        run(folder, {"fake": FakeConfig()})


def test_trackers_do_not_wait_for_the_y_pose(folder, monkeypatch):
    built = []
    monkeypatch.setattr(
        pose_cache, "build_estimators", lambda one: built.extend(one.values()) or {"tracker": Fake(FakeConfig())}
    )
    found = run(folder, {"tracker": TrackerEstimatorConfig(start="y_pose")}, count=1)
    assert [config.start for config in built] == ["auto"] and any("start=auto" in line for line in found.assumptions)


def test_an_estimator_that_sees_the_future_is_named(folder, monkeypatch):
    monkeypatch.setattr(pose_cache, "build_estimators", lambda one: dict.fromkeys(one, Fake(FakeConfig())))
    found = run(folder, {"realtime": RealtimeConfig(), "mine": BestConfig()}, count=1)
    assert "mine: uses images after the one it answers for; the other estimators do not." in remarks(found)


@pytest.mark.parametrize(("checkpoint", "noise", "told"), [("mine", "auto", 1), (None, "auto", 0), ("mine", "none", 0)])
def test_it_is_said_that_the_noise_of_another_checkpoint_is_not_its_own(folder, monkeypatch, checkpoint, noise, told):
    monkeypatch.setattr(pose_cache, "build_estimators", lambda one: {"network": Fake(FakeConfig())})
    estimators = {"network": NetworkEstimatorConfig(checkpoint=checkpoint)}
    found = run(folder, estimators, count=1, scorers={"dance22": PartScorer(noise=noise)})
    assert sum("network runs a given checkpoint" in line for line in found.assumptions) == told


def test_pictures_of_simulated_learners_say_so(folder):
    (folder / "manifest.json").write_text('{"name": "kpop_sim", "simulated": true, "about": "", "dances": 2}')
    found = run(folder, {})
    for figure in (score_by_rank(found), timelines(found, "mama")):
        assert figure.get_suptitle() == "kpop_sim (simulated)"


def test_the_report_has_all_its_parts(folder, fake, tmp_path):
    config = EvaluateConfig(KpopConfig(path=str(folder)), {"fake": FakeConfig(0.05)}, scorer=SCORERS_TOLD, processes=1)
    report = evaluate_dances(config, tmp_path / "out")
    write(report, config, tmp_path / "out")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["estimator"] == "fake" and metrics["scorer"] == "dance22" and metrics["concordance"] == 100
    assert metrics["estimators"]["truth"]["concordance"] == 50
    assert set(metrics["scorers"]) == set(SCORERS_TOLD) and set(metrics["interval"]) == {"concordance", "kendall_tau"}
    assert metrics["benchmark"]["origin"] == "real" and metrics["benchmark"]["dances"] == 2
    text = (tmp_path / "out" / "report.md").read_text()
    assert "REAL learners of 2 dances" in text and "SIMULATED" not in text and "dance22, raptis" in report.text()
    assert "papa" in text.split("## Table 2")[1] and "✗" in text
    rows = list(csv.DictReader((tmp_path / "out" / "table_2.csv").read_text().splitlines()))
    assert len(rows) == 2 * 2 * 2 * 4 and {row["joints"] for row in rows} == {"truth", "fake"}
    assert all((tmp_path / "out" / f"{plot}.png").stat().st_size > 10_000 for plot in ("score_by_rank", "timelines"))


@pytest.mark.parametrize(
    ("benchmark", "settings", "message"),
    [
        ({"dance": "papa", "dances": 1}, {}, "dance=papa: not among the 1 dances to be scored"),
        ({}, {"sequences": 4}, "sequences: .*benchmark.dances"),
        ({}, {"sweep": {"beta": [1]}}, "sweep: is for other benchmarks than kpop; leave it out"),
    ],
)
def test_settings_that_a_set_of_dances_cannot_have_are_refused(folder, tmp_path, benchmark, settings, message):
    config = EvaluateConfig(KpopConfig(path=str(folder), **benchmark), {}, processes=1, **settings)
    with pytest.raises(InputError, match=message):
        evaluate_dances(config, tmp_path / "out")


def test_a_learner_without_depth_is_named_with_what_can_be_scored(folder, fake):
    with h5py.File(folder / "papa" / "bob.h5", "a") as file:
        del file["depth_mm"], file.attrs["depth_key"]
    reason = run(folder, {"fake": FakeConfig()}).failed["papa"]
    assert reason == (
        f"fake: {folder / 'papa' / 'bob.h5'}: expected a recording depth_mm; only its true joints can be scored (estimator=[])"
    )


def test_a_learner_without_true_joints_is_reported(folder, fake):
    with h5py.File(folder / "papa" / "bob.h5", "a") as file:
        del file["joints_m"]
    found = run(folder, {"fake": FakeConfig()})
    assert found.sources == ["fake"]
    assert found.assumptions == [
        "Scores on true joints are left out: a learner of papa has no true joints (1 of 2 dances are incomplete)."
    ]
    with pytest.raises(InputError, match=r"a learner of papa has no true joints .*; give an estimator"):
        run(folder, {})


SEEN_BY_FILES = (
    *("dance/noise/table.py", "dance/performance.py", "programs/score.py", "teacher/library.py", "teacher/posing.py"),
    *("../synth/body/shape.py", "../synth/assets/body.npz"),
)
"""What of the package `kpopnet.programs.score.seen_teacher` calls, or takes constants from, and the simulation."""


@pytest.mark.parametrize("changed", SEEN_BY_FILES)
def test_a_teacher_is_seen_again_once_what_poses_or_draws_them_has_changed(folder, fake, tmp_path, monkeypatch, changed):
    (tmp_path / "kpopnet").mkdir()
    for name in SEEN_BY_FILES:
        file = tmp_path / "kpopnet" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"before")
    monkeypatch.setattr(pose_cache.kpopnet, "__file__", str(tmp_path / "kpopnet" / "__init__.py"))
    asked, dance = [], KpopSet(folder).dance("mama")

    def see(teacher, *_):
        asked.append(teacher)
        return teacher

    cache = PoseCache(tmp_path / "poses", "fake", FakeConfig())
    for content, times in ((b"before", 1), (b"after", 2), (b"after", 2)):
        (tmp_path / "kpopnet" / changed).write_bytes(content)
        cache.seen_teacher(dance, see)
        assert len(asked) == times


def test_learners_are_compared_with_teachers_as_their_estimator_sees_them(folder, fake):
    asked = []

    def see(teacher, name, estimator):
        asked.append((name, estimator.name))
        return Performance(dance_m(0.04, 7), teacher.times_s, estimator=f"{name}_seen_teacher")

    settings = {"network": FakeConfig(), "tracker": FakeConfig()}
    plain, seen = (run(folder, settings, see_teacher=one) for one in (None, see))
    assert asked == [("network", "fake")] * 2  # once for each dance
    assert run(folder, settings, see_teacher=see).scores["network", "dance22"]["mama"][0].score.similarity < 100
    assert len(asked) == 2  # cached
    for source, is_same in (("truth", True), ("tracker", True), ("network", False)):
        before, after = (one.scores[source, "dance22"]["mama"][1].score for one in (plain, seen))
        assert (before.similarity == after.similarity) is is_same, source
    assert seen.scores["network", "dance22"]["mama"][1].score.scorer.noise == "network_seen_teacher"
    assert (
        "sees them in the mean of SIMULATED people: network; with the teachers' own joints: truth, tracker"
        in seen.assumptions[0]
    )
    path = next((folder / "poses").glob("network-*/mama.teacher.*.npz"))
    path.write_bytes(b"no file")
    with pytest.raises(InputError, match=r"no dance could be scored|damaged"):
        run(folder, settings, see_teacher=see, count=1)


def test_every_table_of_dances_holds_each_methods_own_figures(folder, fake):
    found = run(folder, {"fake": FakeConfig(0.1)}, scorers=SCORERS_TOLD)
    for dance, rank, name, scorer, source, *figures, error_cm in learners_table(found).rows:
        one = found.scores[source, scorer][dance][rank - 1]
        assert name == one.name and figures == [f"{v:.4f}" for v in (one.score.similarity, one.score.timing, one.score.posture)]
        assert error_cm == ("" if one.error_m is None else f"{100 * one.error_m:.2f}")
    errors_m = [one.error_m for learners in found.scores["fake", "dance22"].values() for one in learners]
    assert mean_error_cm(found, "fake") == pytest.approx(100 * np.mean(errors_m)) and mean_error_cm(found, "truth") is None
    table = table_2(found)
    for name, *cells in table.rows:
        for column, text in zip(table.header[1:], cells, strict=True):
            scorer, source = column.split(", ")
            assert text.removesuffix(" ✗") == "  ".join(f"{v:.1f}" for v in similarities(found.scores[source, scorer][name]))
    for source, scorer, concordance, tau, *_ in agreement_table(found).rows:
        one = found.agreements[source, scorer]
        assert (concordance.value, tau.value) == (one.concordance, one.kendall_tau)
        assert (concordance.interval, tau.interval) == (one.interval["concordance"], one.interval["kendall_tau"])


def test_frames_per_second_are_frames_divided_by_seconds(folder, fake, monkeypatch):
    monkeypatch.setattr(PoseCache, "poses", lambda self, dance, learner: (learner.joints(), 2.0))
    assert run(folder, {"fake": FakeConfig()}).fps["fake"] == pytest.approx(len(TIMES_S) / 2)
