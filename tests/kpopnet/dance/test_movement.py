"""Amplitude, energy, sharpness and rhythm: each falls with its own fault, alone, on composed and on recorded dances."""

from functools import cache, partial
from itertools import pairwise

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, noisy, performed
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.scoring import score_dance
from kpopnet.skeleton import Joint
from synth.motion.choreography.composer import tempo_bpm

SECONDS = 24.0
COMPOSED = ["20", "21"]
RECORDED = ["g1_J_Dance11_Gnarly", "g1_J_Dance5_Hype"]
DANCES = pytest.mark.parametrize("name", [*COMPOSED, *RECORDED])


@cache
def taught_m(name):
    if name in COMPOSED:
        return dance_joints_m(int(name), SECONDS)
    if not made.CLIPS.is_dir():
        pytest.skip(f"{made.CLIPS}: no recorded dances here")
    return made.clip_joints_m("test", name, SECONDS)


def scored(teacher_m, learner_m, delay_s=0.0):
    return score_dance(performed(teacher_m), performed(learner_m, delay_s))


def beats_s(name):
    return np.arange(0, SECONDS, 60 / tempo_bpm(int(name), 41))


@DANCES
def test_smaller_movements_cost_amplitude_and_energy_but_no_sharpness(name):
    figures = [scored(taught_m(name), made.smaller(taught_m(name), size)).dynamics.figures for size in (1, 0.9, 0.8, 0.65)]
    for figure in ("amplitude", "energy"):
        assert all(more - less > 1 for more, less in pairwise(one[figure] for one in figures)), figures
    assert figures[0]["amplitude"] > 99.9 and figures[2]["sharpness"] > 97 and figures[3]["sharpness"] > 95


@DANCES
def test_softer_movements_cost_sharpness(name):
    figures = [scored(taught_m(name), made.softened(taught_m(name), one)).dynamics.figures for one in (0.001, 0.1, 0.2, 0.3)]
    assert all(more["sharpness"] - less["sharpness"] > 1 for more, less in pairwise(figures)), figures


@pytest.mark.parametrize("name", COMPOSED)
def test_lateness_costs_rhythm_and_is_told_in_seconds(name):
    beats, figures = beats_s(name), []
    for delay_s in (0.0, 0.05, 0.1, 0.15):
        score = scored(taught_m(name), taught_m(name), delay_s)
        rhythm = score.rhythm(beats)
        assert rhythm.ahead_s == pytest.approx(-delay_s, abs=0.02) and min(score.dynamics.figures.values()) > 97
        figures.append(rhythm.figure)
    assert figures[0] > 99.9 and all(more - less > 3 for more, less in pairwise(figures)), figures
    early = scored(taught_m(name), taught_m(name), -0.1).rhythm(beats)
    assert "ahead of the beat" in str(early) and "behind the beat" in str(rhythm)


@pytest.mark.parametrize("name", COMPOSED)
def test_an_unsteady_dancer_is_told_from_a_steady_one(name):
    steady, unsteady = (
        scored(taught_m(name), made.good(taught_m(name), 1, 0.0, spread_s)).rhythm(beats_s(name)) for spread_s in (0.01, 0.1)
    )
    assert unsteady.spread_s > steady.spread_s + 0.02 and unsteady.figure < steady.figure - 10
    assert "steadily on the beat" in str(steady)


@settings(max_examples=6, deadline=None)
@given(st.sampled_from(COMPOSED), st.floats(-np.pi, np.pi), st.floats(-0.6, 0.6), st.floats(0.6, 1.2))
def test_camera_and_size_cost_nothing(name, heading, pitch, size):
    seen_m = size * taught_m(name) @ Rotation.from_euler("yx", [heading, pitch]).as_matrix().T + [0.5, 0.2, 2.0]
    score = scored(taught_m(name), seen_m)
    assert min(score.dynamics.figures.values()) > 99 and score.rhythm(beats_s(name)).figure > 97


@pytest.mark.parametrize("fault", [partial(made.hunched, degrees=20), partial(noisy, deviation_m=0.005)])
@pytest.mark.parametrize("name", COMPOSED)
def test_faults_of_posture_and_a_little_noise_hardly_count(name, fault):
    assert min(scored(taught_m(name), fault(taught_m(name))).dynamics.figures.values()) > 93


def test_a_fault_shows_where_it_is():
    teacher_m = taught_m("20")
    learner_m = teacher_m.copy()
    learner_m[240:420] = made.smaller(teacher_m, 0.6)[240:420]
    moved = scored(teacher_m, learner_m).dynamics
    outside = (moved.start_s + 2 < 8) | (moved.start_s > 14)
    inside = (moved.start_s >= 8) & (moved.start_s + 2 <= 14)
    assert np.nanmin(moved.amplitude[outside]) > 0.95 and np.nanmedian(moved.amplitude[inside]) < 0.8


def test_frame_by_frame_and_at_once_are_the_same():
    teacher_m = taught_m("21")
    learner_m = made.smaller(teacher_m, 0.8)
    scorer = OnlineScorer(performed(teacher_m))
    for frame, pose_m in enumerate(learner_m):
        scorer.update(pose_m, frame / FPS)
    online, offline = scorer.finish(), scored(teacher_m, learner_m)
    assert online.dynamics.figures == pytest.approx(offline.dynamics.figures)
    assert online.rhythm(beats_s("21")) == pytest.approx(offline.rhythm(beats_s("21")))


def test_who_is_not_seen_has_no_figures():
    joints_m = made.hidden(taught_m("20"), 0, SECONDS, [Joint.TORSO])
    score = scored(taught_m("20"), joints_m)
    assert score.dynamics.figures == {} and score.rhythm(beats_s("20")) is None
