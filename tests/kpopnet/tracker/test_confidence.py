"""Confidence of fitted joints: a score of the fit, and a probability from it."""

import numpy as np
import pytest
from cone_people import cone_joints, seen

from kpopnet.geometry.body import PARTS, ROW_TO_JOINT
from kpopnet.geometry.cones import body_segments, extend_joints, nearest_parts
from kpopnet.skeleton import Joint
from kpopnet.tracker import confidence
from kpopnet.tracker.confidence import fit_score, probability, refined_evidence, tracked_evidence


def test_the_score_falls_with_distance_with_a_misplaced_hand_and_without_points() -> None:
    joints = cone_joints(20)
    body, grid = seen(joints)
    scores = [fit_score(joints + np.array([0, 0, shift]), grid, body) for shift in (0, 0.03, 0.06, 0.1, 0.2)]
    means = [score.mean() for score in scores]
    assert scores[0].min() > 0.9 and means == sorted(means, reverse=True) and means[-1] < 0.3
    assert all(((score >= 0) & (score <= 1)).all() for score in scores)
    moved, behind = joints.copy(), joints.copy()
    moved[Joint.RIGHT_HAND] += (-0.3, 0.2, 0)
    loss = scores[0] - fit_score(moved, grid, body)
    assert np.argmax(loss) in (Joint.RIGHT_HAND, Joint.RIGHT_ELBOW) and loss[Joint.RIGHT_HAND] > 0.3
    behind[[Joint.LEFT_HAND, Joint.LEFT_ELBOW], 2] += 3
    assert fit_score(behind, grid, body)[Joint.LEFT_HAND] == 0


def test_better_evidence_gives_more_confidence() -> None:
    """In the score of the joint, of the others, the detector's confidence, and the distance from its joint."""
    low, high = np.full(15, 0.3), np.full(15, 0.9)
    others = high.copy()
    others[0] = 0.3
    worst, lone, best = (probability(tracked_evidence(score), confidence.TRACKED_WEIGHTS)[0] for score in (low, others, high))
    assert 0 < worst < lone < best < 1
    still, moved = np.zeros(15), np.full(15, 0.1)
    given = (high, high, still), (low, high, still), (high, low, still), (high, high, moved)
    best, *worse = (probability(refined_evidence(*one), confidence.REFINED_WEIGHTS)[0] for one in given)
    assert all(one < best for one in worse)
    assert (refined_evidence(high, high, moved)[:, 3] == 10).all()  # centimetres


def test_each_point_counts_for_the_joint_at_the_nearer_end_of_its_part() -> None:
    joints = cone_joints(20)
    body, grid = seen(joints)
    part, off_m, _ = nearest_parts(body_segments(joints, body), grid.points_m, 1)
    ends = extend_joints(joints, body.trunk_offsets_m)[PARTS[part]]
    nearer = np.linalg.norm(ends - grid.points_m[:, None], axis=-1).argmin(axis=1)
    joint_of = ROW_TO_JOINT[PARTS[part, nearer]]
    for joint in Joint:
        own_m = np.abs(off_m[joint_of == joint])
        expected = min(len(own_m) / 4, 1) / (1 + (own_m.mean() / 0.06) ** 2)
        assert fit_score(joints, grid, body)[joint] == pytest.approx(expected, abs=2e-3), joint
