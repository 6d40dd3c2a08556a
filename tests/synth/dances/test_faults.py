"""The second family of faults: each leaves a motion alone at severity 0 and grows; the order of learners is by construction."""

import numpy as np
import pytest
from motions import distance_m, points_m

from synth.dances.faults import FAULTS, LAG_S, habit, lag, with_faults
from synth.dances.simulate import SPACING, KpopSim, KpopSimConfig
from synth.dances.skill import LEVELS, Strengths, learn
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import Motion, height_above_floor

FPS = 30.0


@pytest.fixture(scope="module")
def teacher() -> Motion:
    return dance(0, 12345, 8.0, FPS)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_severity_0_changes_nothing_and_it_grows_with_its_severity(name, teacher):
    distances = [
        np.mean([distance_m(teacher, with_faults(teacher, {name: severity}, np.random.default_rng(seed))) for seed in range(4)])
        for severity in (0.0, 0.5, 1.0, 2.0)
    ]
    assert distances[0] < 1e-5 and (np.diff(distances) > 0).all() and 0.005 < distances[2] < 0.25, distances


def test_a_lag_is_a_delay(teacher):
    frames = 6
    late = lag(teacher, frames / FPS / LAG_S, np.random.default_rng(0))
    np.testing.assert_allclose(points_m(late)[frames:], points_m(teacher)[:-frames], atol=1e-3)


def test_a_habit_turns_two_joints_by_the_same_angle_throughout(teacher):
    turned = habit(teacher, 1.0, np.random.default_rng(3))
    cosine = np.abs((teacher.quats.astype(float) * turned.quats).sum(axis=-1))
    angles_deg = np.degrees(2 * np.arccos(np.clip(cosine, 0, 1)))
    wrong = angles_deg.max(axis=0) > 1
    assert wrong.sum() == 2 and np.ptp(angles_deg[:, wrong], axis=0).max() < 0.1


@pytest.mark.parametrize("family", ["mixed", "skill"])
def test_learners_stay_on_the_floor_and_do_not_jump(teacher, family):
    rng = np.random.default_rng(0)
    strong = Strengths(0, 0, damping=0.3, distortion=0.3, noise_deg=20, mistakes_per_minute=20)
    learner = with_faults(teacher, dict.fromkeys(FAULTS, 2.0), rng) if family == "mixed" else learn(teacher, strong, rng)[0]
    height = height_above_floor(learner.quats, learner.root_m)
    assert height.min() > -1e-3 and height.max() < 0.5
    assert np.linalg.norm(np.diff(points_m(learner), axis=0), axis=-1).max() * FPS < 15
    np.testing.assert_allclose(np.linalg.norm(learner.quats, axis=-1), 1, atol=1e-5)


@pytest.mark.parametrize("family", ["mixed", "skill"])
def test_a_better_level_is_nearer_to_the_teacher(family):
    maker = KpopSim(KpopSimConfig(seed=4, split="train", faults=family), seconds=(3.0, 3.5))
    assert maker.skill.spacing == SPACING[family]
    distances = np.zeros((6, len(LEVELS)))
    for index in range(len(distances)):
        learners = sorted((maker.learner(index, learner) for learner in range(4)), key=lambda one: one.level)
        distances[index] = [distance_m(maker.teacher_motion(index), one.motion) for one in learners]
        if family == "mixed":
            assert all((np.diff([one.strengths[name] for one in learners]) > 0).all() for name in FAULTS)
    assert (np.diff(distances.mean(axis=0)) > 0).all()
