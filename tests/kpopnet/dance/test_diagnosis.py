"""Faults of recordings are found, named and corrected; good recordings and poor dancers are left as they are."""

import dance_learners as made
import numpy as np
import pytest
from dance_people import dance_joints_m, joints_of, mirrored, noisy, performed

from kpopnet.dance.diagnosis import corrected, delayed, diagnose, knees_bend_backwards
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.skeleton import Joint
from synth.dances.faults import FAULTS as DANCERS_FAULTS
from synth.motion.choreography.composer import dance

CONFIG = SCORERS["dance22"]
TEACHER = performed(dance_joints_m(0, 16.0))
FAULTS = {
    "mirrored": ("mirrored", 1.0, 0.0, "learner mirrored"),
    "swapped": ("swapped", 1.0, 0.0, "learner swapped"),
    "reflected": ("reflected", 1.0, 0.0, "learner reflected"),
    "late": ("as_recorded", 1.0, 0.5, "late 0.50"),
    "early": ("as_recorded", 1.0, -4.0, "late -4.00"),
    "24 frames a second read as 30": ("as_recorded", 0.8, 0.0, "recorded at 30 frames a second, not 37.5"),
    "60 frames a second read as 30": ("as_recorded", 2.0, 0.0, "recorded at 30 frames a second, not 15"),
}


def probable_faults(teacher, learner, config):
    return diagnose(teacher, learner, config, as_is=True).faults


@pytest.mark.parametrize("fault", FAULTS)
def test_the_fault_is_named_and_its_correction_brings_the_score_back(fault):
    correction, rate, late_s, named = FAULTS[fault]
    learner = Performance(noisy(TEACHER.joints_m, 0.02, 5), TEACHER.times_s)
    whole = score_dance(TEACHER, learner, CONFIG).similarity
    (found,) = probable_faults(TEACHER, delayed(corrected(learner, correction), -late_s, rate), CONFIG)
    assert named in found.text and "\n" not in found.text
    assert found.corrected == pytest.approx(whole, abs=4)


RECORDED_WRONGLY = {
    "mirrored": (lambda one: corrected(one, "mirrored"), "the learner mirrored"),
    "swapped": (lambda one: corrected(one, "swapped"), "the learner swapped"),
    "reflected": (lambda one: corrected(one, "reflected"), "the learner reflected"),
    "4 s late": (lambda one: delayed(one, -4.0), "the learner's clock 4.0"),
    "clocks apart": (lambda one: delayed(one, -500.0), "the learner's clock 500."),
    "begun 3 s into the dance": (
        lambda one: Performance(one.joints_m[90:], one.times_s[:-90]),
        "the learner's clock 3.",
    ),
    "half the rate": (lambda one: delayed(one, 0.0, 0.5), "the learner's times multiplied by 2"),
    "twice the rate": (lambda one: delayed(one, 0.0, 2.0), "the learner's times multiplied by 0.5"),
    "25 as 30 frames a second": (lambda one: delayed(one, 0.0, 25 / 30), "the learner's times multiplied by 1.2"),
    "mirrored and early": (
        lambda one: delayed(corrected(one, "mirrored"), 3.0),
        "the learner mirrored, the learner's clock 3.0",
    ),
}
"""How a dance is recorded, and what corrects it."""


@pytest.mark.parametrize("wrongly", RECORDED_WRONGLY)
def test_what_no_dancer_does_is_corrected_and_both_scores_are_told(wrongly):
    record, named = RECORDED_WRONGLY[wrongly]
    learner = Performance(noisy(TEACHER.joints_m, 0.02, 5), TEACHER.times_s)
    found = diagnose(TEACHER, record(learner), CONFIG)
    whole = score_dance(TEACHER, learner, CONFIG).similarity
    score = score_dance(found.teacher, found.learner, CONFIG).similarity
    assert found.faults == [] and score == pytest.approx(found.corrected) and found.as_recorded <= score - 30
    assert score == pytest.approx(whole, abs=4) or (wrongly.startswith("begun") and score > 60), score
    assert str(found).startswith(f"as it stands {found.as_recorded:.0f}, with ") and named in str(found)


def test_as_it_is_nothing_is_corrected():
    as_is = diagnose(TEACHER, corrected(TEACHER, "mirrored"), CONFIG, as_is=True)
    assert as_is.correction is None and str(as_is) == "" and as_is.faults


def test_no_fault_of_a_dancer_is_corrected():
    learners = {
        name: performed(joints_of(fault(dance(0, 41, 16.0, 30.0), 3.0, np.random.default_rng(7))))
        for name, fault in DANCERS_FAULTS.items()
    }
    alone = (made.legs_only, made.arms_only, made.standing, made.mean_pose, made.waving, made.never_turning, made.other_build)
    learners |= {make.__name__: performed(make(TEACHER.joints_m)) for make in alone}
    stretches = (made.held, made.hidden)
    learners |= {f"{make.__name__} for 5 s": performed(make(TEACHER.joints_m, 6, 11)) for make in stretches}
    more = ((made.smaller, 0.5), (made.hunched, 30), (made.arms_lowered, 40), (made.elbows_bent, 45))
    learners |= {f"{make.__name__} {size}": performed(make(TEACHER.joints_m, size)) for make, size in more}
    learners |= {f"late {late_s}": delayed(TEACHER, -late_s) for late_s in (-0.5, 0.3, 0.8)}
    learners |= {f"tempo {tempo}": delayed(TEACHER, 0.0, tempo) for tempo in (0.9, 24 / 25, 1.1)}
    for begin in (0, 120, 240):
        phrase_m = TEACHER.joints_m.copy()
        phrase_m[begin : begin + 240] = mirrored(phrase_m)[begin : begin + 240]
        learners[f"mirrors from frame {begin} on"] = performed(phrase_m)
    for name, learner in learners.items():
        found = diagnose(TEACHER, learner, CONFIG)
        assert found.correction is None and found.learner is learner, (name, str(found))


def test_two_faults_at_once_are_both_named():
    learner = delayed(corrected(TEACHER, "mirrored"), -2.3)
    texts = [fault.text for fault in probable_faults(TEACHER, learner, CONFIG)]
    assert len(texts) == 2 and "mirrored" in texts[0] and "--late 2.30" in texts[1]


@pytest.mark.parametrize("correction", ["swapped", "reflected"])
def test_a_teachers_fault_is_the_teachers_and_one_of_both_is_told(correction):
    wrong = corrected(TEACHER, correction)
    (fault,) = probable_faults(wrong, TEACHER, CONFIG)
    assert f"--correct-teacher {correction}" in fault.text and fault.corrected > 95
    (fault,) = probable_faults(wrong, wrong, CONFIG)
    assert "knees of both dancers bend backwards" in fault.text and fault.corrected is None


def test_good_recordings_and_poor_dancers_get_no_warning():
    still = Performance(np.repeat(TEACHER.joints_m[:1], len(TEACHER), axis=0), TEACHER.times_s)
    others = [performed(dance_joints_m(index, 16.0)) for index in range(1, 5)]
    for learner in (TEACHER, still, *others, *(performed(noisy(TEACHER.joints_m, off_m, 5)) for off_m in (0.02, 0.03))):
        assert probable_faults(TEACHER, learner, CONFIG) == []


def test_knees_tell_left_from_right():
    for index in range(8):
        dance = performed(dance_joints_m(index))
        assert not knees_bend_backwards(dance) and not knees_bend_backwards(corrected(dance, "mirrored"))
        assert knees_bend_backwards(corrected(dance, "swapped")) and knees_bend_backwards(corrected(dance, "reflected"))
    sideways = dance.joints_m.copy()  # knees that bend to neither front nor back say nothing
    sideways[:, [Joint.RIGHT_HIP, Joint.LEFT_HIP]] = [[-0.1, 0, 3], [0.1, 0, 3]]
    sideways[:, [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]] = [[-0.2, -0.5, 3], [0.2, -0.5, 3]]
    sideways[:, [Joint.RIGHT_KNEE, Joint.LEFT_KNEE]] = [[-0.3, 0.4, 3], [0.3, 0.4, 3]]
    sideways[:, [Joint.RIGHT_FOOT, Joint.LEFT_FOOT]] = [[-0.1, 0.8, 3], [0.1, 0.8, 3]]
    assert not knees_bend_backwards(Performance(sideways, dance.times_s))
    unknown = dance.joints_m.copy()
    unknown[:, [Joint.LEFT_KNEE, Joint.RIGHT_KNEE]] = np.nan
    assert not knees_bend_backwards(Performance(unknown, dance.times_s))
