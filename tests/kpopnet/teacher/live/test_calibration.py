"""The guided step that measures the latency of a set-up."""

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from kpopnet.teacher.live.calibration import Calibration
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.watching import Image
from synth.dances.live import ON_THE_BEAT, LiveLearner

CAMERA, DEPTH_M = CAMERAS["kinect_v1"], np.zeros((240, 320), np.float32)
LESSON = Lesson("dance_001", to_s=12.0, calibrate=True)


class AtOnce(DanceClock):
    """A clock whose dance began at 0."""

    def __init__(self) -> None:
        super().__init__(0.0, 1.0)
        self._start = 0.0


def measured(dance, joints_at) -> dict:
    """The result of a step of 12 s; `joints_at` gives the learner's joints at a time in seconds."""
    step, clock = Calibration(LESSON, dance, "none"), AtOnce()
    step.rehearse()
    for taken in np.arange(0, 12, 1 / 15):
        joints_m = joints_at(float(taken))
        confidence = None if joints_m is None else np.ones(15)
        image = Image(DEPTH_M, float(taken))
        step.score(clock, image, joints_m, confidence)
        assert step.shown(clock, image, joints_m, confidence, CAMERA)["total"] is None and step.next_verdict(clock) is None
    result, recording = step.finish(0)
    assert result["total"] is None and not recording.times_s  # it is no try of the dance
    return result


@pytest.mark.parametrize("fault", ["", "late"])
def test_the_arm_of_the_simulated_learner_tells_how_late_it_is_seen(library, fault):
    dance = library.dance("dance_001")
    learner = LiveLearner(dance.quats, dance.hips_m, dance.fps, ON_THE_BEAT, fault)
    take, scene = learner._take, learner._studio.scene

    def joints_at(time_s: float) -> np.ndarray:
        number = int(np.clip(round((time_s - 0.1) * dance.fps), 0, len(take.played) - 1))  # the camera is a tenth late
        scene.pose(take.played.local[number], take.played.hips_m[number] + take.place_m)
        return take.view.to_camera(scene.joints_world_m())

    expected_s = 0.1 + (0.35 if fault else 0.0)
    assert measured(dance, joints_at)["latency_s"] == pytest.approx(expected_s, abs=0.04)


def test_who_stands_still_or_is_not_there_is_asked_to_try_again(library):
    dance = library.dance("dance_001")
    for joints_at in (lambda time_s: dance.joints_m[0], lambda time_s: None):
        result = measured(dance, joints_at)
        assert result["latency_s"] is None and "try again" in result["hints"][0]
