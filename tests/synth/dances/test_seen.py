"""The teacher as an estimator sees them: errors of people who dance the same, carried over to the teacher."""

import numpy as np
import pytest
from dance_people import dance_joints_m
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import tool
from scipy.spatial.transform import Rotation

from kpopnet.dance.noise.table import SEEN_PEOPLE
from kpopnet.estimator import Estimate
from kpopnet.skeleton import Joint
from kpopnet.teacher.library import TeacherBody
from kpopnet.teacher.posing import posed
from synth.body.teacher import teacher_arrays
from synth.dances import seen
from synth.dances.simulate import BODY

JOINTS_M = dance_joints_m(3)[:90:3]
TIMES_S = np.arange(len(JOINTS_M)) / seen.FPS
LEFT_ARM = Joint.LEFT_ELBOW, Joint.LEFT_HAND


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 999), st.floats(0.5, 2.0))
def test_errors_turn_and_grow_with_the_body(seed, scale):
    rng = np.random.default_rng(seed)
    turn, errors_m = Rotation.random(random_state=seed), rng.normal(scale=0.05, size=JOINTS_M.shape)
    other_m = scale * turn.apply(JOINTS_M.reshape(-1, 3)).reshape(JOINTS_M.shape) + rng.normal(size=3)
    relative_m = errors_m - errors_m[:, [Joint.TORSO]]
    expected_m = scale * turn.apply(relative_m.reshape(-1, 3)).reshape(JOINTS_M.shape)
    np.testing.assert_allclose(seen.carried_over(errors_m, JOINTS_M, other_m), expected_m, atol=1e-9)
    other_m[:, Joint.HEAD] = np.nan
    np.testing.assert_allclose(seen.carried_over(errors_m, JOINTS_M, other_m), expected_m, atol=1e-9)


class ShortArm:
    """Sees every left forearm at half of its length, and loses one person's head."""

    name = "short arm"

    def __init__(self, monkeypatch) -> None:
        film, self.films = seen._film, []

        def filmed(*arguments):
            self.films.append(film(*arguments))
            return self.films[-1]

        monkeypatch.setattr(seen, "_film", filmed)

    def estimate(self, depth_m, camera):
        joints_m = self.films[-1][2].copy()
        joints_m[:, Joint.LEFT_HAND] = joints_m[:, LEFT_ARM].mean(axis=1)
        if len(self.films) == 1:
            joints_m[:, Joint.HEAD] = np.nan
        return Estimate(joints_m, np.ones(joints_m.shape[:2], np.float32))


def test_the_teacher_is_off_as_the_estimator_is_of_others_and_what_is_missing_stays_missing(monkeypatch):
    monkeypatch.setattr(seen, "PEOPLE", 2)
    estimator, teacher_m, people = ShortArm(monkeypatch), JOINTS_M.astype(np.float64), []
    teacher_m[5, Joint.RIGHT_FOOT] = np.nan
    movement = posed(JOINTS_M, TeacherBody(**teacher_arrays()))
    found_m = teacher_m + seen.common_errors_m(teacher_m, *movement, estimator, TIMES_S, lambda: people.append(1))
    assert len(people) == len(estimator.films) == 2
    np.testing.assert_array_equal(np.isnan(found_m), np.isnan(teacher_m))
    off_m = np.linalg.norm(found_m - teacher_m, axis=2)
    others = [joint for joint in Joint if joint != Joint.LEFT_HAND]
    assert np.nanmax(off_m[:, others]) < 1e-5
    half_m = teacher_m[:, LEFT_ARM].mean(axis=1)
    assert np.linalg.norm(found_m[:, Joint.LEFT_HAND] - half_m, axis=1).max() < 0.03  # forearms of other lengths and directions
    for depth_m, camera, true_m in estimator.films:
        u, v, z = camera.project(true_m[0, Joint.TORSO])
        assert depth_m.shape[1:] == (camera.height, camera.width)
        assert depth_m[0, round(v), round(u)] == pytest.approx(z, abs=0.35)


def test_the_people_are_none_of_whom_a_network_has_learnt(monkeypatch):
    monkeypatch.setattr(seen, "PEOPLE", 2)
    splits, draw_person = [], seen.draw_person
    monkeypatch.setattr(seen, "draw_person", lambda rng, config, split: splits.append(split) or draw_person(rng, config, split))
    movement = posed(JOINTS_M[:2], TeacherBody(**teacher_arrays()))
    seen.common_errors_m(JOINTS_M[:2], *movement, ShortArm(monkeypatch), TIMES_S[:2])
    assert splits == ["validation"] * 2
    learners = tool("graded_learners").Learners("train", SEEN_PEOPLE, 0, None, 4.0, "realtime").set
    drawn, expected = (
        draw(np.random.default_rng(0)) for draw in (learners._person, lambda rng: draw_person(rng, BODY, "validation"))
    )
    np.testing.assert_array_equal(drawn.vertices_m, expected.vertices_m)


def test_the_same_people_dance_every_time(monkeypatch):
    monkeypatch.setattr(seen, "PEOPLE", 1)
    movement = posed(JOINTS_M[:4], TeacherBody(**teacher_arrays()))
    first = ShortArm(monkeypatch)
    seen.common_errors_m(JOINTS_M[:4], *movement, first, TIMES_S[:4])
    again = ShortArm(monkeypatch)
    seen.common_errors_m(JOINTS_M[:4], *movement, again, TIMES_S[:4])
    for one, other in zip(first.films[0], again.films[0], strict=True):
        assert one == other if not isinstance(one, np.ndarray) else np.array_equal(one, other)
