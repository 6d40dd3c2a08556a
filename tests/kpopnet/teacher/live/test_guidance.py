"""What the learner is told."""

from dataclasses import replace

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from kpopnet.dance.feedback import Moment
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from kpopnet.teacher.live.guidance import in_words, latest_words, where_to_stand
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.running import excerpt, scorer_config
from kpopnet.teacher.live.stage import picture
from kpopnet.teacher.live.verdict import Recording, verdict

CAMERA, SURE = CAMERAS["kinect_v1"], np.ones(15)
NOTES = {"frames": 300, "fps": 30.0}


def standing(z_m: float, x_m: float = 0.0) -> np.ndarray:
    """(15, 3) joints of somebody 1.5 m from head to feet, in the middle of the picture."""
    joints_m = np.zeros((15, 3))
    joints_m[:, 1], joints_m[Joint.HEAD, 1] = 0.1, -0.75
    joints_m[[Joint.LEFT_FOOT, Joint.RIGHT_FOOT], 1] = 0.75
    joints_m[:, 0], joints_m[:, 2] = x_m, z_m
    return joints_m


@pytest.mark.parametrize(
    ("joints_m", "confidence", "told"),
    [
        (standing(2.5), SURE, ""),
        (None, None, "nobody there"),
        (np.full((15, 3), np.nan), 0 * SURE, "nobody there"),
        (standing(1.0), SURE, "step back"),
        (standing(1.7), SURE, "step back"),
        (standing(5.0), SURE, "come closer"),
        (standing(2.5) + np.array([0, 0.4, 0]), SURE, "your feet are hidden"),
        (standing(2.5), np.where(np.arange(15) < 13, 1, 0.1), "your feet are hidden"),
        (standing(2.5, x_m=-1.39), SURE, "move to your left"),
        (standing(2.5, x_m=1.39), SURE, "move to your right"),
    ],
)
def test_where_to_stand(joints_m, confidence, told):
    assert where_to_stand(joints_m, confidence, CAMERA) == told


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
    assert in_words(Moment(0, 1, part, "", direction, 20.0, delay_s, 1.0, "")) == words


@pytest.fixture(scope="module")
def taught(library):
    dance = library.dance("dance_001")
    return dance, excerpt(dance.performance, 0.0, 10.0)


def test_a_hanging_arm_is_named(taught):
    _, teacher = taught
    joints_m = teacher.joints_m.copy()
    upper = np.linalg.norm(joints_m[:, Joint.LEFT_ELBOW] - joints_m[:, Joint.LEFT_SHOULDER], axis=1)
    joints_m[:, Joint.LEFT_ELBOW] = joints_m[:, Joint.LEFT_SHOULDER] + np.stack([0 * upper, upper, 0 * upper], axis=1)
    joints_m[:, Joint.LEFT_HAND] = joints_m[:, Joint.LEFT_ELBOW] + [0, 0.25, 0.02]
    score = score_dance(teacher, Performance(joints_m, teacher.times_s))
    assert "left arm" in latest_words(score)
    told = verdict(score, Lesson("dance_001"), taught[0].about, NOTES)
    assert told["worst"][0]["part"] == "left arm" and min(told["parts"], key=told["parts"].get) == "left arm"


def test_a_perfect_dance_has_no_worst_moments(taught):
    dance, teacher = taught
    told = verdict(score_dance(teacher, teacher), Lesson("dance_001"), dance.about, NOTES)
    assert told["total"] > 99 and told["worst"] == [] and told["hints"] == []
    assert latest_words(score_dance(teacher, teacher)) == ""
    slow = verdict(score_dance(teacher, teacher), Lesson("dance_001"), dance.about, {"fps": 4.0})
    assert "only 4 images a second" in slow["hints"][0]


def test_nobody_has_no_score(taught):
    told = verdict(None, Lesson("dance_001"), taught[0].about, NOTES)
    assert told["total"] is None and "nobody" in told["hints"][0]
    assert Recording().arrays()["joints_m"].shape == (0, 15, 3)


@pytest.mark.parametrize(
    "wrong",
    [{"speed": 0.1}, {"speed": float("nan")}, {"dance": "../x"}, {"latency_s": 3.0}, {"from_s": -1.0}, {"seed": -1}],
)
def test_a_lesson_is_checked(wrong):
    with pytest.raises(InputError):
        replace(Lesson("dance_001"), **wrong)


def test_an_excerpt_is_long_enough_to_be_scored():
    assert Lesson("d", from_s=2.0, to_s=99.0).excerpt_s(20.0) == (2.0, 20.0)
    with pytest.raises(InputError, match="choose at least"):
        Lesson("d", from_s=18.0).excerpt_s(20.0)


def test_the_clock_runs_at_the_dances_speed():
    clock = DanceClock(4.0, 0.5)
    assert clock.dance_s(123.0) == 4.0 and not clock.running
    clock.start(0.0)
    begin = clock.dance_s(0.0)
    assert clock.dance_s(10.0) - begin == pytest.approx(5.0) and clock.running
    clock.stop()
    assert clock.dance_s(9.0) == 4.0


def test_in_a_mirror_left_is_left_and_on_a_stage_both_are_right():
    assert scorer_config(Lesson("d"), "none").mirrored == "false"
    config = scorer_config(Lesson("d", mirrored=False, latency_s=0.2, speed=0.5), "none")
    assert config.mirrored == "auto" and config.latency_s == pytest.approx(0.1) and SCORERS["dance22"].latency_s == 0


def test_the_picture_tells_near_from_far_and_from_nothing():
    depth_m = np.tile(np.array([0.0, 0.6, 5.0], np.float32), (4, 8))
    shown = np.frombuffer(picture(depth_m), np.uint8)
    assert shown[:4].view("<u2").tolist() == [24, 4]
    nothing, near, far = shown[4:7]
    assert nothing == 0 and 0 < near < 20 and far > 200
