"""The model of skill: the effect of each kind of error, which grows with its strength."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from motions import distance_m, points_m

from synth.dances.skill import SkillConfig, Strengths, draw_strengths, learn
from synth.motion.choreography.composer import dance
from synth.motion.skeleton import Motion, mirrored

FPS = 30.0
NONE = Strengths(0, 0, 0, 0, 0, 0)


@pytest.fixture(scope="module")
def teacher() -> Motion:
    return dance(0, 12345, 8.0, FPS)


def learnt(teacher: Motion, seed: int = 0, **strengths: float) -> Motion:
    return learn(teacher, replace(NONE, **strengths), np.random.default_rng(seed))[0]


def test_without_errors_the_learner_equals_the_teacher(teacher):
    learner = learnt(teacher)
    np.testing.assert_allclose(points_m(learner), points_m(teacher), atol=1e-4)
    np.testing.assert_allclose(learner.root_m[:, [0, 2]], teacher.root_m[:, [0, 2]], atol=1e-5)
    assert np.abs(learner.root_m[:, 1] - teacher.root_m[:, 1]).max() < 0.03
    assert len(learner) == len(teacher) and learner.fps == teacher.fps


def test_a_lag_is_a_delay(teacher):
    late = learnt(teacher, lag_s=0.2)
    np.testing.assert_allclose(points_m(late)[6:], points_m(teacher)[:-6], atol=1e-4)


def test_the_delay_varies_with_the_given_deviation_and_time_never_runs_backwards(teacher):
    # The hips move uniformly, so their position encodes the time.
    frames = 1200
    root_m = np.zeros((frames, 3))
    root_m[:, 0] = np.arange(frames) / FPS
    clock = Motion(np.tile(teacher.quats[:1], (frames, 1, 1)), root_m.astype(np.float32), FPS, "clock", teacher.leg_m)
    delays = []
    for seed in range(6):
        when = learnt(clock, seed, unevenness_s=0.15).root_m[:, 0]
        assert (np.diff(when) >= -1e-5).all()
        delays.append((np.arange(frames) / FPS - when)[60:-60])
    assert np.std(np.concatenate(delays)) == pytest.approx(0.15, rel=0.35)


def test_the_distance_grows_with_the_strength_of_every_error(teacher):
    for name, most in asdict(Strengths(0.4, 0.3, 0.5, 0.6, noise_deg=25, mistakes_per_minute=30)).items():
        errors = [
            np.mean([distance_m(teacher, learnt(teacher, seed, **{name: share * most})) for seed in range(5)])
            for share in (0.15, 0.4, 1.0)
        ]
        assert errors[0] > 0 and (np.diff(errors) > 0).all(), (name, errors)


@pytest.mark.parametrize("seed", range(4))
def test_each_mistake_shows_the_motion_of_its_kind(teacher, seed):
    learner, mistakes = learn(teacher, replace(NONE, mistakes_per_minute=22), np.random.default_rng(seed))
    wrong, arms = np.zeros(len(teacher), bool), slice(7, 15)
    for mistake in mistakes:
        wrong[int(mistake.start_s * FPS) : int((mistake.start_s + mistake.seconds) * FPS) + 2] = True
        middle = int((mistake.start_s + mistake.seconds / 2) * FPS)
        if mistake.kind == "forgotten":
            assert (points_m(learner)[middle, [10, 14], 1] < 0).all()  # the hands hang
            continue
        swapped = teacher.quats[np.clip(round(middle + mistake.shift_s * FPS), 0, len(teacher) - 1)]
        shown = {"mirrored": mirrored(teacher.quats[middle]), "swapped": swapped}[mistake.kind]
        assert np.abs((learner.quats[middle, arms] * shown[arms]).sum(axis=-1)).min() > 0.99, mistake
    # Outside the mistakes the learner equals the teacher.
    np.testing.assert_allclose(points_m(learner)[~wrong], points_m(teacher)[~wrong], atol=1e-3)


def test_levels_differ_in_the_mean_and_overlap_in_each_error():
    config, rng = SkillConfig(spacing=0.3, spread=0.2), np.random.default_rng(0)
    drawn = np.array([[list(asdict(draw_strengths(rng, level, config)).values()) for level in range(4)] for _ in range(500)])
    mean_log = np.log(drawn).mean(axis=-1)
    np.testing.assert_allclose(np.diff(mean_log, axis=1), config.spacing, atol=1e-9)
    inverted = (np.diff(drawn, axis=1) < 0).mean(axis=(0, 1))
    assert ((inverted > 0.05) & (inverted < 0.25)).all(), inverted
