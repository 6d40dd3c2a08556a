"""What a learner does differently throughout a window limits the score where an estimator's errors would excuse it."""

from dataclasses import replace

import numpy as np
import pytest
from dance_learners import arm_lowered, hidden, smaller
from dance_people import FPS, dance_joints_m, performed

from kpopnet.dance.features import dance_features
from kpopnet.dance.noise.sight import segment_differences
from kpopnet.dance.noise.steady import MOST_EXPECTED_RAD, SEGMENTS, steady_similarity, steady_squared
from kpopnet.dance.noise.table import NOISE, steady_by_noise
from kpopnet.dance.parts import shares_without_missing
from kpopnet.dance.scoring import OURS, score_dance
from kpopnet.dance.window import PARTS
from kpopnet.skeleton import Joint

JOINTS_M, BETA = dance_joints_m(0), OURS.beta


def squared(learner_m, teacher_m=JOINTS_M):
    pair = (dance_features(joints_m, "dance22_turn", FPS) for joints_m in (learner_m, teacher_m))
    return dict(zip(SEGMENTS, steady_squared(segment_differences(*pair, sees_depth=True)), strict=True))


@pytest.fixture
def generous(monkeypatch):
    """A scorer whose noise excuses nearly everything in single frames."""
    loss = dict.fromkeys(("arm", "leg", "torso", "turning"), (9.0, 0.0))
    steady = dict.fromkeys(("elbow", "hand", "knee", "foot", "torso"), (0.05, 0.0))
    monkeypatch.setitem(NOISE, "generous", NOISE["none"]._replace(loss=loss, spread=1.0, steady=steady))
    monkeypatch.setitem(NOISE, "blind", NOISE["generous"]._replace(steady={}))
    return replace(OURS, noise="generous")


def test_a_lowered_arm_is_a_steady_difference_of_its_segments_alone_and_grows_with_the_fault():
    found = [squared(arm_lowered(JOINTS_M, "left", degrees)) for degrees in (10, 20, 30)]
    size_deg = [np.degrees(np.sqrt(one["left_elbow"])) for one in found]
    assert np.diff([0, *size_deg]) == pytest.approx([9, 9, 9], abs=3)  # an arm that hangs already cannot be lowered
    others = [value for name, value in found[2].items() if not name.startswith("left_elbow")]
    assert max(others) < 0.1 * found[2]["left_elbow"]


def test_what_is_known_in_too_few_frames_is_not_judged():
    found = squared(hidden(JOINTS_M, 0, 7, [Joint.RIGHT_HAND]))
    assert np.isnan(found["right_hand"]) and np.isfinite(found["left_hand"])


def test_only_what_exceeds_perfect_dancing_costs_and_an_unsure_estimator_judges_nothing():
    expected = np.full(len(SEGMENTS), 0.01)
    assert (steady_similarity(expected, expected, BETA) == 1).all()
    one = expected + np.where(np.array(SEGMENTS) == "left_elbow", BETA**2, 0)
    assert steady_similarity(one, expected, BETA)[PARTS.index("left arm")] == pytest.approx(np.exp(-1))
    assert (steady_similarity(one + 1, np.full(len(SEGMENTS), 1.01 * MOST_EXPECTED_RAD**2), BETA) == 1).all()
    assert np.isinf(steady_by_noise({}, np.full(len(PARTS), 0.1))).all()
    wider = steady_by_noise({"hand": (0.5, 0.5)}, np.array([0.1, 0.4, 0.1, 0.1, 0.1, 0.1]))
    assert wider[SEGMENTS.index("right_hand")] == pytest.approx(4 * wider[SEGMENTS.index("left_hand")]) == pytest.approx(0.1)


def test_a_steady_fault_costs_where_errors_would_excuse_it_and_costs_more_the_larger_it_is(generous):
    teacher, blind = performed(JOINTS_M), replace(OURS, noise="blind")
    learners = [arm_lowered(JOINTS_M, "left", degrees) for degrees in (15, 25, 40)] + [smaller(JOINTS_M, 0.5)]
    assert min(score_dance(teacher, performed(one), blind).similarity for one in learners[:3]) > 99.5
    perfect, *scores = (score_dance(teacher, performed(one), generous) for one in (JOINTS_M, *learners))
    assert perfect.similarity > 99.9
    assert (np.diff([perfect.similarity, *(one.similarity for one in scores[:3])]) < -1).all() and scores[3].similarity < 98
    assert scores[2].parts["left arm"] < 60 and scores[2].parts["right arm"] == 100
    assert max(*scores[2].windows.posture, *scores[2].windows.similarity) < 100


def test_errors_below_the_usual_ones_do_not_make_up_for_an_unseen_limb(generous):
    learner = performed(hidden(JOINTS_M, 0, len(JOINTS_M), [Joint.LEFT_KNEE, Joint.LEFT_FOOT]))
    known, unknown = (score_dance(performed(JOINTS_M), learner, scorer) for scorer in (OURS, generous))
    assert unknown.similarity == pytest.approx(known.similarity, abs=0.1) and known.similarity < 80
    assert (unknown.windows.parts["left leg"] == 0).all() and unknown.parts["right leg"] == 100


def test_a_part_misses_what_the_teacher_shows_and_the_learner_does_not():
    rng, parts = np.random.default_rng(0), np.array([0, 0, 1, 1, 2])
    confidence, taught_rad = rng.integers(0, 3, (40, 5)) / 2, np.where(rng.random((40, 5)) < 0.3, np.nan, 1.0)
    missing = (confidence == 0) & np.isfinite(taught_rad)
    expected = [1 - missing[:, parts == part].any(axis=1).mean() for part in range(3)]
    np.testing.assert_allclose(shares_without_missing(confidence, taught_rad, parts), expected)


def test_errors_below_the_usual_ones_do_not_excuse_lateness(generous):
    late = score_dance(performed(JOINTS_M), performed(JOINTS_M, 0.1), generous)
    assert 85 < late.similarity < 99 and late.similarity == pytest.approx(late.timing, abs=0.5)
    assert (late.windows.similarity <= late.windows.timing + 1e-9).all()
