"""The rule by which the dance scorers' settings are chosen, and the intervals by which they are compared."""

import json
from dataclasses import replace

import numpy as np
import pytest
from dance_people import dance_joints_m, noisy, performed
from programs import ROOT, tool

from kpopnet.dance.scoring import SCORERS, score_dance

calibrate = tool("calibrate_scorers")


@pytest.mark.parametrize("name", ["dance22", "paper"])
def test_scores_of_kept_windows_are_those_of_the_scorer(name, tmp_path, monkeypatch):
    scorer = replace(SCORERS[name], beta=0.7)
    monkeypatch.setattr(calibrate, "BETAS", (0.7,))
    teacher_m = dance_joints_m(0, 8.0)
    learners_m = [noisy(teacher_m, deviation_m) for deviation_m in (0.02, 0.05, 0.08, 0.2)]
    learners_m[1] = np.concatenate([teacher_m[:1].repeat(9, axis=0), learners_m[1][:-9]])  # late
    dance = calibrate.Dance(teacher_m, np.array(learners_m), "composed")
    for _ in range(2):  # made, then read
        found = calibrate.windows(tmp_path / "0.npz", dance, name)
    scores = calibrate.scores(found, scorer.alpha, scorer.tau, name == "dance22")[0]
    expected = [score_dance(performed(teacher_m), performed(one), scorer).similarity for one in [*learners_m, teacher_m]]
    np.testing.assert_allclose(scores, expected, atol=1e-9)


def made_up(distances_rad: list[float]) -> np.ndarray:
    """(4, B, 5, 3, 2) windows of learners on time at distances from the teacher, by every beta; the fifth is the teacher."""
    posture = 100 * np.exp(-np.array([*distances_rad, 0.0]) / np.array(calibrate.BETAS)[:, None])
    one = np.stack([np.zeros_like(posture), posture, np.ones_like(posture)], axis=-1)
    return np.broadcast_to(one[..., None], (4, *one.shape, 2))


def test_the_rule_takes_what_orders_most_and_separates_best_within_the_bounds():
    learners = made_up([0.1, 0.2, 0.4, 0.8])
    found = calibrate.chosen({"skill": learners, "mixed": learners, "ends": made_up([0.0, 2.0, 2.0, 2.0])}, "paper")
    on = found["chosen on"]
    assert on == {key: found["checked on"][key] for key in on} and on["excess"] == 0 and on["pairs"] == 100
    assert found["settings"] == {"alpha": 0.2, "beta": 0.3, "tau": 0.4}  # sharper ones put a late copy outside LATE
    tied = found["within them, with as many pairs"]
    assert (
        found["keep the bounds"] == f"{len(tied)} of 320" and [0.2, 0.3, 0.4] in tied
    )  # all pairs are in order by any setting
    for delay_s, (least, most) in calibrate.LATE.items():
        assert least <= on["bounded"][f"a copy {delay_s} s late"] <= most


def test_a_scorer_that_cannot_keep_the_bounds_gets_the_settings_that_exceed_them_least():
    learners = made_up([0.1, 0.2, 0.4, 0.8])
    found = calibrate.chosen({"skill": learners, "mixed": learners, "ends": made_up([0.0, 0.0, 2.0, 0.5])}, "paper")
    assert found["keep the bounds"].startswith("0 of") and 65 < found["chosen on"]["excess"] < 71


def test_settings_that_tie_are_compared_on_the_same_dances():
    teacher_m = dance_joints_m(0, 8.0)
    learners_m = np.array([noisy(teacher_m, deviation_m) for deviation_m in (0.02, 0.05, 0.08, 0.2)])
    made = [calibrate.Dance(teacher_m, one, "composed") for one in (learners_m, learners_m[::-1], learners_m[[0, 1, 3, 2]])]
    ours = np.array([[4, 3, 2, 1]] * 3)
    first, second = calibrate.with_settings(made, "paper", [[0.31, 0.4, 0.5], [0.2, 0.6, 0.4]], ours)
    assert first == {"alpha": 0.31, "beta": 0.4, "tau": 0.5, "dances in order": 1, "p against dance22": 0.5}
    assert (second["alpha"], second["beta"], second["tau"], second["dances in order"]) == (0.2, 0.6, 0.4, 1)


def test_the_committed_choice_is_what_ships():
    chosen = json.loads((ROOT / "results/scorers_chosen.json").read_text())["results"]
    for name, scorer in SCORERS.items():
        assert chosen[name]["settings"] == {"alpha": scorer.alpha, "beta": scorer.beta, "tau": scorer.tau}
