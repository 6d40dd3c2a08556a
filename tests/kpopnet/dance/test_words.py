"""Each angle that has words has the word for a body that is moved so, and not its opposite."""

from dataclasses import replace

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, performed

from kpopnet.dance.feedback import feedback
from kpopnet.dance.noise.table import NOISE
from kpopnet.dance.scoring import OURS, score_dance
from kpopnet.skeleton import Joint

X, Y, Z = np.eye(3)
LEG = {"HIP": (0.1, 0.0), "KNEE": (0.1, 0.4), "FOOT": (0.1, 0.8)}
STANDING = {"SHOULDER": (0.2, -0.5), "ELBOW": (0.2, -0.2), "HAND": (0.2, 0.1), **LEG}


def turned(joints_m, about, moved, axis, degrees):
    """Joints turned about another by degrees, one number or one for each frame."""
    frames = len(joints_m)
    angle_rad = np.radians(np.broadcast_to(degrees, frames))
    return made.turned_about(joints_m, about, moved, np.broadcast_to(axis, (frames, 3)), angle_rad)


def dancing(seconds=8.0):
    """(T, 15, 3) a person who faces the camera, arms held half forwards, knees half bent, and moves all limbs in time."""
    swing_deg = 15 * np.sin(np.pi * np.arange(round(FPS * seconds)) / FPS)
    joints_m = np.full((len(swing_deg), 15, 3), (0.0, 0.0, 3.0))
    joints_m[:, [Joint.HEAD, Joint.NECK, Joint.TORSO], 1] = -0.7, -0.5, -0.25
    for side, out in (("LEFT", 1), ("RIGHT", -1)):
        for joint, (x, y) in STANDING.items():
            joints_m[:, Joint[f"{side}_{joint}"], :2] = out * x, y
        shoulder, elbow, hand = made.ARMS[side.lower()]
        joints_m = turned(joints_m, shoulder, (elbow, hand), X, -(60 + swing_deg))
        joints_m = turned(joints_m, shoulder, (elbow, hand), Y, -35 * out)
        joints_m = turned(joints_m, elbow, (hand,), X, -40)
        hip, knee, foot = made.LEGS[side.lower()]
        joints_m = turned(joints_m, hip, (knee, foot), X, -(40 + swing_deg))
        joints_m = turned(joints_m, knee, (foot,), X, 50)
    return joints_m


TEACHER_M = dancing()
CASES = [
    (Joint.TORSO, made.UPPER, Y, 25, "torso", "twisted too far to the right", "twisted too far to the left"),
    (Joint.TORSO, made.UPPER, Z, 20, "torso", "leaning too far to the left", "leaning too far to the right"),
    (Joint.LEFT_SHOULDER, made.ARMS["left"][1:], Y, 30, "left arm", "too far across the front", "too far out or back"),
    (Joint.RIGHT_SHOULDER, made.ARMS["right"][1:], Y, -30, "right arm", "too far across the front", "too far out or back"),
    (Joint.LEFT_KNEE, made.LEGS["left"][2:], X, 30, "left leg", "too bent", "too straight"),
    (Joint.RIGHT_KNEE, made.LEGS["right"][2:], X, 30, "right leg", "too bent", "too straight"),
]


@pytest.mark.parametrize(("about", "moved", "axis", "degrees", "part", "word", "opposite"), CASES)
def test_each_side_has_its_word(about, moved, axis, degrees, part, word, opposite):
    for sign, expected, wrong in ((1, word, opposite), (-1, opposite, word)):
        learner_m = turned(TEACHER_M, about, moved, axis, sign * degrees)
        told = {(one.part, one.direction) for one in feedback(score_dance(performed(TEACHER_M), performed(learner_m))).faults}
        assert (part, expected) in told and (part, wrong) not in told


@pytest.mark.parametrize(("rate", "word"), [(1, "turned too far to the left"), (-1, "turned too far to the right")])
def test_who_turns_farther_to_a_side_is_told_that_side(rate, word):
    learner_m = made.headed(TEACHER_M, rate * np.radians(60) * np.arange(1, len(TEACHER_M) + 1) / FPS)
    faults = feedback(score_dance(performed(TEACHER_M), performed(learner_m))).faults
    assert {one.direction for one in faults if one.part == "turning"} == {word}


@pytest.mark.parametrize(("side", "degrees"), [("left", 30), ("right", -30)])
def test_through_a_picture_each_side_has_its_word_too(monkeypatch, side, degrees):
    monkeypatch.setitem(NOISE, "flat", NOISE["none"]._replace(sees_depth=False))
    shoulder, *arm = made.ARMS[side]
    learner_m = turned(TEACHER_M, shoulder, arm, Y, degrees)
    found = feedback(score_dance(performed(TEACHER_M), performed(learner_m), replace(OURS, noise="flat"))).faults
    told = {one.direction for one in found if one.part == f"{side} arm"}
    assert "too far across the front" in told and "too far out or back" not in told
