"""Faults of recordings are found, named and corrected; good recordings and poor dancers are left as they are."""

from functools import partial

import dance_learners as made
import numpy as np
import pytest
from dance_people import dance_joints_m, joints_of, mirrored, noisy, performed

from kpopnet.dance.diagnosis import AS_RECORDED, CORRECTIONS, Correction, corrected, delayed, diagnose, knees_bend_backwards
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.skeleton import Joint
from synth.dances.faults import FAULTS as DANCERS_FAULTS
from synth.motion.choreography.composer import dance

CONFIG = SCORERS["dance22"]
TEACHER = performed(dance_joints_m(0, 12.0))
LEARNER = performed(noisy(TEACHER.joints_m, 0.02, 5))


def faults(teacher, learner):
    return diagnose(teacher, learner, CONFIG, as_is=True).faults


RECORDED_WRONGLY = {
    **{name: (partial(corrected, correction=name), f"the learner {name}") for name in CORRECTIONS[1:]},
    "clocks apart": (lambda one: delayed(one, -500.0), "the learner's clock 500."),
    "begun 3 s into the dance": (lambda one: Performance(one.joints_m[90:], one.times_s[:-90]), "the learner's clock 3."),
    "half the rate": (lambda one: delayed(one, 0.0, 0.5), "the learner's times multiplied by 2"),
    "25 as 30 frames a second": (lambda one: delayed(one, 0.0, 25 / 30), "the learner's times multiplied by 1.2"),
    "mirrored and early": (
        lambda one: delayed(corrected(one, "mirrored"), 3.0), "the learner mirrored, the learner's clock 3.0"
    ),
}  # fmt: skip
"""How a dance is recorded, and what corrects it."""


@pytest.fixture(scope="module")
def whole():
    """The similarity of the learner whose recording is right."""
    return score_dance(TEACHER, LEARNER, CONFIG).similarity


@pytest.mark.parametrize("wrongly", RECORDED_WRONGLY)
def test_what_no_dancer_does_is_corrected_and_both_scores_are_told(wrongly, whole):
    record, named = RECORDED_WRONGLY[wrongly]
    found = diagnose(TEACHER, record(LEARNER), CONFIG)
    score = score_dance(found.teacher, found.learner, CONFIG).similarity
    assert found.faults == [] and score == pytest.approx(found.corrected) and found.as_recorded <= score - 30
    assert score == pytest.approx(whole, abs=4) or (wrongly.startswith("begun") and score > whole / 2), score
    assert str(found).startswith(f"as it stands {found.as_recorded:.0f}, with ") and named in str(found)


def test_what_is_danced_in_free_parts_neither_hides_nor_makes_a_fault():
    free = (TEACHER.times_s >= 2) & (TEACHER.times_s < 7)
    learner_m = np.where(free[:, None, None], dance_joints_m(7, 12.0), mirrored(LEARNER.joints_m))
    found = diagnose(TEACHER, performed(learner_m), CONFIG, free_s=[(2, 7)])
    assert "the learner mirrored" in str(found)
    right = score_dance(TEACHER, LEARNER, CONFIG, free_s=[(2, 7)]).similarity
    assert found.corrected == pytest.approx(right, abs=2) and found.as_recorded < right - 30


def test_no_fault_of_a_dancer_is_corrected_and_good_recordings_and_poor_dancers_get_no_warning():
    learners = {
        name: performed(joints_of(fault(dance(0, 41, 12.0, 30.0), 3.0, np.random.default_rng(7))))
        for name, fault in DANCERS_FAULTS.items()
    }
    learners |= {make.__name__: performed(make(TEACHER.joints_m)) for make in (made.legs_only, made.waving)}
    learners["still for 5 s"] = performed(made.held(TEACHER.joints_m, 4, 9))
    learners |= {f"late {late_s}": delayed(TEACHER, -late_s) for late_s in (-0.5, 0.8)}
    learners |= {f"tempo {tempo}": delayed(TEACHER, 0.0, tempo) for tempo in (0.9, 1.1)}
    half = TEACHER.times_s[:, None, None] < 6
    learners["mirrors at first"] = performed(np.where(half, mirrored(TEACHER.joints_m), TEACHER.joints_m))
    learners["mirrors at last"] = performed(np.where(half, TEACHER.joints_m, mirrored(TEACHER.joints_m)))
    still = performed(made.standing(TEACHER.joints_m))
    unwarned = {"right": LEARNER, "another dance": performed(dance_joints_m(1, 12.0)), "standing": still}
    for name, learner in (learners | unwarned).items():
        found = diagnose(TEACHER, learner, CONFIG)
        assert found.correction is None and found.learner is learner, (name, str(found))
        assert not found.faults or name not in unwarned, (name, found.faults)


def test_where_nothing_is_to_be_corrected_faults_are_named_with_the_option_that_corrects_them(whole):
    learner = delayed(corrected(TEACHER, "mirrored"), -2.3)
    as_is = diagnose(TEACHER, learner, CONFIG, as_is=True)
    assert as_is.correction is None and as_is.learner is learner and str(as_is) == ""
    texts = [fault.text for fault in as_is.faults]
    assert len(texts) == 2 and "learner mirrored" in texts[0] and "--late 2.30" in texts[1] and "\n" not in "".join(texts)
    (late,) = faults(TEACHER, delayed(LEARNER, -0.5))
    assert "late 0.50" in late.text and late.corrected == pytest.approx(whole, abs=4)
    (tempo,) = faults(TEACHER, delayed(LEARNER, 0.0, 0.8))
    assert "recorded at 30 frames a second, not 37.5" in tempo.text


@pytest.mark.parametrize(
    ("recorded", "given"), [("reflected", "swapped"), ("mirrored", "reflected"), ("as_recorded", "mirrored")]
)
def test_the_option_that_is_named_takes_the_place_of_the_one_given(recorded, given):
    now = corrected(corrected(TEACHER, recorded), given)
    (fault,) = diagnose(TEACHER, now, CONFIG, as_is=True, given=Correction(learner=given)).faults
    assert f"--correct-learner {recorded}" in fault.text


def test_a_practice_of_half_an_hour_is_diagnosed():
    long = np.concatenate([LEARNER.joints_m[::2], np.repeat(LEARNER.joints_m[-1:], 15 * 31 * 60, axis=0)])
    assert diagnose(TEACHER, Performance(long, np.arange(len(long)) / 15), CONFIG).correction is None


@pytest.mark.parametrize("correction", ["swapped", "reflected"])
def test_a_teachers_fault_is_the_teachers_and_one_of_both_is_told(correction):
    wrong = corrected(TEACHER, correction)
    (fault,) = faults(wrong, TEACHER)
    assert f"--correct-teacher {correction}" in fault.text and fault.corrected > 95
    (fault,) = faults(wrong, wrong)
    assert "knees of both dancers bend backwards" in fault.text and fault.corrected is None


def test_knees_that_bend_to_neither_front_nor_back_say_nothing():
    sideways_m = TEACHER.joints_m.copy()
    for part, x, y in (("SHOULDER", 0.2, -0.5), ("HIP", 0.1, 0), ("KNEE", 0.3, 0.4), ("FOOT", 0.1, 0.8)):
        sideways_m[:, Joint[f"RIGHT_{part}"]], sideways_m[:, Joint[f"LEFT_{part}"]] = (-x, y, 3), (x, y, 3)
    assert not knees_bend_backwards(performed(sideways_m))


@pytest.mark.parametrize(
    ("rate", "late_s", "is_sure"), [(0.8, -2.0, True), (1.25, 2.0, True), (0.9, -0.5, False), (1.1, 0.5, False)]
)
def test_what_a_dancer_may_do_faster_or_slower_late_or_early_is_not_sure(rate, late_s, is_sure):
    one = Correction("swapped", "mirrored", rate, late_s)
    assert one.sure == (one if is_sure else one._replace(rate=1.0, late_s=0.0))
    assert one.rest == (AS_RECORDED if is_sure else Correction(rate=rate, late_s=late_s))


def test_a_clock_that_is_late_is_corrected_to_an_earlier_one_from_its_first_frame_on():
    late = performed(TEACHER.joints_m, delay_s=10.0)
    np.testing.assert_allclose(delayed(late, 2.0, 1.25).times_s, 8 + 1.25 * TEACHER.times_s)
    for late_s, word in ((2.0, "earlier"), (-2.0, "later")):
        assert [str(one) for one in Correction(late_s=late_s).done] == [f"the learner's clock 2.00 s {word}"]


def after_standing(joints_m, seconds):
    """A dance before which the dancer stands for some seconds, as before the music begins."""
    return np.concatenate([np.repeat(TEACHER.joints_m[:1], round(30 * seconds), axis=0), joints_m])


def test_a_clock_is_corrected_as_exactly_where_the_teacher_stands_for_most_of_the_recording():
    joints_m = after_standing(TEACHER.joints_m, 20)
    found = diagnose(performed(joints_m), performed(joints_m, 2.1), CONFIG)
    assert found.correction.late_s == pytest.approx(2.1, abs=0.02) and found.corrected > 99


def test_who_mirrors_a_part_of_the_dance_is_not_corrected_however_long_the_teacher_stands():
    joints_m = mirrored(TEACHER.joints_m)
    joints_m[-110:] = TEACHER.joints_m[-110:]  # a third of the dance is danced as it is
    for seconds in (0, 40):
        found = diagnose(*(performed(after_standing(one, seconds)) for one in (TEACHER.joints_m, joints_m)), CONFIG)
        assert found.correction is None, seconds
