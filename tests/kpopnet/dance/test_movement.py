"""Amplitude, energy, sharpness and rhythm: each falls with its own fault, alone."""

from itertools import pairwise

import dance_learners as made
import numpy as np
import pytest
from dance_people import dance_joints_m, noisy, performed
from scipy.spatial.transform import Rotation

from kpopnet.dance.dimensions.movement import FLOOR_RAD, FLOOR_RAD_S, LAG, accents_s, dynamics, rhythm, spread_rad
from kpopnet.dance.features import limb_directions
from kpopnet.dance.scoring import score_dance
from kpopnet.dance.window import FPS
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
    assert steady.spread_s + 0.02 < unsteady.spread_s < 0.1 and unsteady.figure < steady.figure - 10
    assert str(steady) == "steadily on the beat" and str(unsteady).startswith("unsteadily")
    assert scored(TEACHER_M).rhythm(BEATS_S).spread_s == 0  # no less steady than the teacher, whose accents are beside the beat


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


STANDING_M = np.array(
    [
        *((0, -0.6, 0), (0, -0.4, 0), (-0.2, -0.4, 0), (0.2, -0.4, 0), (-0.5, -0.4, 0), (0.5, -0.4, 0), (-0.8, -0.4, 0)),
        *((0.8, -0.4, 0), (0, -0.1, 0), (-0.1, 0.1, 0), (0.1, 0.1, 0), (-0.1, 0.5, 0), (0.1, 0.5, 0), (-0.1, 0.9, 0)),
        (0.1, 0.9, 0),
    ]
)
"""(15, 3) a person who faces the camera, arms stretched sideways, metres."""
AT_S = np.arange(240) / FPS


def swinging(**arms_rad):
    """(T, 15, 3) the person who stands, whose straight arms, by side, are lowered by (T,) angles."""
    joints_m = np.repeat(STANDING_M[None], len(AT_S), axis=0)
    for side, angles_rad in arms_rad.items():
        shoulder, elbow, hand = (Joint[f"{side}_{part}".upper()] for part in ("shoulder", "elbow", "hand"))
        out = np.sign(STANDING_M[hand, 0])
        for joint in (elbow, hand):
            along = np.stack([out * np.cos(angles_rad), np.sin(angles_rad), np.zeros(len(AT_S))], axis=1)
            joints_m[:, joint] = STANDING_M[shoulder] + along * abs(STANDING_M[joint, 0] - STANDING_M[shoulder, 0])
    return joints_m


def swing(size_rad, hz):
    return size_rad * np.sin(2 * np.pi * hz * AT_S)


def test_of_swinging_arms_amplitude_energy_and_sharpness_are_those_of_their_sines():
    """Half as far, and the right arm twice as fast; a leg that the teacher does not move has no ratio."""
    hz = {"right": 1.0, "left": 0.5}
    teacher_m = swinging(**{side: swing(0.4, 0.5) for side in hz})
    learner_m = swinging(**{side: swing(0.2, one) for side, one in hz.items()})
    moved = dynamics(teacher_m, learner_m, np.arange(len(AT_S)))

    def energy_rad_s(size_rad, hz):  # of two bones that turn alike, over steps of LAG frames
        return 2 * size_rad * np.sin(np.pi * hz * LAG / FPS) * FPS / LAG + FLOOR_RAD_S

    assert set(moved.ratios) == {"right arm", "left arm"}
    for column, side in enumerate(hz):
        ratios = moved.ratios[f"{side} arm"]
        assert ratios["amplitude"] == pytest.approx((0.2 + FLOOR_RAD) / (0.4 + FLOOR_RAD), rel=0.02)
        assert ratios["energy"] == pytest.approx(energy_rad_s(0.2, hz[side]) / energy_rad_s(0.4, 0.5), rel=0.04)
        assert ratios["sharpness"] == pytest.approx(ratios["energy"] / ratios["amplitude"])
        np.testing.assert_allclose(moved.amplitude[:, column], ratios["amplitude"], rtol=0.02)
        np.testing.assert_allclose(moved.sharpness[:, column], ratios["sharpness"], rtol=0.05)
    assert np.isnan(moved.amplitude[:, 2:]).all() and np.isnan(moved.sharpness[:, 2:]).all()


def test_a_late_learner_is_compared_with_what_the_teacher_danced_then():
    teacher_m = swinging(right=np.where(AT_S < 4, 0.3, 0.9) * np.sin(np.pi * AT_S))
    matched = np.maximum(np.arange(len(AT_S)) - round(1.5 * FPS), 0)
    moved = dynamics(teacher_m, teacher_m[matched], matched)
    np.testing.assert_allclose(moved.amplitude[moved.start_s >= 1.5, 0], 1)


@pytest.mark.parametrize("first_s", [0.487, 0.5, 0.513])
def test_accents_are_where_an_arm_turns_back_between_two_frames_and_none_is_where_it_is_not_seen(first_s):
    joints_m = swinging(right=0.5 * np.cos(np.pi * (AT_S - first_s)))
    found_s = accents_s(joints_m)
    np.testing.assert_allclose(found_s, first_s + np.arange(len(found_s)), atol=0.006)
    assert len(found_s) >= 7
    joints_m[round(3.3 * FPS) : round(3.7 * FPS), Joint.RIGHT_HAND] = np.nan
    assert not np.any(abs(accents_s(joints_m) - 3.5) < 0.15)


def test_a_teacher_whose_accents_lie_anywhere_in_the_beat_has_no_rhythm():
    joints_m = swinging(right=0.5 * np.cos(np.pi * (AT_S - 0.5)))
    assert rhythm(joints_m, joints_m, np.arange(0, 8.5, 1.0)).figure == pytest.approx(100)
    assert rhythm(joints_m, joints_m, np.arange(0, 8.5, 8 / 7)) is None


def test_the_spread_around_a_frame_is_that_of_the_frames_around_it_and_unknown_beside_a_missing_one():
    joints_m = swinging(right=swing(0.4, 0.5), left=swing(0.3, 0.3))
    joints_m[100, Joint.LEFT_HAND] = np.nan
    found, frames = spread_rad(joints_m, 31), np.arange(15, len(AT_S) - 15)
    directions = limb_directions(joints_m)
    directions[100] = np.nan
    expected = [np.sqrt(directions[frame - 15 : frame + 16].var(axis=0).sum(axis=1)) for frame in frames]
    np.testing.assert_allclose(found[frames], expected, atol=1e-6)
    assert np.isnan(found[85:116]).all() and np.isfinite(found[:, 0]).sum() == len(found) - 31
