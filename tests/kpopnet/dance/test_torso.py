"""Torsos that were seen and such as are the mean of shoulders and hips: what of a bent back is compared."""

from dataclasses import replace

import dance_learners as made
import numpy as np
import pytest
from dance_people import dance_joints_m, followed, performed

from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.scoring import OURS, SCORERS, derived_torso, score_dance

TEACHER_M = dance_joints_m(0)
HUNCHED_M = made.hunched(TEACHER_M, 30)


@pytest.mark.parametrize("name", ["dance22", "paper"])
@pytest.mark.parametrize("derived", ["teacher", "learner"])
def test_where_one_torso_is_derived_the_bend_is_not_compared_and_not_unseen(name, derived):
    whole, without = performed(TEACHER_M), derived_torso(performed(TEACHER_M))
    pair = (without, whole) if derived == "teacher" else (whole, without)
    score, copy = score_dance(*pair, SCORERS[name]), score_dance(without, without, SCORERS[name])
    assert score.similarity == pytest.approx(copy.similarity, abs=1e-6)
    assert score.completeness == pytest.approx(copy.completeness)
    online = OnlineScorer(pair[0], SCORERS[name], torso_is_derived=derived == "learner")
    followed(online, pair[1])
    assert online.finish().similarity == pytest.approx(score.similarity, abs=1e-6)


def test_of_an_estimator_whose_noise_is_known_the_teachers_own_torso_stays():
    teacher = performed(TEACHER_M)
    score = score_dance(teacher, derived_torso(teacher), replace(OURS, noise="webcam"))
    np.testing.assert_array_equal(score.teacher_m, score_dance(teacher, teacher).teacher_m)
