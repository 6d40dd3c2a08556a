"""Parts of a dance that the teacher leaves free, and a total of the teacher's own."""

import dance_learners as made
import numpy as np
import pytest
from dance_people import FPS, dance_joints_m, followed, performed

from kpopnet.dance.feedback import feedback
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.parts import PartScorer
from kpopnet.dance.performance import Performance
from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.errors import InputError

SECONDS, FREE_S = 24.0, (8.0, 16.0)
BEATS_S = np.arange(0, SECONDS, 0.5)


def otherwise(inside):
    """The dance of a teacher, but for something else while the teacher leaves it free: (T, 15, 3) joints of both."""
    teacher_m = dance_joints_m(4, SECONDS)
    seconds = np.arange(len(teacher_m)) / FPS
    free = ((seconds >= FREE_S[0]) & (seconds < FREE_S[1]))[:, None, None]
    return teacher_m, np.where(free, inside(teacher_m), teacher_m)


@pytest.mark.parametrize("scorer", ["dance22", "paper"])
def test_what_is_danced_in_a_free_part_costs_nothing_and_is_not_spoken_of(scorer):
    teacher_m, learner_m = otherwise(lambda joints_m: dance_joints_m(7, SECONDS))
    free, whole = (
        score_dance(performed(teacher_m), performed(learner_m), SCORERS[scorer], free_s=free_s) for free_s in ([FREE_S], ())
    )
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
    teacher_m, learner_m = otherwise(lambda joints_m: joints_m + np.array([1.4, 0, 0]))
    score = score_dance(performed(teacher_m), performed(learner_m), free_s=[FREE_S])
    assert score.stage.figures["place"] > 95 and not score.stage_remarks()
    late = np.roll(teacher_m, round(0.23 * FPS), axis=0)
    _, learner_m = otherwise(lambda joints_m: late)
    rhythm, free = (
        score_dance(performed(teacher_m), performed(learner_m), free_s=one).rhythm(BEATS_S) for one in ((), [FREE_S])
    )
    assert abs(free.ahead_s) < 0.03 < abs(rhythm.ahead_s)


def test_a_score_is_not_surer_for_comparing_less():
    teacher_m = dance_joints_m(4, SECONDS)
    learner = performed(teacher_m)
    learner = Performance(learner.joints_m, learner.times_s, np.full(learner.confidence.shape, 0.95))
    scorer = PartScorer(noise="realtime")
    sure = [score_dance(performed(teacher_m), learner, scorer, free_s=[(0, end_s)]).uncertainty for end_s in (1, 8, 16)]
    assert min(sure) > 0.7 * max(sure), sure


def test_who_stands_still_while_all_is_free_is_told_of_nothing():
    def told(free_s):
        teacher_m, learner_m = otherwise(lambda joints_m: np.broadcast_to(joints_m[round(FREE_S[0] * FPS)], joints_m.shape))
        score = score_dance(performed(teacher_m), performed(learner_m), free_s=free_s)
        return [one.direction for one in feedback(score).moments]

    assert "stood still" in told([]) and "stood still" not in told([FREE_S])


def test_a_free_part_is_graded_by_its_energy():
    figures = []
    for inside in (np.array, lambda joints_m: dance_joints_m(7, SECONDS), made.mean_pose):
        teacher_m, learner_m = otherwise(inside)
        score = score_dance(performed(teacher_m), performed(learner_m), free_s=[FREE_S])
        figures.append(score.free()["energy"])
        assert score.dynamics.figures["energy"] > 90  # which tells the rest of the dance
    assert figures[0] > 99 and figures[0] > figures[1] > figures[2] + 20, figures
    assert "energy" not in score_dance(performed(teacher_m), performed(learner_m)).free()


def test_a_free_part_is_free_during_the_dance_too():
    teacher_m, learner_m = otherwise(lambda joints_m: dance_joints_m(7, SECONDS))
    online = OnlineScorer(performed(teacher_m), free_s=[FREE_S])
    followed(online, performed(learner_m))
    offline = score_dance(performed(teacher_m), performed(learner_m), free_s=[FREE_S])
    assert online.finish().similarity == pytest.approx(offline.similarity) and online.finish().free() == offline.free()
    with pytest.raises(InputError, match="free from 3 to 3 s"):
        score_dance(performed(teacher_m), performed(learner_m), free_s=[(3, 3)])


def test_a_total_is_of_what_its_teacher_wants():
    teacher_m = dance_joints_m(4, SECONDS)
    score = score_dance(performed(teacher_m), performed(made.smaller(teacher_m, 0.6), 0.1))
    figures = {"similarity": score.similarity} | score.stage.figures | score.dynamics.figures
    assert score.total({"similarity": 1}) == score.similarity
    expected = (3 * figures["similarity"] + figures["place"]) / 4
    assert score.total({"similarity": 3, "place": 1, "energy": 0}) == pytest.approx(expected)
    assert score.total({"amplitude": 1, "rhythm": 1}) == pytest.approx(figures["amplitude"])  # without beats no rhythm
    assert score.total({"rhythm": 1}, BEATS_S) == pytest.approx(score.rhythm(BEATS_S).figure)
    for weights in ({"head": 1}, {"place": -1}, {"place": 0}, {"place": np.inf}):
        with pytest.raises(InputError):
            score.total(weights)
