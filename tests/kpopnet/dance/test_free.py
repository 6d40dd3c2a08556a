"""Parts of a dance that the teacher leaves free, and a total of the teacher's own."""

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, followed, performed

from kpopnet.dance.feedback import feedback
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import OURS, SCORERS, score_dance
from kpopnet.errors import InputError

SECONDS, FREE_S = 24.0, (8.0, 16.0)
BEATS_S = np.arange(0, SECONDS, 0.5)


TEACHER_M, OTHER_M = dance_joints_m(4, SECONDS), dance_joints_m(7, SECONDS)
TEACHER = performed(TEACHER_M)
INSIDE = (TEACHER.times_s >= FREE_S[0]) & (TEACHER.times_s < FREE_S[1])


def otherwise(inside_m):
    """Who dances something else while the teacher leaves it free."""
    return performed(np.where(INSIDE[:, None, None], inside_m, TEACHER_M))


def scores(learner, scorer=OURS):
    """With the free part, and without."""
    return (score_dance(TEACHER, learner, scorer, free_s=free_s) for free_s in ([FREE_S], ()))


@pytest.mark.parametrize("scorer", ["dance22", "paper"])
def test_what_is_danced_in_a_free_part_costs_nothing_and_is_not_spoken_of(scorer):
    free, whole = scores(otherwise(OTHER_M), SCORERS[scorer])
    assert whole.similarity < 80 and free.similarity > {"dance22": 97, "paper": 85}[scorer]
    inside = (free.windows.middle_s > FREE_S[0] + 0.1) & (free.windows.middle_s < FREE_S[1] - 0.1)
    assert np.isnan(free.windows.similarity[inside]).all() and np.isfinite(free.windows.similarity[~inside]).any()
    if scorer == "dance22":
        assert not feedback(free).moments and feedback(whole).moments


@pytest.mark.parametrize("dance", [0, 2, 4])
def test_a_copy_is_not_late_where_its_begin_is_free_or_shown_by_nobody(dance):
    joints_m = dance_joints_m(dance, 12.0)
    hidden_m = joints_m.copy()
    hidden_m[:40] = np.nan
    assert score_dance(performed(joints_m), performed(joints_m), free_s=[(0.0, 3.0)]).similarity > 99
    for teacher_m, learner_m in ((hidden_m, hidden_m), (hidden_m, joints_m)):
        assert score_dance(performed(teacher_m), performed(learner_m)).similarity > 99
    joins_late = score_dance(performed(joints_m), performed(hidden_m)).windows
    assert joins_late.similarity[joins_late.start_s >= 40 / FPS].min() > 99


def test_where_a_free_part_is_danced_and_to_which_beat_is_not_graded():
    free, _ = scores(otherwise(TEACHER_M + np.array([1.4, 0, 0])))
    assert free.stage.figures["place"] > 95 and not free.stage_remarks()
    free, rhythm = (one.rhythm(BEATS_S) for one in scores(otherwise(np.roll(TEACHER_M, round(0.23 * FPS), axis=0))))
    assert abs(free.ahead_s) < 0.03 < abs(rhythm.ahead_s)


def test_a_score_is_not_surer_for_comparing_less():
    learner, scorer = Performance(TEACHER_M, TEACHER.times_s, np.full(TEACHER_M.shape[:2], 0.95)), PartScorer(noise="realtime")
    sure = [score_dance(TEACHER, learner, scorer, free_s=[(0, end_s)]).uncertainty for end_s in (1, 8, 16)]
    assert min(sure) > 0.7 * max(sure), sure


def test_who_stands_still_while_all_is_free_is_told_of_nothing():
    learner = otherwise(np.broadcast_to(TEACHER_M[round(FREE_S[0] * FPS)], TEACHER_M.shape))
    free, whole = ({one.direction for one in feedback(score).moments} for score in scores(learner))
    assert "stood still" in whole - free


def test_a_free_part_is_graded_by_its_energy():
    figures = []
    for inside_m in (TEACHER_M, OTHER_M, made.mean_pose(TEACHER_M)):
        free, whole = scores(otherwise(inside_m))
        figures.append(free.free()["energy"])
        assert free.dynamics.figures["energy"] > 90 and not whole.free()  # which tells the rest of the dance
    assert figures[0] > 99 and figures[0] > figures[1] > figures[2] + 20, figures


def test_a_free_part_is_free_during_the_dance_too():
    online, (offline, _) = OnlineScorer(TEACHER, free_s=[FREE_S]), scores(otherwise(OTHER_M))
    followed(online, otherwise(OTHER_M))
    np.testing.assert_equal(online.finish(), offline)
    with pytest.raises(InputError, match="free from 3 to 3 s"):
        score_dance(TEACHER, TEACHER, free_s=[(3, 3)])


def test_a_total_is_of_what_its_teacher_wants():
    score = score_dance(TEACHER, performed(made.smaller(TEACHER_M, 0.6), 0.1))
    figures = {"similarity": score.similarity} | score.stage.figures | score.dynamics.figures
    assert score.total({"similarity": 1}) == score.similarity
    expected = (3 * figures["similarity"] + figures["place"]) / 4
    assert score.total({"similarity": 3, "place": 1, "energy": 0}) == pytest.approx(expected)
    assert score.total({"amplitude": 1, "rhythm": 1}) == pytest.approx(figures["amplitude"])  # without beats no rhythm
    assert score.total({"rhythm": 1}, BEATS_S) == pytest.approx(score.rhythm(BEATS_S).figure)
    for weights in ({"head": 1}, {"place": -1}, {"place": 0}, {"place": np.inf}):
        with pytest.raises(InputError):
            score.total(weights)
