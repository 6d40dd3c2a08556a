"""The program `kpopnet rate`: killed while it serves, its report, and ranks from ratings."""

import json
import signal
import subprocess
import sys
import urllib.request
from functools import partial

import numpy as np
import pytest
from dance_people import dance_joints_m, performed
from programs import ROOT
from rated_sets import SKILLS_M as SKILLS
from rated_sets import answered, write_set

import kpopnet.programs.rate
from kpopnet.camera import CAMERAS
from kpopnet.datasets.dances.dance_set import LABELS, KpopSet
from kpopnet.datasets.dances.ratings import all_pairs, ratings_path, read_ratings, write_ratings
from kpopnet.datasets.dances.writer import PackedDepth, write_labels, write_learner, write_teacher
from kpopnet.evaluation.dances.rating_report import rating_report
from kpopnet.runtime.folder_lock import locked

DANCES = {f"dance_{index}": sorted(SKILLS) for index in range(5)}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return write_set(tmp_path_factory.mktemp("set"), 5)


@pytest.fixture
def run(program):
    return partial(program, "rate")


def by_skill(pair) -> bool:
    return SKILLS[pair.left] < SKILLS[pair.right]


def test_the_report_and_the_ranks(made, run, tmp_path, monkeypatch):
    monkeypatch.setattr(kpopnet.programs.rate, "available_cores", lambda: 1)
    assert "no ratings yet" in run(made, "--report", fails=True)
    assert "--port -1: expected" in run(made, "--port", -1, fails=True)
    for rater in ("eve", "fay"):
        write_ratings(ratings_path(made, rater), answered(DANCES, rater, by_skill))
    by_side = answered(DANCES, "gil", lambda pair: pair.dance == "dance_0" or by_skill(pair))
    write_ratings(ratings_path(made, "gil"), by_side)
    told = run(made, "--write-labels")
    assert told.count("labelled: cyril, anna, boris") == 5
    ranked = KpopSet(made)
    assert all([one.name for one in ranked.dance(name).learners] == list(SKILLS) for name in ranked.names)
    text = run(made, "--report", "--out", tmp_path / "out")
    figures = json.loads((tmp_path / "out" / "ratings.json").read_text())
    assert figures["agreement"]["Kendall's W"]["dances"] == 5 and figures["joints"] == "truth"
    assert figures["raters"]["eve"]["same"]["value"] == 1 and figures["raters"]["gil"]["same"]["value"] < 1
    assert set(figures["scorers"]) == {"dance22", "paper", "raptis", LABELS} and figures["scorers"][LABELS]["tau"]["value"] == 1
    assert figures["scorers"]["dance22"]["pairs"]["value"] > 0.8
    with monkeypatch.context() as changed:
        changed.setattr("kpopnet.evaluation.dances.rating_report.rating_report", None)  # not called: it may take minutes
        assert "and is no folder" in run(made, "--report", "--out", tmp_path / "out" / "ratings.json", fails=True)
    page = (tmp_path / "out" / "ratings.html").read_text()
    assert all(word in text and word in page for word in ("Krippendorff", "eve", "dance22"))
    write_labels(made / "dance_0", sorted(SKILLS))  # ranks that another program wrote
    before = {name: (made / name / LABELS).read_bytes() for name in DANCES}
    write_ratings(ratings_path(made, "gil"), answered(DANCES, "gil", lambda pair: not by_skill(pair)))
    assert run(made, "--write-labels").count("which stays") == len(before)
    assert before == {name: (made / name / LABELS).read_bytes() for name in before}


def test_a_dance_with_a_damaged_file_is_left_out_by_the_scorers_and_counts_for_the_raters(run, tmp_path, monkeypatch):
    monkeypatch.setattr(kpopnet.programs.rate, "available_cores", lambda: 1)
    write_set(tmp_path / "set")
    (tmp_path / "set" / "dance_1" / "anna.h5").write_bytes(b"no joints")
    write_ratings(ratings_path(tmp_path / "set", "eve"), answered(dict(list(DANCES.items())[:2]), "eve", by_skill))
    text = run(tmp_path / "set", "--report", "--out", tmp_path / "out")
    figures = json.loads((tmp_path / "out" / "ratings.json").read_text())
    assert "2 of them compared completely" in text and "Left out by the scorers because of an error: dance_1: " in text
    assert figures["joints"] == "truth" and figures["scorers"]["dance22"]["tau"]["dances"] == 1


@pytest.mark.parametrize(("source", "told"), [("truth", "the true joints"), ("best", "joints by mode best of the package")])
def test_the_report_says_whose_joints_were_scored(made, monkeypatch, source, told):
    monkeypatch.setattr("kpopnet.evaluation.dances.rating_report.scorers_signs", lambda *_: (source, {}, {}))
    blocks, figures = rating_report(KpopSet(made, ranked=False), {"eve": answered(DANCES, "eve", by_skill)}, 0, 1)
    assert f"Scorers had {told}." in blocks and figures["joints"] == source


def test_learners_without_true_joints_are_shown_with_joints_by_mode_best(tmp_path):
    joints_m, depth = dance_joints_m(0, seconds=0.1), PackedDepth(CAMERAS["kinect_v1"])
    for _ in joints_m:
        depth.add(np.full((80, 30), 2.5), 140, 60)
    write_teacher(tmp_path / "mama", performed(joints_m))
    for name in ("ann", "bo"):
        write_learner(tmp_path / "mama", name, np.arange(len(joints_m)) / 30, depth=depth)
    dance = KpopSet(tmp_path, ranked=False).dance("mama")
    assert kpopnet.programs.rate.shown_joints(dance, dance.learners[0]).joints_m.shape == joints_m.shape


def test_what_was_answered_before_a_kill_is_kept(made, tmp_path):
    pytest.importorskip("aiohttp", reason="the extra app is not installed")
    for name in DANCES:
        (tmp_path / name).symlink_to(made / name)
    command = [sys.executable, "-m", "kpopnet.cli", "rate", str(tmp_path), "--no-browser", "--port", "0"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            address = process.stdout.readline().removeprefix("rate at ").split()[0]
            for done in range(3):
                content = json.dumps({"rater": "eve", "done": done, "choice": "left"}).encode()
                with urllib.request.urlopen(f"{address}api/answer", content, timeout=60) as answer:
                    assert answer.status == 200
        finally:
            process.send_signal(signal.SIGKILL)  # else the end of this block would wait for a server that goes on
    path = ratings_path(tmp_path, "eve")
    kept = read_ratings(path, DANCES)
    assert [one.pair for one in kept] == [one.pair for one in all_pairs(DANCES, "eve", 0)[:3]]
    with locked(path.parent):  # another server may go on
        assert len(list(path.parent.glob("*.json"))) == 1
