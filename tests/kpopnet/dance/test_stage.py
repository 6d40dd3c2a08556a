"""Faults on the stage, which angles of the body about itself do not tell, on a composed dance that travels."""

from itertools import pairwise

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, noisy, performed, turned
from scipy.spatial.transform import Rotation

from kpopnet.dance.dimensions.stage import DIMENSIONS, StageScore, stage_score, stance
from kpopnet.dance.feedback import feedback
from kpopnet.dance.scoring import score_dance
from kpopnet.skeleton import Joint

TEACHER_M = dance_joints_m(0, 16.0)
FAULT_S = 6.0, 10.0
HIPS, LEGS = [Joint.LEFT_HIP, Joint.RIGHT_HIP], [Joint.LEFT_KNEE, Joint.RIGHT_KNEE, Joint.LEFT_FOOT, Joint.RIGHT_FOOT]
SECONDS = np.arange(len(TEACHER_M)) / FPS
DURING = np.clip(np.minimum(SECONDS - FAULT_S[0], FAULT_S[1] - SECONDS) * 5, 0, 1)
"""(T,) 1 within FAULT_S, 0 elsewhere, with a fifth of a second between."""


def stage(learner_m, delay_s=0.0, teacher_m=TEACHER_M):
    return score_dance(performed(teacher_m), performed(learner_m, delay_s)).stage


def elsewhere(metres):
    return TEACHER_M + DURING[:, None, None] * [metres, 0, 0]


def jumping(metres):
    return TEACHER_M + (DURING * np.maximum(np.sin(SECONDS * 2 * np.pi), 0))[:, None, None] * [0, -metres, 0]


def about_the_hips(axes, degrees):
    hips_m = TEACHER_M[:, HIPS].mean(axis=1)
    angles_rad = np.radians(degrees) * DURING
    return np.stack([hips_m + made.rotated(TEACHER_M[:, joint] - hips_m, axes, angles_rad) for joint in Joint], axis=1)


def leaning(degrees):
    return about_the_hips(made.across(TEACHER_M), degrees)


def facing(degrees):
    return about_the_hips(np.broadcast_to(-made.DOWN, (len(TEACHER_M), 3)), degrees)


FAULTS = {
    "place": (elsewhere, (0.2, 0.5, 1.0)), "height": (jumping, (0.1, 0.2, 0.4)), "lean": (leaning, (15, 30, 60)),
    "facing": (facing, (30, 60, 120)),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_greater_fault_costs_more_of_its_own_figure_in_its_own_time_alone(name):
    fault, sizes = FAULTS[name]
    scores = [stage(fault(size)) for size in sizes]
    figures = [100.0, *(one.figures[name] for one in scores)]
    assert all(before - after > 2 for before, after in pairwise(figures)), figures
    for score in scores:
        others = {other: value for other, value in score.figures.items() if other != name}
        assert min(others.values()) > 97, others
        large = np.linalg.norm(score.errors[name], axis=1) > DIMENSIONS[name].mentioned / 2
        seconds = np.flatnonzero(large) / FPS
        assert not len(seconds) or (FAULT_S[0] - 0.1 < seconds[0] and seconds[-1] < FAULT_S[1] + 0.1)
    signed = np.nanmean(scores[1].errors[name][DURING == 1], axis=0)
    assert signed[-1 if name == "lean" else 0] > 0  # to the left of who faces the camera, up, to the front, turned left


def test_on_the_spot_the_opposite_way_and_lying_down_are_no_dance_of_angles():
    path_m = (TEACHER_M[:, HIPS].mean(axis=1) - TEACHER_M[:1, HIPS].mean(axis=1)) * [1, 0, 1]
    spot_m, opposite_m = (TEACHER_M + share * path_m[:, None] for share in (-1, -2))
    opposite = score_dance(performed(TEACHER_M), performed(opposite_m))
    assert opposite.similarity > 99.9 and opposite.stage.figures["place"] <= stage(spot_m).figures["place"] < 90
    assert opposite.stage.figures["place"] < 60
    assert stage(turned(TEACHER_M, np.array([1.0, 0, 0]), np.pi / 2)).figures["lean"] < 1


@pytest.mark.parametrize(("heading", "pitch", "size", "delay_s"), [(-2.5, 0.8, 0.6, 0.25), (0.9, -0.8, 1.2, 0.0)])
def test_the_camera_the_size_and_the_delay_cost_nothing(heading, pitch, size, delay_s):
    camera = Rotation.from_euler("yx", [heading, pitch])
    assert min(stage(size * TEACHER_M @ camera.as_matrix().T + [0.5, 0.2, 2.0], delay_s).figures.values()) > 97


def test_faults_of_the_arms_and_an_estimators_noise_hardly_count():
    for learner_m in (made.arms_lowered(TEACHER_M, 30), made.elbows_bent(TEACHER_M, 45), noisy(TEACHER_M, 0.03)):
        assert min(stage(learner_m).figures.values()) > 95


def test_what_is_not_seen_has_no_figure():
    assert stage(made.hidden(TEACHER_M, 0, 16, HIPS)).figures == {}
    legless = stage(made.hidden(TEACHER_M, 0, 16, LEGS))
    assert set(legless.figures) == {"lean", "facing"}  # steps have no measure without the body's length
    headless_m = made.hidden(TEACHER_M, 0, 16, [Joint.NECK, Joint.HEAD])
    assert "lean" not in stage(headless_m, teacher_m=headless_m).figures
    assert min(stage(made.hidden(TEACHER_M, 8.0, 16.0)).figures.values()) > 99
    in_one_point_m = TEACHER_M.copy()
    in_one_point_m[200:230] = 0
    assert min(stage(in_one_point_m).figures.values()) > 85


@pytest.mark.parametrize("whose", [("teacher",), ("learner",), ("teacher", "learner")])
def test_joints_about_the_hips_have_no_place_and_no_height_and_that_is_said(whose):
    """One who travels 0.8 m and jumps 0.4 m is not told so, where either recording does not know where the body is."""
    learner_m = elsewhere(0.8) + jumping(0.4) - TEACHER_M
    noise_m = np.random.default_rng(0).normal(scale=0.001, size=(len(TEACHER_M), 1, 3))

    def about_hips(name, joints_m):
        return joints_m - joints_m[:, HIPS].mean(axis=1, keepdims=True) + noise_m if name in whose else joints_m

    dances = about_hips("teacher", TEACHER_M), about_hips("learner", learner_m)
    score, known = (score_dance(*map(performed, pair)) for pair in (dances, (TEACHER_M, learner_m)))
    assert known.stage.figures.keys() == DIMENSIONS.keys()
    assert score.stage.figures == pytest.approx({name: known.stage.figures[name] for name in ("lean", "facing")}, abs=1)
    assert known.stage_remarks() and not score.stage_remarks()
    hint = f"place and height are not graded: as recorded, the hips never move ({', '.join(whose)})"
    assert feedback(score).hints == (hint,) and not feedback(known).hints


def test_only_a_dance_whose_hips_never_move_is_about_them():
    still_m = made.standing(TEACHER_M)
    phrase_m = dance_joints_m(8, 20.0)[322:394]  # here the hips hardly move for more than two seconds
    for learner_m in (*(noisy(still_m, error_m) for error_m in (0.0, 0.005, 0.01)), phrase_m):
        assert stage(learner_m, teacher_m=learner_m).figures.keys() >= {"place", "height"}
    about_m = TEACHER_M - TEACHER_M[:, HIPS].mean(axis=1, keepdims=True)
    about_m[100:130, Joint.NECK] = np.nan
    assert stage(about_m).centred == ("learner",)


def test_who_joins_late_in_a_turn_has_the_teachers_front():
    teacher_m = dance_joints_m(0, 20.0)  # turns once round in its first two seconds, so that its mean heading says little
    late_m, late = teacher_m.copy(), round(0.5 * FPS)
    late_m[:late] = teacher_m[0]
    assert stage(late_m, teacher_m=teacher_m).figures["facing"] > 85


def test_what_is_most_wrong_is_said_in_words():
    learner_m = facing(-90) + elsewhere(0.8) - TEACHER_M
    remarks = {str(text): at_s for at_s, text in score_dance(performed(TEACHER_M), performed(learner_m)).stage_remarks()}
    assert set(remarks) == {"0.8 m too far left", "90° turned to the right"}
    assert all(abs(at_s - FAULT_S[0]) < 0.3 for at_s in remarks.values())


def test_who_turns_round_and_round_is_told_how_far_though_left_and_right_meet_at_the_back():
    learner_m = turned(TEACHER_M, np.array([0, 1.0, 0]), np.linspace(0, 4 * np.pi, len(TEACHER_M)))
    remarks = [str(text) for _, text in score_dance(performed(TEACHER_M), performed(learner_m)).stage_remarks()]
    (told,) = [text for text in remarks if "turned to the" in text]
    assert 90 < int(told.split("°")[0]) < 150


STANDING_M = np.array(
    [
        *((0, -0.6, 3), (0, -0.4, 3), (-0.2, -0.4, 3), (0.2, -0.4, 3), (-0.3, -0.1, 3), (0.3, -0.1, 3), (-0.3, 0.2, 3)),
        *((0.3, 0.2, 3), (0, -0.1, 3), (-0.1, 0.1, 3), (0.1, 0.1, 3), (-0.1, 0.5, 3), (0.1, 0.5, 3), (-0.1, 0.9, 3)),
        (0.1, 0.9, 3),
    ]
)
"""(15, 3) a person who faces the camera, metres."""
UPPER = [Joint.HEAD, Joint.NECK, Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER]
QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
"""A quarter turn about the camera's axis, of row vectors."""


def stood(frames=240):
    return np.repeat(STANDING_M[None], frames, axis=0)


def compared(learner_m):
    return stage_score(stood(len(learner_m)), learner_m, np.zeros(len(learner_m)))


@pytest.mark.parametrize(
    ("joints", "moved_m", "word"),
    [
        (list(Joint), (0.8, 0, 0), "too far left"), (list(Joint), (-0.8, 0, 0), "too far right"),
        (list(Joint), (0, 0, 0.8), "too far back"), (list(Joint), (0, 0, -0.8), "too far forward"),
        (list(Joint), (0, 0.3, 0), "too low"), (list(Joint), (0, -0.3, 0), "too high"),
        (UPPER, (0.4, 0, 0), "leaning to the left"), (UPPER, (-0.4, 0, 0), "leaning to the right"),
        (UPPER, (0, 0, 0.4), "leaning back"), (UPPER, (0, 0, -0.4), "leaning forward"),
    ],
)  # fmt: skip
def test_each_side_has_its_word_for_who_faces_the_camera(joints, moved_m, word):
    learner_m = stood()
    learner_m[120:180, joints] += moved_m
    ((at_s, text),) = compared(learner_m).remarks()
    assert str(text).endswith(f" {word}") and at_s == pytest.approx(4)


def test_the_longest_error_is_told_and_none_that_is_shorter_than_a_jump():
    errors = np.zeros((240, 1))
    errors[30:38], errors[60:80], errors[120:200] = 0.5, -0.5, 0.5
    score = StageScore({}, {"height": errors}, 1.35)
    assert [(at_s, str(text)) for at_s, text in score.remarks()] == [(4, "0.7 m too high")]
    errors[60:] = 0
    assert not list(score.remarks())


def test_what_is_compared_for_an_instant_has_no_figure():
    learner_m = stood()
    learner_m[20:] = np.nan
    assert compared(learner_m).figures == {}
    assert min(compared(stood()).figures.values()) > 99


def test_a_body_on_its_side_has_no_heading_but_a_lean():
    learner_m = stood()
    middle_m = STANDING_M[HIPS].mean(axis=0)
    learner_m[120:180] = (learner_m[120:180] - middle_m) @ QUARTER + middle_m
    errors = compared(learner_m).errors
    on_side = np.isnan(errors["facing"][:, 0])
    assert on_side[120:180].all() and not on_side[:120].any() and not on_side[180:].any()
    np.testing.assert_allclose(np.linalg.norm(errors["lean"][120:180], axis=1), np.pi / 2, atol=1e-6)


def test_a_body_on_its_side_keeps_its_heading_also_where_left_and_right_meet_at_the_back():
    """A person who turns their back, and leans forward, a little to either side of the camera's axis."""
    away_m, leaning_m = np.array([0, 0, 3.0]), STANDING_M.copy()
    leaning_m[UPPER] -= [0, 0, 0.2]
    turned_m = [
        Rotation.from_euler("y", np.pi + off_rad).apply(leaning_m - away_m) + away_m for off_rad in (-0.05, -0.05, 0.05)
    ]
    joints_m = np.array(turned_m)
    joints_m[1, [Joint.LEFT_HIP, Joint.RIGHT_HIP]] = joints_m[1, HIPS].mean(axis=0) + np.array([[0, 0.1, 0], [0, -0.1, 0]])
    joints_m[1, [Joint.LEFT_SHOULDER, Joint.RIGHT_SHOULDER]] = joints_m[1, Joint.NECK] + np.array([[0, 0.2, 0], [0, -0.2, 0]])
    found = stance(joints_m, np.eye(3))
    assert np.isfinite(found.heading).tolist() == [True, False, True]
    np.testing.assert_allclose(found.trunk[1], found.trunk[0], atol=0.05)


def test_who_lies_all_the_time_is_not_taken_for_a_cameras_tilt():
    assert stage(turned(TEACHER_M, np.array([1.0, 0, 0]), np.radians(75))).figures["lean"] < 50
