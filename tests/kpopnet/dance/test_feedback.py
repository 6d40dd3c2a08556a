"""Injected faults are named by part, window, direction and sign; what repeats is gathered; the set-up's faults are told."""

from functools import partial

import numpy as np
import pytest
from dance_learners import ARMS, LEGS, arm_lowered, elbow_bent, hidden, hunched, knee_moved
from dance_people import FPS, dance_joints_m, mirrored, noisy, performed

from kpopnet.dance.feedback import MOMENTS_PER_PHRASE, feedback
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import DanceScore, score_dance
from kpopnet.skeleton import Joint

FAULTS = [
    *((f"{side} arm", word, partial(arm_lowered, side=side, degrees=degrees), ARMS[side])
      for side in ARMS for word, degrees in (("too low", 30), ("too high", -30))),
    *((f"{side} arm", word, partial(elbow_bent, side=side, degrees=degrees), ARMS[side])
      for side in ARMS for word, degrees in (("too bent", 40), ("too straight", -40))),
    *((f"{side} leg", "too high", partial(knee_moved, side=side, degrees=30), LEGS[side]) for side in LEGS),
    ("torso", "bent too far forward", partial(hunched, degrees=25), (Joint.NECK,)),
    ("torso", "bent too far back", partial(hunched, degrees=-25), (Joint.NECK,)),
]  # fmt: skip
BEGIN, END = 150, 210


def scored(teacher_m, learner_m, delay_s=0.0) -> DanceScore:
    return score_dance(performed(teacher_m), performed(learner_m, delay_s))


def has_effect(teacher_m, faulty_m, joints) -> bool:
    """Whether the fault shows: a hanging arm cannot be too low, a straight elbow not too straight."""
    moved_m = np.linalg.norm(faulty_m - teacher_m, axis=-1)[BEGIN:END, list(joints)].max(axis=1)
    return bool(np.quantile(moved_m, 0.2) > 0.06)


def test_injected_faults_are_named_by_part_window_and_direction():
    part_right, window_right, direction_right = [], [], []
    for index in range(4):
        teacher_m = dance_joints_m(index)
        for part, direction, faulted, joints in FAULTS:
            learner_m, faulty_m = noisy(teacher_m, 0.01, index), faulted(teacher_m)
            if not has_effect(teacher_m, faulty_m, joints):
                continue
            learner_m[BEGIN:END] += (faulty_m - teacher_m)[BEGIN:END]
            faults = feedback(scored(teacher_m, learner_m)).faults
            part_right.append(bool(faults) and faults[0].part == part)
            if not part_right[-1]:
                continue
            window_right.append(all(BEGIN / FPS - 0.6 <= start_s <= END / FPS for start_s in faults[0].starts_s))
            direction_right.append(faults[0].direction == direction and (faults[0].degrees > 0) == (direction not in LESS))
    assert len(part_right) > 30
    assert np.mean(part_right) >= 0.95 and np.mean(window_right) == 1 and np.mean(direction_right) >= 0.9


LESS = ("too low", "too straight", "bent too far back")


def test_a_fault_is_told_in_words_and_repetitions_are_gathered():
    teacher_m = dance_joints_m(0, 16.0)
    low_m, learner_m = arm_lowered(teacher_m, "left", 25), teacher_m.copy()
    for begin in (40, 140, 400):
        learner_m[begin : begin + 45] = low_m[begin : begin + 45]
    (fault, *_) = feedback(scored(teacher_m, learner_m)).faults
    assert fault.part == "left arm" and fault.joint == "left shoulder" and -26 < fault.degrees < -12
    assert len(fault.starts_s) == 3 and np.allclose(fault.starts_s, (1.3, 4.7, 13.3), atol=0.6)
    assert fault.text.startswith("left arm ") and "° too low at 0:01, 0:0" in fault.text
    (constant, *_) = feedback(scored(teacher_m, low_m)).faults
    assert constant.text.endswith("too low throughout") and -26 < constant.degrees < -20


def test_each_phrase_has_its_worst_moments():
    teacher_m = dance_joints_m(1, 16.0)
    found = feedback(scored(teacher_m, noisy(teacher_m, 0.12)))
    assert [phrase.start_s for phrase in found.phrases] == [0, 4, 8, 12]
    for phrase in found.phrases:
        costs = [one.points for one in phrase.moments]
        assert 1 <= len(costs) <= MOMENTS_PER_PHRASE and costs == sorted(costs, reverse=True)
        assert 0 <= phrase.similarity <= 100
        assert all(one.end_s > phrase.start_s and one.start_s < phrase.end_s for one in phrase.moments)
    eight = feedback(scored(teacher_m, teacher_m), beat_s=0.6)
    assert [phrase.end_s for phrase in eight.phrases] == pytest.approx([4.8, 9.6, 14.4, 19.2])
    assert eight.faults == () and eight.hints == ()


def test_lateness_is_told_in_seconds_or_beats():
    teacher_m = dance_joints_m(0)
    late = scored(teacher_m, teacher_m, 0.25)
    (fault,) = feedback(late).faults
    assert fault.part == "timing" and fault.delay_s == pytest.approx(0.25, abs=0.01) and fault.text == "0.2 s late throughout"
    assert feedback(late, beat_s=0.5).faults[0].text == "half a beat late throughout"
    assert feedback(scored(teacher_m, teacher_m, -0.25), beat_s=0.5).faults[0].text == "half a beat early throughout"
    held_back_m = np.concatenate([teacher_m[:180], np.repeat(teacher_m[180:181], 8, axis=0), teacher_m[180:-8]])
    (fault, *_) = feedback(scored(teacher_m, held_back_m), beat_s=0.5).faults
    assert fault.direction == "late" and len(fault.starts_s) == 1 and 4.5 < fault.starts_s[0] < 7.5


def test_the_set_ups_faults_are_hinted_at():
    teacher_m = dance_joints_m(0, 16.0)

    def hints(learner_m, tempo=1.0):
        learner = Performance(learner_m, np.arange(len(learner_m)) / FPS / tempo)
        return feedback(score_dance(performed(teacher_m), learner)).hints

    assert "mirror image" in hints(mirrored(teacher_m))[0]
    assert any("10% too fast" in hint for hint in hints(teacher_m, 1.1))
    assert hints(hidden(teacher_m, 5, 9)) == ("no person in the picture from 0:05 to 0:09",)
    arms = [joint for arm in ARMS.values() for joint in arm[1:]]
    assert hints(hidden(teacher_m, 5, 9, arms)) == ("arms out of the picture from 0:05 to 0:09",)
    assert hints(hidden(teacher_m, 0, 16, [Joint.LEFT_FOOT])) == ("left leg out of the picture from 0:01 to 0:15",)


def test_the_feedback_is_the_same_online():
    teacher_m = dance_joints_m(2)
    learner_m = noisy(teacher_m, 0.06)
    online = OnlineScorer(performed(teacher_m))
    for frame, joints_m in enumerate(learner_m):
        online.update(joints_m, frame / FPS)
        if frame == 200:
            early = feedback(online.score_so_far())
    whole = feedback(scored(teacher_m, learner_m))
    assert feedback(online.finish()) == whole and whole.faults
    assert early.phrases[0] == whole.phrases[0]
