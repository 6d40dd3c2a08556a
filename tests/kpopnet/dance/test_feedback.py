"""What a dancer is told: causes of a phrase, faults by part, time and direction, what repeats, the set-up's faults, praise."""

import itertools
from functools import partial

import dance_learners as made
import numpy as np
import pytest
from dance_learners import ARMS, LEGS, arm_lowered, elbow_bent, hidden, hunched, knee_moved
from dance_people import FPS, dance_joints_m, mirrored, noisy, performed

from kpopnet.dance.feedback import MOMENTS_PER_PHRASE, feedback, moments_since
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.dance.words.moments import clock
from kpopnet.skeleton import Joint

TEACHER_M = dance_joints_m(0, 16.0)


def told(learner_m, delay_s=0.0, teacher_m=TEACHER_M, beat_s=None):
    return feedback(score_dance(performed(teacher_m), performed(learner_m, delay_s)), beat_s)


FAULTS = [
    *((f"{side} arm", word, partial(arm_lowered, side=side, degrees=degrees), ARMS[side])
      for side in ARMS for word, degrees in (("too low", 30), ("too high", -30))),
    *((f"{side} arm", word, partial(elbow_bent, side=side, degrees=degrees), ARMS[side])
      for side in ARMS for word, degrees in (("too bent", 40), ("too straight", -40))),
    *((f"{side} leg", "too high", partial(knee_moved, side=side, degrees=30), LEGS[side]) for side in LEGS),
    ("torso", "bent too far forward", partial(hunched, degrees=25), (Joint.NECK,)),
    ("torso", "bent too far back", partial(hunched, degrees=-25), (Joint.NECK,)),
]  # fmt: skip
LESS = ("too low", "too straight", "bent too far back")
BEGIN, END = 150, 210


def has_effect(teacher_m, faulty_m, joints) -> bool:
    """Whether the fault shows: a hanging arm cannot be too low, a straight elbow not too straight."""
    moved_m = np.linalg.norm(faulty_m - teacher_m, axis=-1)[BEGIN:END, list(joints)].max(axis=1)
    return bool(np.quantile(moved_m, 0.2) > 0.06)


def test_injected_faults_are_named_by_part_window_and_direction():
    told_right = []
    for index, (part, direction, faulted, joints) in itertools.product(range(2), FAULTS):
        teacher_m = dance_joints_m(index)
        learner_m, faulty_m = noisy(teacher_m, 0.01, index), faulted(teacher_m)
        if has_effect(teacher_m, faulty_m, joints):
            learner_m[BEGIN:END] += (faulty_m - teacher_m)[BEGIN:END]
            first = told(learner_m, teacher_m=teacher_m).faults[:1]
            expected = [(part, direction, direction in LESS)]
            told_right.append([(one.part, one.direction, one.degrees < 0) for one in first] == expected)
            assert all(BEGIN / FPS - 0.6 <= start_s <= END / FPS for one in first for start_s in one.starts_s)
    assert len(told_right) > 15 and np.mean(told_right) >= 0.9


def during(faulty_m, teacher_m):
    """The teacher's dance, but for its third phrase."""
    learner_m = teacher_m.copy()
    learner_m[240:360] = faulty_m[240:360]
    return learner_m


CAUSES = {
    "mirrored": lambda m: during(mirrored(m), m),
    "another phrase": lambda m: during(np.roll(m, 240, axis=0), m),
    "something else": lambda m: during(dance_joints_m(21, 16.0), m),
    "stood still": lambda m: made.held(m, 8, 12),
    "late entry": lambda m: made.held(m, 0, 4),
    "too small": lambda m: during(made.smaller(m, 0.6), m),
    "too soft": lambda m: during(made.softened(m, 0.3), m),
}


@pytest.mark.parametrize("name", CAUSES)
def test_the_cause_of_a_phrase_stands_before_its_joints(name):
    teacher_m = dance_joints_m(1, 16.0)
    found = told(CAUSES[name](teacher_m), teacher_m=teacher_m)
    first = found.moments[0]
    assert (first.part, first.direction) == ("phrase", name)
    assert -1 < first.start_s - (0 if name == "late entry" else 8) < 2  # the teacher may rest at first
    if name not in ("late entry", "stood still"):
        assert not [one for one in found.phrases[2].moments if one.part not in ("phrase", "timing")]


def test_who_never_begins_stands_still_and_is_not_late():
    teacher_m = dance_joints_m(1, 16.0)
    moments = told(made.held(teacher_m, 0, 16), teacher_m=teacher_m).moments
    assert {one.direction for one in moments if one.part == "phrase"} == {"stood still"}


def test_one_wrong_limb_beside_one_that_is_a_little_off_is_not_something_else():
    """The right arm of a dancer whose left arm hangs has 50 to 60 in many a lesson."""
    teacher_m = dance_joints_m(1, 16.0)
    score = score_dance(performed(teacher_m), performed(CAUSES["something else"](teacher_m)))
    for right_arm, is_else in ((30.0, True), (50.0, False)):
        parts = {name: np.full_like(values, 100.0) for name, values in score.windows.parts.items()}
        parts["left arm"][:], parts["right arm"][:] = 1.0, right_arm
        third = feedback(score._replace(windows=score.windows._replace(parts=parts))).phrases[2]
        assert ("something else" in [one.direction for one in third.moments]) is is_else


def test_who_lets_one_arm_hang_and_dances_with_the_rest_stands_still_nowhere():
    for index in range(12):
        teacher_m = dance_joints_m(index, 16.0)
        learner_m = made.good(made.hanging(teacher_m, [made.ARMS["left"]]), index)
        assert "stood still" not in {one.direction for one in told(learner_m, teacher_m=teacher_m).moments}


def test_who_moves_half_as_far_from_the_first_moment_on_rests_nowhere():
    for index in range(4):
        teacher_m = dance_joints_m(index, 16.0)
        moments = told(made.smaller(teacher_m, 0.5), teacher_m=teacher_m).moments
        causes = {one.direction for one in moments if one.part == "phrase"}
        assert "too small" in causes and not {"late entry", "stood still"} & causes


def test_a_phrase_that_is_seen_in_part_keeps_its_cause():
    teacher_m = dance_joints_m(1, 16.0)
    learner_m = mirrored(teacher_m)
    learner_m[255:300] = np.nan  # of the third phrase, 240 to 360
    third = told(learner_m, teacher_m=teacher_m).phrases[2].moments
    assert [one.direction for one in third][:1] == ["mirrored"]


def test_a_good_dancer_is_told_at_most_one_thing_a_phrase():
    teachers_m = [dance_joints_m(index, 16.0) for index in range(3)]
    remarks = [phrase.moments for one in teachers_m for phrase in told(made.good(one, 0), teacher_m=one).phrases]
    assert sum(len(one) > 1 for one in remarks) <= 1 and np.mean([len(one) for one in remarks]) < 0.35
    assert all(abs(one.degrees) >= 10 or abs(one.delay_s) >= 0.08 for moments in remarks for one in moments)


def test_what_costs_most_is_told_first_and_what_is_right_is_praised():
    learner_m = arm_lowered(TEACHER_M, "left", 30)
    late = told(arm_lowered(TEACHER_M, "left", 15), 0.25)
    assert late.faults[0].part == "timing" and "left arm" in [one.part for one in late.faults[1:]]
    praise = " ".join(told(learner_m).praise)
    assert "right arm" in praise and "left arm" not in praise and "on time" in praise
    assert not told(made.standing(TEACHER_M)).praise


def test_a_phrase_counts_as_the_dance_does_where_the_teacher_moves():
    teacher_m = TEACHER_M.copy()
    teacher_m[:150] = teacher_m[150]  # stands for five seconds, while the learner warms up
    score = score_dance(performed(teacher_m), performed(TEACHER_M))
    first, second, *others = feedback(score).phrases
    assert first.similarity is None and second.similarity < 90 < score.similarity  # its first windows begin before
    assert all(one.similarity > 98 for one in others)


@pytest.mark.parametrize("name", CAUSES)
def test_the_latest_moments_are_those_of_the_whole_feedback(name):
    learner_m = CAUSES[name](TEACHER_M)
    learner_m[390:450] = elbow_bent(TEACHER_M, "left", 40)[390:450]
    score = score_dance(performed(TEACHER_M), performed(learner_m))
    latest, first_s = moments_since(score, 9.0), float(score.windows.start_s[0]) + 8.0  # of the third phrase
    whole = [one for one in feedback(score).moments if one.start_s >= first_s and one.end_s > 9.0]
    assert [one for one in latest if one.start_s >= first_s] == whole != []
    assert all(one.end_s > 9.0 for one in latest)


def test_a_fault_is_told_in_words_and_repetitions_are_gathered():
    low_m, learner_m = arm_lowered(TEACHER_M, "left", 25), TEACHER_M.copy()
    for begin in (40, 140, 400):
        learner_m[begin : begin + 45] = low_m[begin : begin + 45]
    (fault, *_) = told(learner_m).faults
    assert fault.part == "left arm" and fault.joint == "left shoulder" and -26 < fault.degrees < -12
    assert len(fault.starts_s) == 3 and np.allclose(fault.starts_s, (1.3, 4.7, 13.3), atol=0.6)
    assert fault.text.startswith("left arm ") and "° too low at 0:01, 0:0" in fault.text
    (constant, *_) = told(low_m).faults
    assert constant.text.endswith("too low throughout") and -26 < constant.degrees < -20


def test_each_phrase_has_its_worst_moments():
    found = told(noisy(TEACHER_M, 0.12))
    assert [phrase.start_s for phrase in found.phrases] == [0, 4, 8, 12]
    for phrase in found.phrases:
        costs = [one.points for one in phrase.moments]
        assert 1 <= len(costs) <= MOMENTS_PER_PHRASE and costs == sorted(costs, reverse=True)
        assert 0 <= phrase.similarity <= 100
        assert all(one.end_s > phrase.start_s and one.start_s < phrase.end_s for one in phrase.moments)


def test_lateness_is_told_in_seconds_or_beats():
    (fault,) = told(TEACHER_M, 0.25).faults
    assert fault.part == "timing" and fault.delay_s == pytest.approx(0.25, abs=0.01) and fault.text == "0.2 s late throughout"
    assert told(TEACHER_M, 0.25, beat_s=0.5).faults[0].text == "half a beat late throughout"
    assert told(TEACHER_M, -0.25, beat_s=0.5).faults[0].text == "half a beat early throughout"
    teacher_m = dance_joints_m(24, 20.0)  # whose first windows match one who stands still a second later
    stood_still = told(made.held(teacher_m, 0, 2.5), 0.25, teacher_m, beat_s=0.5).faults
    assert [one.text for one in stood_still if one.part == "timing"] == ["half a beat late throughout"]
    held_back_m = np.concatenate([TEACHER_M[:180], np.repeat(TEACHER_M[180:181], 8, axis=0), TEACHER_M[180:-8]])
    (fault, *_) = told(held_back_m, beat_s=0.5).faults
    assert fault.direction == "late" and len(fault.starts_s) == 1 and 4.5 < fault.starts_s[0] < 7.5


def test_the_set_ups_faults_are_hinted_at():
    def hints(learner_m, tempo=1.0):
        learner = Performance(learner_m, np.arange(len(learner_m)) / FPS / tempo)
        return feedback(score_dance(performed(TEACHER_M), learner)).hints

    assert "mirror image" in hints(mirrored(TEACHER_M))[0]
    in_a_mirror = score_dance(performed(TEACHER_M), performed(mirrored(TEACHER_M)), PartScorer(mirrored="auto"))
    assert "left and right are as the teacher has them" in feedback(in_a_mirror).hints[0]
    assert any("10% too fast" in hint for hint in hints(TEACHER_M, 1.1))
    assert hints(hidden(TEACHER_M, 5, 9)) == ("no person in the picture from 0:05 to 0:09",)
    arms = [joint for arm in ARMS.values() for joint in arm[1:]]
    assert hints(hidden(TEACHER_M, 5, 9, arms)) == ("arms out of the picture from 0:05 to 0:09",)
    assert hints(hidden(TEACHER_M, 0, 16, [Joint.LEFT_FOOT])) == ("left leg out of the picture from 0:01 to 0:15",)


@pytest.mark.parametrize("begin_s", [-7.3, 0.4, 2.9, 4.5, 31.0])
def test_phrases_are_counted_from_the_beat_whenever_the_recording_begins(begin_s):
    beat_s, seconds = 0.55, 16.0
    dance = Performance(TEACHER_M, begin_s + np.arange(len(TEACHER_M)) / FPS)
    score = score_dance(dance, dance)
    starts_s = [one.start_s for one in feedback(score, beat_s).phrases]
    on_beats = np.array(starts_s) / (8 * beat_s)
    np.testing.assert_allclose(on_beats, np.round(on_beats), atol=1e-9)
    np.testing.assert_allclose(np.diff(starts_s), 8 * beat_s)
    assert starts_s[0] <= begin_s + 1 < starts_s[0] + 8 * beat_s and starts_s[-1] < begin_s + seconds
    without_beat = feedback(score)
    assert without_beat.phrases[0].start_s == begin_s and all(one.similarity is not None for one in without_beat.phrases)
    assert without_beat.faults == () and without_beat.hints == ()


def test_the_first_phrase_has_its_cause_also_where_it_begins_before_the_recording():
    learner_m, times_s = TEACHER_M.copy(), 1 + np.arange(len(TEACHER_M)) / FPS
    learner_m[:90] = mirrored(TEACHER_M)[:90]
    told = feedback(score_dance(Performance(TEACHER_M, times_s), Performance(learner_m, times_s)), beat_s=0.5)
    assert told.phrases[0].start_s == 0 and told.phrases[0].moments[0].direction == "mirrored"


def test_a_teacher_of_whom_nothing_can_be_compared_is_no_error():
    teacher_m = TEACHER_M.copy()
    teacher_m[:, Joint.TORSO] = np.nan
    assert told(TEACHER_M, teacher_m=teacher_m).moments == ()


PHRASES_M = dance_joints_m(1, 16.0)


def third(learner_m):
    """What is told of the third phrase."""
    return feedback(score_dance(performed(PHRASES_M), performed(learner_m))).phrases[2].moments


def of_third(faulty_m):
    """The dance but for its third phrase, which is that of another one."""
    learner_m = PHRASES_M.copy()
    learner_m[240:360] = faulty_m[240:360]
    return learner_m


def test_who_dances_another_phrase_is_told_where_it_belongs():
    for shift, place in ((240, "0:00"), (-120, "0:12")):
        told = [str(one.fault) for one in third(of_third(np.roll(PHRASES_M, shift, axis=0)))]
        assert told[0] == f"danced what belongs at {place}", (shift, told)


def test_the_share_of_small_movements_is_that_of_the_teachers():
    (first, *_) = third(of_third(made.smaller(PHRASES_M, 0.6)))
    assert first.direction == "too small" and 50 < int(str(first.fault).split(", ")[1].split("%")[0]) < 80, first.fault


def test_who_moves_too_little_and_late_is_told_both():
    told = {
        one.direction
        for one in feedback(score_dance(performed(PHRASES_M), performed(made.smaller(PHRASES_M, 0.6), 0.25))).moments
    }
    assert {"too small", "late"} <= told, told


def hints_at(tempo):
    learner = Performance(TEACHER_M, np.arange(len(TEACHER_M)) / FPS / tempo)
    return " ".join(feedback(score_dance(performed(TEACHER_M), learner)).hints)


def test_who_is_too_slow_is_not_told_to_be_too_fast():
    assert "10% too fast" in hints_at(1.1) and "10% too slow" in hints_at(0.9)


def test_what_is_not_in_the_picture_is_told_in_its_phrases_alone():
    phrases = feedback(score_dance(performed(TEACHER_M), performed(hidden(TEACHER_M, 5, 7.5)))).phrases
    assert [bool(one.unseen) for one in phrases] == [False, True, False, False]


def test_a_part_that_differs_a_little_throughout_is_not_praised():
    learner_m = arm_lowered(TEACHER_M, "left", 20)
    score = score_dance(performed(TEACHER_M), performed(learner_m))
    assert 40 < score.parts["left arm"] < 85 and "left arm" not in " ".join(feedback(score).praise), score.parts


def test_times_before_the_music_have_a_sign():
    assert [clock(at) for at in (-5.2, -0.4, 65.5, 59.6)] == ["-0:05", "0:00", "1:06", "1:00"]


def test_who_is_wrong_whenever_the_teacher_moves_is_not_praised_for_standing():
    still_m = np.repeat(TEACHER_M[:1], round(66 * FPS), axis=0)  # before the music begins
    teacher_m, lowered_m = (np.concatenate([still_m, one]) for one in (TEACHER_M, arm_lowered(TEACHER_M, "left", 60)))
    praise = " ".join(told(lowered_m, teacher_m=teacher_m).praise)
    assert "right arm" in praise and "left arm" not in praise and "on time" in praise


def test_the_share_of_small_movements_is_not_that_of_a_limb_that_moves_more():
    swing = np.sin(np.pi * np.arange(round(12 * FPS)) / FPS)

    def danced(others_deg, right_arm_deg):
        joints_m = TEACHER_M[:1].repeat(len(swing), axis=0)
        for limb in (*ARMS.values(), *LEGS.values()):
            degrees = right_arm_deg if limb is ARMS["right"] else others_deg
            angles_rad = np.radians(40 + degrees * swing)
            joints_m = made.turned_about(joints_m, limb[0], limb[1:], np.tile([-1.0, 0, 0], (len(swing), 1)), angles_rad)
        return joints_m

    moments = told(danced(13, 50), teacher_m=danced(18, 18)).moments
    shares = [int(str(one.fault).split(", ")[1].split("%")[0]) for one in moments if one.direction == "too small"]
    assert shares and all(60 < one < 85 for one in shares), shares


def test_who_leaves_the_picture_is_told_so_also_where_a_limb_of_the_teacher_is_hidden():
    teacher_m, learner_m = TEACHER_M.copy(), hidden(TEACHER_M, 5, 10)
    teacher_m[60:390, ARMS["left"][1:]] = np.nan
    assert told(learner_m, teacher_m=teacher_m).hints == told(learner_m).hints
    assert [one.split(" from")[0] for one in told(learner_m).hints] == ["no person in the picture"]


@pytest.mark.parametrize("intro_s", [0, 16, 80])
def test_who_stands_still_is_told_so_however_long_the_teacher_stood_before(intro_s):
    teacher_m = dance_joints_m(2, 16.0)

    def after_standing(joints_m):
        return np.concatenate([np.repeat(teacher_m[:1], round(intro_s * FPS), axis=0), joints_m])

    for begin_s, cause in ((0, "late entry"), (1, "stood still"), (4, "stood still")):
        learner_m = noisy(after_standing(made.held(teacher_m, begin_s, begin_s + 6)), 0.02, 3)
        (first, *_) = told(learner_m, teacher_m=after_standing(teacher_m)).moments
        assert first.direction == cause and first.start_s == pytest.approx(intro_s + begin_s, abs=1.1), first
        assert first.end_s == pytest.approx(intro_s + begin_s + 6, abs=0.6), first


def test_nobody_dances_what_belongs_before_the_dance():
    still_m = noisy(np.repeat(PHRASES_M[:1], round(6 * FPS), axis=0), 0.2, 1)  # waves about for six seconds, then dances
    learner_m = np.concatenate([still_m, PHRASES_M])[: len(PHRASES_M)]
    texts = [str(one.fault) for one in feedback(score_dance(performed(PHRASES_M), performed(learner_m))).moments]
    assert "danced what belongs at 0:00" in texts and "danced what belongs at -0:02" not in texts, texts
