"""The program `kpopnet score`: two files in, a page and JSON out."""

import argparse
import base64
import json
import re
import sys
from dataclasses import asdict
from functools import partial

import numpy as np
import pytest
from dance_people import dance_joints_m
from teacher_page import english

from kpopnet.dance.diagnosis import corrected
from kpopnet.dance.feedback import feedback
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.languages import keyed
from kpopnet.programs.arguments import weight
from kpopnet.skeleton import JOINT_NAMES, Joint


@pytest.fixture
def run(program, tmp_path):
    """Scores two files, into the folder `out`."""
    return partial(program, "score", "--out", tmp_path / "out")


def stored(folder) -> dict:
    """What the JSON file of a score holds."""
    return json.loads((folder / "out" / "score.json").read_text())


def on_page(folder) -> dict:
    """What the page of a score is given."""
    return json.loads(re.search(r'id="given">(.*?)</script>', (folder / "out" / "score.html").read_text())[1])


@pytest.fixture
def files(tmp_path):
    """A teacher, and a learner whose left arm stays down from 5 s to 8 s, at 30 frames per second."""
    joints_m = dance_joints_m(3)
    learner_m = joints_m.copy()
    learner_m[150:240, [Joint.LEFT_ELBOW, Joint.LEFT_HAND]] = learner_m[150:240, [Joint.LEFT_SHOULDER]] + [
        [0.02, 0.28, 0.0],
        [0.04, 0.55, -0.05],
    ]
    for name, dance_m in (("teacher", joints_m), ("learner", learner_m)):
        np.savez(tmp_path / f"{name}.npz", joints_m=dance_m, fps=30)
    return tmp_path / "teacher.npz", tmp_path / "learner.npz", joints_m, learner_m


def test_the_page_holds_both_movements_and_the_json_the_score(files, run, tmp_path):
    teacher, learner, joints_m, learner_m = files
    printed = run(teacher, learner)
    expected = score_dance(joints_m, learner_m, fps=30)
    assert f"similarity {expected.similarity:.0f}, timing" in printed and "warning" not in printed
    told = feedback(expected)
    assert told.faults[0].part == "left arm" and all(phrase.moments[0].text in printed for phrase in told.phrases[1:2])
    assert "0:00 to 0:04, 100: no fault stands out" in printed and printed.count(" to 0:") >= 3

    page = (tmp_path / "out" / "score.html").read_text()
    assert not re.search(r"""https?://|<link|src=|from "\.""", page) and page.count("<script") == 3
    given = on_page(tmp_path)
    assert given["found"]["name"] == "learner.npz after teacher.npz"
    assert given["found"]["total"] == round(expected.similarity, 3) and given["found"]["hints"] == []
    shown = [(one["start_s"], one["total"]) for one in given["found"]["phrases"]]  # which the page rounds once more
    assert shown == [(round(one.start_s, 3), round(one.similarity, 3)) for one in told.phrases]
    assert given["found"]["faults"][0] == keyed(told.faults[0].text)
    assert [one["text"] for one in given["found"]["phrases"][1]["moments"]] == [
        keyed(one.text) for one in told.phrases[1].moments
    ]
    frames = len(joints_m) - 1  # resampled at half-open intervals
    assert all(len(base64.b64decode(given[one]["hips_m"])) // 12 >= frames for one in ("dance", "movement"))

    content = stored(tmp_path)
    assert content["score"]["similarity"] == pytest.approx(expected.similarity)
    assert content["score"]["windows"]["parts"].keys() == expected.parts.keys() == content["score"]["parts"].keys()
    np.testing.assert_allclose(content["score"]["windows"]["delay_s"], expected.windows.delay_s)
    assert content["feedback"] == json.loads(json.dumps(asdict(told))) and "scorer" not in content["score"]
    assert content["warnings"] == [] and content["scorer"]["name"] == "dance22" and content["teacher"] == str(teacher)


def test_joints_that_tremble_cost_points_though_no_fault_stands_out(files, run, tmp_path):
    joints_m = files[2] + np.random.default_rng(0).normal(0, 0.04, files[2].shape)
    np.savez(tmp_path / "trembling.npz", joints_m=joints_m, fps=30)
    printed = run(files[0], tmp_path / "trembling.npz")
    phrases = re.findall(r"to 0:\d\d, (\d+): differences throughout, of which none stands out", printed)
    assert phrases and all(20 < int(score) < 90 for score in phrases)


def test_what_no_dancer_does_is_corrected_and_told(files, run, tmp_path):
    teacher, _, joints_m, _ = files
    dance = corrected(Performance(joints_m, np.arange(len(joints_m)) / 30 + 5), "mirrored")
    np.savez(tmp_path / "wrong.npz", joints_m=dance.joints_m, times_s=dance.times_s)
    words = (teacher, tmp_path / "wrong.npz")
    told = r"as it stands \d, with the learner mirrored, the learner's clock 5\.0\d s earlier 100: scored so; --as-is keeps it"
    printed = run(*words)
    assert re.search(told, printed) and re.search(r"similarity (99|100)", printed) and "warning" not in printed
    note, sides = english(on_page(tmp_path)["found"]["hints"])
    assert re.search(told, note) and sides == "compared as in a mirror: left and right are as the teacher has them"
    done = stored(tmp_path)["corrections"]
    assert done["learner"] == "mirrored" and done["late_s"] == pytest.approx(5, abs=0.1) and done["corrected"] > 95
    printed = run(*words, "--as-is")
    assert re.search(r"similarity \d,", printed) and printed.count("warning") == 2


@pytest.mark.parametrize("later_s", [86_400, 0.5])
def test_clocks_that_count_since_1970_are_compared_from_the_first_frame(files, run, tmp_path, later_s):
    """Of each recording; where both were recorded at once, of the teacher's."""
    joints_m, days_s = files[2], 1.7e9 + np.arange(len(files[2])) / 30
    np.savez(tmp_path / "teacher.npz", joints_m=joints_m, times_s=days_s)
    recorded_m, times_s = (joints_m[15:], days_s[15:]) if later_s < 1 else (joints_m, days_s + later_s)
    np.savez(tmp_path / "learner.npz", joints_m=recorded_m, times_s=times_s)
    run(*files[:2], "--free", 0, 1)
    score = stored(tmp_path)
    assert score["score"]["similarity"] > 98 and score["corrections"] is None
    assert np.abs(score["score"]["windows"]["delay_s"][4:]).max() < 0.05 and score["score"]["windows"]["start_s"][0] == 0


def test_a_faulty_recording_is_told_and_the_option_that_is_named_corrects_it(files, run, tmp_path):
    teacher, _, joints_m, _ = files
    dance = Performance(joints_m, np.arange(len(joints_m)) / 30 + 0.6)
    np.savez(tmp_path / "wrong.npz", joints_m=corrected(dance, "mirrored").joints_m, times_s=dance.times_s)
    words = (teacher, tmp_path / "wrong.npz")
    printed = run(*words)
    options = re.findall(r"--(?:correct|late)\S* \S+", printed)
    assert [option.split()[0] for option in options] == ["--correct-learner", "--late"] and printed.count("warning") == 2
    assert len(stored(tmp_path)["warnings"]) == 2
    assert "learner dances mirrored" in english(on_page(tmp_path)["found"]["hints"])[0]
    again = run(*words, *(word for option in options for word in option.replace("(", " ").split()))
    assert (
        "left and right are as the teacher has them" in again
        and "warning" not in again
        and int(re.search(r"similarity (\d+)", again)[1]) >= 95
    )
    assert options[1] in run(*words, "--late", "0.3")  # the whole delay, not what is left of it


def test_score_and_page_are_in_the_language_that_is_asked_for(files, run, tmp_path):
    printed = run(*files[:2], "--lang", "de", "--bpm", 100)
    assert printed.startswith("Übereinstimmung ") and "linker Arm" in printed and "learner.npz" not in printed
    assert not re.search(r"\b(the|left|arm|late|at|from|no)\b", printed)
    page = (tmp_path / "out" / "score.html").read_text()
    assert '<html lang="de" data-language="de">' in page and "<title>learner.npz nach teacher.npz</title>" in page
    assert stored(tmp_path)["feedback"]["faults"][0]["text"].startswith("left elbow")


def test_the_tempo_of_the_music_makes_phrases_and_an_estimators_noise_shows_the_uncertainty(files, run, tmp_path):
    words = files[:2]
    assert "0:00 to 0:06," in run(*words, "--bpm", 80) and "±" not in run(*words)
    told = run(*words, "--noise", "realtime")
    uncertain = re.search(r"^similarity \d+ ± (\d+), ", told, re.MULTILINE)[1]
    score = stored(tmp_path)["score"]
    assert round(score["uncertainty"]) == int(uncertain) > 0 and f"± {uncertain}: on true joints" in told
    assert "--bpm 0: expected 20 to 400" in run(*words, "--bpm", 0, fails=True)
    assert "--late=nan: expected a number" in run(*words, "--late", "nan", fails=True)
    refused = run(*words, "--scorer", "paper", "--noise", "tracker", fails=True)
    assert "--noise tracker: scorer paper knows no noise; dance22 does" in refused


def test_phrases_of_a_recording_that_begins_within_one_are_those_of_the_music(files, run, tmp_path):
    *paths, joints_m, learner_m = files

    def run_from(start_s):
        for path, one in zip(paths, (joints_m, learner_m), strict=True):
            np.savez(path, joints_m=one, times_s=start_s + np.arange(len(one)) / 30)
        return run(*paths, "--bpm", 80)

    assert "similarity" in run_from(-50)
    printed = run_from(3.5)
    assert "0:00 to 0:06," in printed and "0:06 to 0:12," in printed
    given = on_page(tmp_path)
    assert given["dance"]["first_s"] == given["found"]["phrases"][0]["start_s"] == 0


def test_frame_rates_of_files_without_them(files, run, tmp_path):
    teacher, _, joints_m, _ = files
    np.savez(tmp_path / "bare.npz", joints_m=joints_m[::2])
    words = (teacher, tmp_path / "bare.npz")
    run(*words, fails=True)
    assert int(re.search(r"similarity (\d+)", run(*words, "--learner-fps", 15))[1]) >= 85
    assert "with the learner's times multiplied by 1.67" in run(*words, "--learner-fps", 25)


def test_other_formats_and_missing_joints_are_told(files, run, tmp_path):
    teacher, learner, joints_m, _ = files
    named = [dict(zip(JOINT_NAMES, pose.tolist(), strict=True)) for pose in joints_m]
    frames = [{"time_s": k / 30, "joints": joints} for k, joints in enumerate(named)]
    (tmp_path / "a.json").write_text(json.dumps({"frames": frames}))
    assert "teacher.npz and a.json are of different formats" in run(teacher, tmp_path / "a.json")

    headless_m = joints_m.copy()
    headless_m[:, Joint.NECK] = np.nan
    np.savez(tmp_path / "headless.npz", joints_m=headless_m, fps=30)
    words = (tmp_path / "headless.npz", learner)
    assert "similarity" in run(*words)
    refused = run(*words, "--scorer", "raptis", fails=True)
    assert "headless.npz: neck missing in every frame; scorer raptis needs it" in refused


def test_windows_without_joints_are_null_in_the_json_and_a_dance_of_only_such_is_refused(files, run, tmp_path):
    teacher, _, joints_m, _ = files
    for name, known in (("half", 180), ("rare", 4)):
        seen_m = np.full_like(joints_m, np.nan)
        seen_m[:known] = joints_m[:known]
        np.savez(tmp_path / f"{name}.npz", joints_m=seen_m, fps=30)
    run(teacher, tmp_path / "half.npz")
    windows = stored(tmp_path)["score"]["windows"]
    assert windows["similarity"][0] > 90 and windows["similarity"][-1] == 0 and windows["delay_s"][-1] is None
    refused = run(teacher, tmp_path / "rare.npz", fails=True)
    assert "rare.npz: in no window of 2 s are enough joints known" in refused


def test_a_teacher_leaves_a_part_free_and_weighs_the_total(run, files, tmp_path):
    words = files[:2]
    assert "free parts" not in run(*words)
    told = run(*words, "--free", 4, 9, "--weights", "posture=1", "place=1")
    assert "0:04 to 0:08, –: not compared" in told and told.count("no fault stands out") == told.count(", 100: ")
    content = stored(tmp_path)
    score = content["score"]
    assert score["similarity"] > 97 and score["free"]["energy"] < 99 and "free parts: energy" in told
    expected = (score["posture"] + score["stage"]["place"]) / 2
    assert content["total"] == pytest.approx(expected) and f"total {expected:.0f} of 100: posture 1, place 1" in told
    assert "von 100: Haltung 1, Position 0,5" in run(*words, "--weights", "posture=1", "place=0.5", "--lang", "de")
    mistakes = {
        ("--weights", "hands=1"): "hands",
        ("--weights", "place=inf"): "place",
        ("--weights", "rhythm=1"): "nothing of it is known of this dance",
        ("--free", 0, 1000): "the whole dance is free",
    }
    for mistake, told in mistakes.items():
        assert told in run(*words, *mistake, fails=True)
    with pytest.raises(argparse.ArgumentTypeError, match="is no NAME=WEIGHT; files come before --weights"):
        weight("b.bvh")


def test_a_teacher_as_the_estimator_sees_them(files, run, tmp_path, monkeypatch):
    _, learner, joints_m, _ = files
    np.savez(tmp_path / "short.npz", joints_m=joints_m[:90], fps=30)
    words = tmp_path / "short.npz", learner, "--noise", "network"
    run(*words)
    plain = stored(tmp_path)
    told = run(*words, "--teacher-joints", "seen")
    seen = stored(tmp_path)
    assert "simulated dances seen by network score within it" in told
    assert [one["scorer"]["noise"] for one in (plain, seen)] == ["network", "network_seen_teacher"]
    assert seen["score"]["similarity"] != plain["score"]["similarity"] and seen["score"]["similarity"] > 60
    run(*words, "--teacher-joints", "recorded")
    recorded = stored(tmp_path)
    assert recorded["scorer"]["noise"] == "network_recorded_teacher"
    assert recorded["score"]["uncertainty"] > seen["score"]["uncertainty"]
    for joints in ("seen", "recorded"):
        refused = run(tmp_path / "short.npz", learner, "--teacher-joints", joints, fails=True)
        assert f"--teacher-joints {joints}: needs the estimator" in refused and "--noise network, realtime" in refused
    headless_m = joints_m[:90].copy()
    headless_m[:, Joint.HEAD] = np.nan
    np.savez(tmp_path / "headless.npz", joints_m=headless_m, fps=30)
    refused = run(tmp_path / "headless.npz", learner, "--noise", "network", "--teacher-joints", "seen", fails=True)
    assert "head missing in every frame; all joints are needed" in refused
    (tmp_path / "file").touch()
    with monkeypatch.context() as changed:
        changed.setattr("kpopnet.programs.score.seen_teacher", None)  # not called: it would take minutes
        assert "and is no folder" in run(*words, "--teacher-joints", "seen", "--out", tmp_path / "file", fails=True)
    monkeypatch.setitem(sys.modules, "synth.dances.seen", None)  # as in a slim installation
    assert "is simulated, which needs synth.dances.seen; install it" in run(*words, "--teacher-joints", "seen", fails=True)


def test_what_lies_before_the_first_beat_has_times_below_zero(files, run, tmp_path):
    _, _, joints_m, learner_m = files
    for name, dance_m in (("teacher", joints_m), ("learner", learner_m)):
        np.savez(tmp_path / f"{name}.npz", joints_m=dance_m, times_s=np.arange(len(dance_m)) / 30 - 8)
    printed = run(*files[:2])
    assert "-0:08 to -0:04, 100: no fault stands out" in printed and "-0:04 to 0:00" in printed


def test_of_a_dance_longer_than_a_replay_the_learners_part_is_replayed(files, run, tmp_path, monkeypatch):
    for module in ("result_page", "posing"):
        monkeypatch.setattr(f"kpopnet.teacher.{module}.MAX_S", 6.0)
    teacher, learner, joints_m, _ = files
    end_s = len(joints_m) / 30
    for first_s in (4.0, 6.0, 8.0, end_s - 2.5):
        begin = round(30 * first_s)
        np.savez(learner, joints_m=joints_m[begin:], times_s=np.arange(begin, len(joints_m)) / 30)
        run(teacher, learner, "--as-is")
        shown = on_page(tmp_path)
        assert shown["movement"]["begin_s"] == pytest.approx(first_s, abs=0.05)
        assert shown["dance"]["begin_s"] == pytest.approx(min(first_s, end_s - 6.0), abs=0.05)
        assert len(base64.b64decode(shown["movement"]["hips_m"])) // 12 > 60
