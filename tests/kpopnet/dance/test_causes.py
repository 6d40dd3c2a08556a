"""Causes of a phrase are named; good dancers are told hardly anything; what is right is praised; what costs most is first."""

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, mirrored, noisy, performed

from kpopnet.dance.feedback import feedback
from kpopnet.dance.scoring import score_dance

SECONDS, DANCES = 16.0, range(4)
PHRASE = slice(round(8 * FPS), round(12 * FPS))


def told(teacher_m, learner_m, delay_s=0.0):
    return feedback(score_dance(performed(teacher_m), performed(learner_m, delay_s)))


def within(teacher_m, faulty_m, rows=PHRASE):
    learner_m = teacher_m.copy()
    learner_m[rows] = faulty_m[rows]
    return learner_m


CAUSES = {
    "mirrored": lambda m, index: within(m, mirrored(m)),
    "another phrase": lambda m, index: within(m, np.roll(m, PHRASE.start, axis=0)),
    "something else": lambda m, index: within(m, dance_joints_m(index + 20, SECONDS)),
    "stood still": lambda m, index: made.held(m, 8, 12),
    "late entry": lambda m, index: made.held(m, 0, 4),
    "too small": lambda m, index: within(m, made.smaller(m, 0.6)),
    "too soft": lambda m, index: within(m, made.softened(m, 0.3)),
}


@pytest.mark.parametrize("name", CAUSES)
def test_the_cause_of_a_phrase_stands_before_its_joints(name):
    right = []
    for index in DANCES:
        teacher_m = dance_joints_m(index, SECONDS)
        found = told(teacher_m, noisy(CAUSES[name](teacher_m, index), 0.005, index))
        first = found.moments[:1]
        right.append(bool(first) and (first[0].part, first[0].direction) == ("phrase", name))
        if right[-1]:
            assert -1 < first[0].start_s - (0 if name == "late entry" else 8) < 2  # the teacher may rest at first
            assert not [one for one in found.phrases[2].moments if one.part not in ("phrase", "timing")] or name in (
                "late entry",
                "stood still",
            )
    # What else was danced may fit by chance, and smoothing hardly shows where the dance has no accents.
    assert np.mean(right) >= (0.5 if name in ("something else", "too soft") else 0.75), right


def test_a_good_dancer_is_told_at_most_one_thing_a_phrase():
    remarks = [
        phrase.moments
        for index in DANCES
        for seed in (0, 1)
        for phrase in told(dance_joints_m(index, SECONDS), made.good(dance_joints_m(index, SECONDS), seed)).phrases
    ]
    assert np.mean([len(one) > 1 for one in remarks]) < 0.05 and np.mean([len(one) for one in remarks]) < 0.35
    assert all(abs(one.degrees) >= 10 or abs(one.delay_s) >= 0.08 for moments in remarks for one in moments)


def test_what_costs_most_is_told_first():
    teacher_m = dance_joints_m(0, SECONDS)
    first, *others = told(teacher_m, made.arm_lowered(teacher_m, "left", 15), 0.25).faults
    assert first.part == "timing" and "left arm" in [one.part for one in others]


def test_what_is_right_is_praised():
    teacher_m = dance_joints_m(0, SECONDS)
    praise = " ".join(told(teacher_m, made.arm_lowered(teacher_m, "left", 30)).praise)
    assert "right arm" in praise and "left arm" not in praise and "on time" in praise
    assert not told(teacher_m, made.standing(teacher_m)).praise


def test_a_mirrored_dance_is_said_once():
    teacher_m = dance_joints_m(1, SECONDS)
    assert told(teacher_m, mirrored(teacher_m)).faults[0].text.startswith("mirrored ")


def test_a_teacher_who_is_never_seen_from_the_hips_down_is_no_error():
    """Of legs and torso nothing is known, so that nothing can be compared."""
    teacher_m = dance_joints_m(0, SECONDS).copy()
    teacher_m[:, 2] = np.nan
    score = score_dance(performed(teacher_m), performed(dance_joints_m(0, SECONDS)))
    assert feedback(score).moments == ()
