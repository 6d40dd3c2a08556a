"""An estimator's known errors are taken out of the distance: perfect dancing scores high, and levels stay apart."""

from dataclasses import replace

import numpy as np
import pytest
from dance_learners import arms_lowered, smaller, standing
from dance_people import dance_joints_m, noisy, performed
from programs import tool

from kpopnet.dance.features import FEATURES
from kpopnet.dance.parts import NOISE, AngleNoise
from kpopnet.dance.scoring import OURS, DanceScore, score_dance

noise = tool("measure_noise")

NOISE_M = 0.03
NAMES = FEATURES["dance22_turn"].names


def seen(dance: int, seed: int) -> noise.Seen:
    joints_m = dance_joints_m(dance)
    return noise.Seen(dance, performed(joints_m), performed(noisy(joints_m, NOISE_M, seed)))


@pytest.fixture(scope="module")
def known():
    with pytest.MonkeyPatch.context() as patch:
        std_rad = noise.measured_std_rad([seen(dance, 7) for dance in (3, 4)])
        patch.setitem(NOISE, "test", AngleNoise(std_rad, 97.0))
        yield replace(OURS, noise="test")


def scored(dance: int, learner_m: np.ndarray, scorer) -> DanceScore:
    return score_dance(performed(dance_joints_m(dance)), performed(noisy(learner_m, NOISE_M, dance)), scorer)


@pytest.mark.parametrize("dance", range(3))
def test_perfect_dancing_scores_high_and_levels_stay_apart(dance, known):
    joints_m = dance_joints_m(dance)
    perfect, unknown = scored(dance, joints_m, known), scored(dance, joints_m, OURS)
    assert perfect.similarity > max(85, unknown.similarity + 8)
    assert perfect.ceiling == 97 and unknown.ceiling == 100
    learners = [arms_lowered(joints_m, 10), arms_lowered(joints_m, 30), smaller(joints_m, 0.5), standing(joints_m)]
    scores = [perfect.similarity, *(scored(dance, learner_m, known).similarity for learner_m in learners)]
    assert (np.diff(scores[:3]) < -4).all() and scores[3] < 80 and scores[4] < 20
    assert scored(dance, dance_joints_m(dance + 1), known).similarity < 20


def test_noise_is_measured_as_it_is():
    learners, std_rad = [seen(dance, 3) for dance in range(3)], noise.measured_std_rad([seen(dance, 5) for dance in range(3)])
    assert set(std_rad) == set(NAMES) and 0.03 < min(std_rad["left_elbow_inclination"], std_rad["right_foot_inclination"]) < 0.3
    twice = [one._replace(estimated=performed(noisy(one.true.joints_m, 2 * NOISE_M, 5))) for one in learners]
    assert noise.measured_std_rad(twice)["left_elbow_inclination"] > 1.5 * std_rad["left_elbow_inclination"]
    without, with_noise = noise.perfect_scores(learners)
    assert len(without) == len(with_noise) == 3 and min(with_noise) > 87 > max(without)
    assert all(a > b + 5 for a, b in zip(noise.scores_with(learners, "tracker"), without, strict=True))
