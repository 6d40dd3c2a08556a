"""The evaluation of dance scores: from a folder of dances to Table 2, with and without estimators."""

import csv
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest

from kpopnet.benchmarks import kpop_evaluation, kpop_poses, kpop_report
from kpopnet.benchmarks.evaluation import EvaluateConfig
from kpopnet.benchmarks.kpop import KpopConfig, KpopSet
from kpopnet.benchmarks.kpop_evaluation import run_dances
from kpopnet.benchmarks.kpop_pictures import score_by_rank
from kpopnet.benchmarks.kpop_poses import PoseCache
from kpopnet.benchmarks.kpop_report import evaluate_dances
from kpopnet.benchmarks.kpop_scores import confusions
from kpopnet.benchmarks.kpop_writing import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.benchmarks.sweep import AxisConfig, SweepConfig
from kpopnet.camera import Camera
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS
from kpopnet.errors import InputError
from kpopnet.estimators import Estimate
from kpopnet.skeleton import Joint
from kpopnet.tracker.estimator import TrackerEstimatorConfig

ROOT = Path(__file__).parents[2]
CAMERA = Camera.centred(20.0, 24, 20)
SECONDS, FPS = 4.0, 20.0
TIMES_S = np.arange(SECONDS * FPS) / FPS
LEARNERS = ("ann", "bob", "cho", "dee")


def danced_m(noise_m: float, seed: int) -> np.ndarray:
    """(T, 15, 3): a body whose arms and legs swing, and noise that is slow."""
    rng = np.random.default_rng(0)
    body = np.array(
        [
            *((0, -0.6, 2.5), (0, -0.45, 2.5), (-0.17, -0.35, 2.5), (0.17, -0.35, 2.5), (-0.3, -0.1, 2.5), (0.3, -0.1, 2.5)),
            *((-0.4, 0.1, 2.4), (0.4, 0.1, 2.4), (0, -0.1, 2.5), (-0.1, 0.1, 2.5), (0.1, 0.1, 2.5), (-0.15, 0.5, 2.45)),
            *((0.15, 0.5, 2.45), (-0.15, 0.9, 2.5), (0.15, 0.9, 2.5)),
        ]
    )
    limbs = [4, 5, 6, 7, 11, 12, 13, 14]
    joints = np.tile(body, (len(TIMES_S), 1, 1))
    joints[:, limbs] += 0.15 * np.sin(2 * np.pi * (TIMES_S[:, None, None] * rng.uniform(0.3, 0.8, (8, 3)) + rng.random((8, 3))))
    own = np.random.default_rng([seed, 1])
    swing = np.sin(2 * np.pi * (TIMES_S[:, None, None] * own.uniform(0.2, 0.5, (15, 3)) + own.random((15, 3))))
    return (joints + noise_m * swing).astype(np.float32)


def write_one(folder: Path, name: str, noises_m: tuple[float, ...]) -> None:
    write_teacher(folder / name, Performance(danced_m(0, 0), TIMES_S))
    for number, (learner, noise_m) in enumerate(zip(LEARNERS, noises_m, strict=True)):
        depth = PackedDepth(CAMERA)
        for frame in range(len(TIMES_S)):
            image = np.zeros((CAMERA.height, CAMERA.width), np.float32)
            image[4:16, 8:14] = 2 + 0.001 * (frame % 7) + 0.01 * number
            depth.add(image)
        write_learner(folder / name, learner, TIMES_S, danced_m(noise_m, number + 7), depth)
    write_labels(folder / name, LEARNERS)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two dances; in the second, bob and cho are labelled in the wrong order."""
    write_one(tmp_path / "set", "mama", (0.0, 0.04, 0.09, 0.16))
    write_one(tmp_path / "set", "papa", (0.0, 0.09, 0.04, 0.16))
    return tmp_path / "set"


@dataclass(frozen=True)
class FakeConfig:
    offset_m: float = 0.0
    weights: str | None = None
    arm: float | None = None


class Fake:
    """Knows the truth by the depth that each learner has; with `arm` it has lost the left arm and is so sure of it."""

    name = "fake"
    calls = 0

    def __init__(self, config: FakeConfig) -> None:
        self.config = config

    def estimate(self, depth_m: np.ndarray, camera: Camera) -> Estimate:
        type(self).calls += 1
        number = round((depth_m[0].max() - 2) / 0.01)
        noise_m = (0.0, 0.04, 0.09, 0.16)[number]
        joints_m = danced_m(noise_m, number + 7)[: len(depth_m)] + np.float32(self.config.offset_m)
        confidence = np.ones(joints_m.shape[:2], np.float32)
        if self.config.arm is not None:
            lost = [Joint.LEFT_ELBOW, Joint.LEFT_HAND]
            joints_m[:, lost], confidence[:, lost] = joints_m[:, [Joint.RIGHT_HAND, Joint.RIGHT_ELBOW]], self.config.arm
        return Estimate(joints_m, confidence)


@pytest.fixture
def fake(monkeypatch) -> type[Fake]:
    Fake.calls = 0
    monkeypatch.setattr(kpop_poses, "build_estimators", lambda configs: {n: Fake(c) for n, c in configs.items()})
    return Fake


def run(folder: Path, estimators: dict, **changed):
    asked = {"scorers": SCORERS, "poses": folder / "poses", "count": None, "seed": 0, "processes": 1} | changed
    return run_dances(KpopSet(folder), estimators, **asked)


def test_true_joints_are_ordered_as_they_should_be(folder):
    found = run(folder, {})
    assert list(found.scores) == ["truth"] and list(found.scores["truth"]) == ["dance22", "raptis"]
    judged = found.agreements["truth"]["dance22"]
    assert judged.concordance == 50 and judged.wrong == ("papa",) and judged.kendall_tau == pytest.approx((1 + 4 / 6) / 2)
    best = found.scores["truth"]["dance22"]["mama"][0]
    assert best.name == "ann" and best.score.similarity > 90 and best.error_m is None


def test_an_estimator_stands_beside_the_truth_and_its_poses_are_kept(folder, fake):
    found = run(folder, {"fake": FakeConfig(0.1)})
    assert list(found.scores) == ["truth", "fake"] and found.fps["fake"] > 0
    # All of a body moved by as much is the same dance.
    one, other = (found.scores[source]["dance22"]["mama"] for source in ("truth", "fake"))
    for a, b in zip(one, other, strict=True):
        assert b.score.similarity == pytest.approx(a.score.similarity, abs=0.5)
    assert other[2].error_m == pytest.approx(0.1 * np.sqrt(3), rel=1e-3)
    calls = fake.calls
    again = run(folder, {"fake": FakeConfig(0.1)}, scorers={"raptis": SCORERS["raptis"]})
    assert fake.calls == calls and again.agreements["fake"]["raptis"] == found.agreements["fake"]["raptis"]
    run(folder, {"fake": FakeConfig(0.2)})
    assert fake.calls > calls


def test_what_an_estimator_is_not_sure_of_counts_for_less(folder, fake):
    best = {}
    for arm in (None, 0.0, 0.1, 1.0):
        found = run(folder, {"fake": FakeConfig(arm=arm)}, scorers={"dance22": SCORERS["dance22"]})
        best[arm] = found.scores["fake"]["dance22"]["mama"][0].score.similarity
    assert best[1.0] + 10 < best[0.1] < best[0.0] == pytest.approx(best[None], abs=1)


def test_poses_are_kept_by_what_they_depend_on(folder, fake, tmp_path):
    weights = tmp_path / "weights"
    weights.write_bytes(b"one")
    folders = [PoseCache(tmp_path, "fake", FakeConfig(0.1, str(weights))).folder]
    moved = tmp_path / "elsewhere"
    moved.write_bytes(b"one")
    assert PoseCache(tmp_path, "fake", FakeConfig(0.1, str(moved))).folder == folders[0]
    weights.write_bytes(b"two")
    folders.append(PoseCache(tmp_path, "fake", FakeConfig(0.1, str(weights))).folder)
    folders.append(PoseCache(tmp_path, "fake", FakeConfig(0.3, str(weights))).folder)
    assert len(set(folders)) == 3


def test_other_depth_is_estimated_anew_and_torn_poses_are_named(folder, fake):
    run(folder, {"fake": FakeConfig()})
    calls = fake.calls
    write_one(folder, "papa", (0.0, 0.09, 0.04, 0.2))  # the depth is the same, the truth is another
    run(folder, {"fake": FakeConfig()})
    assert fake.calls == calls
    torn = next((folder / "poses").glob("*/mama.ann.*.npz"))
    whole = torn.read_bytes()
    for part in (whole[:100], b""):
        torn.write_bytes(part)
        found = run(folder, {"fake": FakeConfig()})
        assert "not whole" in found.failed["mama"] and list(found.scores["truth"]["dance22"]) == ["papa"]


def test_corrected_times_need_no_other_poses(folder, fake):
    late = run(folder, {"fake": FakeConfig()}).scores["fake"]["dance22"]["mama"][0].score
    calls = fake.calls
    path = folder / "mama" / "ann.h5"
    with h5py.File(path, "a") as file:
        file["times_s"][:] = TIMES_S + 0.3
    moved = run(folder, {"fake": FakeConfig()}).scores["fake"]["dance22"]["mama"][0].score
    assert fake.calls == calls and moved.timing < late.timing - 10
    with h5py.File(path, "a") as file:
        del file["times_s"]
        del file["joints_m"]
        file["times_s"] = TIMES_S[:-1]
    assert "ann.h5: 80 frames but 79 times_s" in run(folder, {"fake": FakeConfig()}).failed["mama"]


def test_poses_depend_on_all_of_a_models_folder(tmp_path, fake):
    model = tmp_path / "model"
    model.mkdir()
    folders = set()
    for name in ("trees.safetensors", "model.safetensors", "meta.json"):
        for text in ("one", "two"):
            (model / name).write_text(text)
            folders.add(PoseCache(tmp_path, "fake", FakeConfig(weights=str(model))).folder)
    assert len(folders) == 6
    (model / "state.pt").write_text("what only further training needs")
    moved = model.rename(tmp_path / "elsewhere")
    assert PoseCache(tmp_path, "fake", FakeConfig(weights=str(moved))).folder in folders


def test_poses_depend_on_the_code_that_estimators_share(folder, fake, tmp_path, monkeypatch):
    read, seen = Path.read_bytes, set()
    monkeypatch.setattr(Path, "read_bytes", lambda path: seen.add(path.name) or read(path))
    PoseCache(tmp_path, "fake", FakeConfig(0.1))
    # A tree walk crops as a network does, and a tracker may ask one.
    assert {"camera.py", "estimators.py", "cube.py", "dense.py", "ridge.py", "skeleton.py"} <= seen
    # What reads a model, builds an estimator of it and unpacks the depth.
    assert {"checkpoint.py", "registry.py", "kpop_format.py"} <= seen


def test_a_faulty_dance_takes_no_other_with_it(folder, fake):
    (folder / "mama" / "labels.csv").write_text("")
    found = run(folder, {"fake": FakeConfig()})
    assert "empty" in found.failed["mama"] and list(found.scores["fake"]["dance22"]) == ["papa"]
    (folder / "papa" / "dee.h5").write_bytes(b"torn")
    with pytest.raises(InputError, match=r"none of 2 dances can be scored; .*labels\.csv"):
        run(folder, {"fake": FakeConfig()})


def test_what_nobody_foresaw_takes_its_dance_alone_too(folder, fake, monkeypatch, caplog):
    estimate = fake.estimate

    def faulty_once(self, depth_m, camera):
        found = estimate(self, depth_m, camera)
        if fake.calls == 2:  # the first is to warm up
            raise ZeroDivisionError("no such luck")
        return found

    monkeypatch.setattr(fake, "estimate", faulty_once)
    found = run(folder, {"fake": FakeConfig()})
    assert found.failed == {"mama": "fake: ZeroDivisionError: no such luck"}
    assert list(found.scores["fake"]["dance22"]) == ["papa"] and "Traceback" in caplog.text

    monkeypatch.setattr(kpop_evaluation, "score_dance", lambda *asked: 1 / 0)
    with pytest.raises(InputError, match=r"none of 2 dances can be scored; .*ZeroDivisionError: division by zero"):
        run(folder, {})


def test_trackers_begin_with_whoever_stands_there(folder, monkeypatch):
    built = []

    def build(configs):
        built.extend(configs.values())
        return {name: Fake(FakeConfig()) for name in configs}

    monkeypatch.setattr(kpop_poses, "build_estimators", build)
    found = run(folder, {"tracker": TrackerEstimatorConfig()}, count=1)
    assert all(config.start == "standing" for config in built)
    assert any("start=standing" in line for line in found.assumed)


def test_the_report_holds_what_was_promised(folder, fake, tmp_path):
    benchmark = KpopConfig(path=str(folder))
    config = EvaluateConfig(benchmark, {"fake": FakeConfig(0.05)}, scorer=dict(SCORERS), processes=1)
    evaluate_dances(config, tmp_path / "out")
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["estimator"] == "fake" and metrics["scorer"] == "dance22" and metrics["concordance"] == 100
    assert metrics["estimators"]["truth"]["concordance"] == 50
    for source in ("truth", "fake"):
        one = metrics["estimators"][source]
        assert set(one["scorers"]) == {"dance22", "raptis"} and set(one["interval"]) == {"concordance", "kendall_tau"}
        assert one["concordance"] == one["scorers"]["dance22"]["concordance"] and -1 <= one["kendall_tau"] <= 1
    assert metrics["benchmark"]["origin"] == "real" and metrics["benchmark"]["dances"] == 2
    report = (tmp_path / "out" / "report.md").read_text()
    assert "REAL learners of 2 dances" in report and "SIMULATED" not in report
    assert "Read by estimators: fake no file; code" in report and metrics["files"] == {"fake": {}}
    assert "papa" in report.split("## Table 2")[1] and "✗" in report and "2 and 3" in report
    with (tmp_path / "out" / "table_2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 2 * 4 and {row["joints"] for row in rows} == {"truth", "fake"}
    for picture in ("score_by_rank.png", "timelines.png"):
        assert (tmp_path / "out" / picture).stat().st_size > 10_000
        assert picture in (tmp_path / "out" / "report.html").read_text()


def test_what_is_cut_is_said_and_dances_are_counted(folder, monkeypatch):
    found = run(folder, {})
    titles = [panel.get_title() for panel in score_by_rank(found).axes]
    assert titles[0] == "dance22, truth: 1 of 2"
    monkeypatch.setattr(kpop_report, "SHOWN_CONFUSIONS", 1)
    pairs = len(confusions(found.scores["truth"]["dance22"], None))
    texts = [content for kind, content in kpop_report.confusion_blocks(found, "truth", "dance22") if kind == "text"]
    assert pairs == 1 and not texts
    swapped = {name: learners[::-1] for name, learners in found.scores["truth"]["dance22"].items()}
    found.scores["truth"]["dance22"] = swapped
    (kind, text), (_, (_, rows)) = kpop_report.confusion_blocks(found, "truth", "dance22")[1:]
    assert kind == "text" and text == "1 of 11 pairs, the widest apart first." and len(rows) == 1


def test_another_dance_is_drawn_where_the_one_asked_for_failed(folder, tmp_path):
    (folder / "mama" / "teacher.h5").write_bytes(b"torn")
    evaluate_dances(EvaluateConfig(KpopConfig(path=str(folder), dance="mama"), {}, processes=1), tmp_path / "out")
    report = (tmp_path / "out" / "report.md").read_text()
    assert "papa over time" in report and "benchmark.dance=mama failed and cannot be drawn" in report
    assert "Read by estimators: nothing; code" in report


def test_a_dance_that_is_to_be_drawn_must_be_there(folder, fake, tmp_path):
    for name, dances, message in (
        ("nobody", None, "dance=nobody: not among the 2 dances that are to be scored; there are mama, papa"),
        ("papa", 1, "dance=papa: not among the 1 dances that are to be scored; raise benchmark.dances"),
    ):
        config = EvaluateConfig(KpopConfig(path=str(folder), dance=name, dances=dances), {"fake": FakeConfig()}, processes=1)
        with pytest.raises(InputError, match=message):
            evaluate_dances(config, tmp_path / "out")
    assert fake.calls == 0
    with pytest.raises(InputError, match=r"benchmark\.dances=0"):
        KpopConfig(dances=0)


def test_what_only_benchmarks_of_joints_have_is_refused(folder, tmp_path):
    axis = AxisConfig("hierarchy.r_m", [0.1, 0.2])
    for given, said in (({"sequences": 4}, "sequences=4: .*benchmark.dances"), ({"sweep": SweepConfig(axis, axis)}, "sweep: ")):
        with pytest.raises(InputError, match=said):
            evaluate_dances(EvaluateConfig(KpopConfig(path=str(folder)), {}, processes=1, **given), tmp_path / "out")


def test_a_set_without_true_joints_needs_an_estimator(folder):
    for path in folder.glob("*/*.h5"):
        if path.name != "teacher.h5":
            learner = next(one for one in KpopSet(folder).dance(path.parent.name).learners if one.name == path.stem)
            clip = learner.depth()
            depth = PackedDepth(clip.camera)
            for image in clip.depth_m:
                depth.add(image)
            write_learner(path.parent, path.stem, clip.times_s, None, depth)
    with pytest.raises(InputError, match=r"a learner of mama has no true joints \(2 of 2 .*; give an estimator"):
        run(folder, {})


def test_a_learner_without_true_joints_is_named(folder, fake):
    with h5py.File(folder / "papa" / "bob.h5", "a") as file:
        del file["joints_m"]
    found = run(folder, {"fake": FakeConfig()})
    assert list(found.scores) == ["fake"]
    assert found.assumed == [
        "Scores on true joints are left out: a learner of papa has no true joints (1 of 2 dances are without)."
    ]
    with pytest.raises(InputError, match=r"a learner of papa has no true joints .*; give an estimator"):
        run(folder, {})


def test_evaluate_py_judges_a_set(folder, tmp_path):
    command = [sys.executable, "evaluate.py", "benchmark=kpop", f"benchmark.path={folder}", "estimator=[]", "processes=1"]
    done = subprocess.run(
        [*command, "scorer=[raptis]", f"hydra.run.dir={tmp_path}/out"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert ["truth", "raptis"] in [line.split()[:2] for line in done.stdout.splitlines()]
    assert (tmp_path / "out" / "report.html").is_file()
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert list(metrics["estimators"]) == ["truth"] and list(metrics["estimators"]["truth"]["scorers"]) == ["raptis"]
