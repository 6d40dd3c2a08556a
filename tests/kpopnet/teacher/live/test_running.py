"""A try of a dance, image by image, without a camera."""

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.running import RunningLesson
from kpopnet.teacher.live.watching import Image

CAMERA, DEPTH_M = CAMERAS["kinect_v1"], np.zeros((240, 320), np.float32)


class AtOnce(DanceClock):
    """A clock whose dance began at 0."""

    def __init__(self, speed: float = 1.0) -> None:
        super().__init__(0.0, speed)
        self._start = 0.0


def danced(dance, fps: float, lesson: Lesson, late_s: float = 0.0, seconds: float = 8.0) -> dict:
    """The verdict on a perfect learner of whom an image is taken `fps` times a second."""
    running, clock = RunningLesson(lesson, dance, "none"), AtOnce(lesson.speed)
    running.rehearse()
    for taken in np.arange(0.0, seconds / lesson.speed, 1 / fps):
        frame = round(max(clock.dance_s(taken) - late_s, 0.0) * dance.fps)
        running.score(clock, Image(DEPTH_M, float(taken)), dance.joints_m[frame], np.ones(15))
    result, recording = running.finish(0)
    assert len(recording.times_s) == result["notes"]["frames"]
    return result


@pytest.fixture(scope="module")
def dance(library):
    return library.dance("dance_001")


def test_a_perfect_learner_scores_full_at_any_speed(dance):
    for speed in (1.0, 0.5):
        result = danced(dance, 30.0, Lesson("dance_001", to_s=8.0, speed=speed))
        assert result["total"] > 98 and result["worst"] == [] and result["notes"]["fps"] == pytest.approx(30, abs=0.5)


def test_a_slow_machine_costs_little_and_is_told(dance):
    result = danced(dance, 6.0, Lesson("dance_001", to_s=8.0))
    assert result["total"] > 75 and "only 6 images a second" in result["hints"][0]
    assert not any("nobody" in hint for hint in result["hints"])


def test_a_constant_delay_is_measured_and_taken_off(dance):
    late = danced(dance, 30.0, Lesson("dance_001", to_s=8.0), late_s=0.2)
    assert late["latency_s"] == pytest.approx(0.2, abs=0.04) and late["timing"] < 95
    mended = danced(dance, 30.0, Lesson("dance_001", to_s=8.0, latency_s=late["latency_s"]), late_s=0.2, seconds=8.2)
    assert mended["timing"] > 97 and mended["total"] > late["total"]


def test_nobody_has_no_score_and_a_long_gap_stays_one(dance):
    running = RunningLesson(Lesson("dance_001", to_s=8.0), dance, "none")
    shown = running.shown(AtOnce(), Image(DEPTH_M, 1.0), None, None, CAMERA)
    assert shown["guidance"] == "nobody there" and shown["joints"] is None
    result, recording = running.finish(0)
    assert result["total"] is None and len(recording.times_s) == 0
    clock = AtOnce()
    for taken in (*np.arange(0, 3, 1 / 30), *np.arange(6, 8, 1 / 30)):
        running.score(clock, Image(DEPTH_M, float(taken)), dance.joints_m[round(taken * 30)], np.ones(15))
    result, _ = running.finish(0)
    assert any("nobody in the picture" in hint for hint in result["hints"]) and result["total"] < 85


def test_missing_joints_are_shown_as_missing(dance):
    running, joints_m = RunningLesson(Lesson("dance_001"), dance, "none"), dance.joints_m[0].copy()
    joints_m[3] = np.nan
    shown = running.shown(AtOnce(), Image(DEPTH_M, 0.0), joints_m, np.ones(15), CAMERA)
    assert shown["joints"][3][:3] == [None, None, None] and 0 < shown["joints"][8][0] < 1
