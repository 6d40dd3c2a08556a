"""Faults on the stage, which angles of the body about itself do not tell, on composed dances that travel."""

from itertools import pairwise

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, noisy, performed, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kpopnet.dance.dimensions.stage import DIMENSIONS
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.scoring import score_dance
from kpopnet.skeleton import Joint

SECONDS = 16.0
DANCES = range(3)
FAULT_S = 6.0, 10.0
HIPS = [Joint.LEFT_HIP, Joint.RIGHT_HIP]


def stage(teacher_m, learner_m, delay_s=0.0):
    return score_dance(performed(teacher_m), performed(learner_m, delay_s)).stage


def during(joints_m):
    """(T,) 1 within FAULT_S, 0 elsewhere, with a fifth of a second between."""
    seconds = np.arange(len(joints_m)) / FPS
    return np.clip(np.minimum(seconds - FAULT_S[0], FAULT_S[1] - seconds) * 5, 0, 1)


def moved(joints_m, path_m):
    return joints_m + path_m[:, None]


def elsewhere(joints_m, metres):
    return moved(joints_m, during(joints_m)[:, None] * [metres, 0, 0])


def jumping(joints_m, metres):
    beats = np.maximum(np.sin(np.arange(len(joints_m)) / FPS * 2 * np.pi), 0)
    return moved(joints_m, (during(joints_m) * beats)[:, None] * [0, -metres, 0])


def leaning(joints_m, degrees):
    """Turned to the front about the hips."""
    axis, turn = made.across(joints_m), np.radians(degrees) * during(joints_m)
    hips_m = joints_m[:, HIPS].mean(axis=1, keepdims=True)
    return hips_m + np.stack([made.rotated(joints_m[:, j] - hips_m[:, 0], axis, turn) for j in Joint], axis=1)


def facing(joints_m, degrees):
    hips_m = joints_m[:, HIPS].mean(axis=1, keepdims=True)
    turn = Rotation.from_rotvec(np.radians(degrees) * during(joints_m)[:, None] * [0.0, -1.0, 0.0])
    return hips_m + np.stack([turn.apply(joints_m[:, j] - hips_m[:, 0]) for j in Joint], axis=1)


FAULTS = {"place": (elsewhere, (0.2, 0.5, 1.0)), "height": (jumping, (0.1, 0.2, 0.4))} | {
    "lean": (leaning, (15, 30, 60)),
    "facing": (facing, (30, 60, 120)),
}


@pytest.mark.parametrize("index", DANCES)
@pytest.mark.parametrize("name", FAULTS)
def test_a_greater_fault_costs_more_of_its_own_figure_in_its_own_time_alone(name, index):
    joints_m = dance_joints_m(index, SECONDS)
    fault, sizes = FAULTS[name]
    scores = [stage(joints_m, fault(joints_m, size)) for size in sizes]
    figures = [100.0, *(one.figures[name] for one in scores)]
    assert all(before - after > 2 for before, after in pairwise(figures)), figures
    for score in scores:
        others = {other: value for other, value in score.figures.items() if other != name}
        assert min(others.values()) > 97, others
        large = np.linalg.norm(score.errors[name], axis=1) > DIMENSIONS[name].mentioned / 2
        seconds = np.flatnonzero(large) / FPS
        assert not len(seconds) or (FAULT_S[0] - 0.1 < seconds[0] and seconds[-1] < FAULT_S[1] + 0.1)
    signed = np.nanmean(scores[1].errors[name][round(FAULT_S[0] * FPS) : round(FAULT_S[1] * FPS)], axis=0)
    assert signed[-1 if name == "lean" else 0] > 0  # to the left of who faces the camera, up, to the front, turned left


@pytest.mark.parametrize("index", DANCES)
def test_faults_that_a_dance_of_angles_does_not_have(index):
    joints_m = dance_joints_m(index, SECONDS)
    path_m = (joints_m[:, HIPS].mean(axis=1) - joints_m[:1, HIPS].mean(axis=1)) * [1, 0, 1]
    spot, opposite = (stage(joints_m, moved(joints_m, share * path_m)).figures["place"] for share in (-1, -2))
    assert opposite <= spot < 90 and opposite < 60
    assert stage(joints_m, turned(joints_m, np.array([1.0, 0, 0]), np.pi / 2)).figures["lean"] < 1
    score = score_dance(performed(joints_m), performed(moved(joints_m, -2 * path_m)))
    assert score.similarity > 99.9


@settings(max_examples=8, deadline=None)
@given(
    st.sampled_from(DANCES),
    st.floats(-np.pi, np.pi),
    st.floats(-0.8, 0.8),
    st.floats(0.6, 1.2),
    st.sampled_from([0.0, 0.25]),
)
def test_the_camera_the_size_and_the_delay_cost_nothing(index, heading, pitch, size, delay_s):
    joints_m = dance_joints_m(index, SECONDS)
    camera = Rotation.from_euler("yx", [heading, pitch])
    seen_m = size * joints_m @ camera.as_matrix().T + [0.5, 0.2, 2.0]
    assert min(stage(joints_m, seen_m, delay_s).figures.values()) > 97


@pytest.mark.parametrize("index", DANCES)
def test_faults_of_the_arms_and_an_estimators_noise_hardly_count(index):
    joints_m = dance_joints_m(index, SECONDS)
    for learner_m in (made.arms_lowered(joints_m, 30), made.elbows_bent(joints_m, 45), noisy(joints_m, 0.03)):
        assert min(stage(joints_m, learner_m).figures.values()) > 95


def test_frame_by_frame_and_at_once_are_the_same():
    joints_m = dance_joints_m(0, SECONDS)
    learner_m = facing(elsewhere(joints_m, 0.4), 50)
    scorer = OnlineScorer(performed(joints_m))
    for frame, pose_m in enumerate(learner_m):
        scorer.update(pose_m, frame / FPS)
    online, offline = scorer.finish().stage, stage(joints_m, learner_m)
    assert online.figures == pytest.approx(offline.figures)


def test_what_is_not_seen_has_no_figure():
    joints_m = dance_joints_m(0, SECONDS)
    legless_m = joints_m.copy()
    legless_m[:, HIPS] = np.nan
    assert stage(joints_m, legless_m).figures == {}
    seated_m = joints_m.copy()
    seated_m[:, [Joint.LEFT_KNEE, Joint.RIGHT_KNEE, Joint.LEFT_FOOT, Joint.RIGHT_FOOT]] = np.nan
    assert set(stage(joints_m, seated_m).figures) == {"lean", "facing"}  # steps have no measure without the body's length
    headless_m = joints_m.copy()
    headless_m[:, [Joint.NECK, Joint.HEAD]] = np.nan
    assert "lean" not in stage(headless_m, headless_m).figures
    hidden_m = made.hidden(joints_m, 8.0, 16.0)
    assert min(stage(joints_m, hidden_m).figures.values()) > 99


def test_what_is_most_wrong_is_said_in_words():
    joints_m = dance_joints_m(0, SECONDS)
    learner_m = facing(elsewhere(joints_m, 0.8), -90)
    remarks = dict(reversed(one) for one in score_dance(performed(joints_m), performed(learner_m)).stage_remarks())
    assert set(remarks) == {"0.8 m too far left", "90° turned to the right"} and all(
        abs(at_s - FAULT_S[0]) < 0.3 for at_s in remarks.values()
    )
