"""What a lesson is, and what the page shows in words."""

from dataclasses import replace

import numpy as np
import pytest
from dance_learners import arm_lowered

from kpopnet.camera import CAMERAS
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import score_dance
from kpopnet.dance.words.moments import Moment
from kpopnet.errors import InputError
from kpopnet.pose import PersonPose
from kpopnet.skeleton import Joint
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.score import excerpt
from kpopnet.teacher.live.words import in_words, latest_words, try_result, where_to_stand

CAMERA, SURE = CAMERAS["kinect_v1"], np.ones(15)


def standing(z_m: float, x_m: float = 0.0) -> np.ndarray:
    """(15, 3) joints of a person of 1.5 m from head to feet, in the middle of the picture."""
    joints_m = np.zeros((15, 3))
    joints_m[:, 1], joints_m[Joint.HEAD, 1] = 0.1, -0.75
    joints_m[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 1] = 0.75
    joints_m[:, 0], joints_m[:, 2] = x_m, z_m
    return joints_m


@pytest.mark.parametrize(
    ("joints_m", "confidence", "told"),
    [
        (standing(2.5), SURE, ""),
        (np.full((15, 3), np.nan), 0 * SURE, "no person seen"),
        (standing(1.7), SURE, "step back"),
        (standing(2.0) + np.array([0, 0.08, 0]), SURE, "step back"),  # the feet are out, and there is no room above the head
        (standing(2.0) - np.array([0, 0.1, 0]), SURE, "step back"),  # the head alone is out
        (standing(5.0), SURE, "come closer"),
        (standing(2.5) + np.array([0, 0.4, 0]), SURE, "your feet are hidden"),
        (standing(2.5), np.where(np.arange(15) < 13, 1, 0.1), "your feet are hidden"),
        (standing(2.5, x_m=-1.39), SURE, "move to your left"),
        (standing(2.5, x_m=1.39), SURE, "move to your right"),
    ],
)
def test_where_to_stand(joints_m, confidence, told):
    assert where_to_stand(PersonPose(1, joints_m, confidence), CAMERA) == told


@pytest.mark.parametrize(
    ("part", "direction", "delay_s", "words"),
    [
        ("left arm", "too low", 0.0, "left arm too low"),
        ("timing", "late", 0.15, "a little late"),
        ("timing", "early", -0.5, "early"),
        ("turning", "turned too far to the left", 0.0, "body turned too far to the left"),
    ],
)
def test_moments_in_words(part, direction, delay_s, words):
    assert in_words(Moment(0, 1, part, "", direction, 20.0, delay_s, 1.0, "", "")) == words


def test_the_result_names_the_part_that_was_wrong_and_of_a_perfect_dance_none(library):
    dance = library.dance("dance_001")
    teacher, lesson, notes = excerpt(dance.performance, 0.0, 6.0), Lesson("dance_001"), {"fps": 30.0}
    perfect = score_dance(teacher, teacher)
    result = try_result(perfect, lesson, dance.about, notes)
    assert result["total"] > 99 and result["worst"] == [] and result["hints"] == [] and latest_words(perfect) == ""
    unknown = replace(dance.about, weights={"rhythm": 1.0})  # a still dance has none
    still = Performance(np.broadcast_to(teacher.joints_m[:1], teacher.joints_m.shape), teacher.times_s)
    result = try_result(score_dance(still, still), lesson, unknown, notes)
    assert result["total"] > 99 and result["weights"] == {} and "could not be measured" in result["hints"][0]
    score = score_dance(teacher, Performance(arm_lowered(teacher.joints_m, "left", 60), teacher.times_s))
    assert "left arm" in latest_words(score)
    result = try_result(score, lesson, dance.about, notes)
    assert result["worst"][0]["part"] == "left arm" and min(result["parts"], key=result["parts"].get) == "left arm"


@pytest.mark.parametrize(
    "wrong", [{"speed": 0.1}, {"speed": float("nan")}, {"dance": "../x"}, {"from_s": -1.0}, {"calibrate": True, "people": 2}]
)
def test_a_lesson_is_checked(wrong):
    with pytest.raises(InputError):
        replace(Lesson("dance_001"), **wrong)


def test_an_excerpt_is_long_enough_to_be_scored():
    assert Lesson("d", from_s=2.0, to_s=99.0).excerpt_s(20.0) == (2.0, 20.0)
    with pytest.raises(InputError, match="choose at least"):
        Lesson("d", from_s=18.0).excerpt_s(20.0)
