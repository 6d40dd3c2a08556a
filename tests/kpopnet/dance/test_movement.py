"""Amplitude, energy, sharpness and rhythm: each falls with its own fault, alone."""

from itertools import pairwise

import dance_learners as made
import numpy as np
import pytest
from dance_people import dance_joints_m, noisy, performed
from scipy.spatial.transform import Rotation

from kpopnet.dance.scoring import score_dance
from kpopnet.skeleton import Joint
from synth.motion.choreography.composer import tempo_bpm

SECONDS = 16.0
TEACHER_M = dance_joints_m(20, SECONDS)
BEATS_S = np.arange(0, SECONDS, 60 / tempo_bpm(20, 41))
RECORDED = "g1_J_Dance11_Gnarly"


def scored(learner_m, delay_s=0.0, teacher_m=TEACHER_M):
    return score_dance(performed(teacher_m), performed(learner_m, delay_s))


@pytest.mark.parametrize("recorded", [False, True])
def test_smaller_movements_cost_amplitude_and_energy_and_softer_ones_sharpness(recorded):
    if recorded and not made.CLIPS.is_dir():
        pytest.skip(f"{made.CLIPS}: no recorded dances here")
    teacher_m = made.clip_joints_m("test", RECORDED, SECONDS) if recorded else TEACHER_M
    small = [scored(made.smaller(teacher_m, size), 0.0, teacher_m).dynamics.figures for size in (1, 0.8, 0.65)]
    for figure in ("amplitude", "energy"):
        assert all(more - less > 1 for more, less in pairwise(one[figure] for one in small)), small
    assert small[0]["amplitude"] > 99.9 and small[1]["sharpness"] > 97 and small[2]["sharpness"] > 95
    soft = [scored(made.softened(teacher_m, one), 0.0, teacher_m).dynamics.figures for one in (0.001, 0.1, 0.3)]
    assert all(more["sharpness"] - less["sharpness"] > 1 for more, less in pairwise(soft)), soft


def test_lateness_costs_rhythm_and_is_told_in_seconds():
    figures = []
    for delay_s in (0.0, 0.05, 0.15):
        score = scored(TEACHER_M, delay_s)
        rhythm = score.rhythm(BEATS_S)
        assert rhythm.ahead_s == pytest.approx(-delay_s, abs=0.02) and min(score.dynamics.figures.values()) > 97
        figures.append(rhythm.figure)
    assert figures[0] > 99.9 and all(more - less > 3 for more, less in pairwise(figures)), figures
    assert "behind the beat" in str(rhythm) and "ahead of the beat" in str(scored(TEACHER_M, -0.1).rhythm(BEATS_S))


def test_an_unsteady_dancer_is_told_from_a_steady_one():
    steady, unsteady = (scored(made.good(TEACHER_M, 1, 0.0, spread_s)).rhythm(BEATS_S) for spread_s in (0.01, 0.1))
    assert unsteady.spread_s > steady.spread_s + 0.02 and unsteady.figure < steady.figure - 10
    assert "steadily on the beat" in str(steady)


def test_camera_size_posture_and_a_little_noise_hardly_count():
    camera = Rotation.from_euler("yx", [2.0, 0.5]).as_matrix()
    score = scored(0.7 * TEACHER_M @ camera.T + [0.5, 0.2, 2.0])
    assert min(score.dynamics.figures.values()) > 99 and score.rhythm(BEATS_S).figure > 97
    for learner_m in (made.hunched(TEACHER_M, 20), noisy(TEACHER_M, 0.005)):
        assert min(scored(learner_m).dynamics.figures.values()) > 93


def test_a_fault_shows_where_it_is_and_who_is_not_seen_has_no_figures():
    learner_m = TEACHER_M.copy()
    learner_m[180:360] = made.smaller(TEACHER_M, 0.6)[180:360]
    moved = scored(learner_m).dynamics
    outside = (moved.start_s + 2 < 6) | (moved.start_s > 12)
    inside = (moved.start_s >= 6) & (moved.start_s + 2 <= 12)
    assert np.nanmin(moved.amplitude[outside]) > 0.95 and np.nanmedian(moved.amplitude[inside]) < 0.8
    learner_m[:, Joint.TORSO] = np.nan
    unseen = scored(learner_m)
    assert unseen.dynamics.figures == {} and unseen.rhythm(BEATS_S) is None
