"""What the figures of lessons mean, and that learners are kept."""

from types import SimpleNamespace

import numpy as np
import pytest
from dance_people import dance_joints_m, noisy, performed
from programs import tool

from kpopnet.dance.scoring import score_dance
from kpopnet.estimator import Estimate
from kpopnet.pose import PersonPose

lessons = tool("measure_lessons")


def test_a_learner_is_estimated_once_with_and_without_what_was_seen_before(tmp_path, monkeypatch):
    monkeypatch.setattr(lessons, "SECONDS", 0.3)
    network = Estimate(np.full((15, 3), 2.0), np.full(15, 0.5))
    answers = iter([[], [PersonPose(1, np.ones((15, 3)), np.ones(15), network)], *[[]] * 9])
    seeing = SimpleNamespace(reset=lambda: None, update=lambda *_: next(answers))
    made = lessons.learner(tmp_path / "one.npz", 101, 2, "benchmark", seeing)
    kept = lessons.learner(tmp_path / "one.npz", 101, 2, "benchmark", None)
    for one in (made, kept):
        assert one.kind == "arm_15" and len(one.true) == 5 and np.isfinite(one.true.joints_m).all()
        for name, metres, confidence in (("realtime", 1.0, 1.0), ("network", 2.0, 0.5)):
            estimated = one.estimated[name]
            assert np.isnan(estimated.joints_m[0]).all() and (estimated.confidence[0] == 0).all()
            assert (estimated.joints_m[1] == metres).all() and (estimated.confidence[1] == confidence).all()
    np.testing.assert_array_equal(made.true.joints_m, kept.true.joints_m)


def test_figures_tell_errors_perfect_dancing_small_faults_and_order():
    teacher_m = dance_joints_m(0, 8.0)
    noise_m = {"perfect_0": 0.0, "perfect_2": 0.005, "best_0": 0.02, "bad_0": 0.06, "worst_0": 0.12}
    noise_m |= {f"{kind}_{size}": 0.03 for kind, size in lessons.GRADED}
    learners = [SimpleNamespace(kind=kind) for kind in noise_m]
    scores = [score_dance(performed(teacher_m), performed(noisy(teacher_m, one))) for one in noise_m.values()]
    true = np.array([one.similarity for one in scores])
    scores[0] = scores[0]._replace(similarity=true[0] - 5)
    found = lessons.figures(learners, scores, true)
    assert found["in_order"] == 1 and set(found["auc"].values()) == {1.0}
    assert found["perfect"][1] == pytest.approx(true[0] - 5) and found["bias"] == pytest.approx(-5 / len(scores))
    assert found["rms"] == pytest.approx(5 / len(scores) ** 0.5) and found["within_uncertainty"] == pytest.approx(90)
