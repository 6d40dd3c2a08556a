"""A try of a dance, image by image, without a camera: its score, its moves, its result, and the latency of a set-up."""

from dataclasses import replace

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from kpopnet.dance.performance import Performance, off_by
from kpopnet.dance.scoring import SCORERS
from kpopnet.estimator import Estimate
from kpopnet.pose import PersonPose
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.sources.live import Image
from kpopnet.teacher.library import MOVE_COUNTS
from kpopnet.teacher.live import score as live_score
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.score import LEAST_S, Calibration, DanceTry, excerpt, scorer_config
from synth.dances.live import ON_THE_BEAT, LiveLearner

DEPTH_M = np.zeros((240, 320), np.float32)


def begun(dance, kind: type[DanceTry] = DanceTry, **lesson) -> DanceTry:
    """A try of a dance that began at the moment 0."""
    asked = Lesson("dance_001", **lesson)
    return kind(asked, dance, "none", started(DanceClock(0.0, asked.speed)))


def started(clock: DanceClock) -> DanceClock:
    """A clock of a dance that began at the moment 0."""
    clock._start = 0.0
    return clock


def look(one: DanceTry, taken: float, joints_m: np.ndarray | None) -> dict:
    """What is shown of an image in which the learner has these joints."""
    person = None if joints_m is None else PersonPose(1, joints_m, np.ones(15))
    return one.see(Image(DEPTH_M, float(taken)), person, CAMERAS["kinect_v1"])


@pytest.fixture(scope="module")
def dance(library):
    return library.dance("dance_001")


def danced(dance, fps: float, late_s: float = 0.0, to_s: float = 6.0, speed: float = 1.0, latency_s: float = 0.0) -> dict:
    """The result of a perfect learner of whom an image is taken `fps` times a second."""
    one = begun(dance, to_s=to_s, speed=speed, latency_s=latency_s)
    for taken in np.arange(0.0, to_s / speed + latency_s, 1 / fps):
        look(one, taken, dance.joints_m[round(max((taken - late_s) * speed, 0.0) * dance.fps)])
    result, recorded = one.finish(0)
    assert len(recorded["times_s"]) == result["notes"]["frames"]
    return result


def test_a_perfect_learner_scores_full_at_half_the_speed(dance):
    result = danced(dance, 30.0, speed=0.5)
    assert result["total"] > 98 and result["worst"] == [] and result["notes"]["fps"] == pytest.approx(30, abs=0.5)


def test_beside_a_teacher_as_they_are_seen_the_network_alone_is_graded_and_all_joints_are_shown(dance):
    as_seen = replace(dance, seen=off_by(dance.performance, np.zeros_like(dance.joints_m, float), "network_seen_teacher"))
    still_m, scores = dance.joints_m[0], {}
    for noise in ("realtime", "none"):
        one = DanceTry(Lesson("dance_001", to_s=6.0), as_seen, noise, started(DanceClock(0.0, 1.0)))
        for frame in range(0, 180, 3):
            person = PersonPose(1, still_m, np.full(15, 0.8), Estimate(dance.joints_m[frame], np.full(15, 0.9)))
            shown = one.see(Image(DEPTH_M, frame / dance.fps), person, CAMERAS["kinect_v1"])
            assert shown["joints"][0][3] == 0.8
        result, recorded = one.finish(0)
        np.testing.assert_array_equal(recorded["joints_m"][-1], still_m)
        scores[noise] = result["total"]
    assert scores["realtime"] > 98 and scores["none"] < 20


@pytest.mark.parametrize(("fps", "least"), [(6.0, 95.0), (3.0, 75.0)])
def test_a_slow_machine_costs_little_and_is_told(dance, fps, least):
    result = danced(dance, fps)
    assert result["total"] > least and f"only {fps:.0f} images a second" in result["hints"][0]
    assert not any("no person" in hint for hint in result["hints"])


@pytest.mark.parametrize(("speed", "fps", "is_told"), [(0.5, 6.0, False), (1.5, 7.5, True), (1.0, 8.0, False)])
def test_images_count_by_the_second_of_the_dance(dance, speed, fps, is_told):
    told = danced(dance, fps, speed=speed)
    assert any("images a second were scored" in hint for hint in told["hints"]) == is_told
    assert told["notes"]["fps"] == pytest.approx(fps, abs=0.1) and (told["total"] > 98) != is_told


def test_a_camera_that_ends_in_mid_dance_is_not_called_slow(dance):
    one = begun(dance, to_s=6.0)
    for taken in np.arange(0.0, 2.5, 1 / 30):
        look(one, taken, dance.joints_m[round(taken * dance.fps)])
    told = one.finish(0)[0]
    assert told["total"] < 60 and told["notes"]["fps"] == pytest.approx(30, abs=0.1)
    assert not any("images a second" in hint for hint in told["hints"])


@pytest.mark.parametrize(("took_s", "fps", "speed", "most"), [(0.0, 30.0, 1.0, 24), (0.1, 30.0, 1.0, 6), (0.0, 10.0, 0.5, 48)])
def test_words_that_take_long_are_new_less_often(dance, monkeypatch, took_s, fps, speed, most):
    moments_s = [0.0]

    def words(_) -> str:
        moments_s.append(moments_s[-1] + took_s)
        return "late"

    monkeypatch.setattr(live_score, "latest_words", words)
    monkeypatch.setattr(live_score.time, "perf_counter", lambda: moments_s[-1])
    danced(dance, fps, speed=speed)
    assert most / 2 < len(moments_s) - 1 <= most


@pytest.mark.parametrize(("speed", "late_s"), [(1.0, 0.2), (0.5, 0.4)])
def test_a_constant_delay_is_measured_and_taken_off(dance, speed, late_s):
    late = danced(dance, 15.0, late_s, speed=speed)
    assert late["latency_s"] == pytest.approx(late_s, abs=0.05) and late["timing"] < 95
    mended = danced(dance, 15.0, late_s, speed=speed, latency_s=late["latency_s"])
    assert mended["timing"] > 97 and mended["total"] > late["total"]


@pytest.mark.parametrize("speed", [1.0, 0.5])
def test_who_dances_before_the_beat_is_scored_from_the_first_move_on(dance, speed):
    """Who anticipates by half a second has a latency below 0: the dance's begin is seen before its own begin."""
    one, early_s = begun(dance, to_s=6.0, speed=speed, latency_s=-0.5), 0.5
    for taken in np.arange(-1.0, 6.0 / speed, 1 / 30):
        look(one, taken, dance.joints_m[round(max((taken + early_s) * speed, 0.0) * dance.fps)])
        if (verdict := one.next_verdict()) is not None and verdict["number"] == 1:
            assert verdict["total"] > 97
    result, recorded = one.finish(0)
    assert result["total"] > 99 and 0 <= recorded["times_s"][0] < 0.05


@pytest.mark.parametrize(("image_s", "over"), [(5.95, False), (6.05, True)])
def test_a_dance_ends_with_the_first_image_after_its_end_which_may_come_late(dance, monkeypatch, image_s, over):
    one = begun(dance, to_s=6.0)
    monkeypatch.setattr(live_score.time, "monotonic", lambda: now_s)
    now_s = image_s + 0.13  # a webcam's image
    look(one, image_s, dance.joints_m[180])
    for now_s in (6.09, 6.2, 6.5):
        assert one.is_over == (over and now_s > 6.1)
    now_s = 6.7
    assert one.is_over


@pytest.mark.parametrize("speed", [1.0, 0.5])
def test_learners_beside_each_other_are_told_who_was_after_whom_in_seconds_of_the_clock(dance, speed):
    times_s, late_s = np.arange(0.0, 10.0, 1 / 30), 0.4
    first, second = (
        {"times_s": times_s, "joints_m": dance.joints_m[np.rint(np.maximum(times_s - after_s, 0) * 30).astype(int)],
         "confidence": np.ones((len(times_s), 15))} for after_s in (0.0, late_s * speed)
    )  # fmt: skip
    assert live_score.together([first, second], (), speed)["after_s"] == [0.0, pytest.approx(late_s, abs=0.05)]


def test_no_person_has_no_score_and_a_long_gap_stays_one(dance):
    one = begun(dance, to_s=8.0)
    shown = look(one, 0.0, None)
    assert shown["guidance"] == "no person seen" and shown["joints"] is None
    result, recorded = one.finish(0)
    assert result["total"] is None and "no person" in result["hints"][0] and recorded["joints_m"].shape == (0, 15, 3)
    for taken in np.arange(0, 8, 1 / 15):
        look(one, taken, dance.joints_m[round(taken * 30)] if taken < 3 or taken > 6 else None)
    result, _ = one.finish(0)
    assert any("no person in the picture" in hint for hint in result["hints"]) and result["total"] < 85
    assert not any("images a second" in hint for hint in result["hints"])  # it is not the machine's fault


def test_missing_joints_are_shown_as_missing(dance):
    joints_m = dance.joints_m[0].copy()
    joints_m[3] = np.nan
    joints = look(begun(dance), 0.0, joints_m)["joints"]
    assert joints[3][:3] == [None, None, None] and 0 < joints[8][0] < 1


def test_in_a_mirror_left_is_left_and_on_a_stage_both_are_right():
    assert scorer_config(Lesson("d"), "none").mirrored == "false"
    config = scorer_config(Lesson("d", mirrored=False, latency_s=0.2, speed=0.5), "none")
    assert config.mirrored == "auto" and config.latency_s == pytest.approx(0.1) and SCORERS["dance22"].latency_s == 0


def test_who_mirrors_a_teacher_on_a_stage_is_told_of_their_own_sides(dance):
    mirrored_m = dance.joints_m[:, MIRROR] * np.array([-1.0, 1, 1], np.float32)
    mirrored_m[:, Joint.LEFT_ELBOW] = mirrored_m[:, Joint.LEFT_SHOULDER] + [0.02, 0.28, 0]  # their left arm hangs
    mirrored_m[:, Joint.LEFT_HAND] = mirrored_m[:, Joint.LEFT_ELBOW] + [0.02, 0.25, 0]
    one, words = begun(dance, to_s=8.0, mirrored=False), set()
    for taken in np.arange(0.0, 8.0, 1 / 15):
        shown = look(one, taken, mirrored_m[round(taken * 30)])
        words |= {shown["words"], (one.next_verdict() or {"words": ""})["words"]}
    assert shown["parts"]["left arm"] < 50 < 90 < shown["parts"]["right arm"]
    assert any(text.startswith("left arm") for text in words) and not any("right arm" in text for text in words)
    result, _ = one.finish(0)  # as while dancing
    assert result["parts"]["left arm"] < 50 < 90 < result["parts"]["right arm"]
    assert "compared as in a mirror" in result["hints"][0]
    assert np.mean(result["course"]["parts"]["left arm"]) < 50 and result["coverage"]["left arm"] > 0.9
    moments = [*result["worst"], *(moment for phrase in result["phrases"] for moment in phrase["moments"])]
    told = [text for moment in moments for text in (moment["words"], moment["text"], moment["part"])]
    assert any(text.startswith("left arm") for text in told) and not any("right" in text for text in [*told, *result["faults"]])
    assert result["praise"][0].startswith("right nearly throughout: ") and "right arm" in result["praise"][0], result["praise"]


def verdicts(dance, learner: Performance, seconds: float = 6.5, **lesson) -> list[tuple[float, dict]]:
    """The verdicts on what a learner danced, with the time of the newest image at each."""
    one, found = begun(dance, to_s=seconds, **lesson), []
    for joints_m, time_s in zip(learner.joints_m, learner.times_s.tolist(), strict=True):
        look(one, time_s, joints_m)
        if verdict := one.next_verdict():
            found.append((time_s, verdict))
            assert one.next_verdict() is None
    return found


def move_s(dance) -> float:
    return MOVE_COUNTS * 60 / dance.about.bpm


def test_each_move_is_scored_once_soon_after_its_end(dance):
    found, each_s = verdicts(dance, excerpt(dance.performance, 0.0, 6.9)), move_s(dance)
    assert [one["number"] for _, one in found] == list(range(1, int(6.51 / each_s) + 1))
    for time_s, one in found:
        assert one["end_s"] == pytest.approx(one["number"] * each_s)
        assert 0 <= time_s - one["end_s"] < 1 / dance.fps
        assert one["total"] > 99 and one["words"] == ""


def test_a_last_move_that_ends_just_after_the_dance_is_scored(dance):
    each_s = move_s(dance)
    whole = excerpt(dance.performance, 0.0, 2 * each_s + 0.1)
    for after_s, numbers in ((0.01, [1, 2]), (0.04, [1, 2]), (0.08, [1])):
        assert [one["number"] for _, one in verdicts(dance, whole, 2 * each_s - after_s)] == numbers


@pytest.mark.parametrize("identity", ["dance_001", "dance_002"])
def test_the_first_verdict_knows_who_mirrors_a_teacher_on_a_stage(library, identity):
    dance = library.dance(identity)
    danced = excerpt(dance.performance, 0.0, 4.4)
    mirrored_m = danced.joints_m[:, MIRROR] * np.array([-1.0, 1, 1], np.float32)
    for learner in (danced, Performance(mirrored_m, danced.times_s)):
        assert min(one["total"] for _, one in verdicts(dance, learner, 4.0, mirrored=False)) > 90


def test_the_reason_is_the_limb_that_hangs_and_only_while_it_hangs_or_the_lateness(dance):
    whole = excerpt(dance.performance, 0.0, 10.4)
    joints_m, hanging = whole.joints_m.copy(), whole.times_s > 2 * move_s(dance)
    for joint, down_m in ((Joint.LEFT_ELBOW, 0.28), (Joint.LEFT_HAND, 0.53)):
        joints_m[hanging, joint] = joints_m[hanging, Joint.LEFT_SHOULDER] + [0, down_m, 0.02]
    found = [one for _, one in verdicts(dance, Performance(joints_m, whole.times_s), 10.0)]
    assert [one["words"] for one in found[:2]] == ["", ""]
    assert all(one["words"].startswith("left arm") and one["total"] < 90 for one in found[3:])
    late = excerpt(dance.performance, 0.0, 6.9)
    words = [one["words"] for _, one in verdicts(dance, Performance(late.joints_m, late.times_s + 0.3))][1:]
    assert words and words.count("late") > len(words) / 2


def test_after_a_gap_the_next_move_is_scored_and_those_in_it_are_not(dance):
    whole, each_s = excerpt(dance.performance, 0.0, 8.4), move_s(dance)
    known = (whole.times_s < 0.9 * each_s) | (whole.times_s > 2.2 * each_s)
    found = [one for _, one in verdicts(dance, Performance(whole.joints_m[known], whole.times_s[known]), 8.0)]
    numbers = [one["number"] for one in found]
    assert numbers == sorted(set(numbers)) and numbers[-1] == int(8.01 / each_s)
    assert found[-1]["total"] == pytest.approx(100, abs=1)


def test_in_a_part_that_is_left_free_there_are_no_verdicts_and_the_total_is_the_teachers(dance):
    each_s = move_s(dance)
    about = replace(dance.about, free_s=[[2 * each_s, 4 * each_s]], weights={"similarity": 1, "energy": 1})
    free = replace(dance, about=about)
    whole = excerpt(dance.performance, 0.0, 6 * each_s + 0.4)
    joints_m, still = whole.joints_m.copy(), (whole.times_s >= 2 * each_s) & (whole.times_s < 4 * each_s)
    joints_m[still] = joints_m[still][0]
    found = [one for _, one in verdicts(free, Performance(joints_m, whole.times_s), 6 * each_s)]
    assert [one["number"] for one in found] == [1, 2, 5, 6] and found[0]["total"] > 99

    result = danced(free, 30.0, to_s=6 * each_s)
    assert result["weights"] == about.weights and result["total"] > 95 and result["free"]["energy"] > 95
    assert result["counted"].keys() == about.weights.keys()
    assert result["total"] == pytest.approx(sum(result["counted"].values()) / 2, abs=0.1)
    assert danced(dance, 30.0, to_s=6 * each_s)["free"] == {}
    nothing = replace(dance, about=replace(about, free_s=[[0, 99]]))
    assert danced(nothing, 30.0, to_s=6 * each_s)["hints"] == ["all of this is free: nothing was compared"]


def test_moves_too_short_to_be_scored_begin_with_the_first_that_can_be(dance):
    fast = replace(dance, about=replace(dance.about, bpm=360.0))
    found, each_s = verdicts(fast, excerpt(dance.performance, 0.0, 4.4), 4.0), move_s(fast)
    assert found[0][1]["end_s"] == pytest.approx(each_s) and found[0][0] == pytest.approx(LEAST_S, abs=0.04)
    assert [one["number"] for _, one in found] == list(range(1, round(4.0 / each_s) + 1))


def measured(dance, joints_at) -> dict:
    """The result of a calibration of 12 s; `joints_at` gives the learner's joints at a time in seconds."""
    step = begun(dance, Calibration, to_s=12.0, calibrate=True)
    step.compile()
    for taken in np.arange(0, 12, 1 / 15):
        assert look(step, taken, joints_at(float(taken)))["total"] is None and step.next_verdict() is None
    result, _ = step.finish(0)
    assert result["total"] is None  # it is no try of the dance
    return result


@pytest.mark.parametrize("fault", ["", "late"])
def test_the_arm_of_the_simulated_learner_tells_how_late_it_is_seen(dance, fault):
    learner = LiveLearner(dance.quats, dance.hips_m, dance.fps, ON_THE_BEAT, fault)
    take, scene = learner._take, learner._studio.scene

    def joints_at(time_s: float) -> np.ndarray:
        number = int(np.clip(round((time_s - 0.1) * dance.fps), 0, len(take.played) - 1))  # the camera is a tenth late
        scene.pose(take.played.local[number], take.played.hips_m[number] + take.place_m)
        return take.view.to_camera(scene.joints_world_m())

    expected_s = 0.1 + (0.35 if fault else 0.0)
    assert measured(dance, joints_at)["latency_s"] == pytest.approx(expected_s, abs=0.04)


def test_who_stands_still_or_is_not_there_is_asked_to_try_again(dance):
    for joints_at in (lambda time_s: dance.joints_m[0], lambda time_s: None):
        result = measured(dance, joints_at)
        assert result["latency_s"] is None and "try again" in result["hints"][0]
