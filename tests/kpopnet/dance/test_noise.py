"""An estimator's known errors are taken out of the distance: perfect dancing scores high, and levels stay apart."""

import json
from dataclasses import replace

import numpy as np
import pytest
from dance_learners import arms_lowered, smaller, standing
from dance_people import dance_joints_m, noisy, performed

from kpopnet.dance.config import SCORERS, ScorerConfig
from kpopnet.dance.features import feature_names
from kpopnet.dance.noise import NOISE, TABLE, AngleNoise, angle_variance
from kpopnet.dance.scoring import DanceScore, score_dance
from kpopnet.errors import InputError
from kpopnet.evaluation.dances.noise import Seen, enter, known_scores, measured_std_rad, perfect_scores

NOISE_M = 0.03
NAMES = feature_names("dance22", True)


def seen(dance: int, seed: int) -> Seen:
    joints_m = dance_joints_m(dance)
    return Seen(dance, performed(joints_m), performed(noisy(joints_m, NOISE_M, seed)))


@pytest.fixture(scope="module")
def config():
    with pytest.MonkeyPatch.context() as patch:
        std_rad = measured_std_rad([seen(dance, 7) for dance in (3, 4)])
        patch.setitem(NOISE, "test", AngleNoise(std_rad, 97.0))
        yield replace(SCORERS["dance22"], noise="test")


def scored(dance: int, learner_m: np.ndarray, config: ScorerConfig) -> DanceScore:
    return score_dance(performed(dance_joints_m(dance)), performed(noisy(learner_m, NOISE_M, dance)), config)


@pytest.mark.parametrize("dance", range(3))
def test_perfect_dancing_scores_high_and_levels_stay_apart(dance, config):
    joints_m = dance_joints_m(dance)
    perfect = scored(dance, joints_m, config)
    assert perfect.similarity > max(85, scored(dance, joints_m, SCORERS["dance22"]).similarity + 8)
    assert perfect.ceiling == 97 and scored(dance, joints_m, SCORERS["dance22"]).ceiling == 100
    learners = [arms_lowered(joints_m, 10), arms_lowered(joints_m, 30), smaller(joints_m, 0.5), standing(joints_m)]
    scores = [perfect.similarity, *(scored(dance, learner_m, config).similarity for learner_m in learners)]
    assert (np.diff(scores[:3]) < -4).all() and scores[3] < 80 and scores[4] < 20
    assert scored(dance, dance_joints_m(dance + 1), config).similarity < 20


def test_noise_is_measured_as_it_is():
    known, std_rad = [seen(dance, 3) for dance in range(3)], measured_std_rad([seen(dance, 5) for dance in range(3)])
    assert set(std_rad) == {"dance22", "raptis"} and set(std_rad["raptis"]) == set(feature_names("raptis"))
    ours = std_rad["dance22"]
    assert set(ours) == set(NAMES) and 0.03 < min(ours["left_elbow_inclination"], ours["right_foot_inclination"]) < 0.3
    twice = [one._replace(estimated=performed(noisy(one.true.joints_m, 2 * NOISE_M, 5))) for one in known]
    assert measured_std_rad(twice)["dance22"]["left_elbow_inclination"] > 1.5 * ours["left_elbow_inclination"]
    without, with_noise = perfect_scores(known)
    assert len(without) == len(with_noise) == 3 and min(with_noise) > 87 > max(without)
    assert "measured" not in NOISE


def test_the_noise_of_the_table_is_tried_on_other_people():
    seen = [Seen(0, performed(dance_joints_m(index)), performed(noisy(dance_joints_m(index), 0.05, index))) for index in (0, 1)]
    with_noise, without = known_scores(seen, "tracker"), known_scores(seen, "none")
    assert len(with_noise) == 2 and all(a > b + 5 for a, b in zip(with_noise, without, strict=True))


def test_the_noise_of_an_estimator_is_entered_in_the_table(tmp_path, monkeypatch):
    table = tmp_path / "noise.json"
    table.write_text(TABLE.read_text())
    monkeypatch.setattr("kpopnet.evaluation.dances.noise.TABLE", table)
    enter("best", AngleNoise({"dance22": {"twist": 0.5}}, 12.0))
    entered = json.loads(table.read_text())
    assert entered["best"] == {"std_rad": {"dance22": {"twist": 0.5}}, "ceiling": 12.0}
    assert entered["tracker"] == json.loads(TABLE.read_text())["tracker"]


@pytest.mark.parametrize("scorer", ["dance22", "raptis_parts"])
def test_the_noise_of_both_features_is_taken_out_of_the_distance(scorer, monkeypatch):
    joints_m = dance_joints_m(3)
    monkeypatch.setitem(NOISE, "test", AngleNoise(measured_std_rad([seen(dance, 7) for dance in (4, 5)]), 97.0))
    estimated = performed(noisy(joints_m, NOISE_M, 1))
    without, known = (
        score_dance(performed(joints_m), estimated, replace(SCORERS[scorer], noise=noise)).similarity
        for noise in ("none", "test")
    )
    assert known > without + 8


def test_noise_has_a_name():
    assert not angle_variance("none", "dance22", True).any()
    for name in ("realtime", "network", "fitted_network", "best", "tracker"):
        for feature, heading in (("dance22", True), ("raptis", False)):
            assert angle_variance(name, feature, heading).min() > 0
            assert set(NOISE[name].std_rad[feature]) == set(feature_names(feature, heading))
    with pytest.raises(InputError, match=r"noise=odd is not one of auto, none, .*tracker"):
        ScorerConfig(noise="odd")
