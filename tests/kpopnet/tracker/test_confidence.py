"""Confidence of fitted joints: a score of the fit, and a probability from it."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones

from kpopnet.camera import CAMERAS
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.skeleton import Joint
from kpopnet.tracker import confidence
from kpopnet.tracker.confidence import fit_score, probability, refined_evidence, tracked_evidence

CAMERA = CAMERAS["kinect_v1"]


@pytest.fixture(scope="module")
def person():
    """(15, 3) joints of a person made of cones, the body, and the depth image's grid."""
    joints = cone_joints(20)
    body = cone_body(joints)
    return joints, body, build_depth_grid(draw_cones(joints, body, CAMERA), CAMERA)


def test_the_true_pose_fits_and_a_shifted_one_fits_less_the_farther_it_is(person) -> None:
    joints, body, grid = person
    scores = [fit_score(joints + np.array([0, 0, shift]), grid, body) for shift in (0, 0.03, 0.06, 0.1, 0.2)]
    assert scores[0].min() > 0.9
    means = [score.mean() for score in scores]
    assert means == sorted(means, reverse=True) and means[-1] < 0.3
    assert all(((score >= 0) & (score <= 1)).all() for score in scores)


def test_a_misplaced_hand_lowers_its_own_score_most(person) -> None:
    joints, body, grid = person
    moved = joints.copy()
    moved[Joint.RIGHT_HAND] += (-0.3, 0.2, 0)
    loss = fit_score(joints, grid, body) - fit_score(moved, grid, body)
    assert np.argmax(loss) in (Joint.RIGHT_HAND, Joint.RIGHT_ELBOW) and loss[Joint.RIGHT_HAND] > 0.3


def test_a_joint_without_points_has_score_0(person) -> None:
    joints, body, grid = person
    behind = joints.copy()
    behind[Joint.LEFT_HAND] += (0, 0, 3)
    behind[Joint.LEFT_ELBOW] += (0, 0, 3)
    assert fit_score(behind, grid, body)[Joint.LEFT_HAND] == 0


def test_the_probability_is_a_logistic_regression() -> None:
    evidence = np.array([[1.0, 0.0, 2.0], [1.0, 1.0, 0.0]])
    np.testing.assert_allclose(probability(evidence, (0.0, np.log(3), 0.0)), [0.5, 0.75])


def test_better_evidence_gives_more_confidence() -> None:
    """In the score of the joint, of the others, the detector's confidence, and the distance from its joint."""
    low, high = np.full(15, 0.3), np.full(15, 0.9)
    others = high.copy()
    others[0] = 0.3
    worst, lone, best = (probability(tracked_evidence(score), confidence.TRACKED_WEIGHTS)[0] for score in (low, others, high))
    assert 0 < worst < lone < best < 1
    still, moved = np.zeros(15), np.full(15, 0.1)
    best, *worse = (
        probability(refined_evidence(*given), confidence.REFINED_WEIGHTS)[0]
        for given in ((high, high, still), (low, high, still), (high, low, still), (high, high, moved))
    )
    assert all(one < best for one in worse)
