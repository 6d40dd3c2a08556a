"""Faults of recordings are found and named; good recordings and poor dancers get no warning."""

import numpy as np
import pytest
from dance_people import dance_joints_m, noisy, performed

from kpopnet.dance.diagnosis import corrected, delayed, knees_bend_backwards, probable_faults
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.skeleton import Joint

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


@pytest.mark.parametrize("fault", FAULTS)
def test_the_fault_is_named_and_its_correction_brings_the_score_back(fault):
    correction, rate, late_s, named = FAULTS[fault]
    learner = Performance(noisy(TEACHER.joints_m, 0.02, 5), TEACHER.times_s)
    whole = score_dance(TEACHER, learner, CONFIG).similarity
    (found,) = probable_faults(TEACHER, delayed(corrected(learner, correction), -late_s, rate), CONFIG)
    assert named in found.text and "\n" not in found.text
    assert found.corrected == pytest.approx(whole, abs=4)


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
    for learner in (TEACHER, still, *others, performed(noisy(TEACHER.joints_m, 0.03))):
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
