"""Every rule of Algorithm 2 on constructed points."""

import itertools

import numpy as np
import pytest
from y_people import y_joints

from kpopnet.camera import CAMERAS
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.paper_tracker.algorithm2 import JOINT_ORDER, Plan, collect, is_valid
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig
from kpopnet.skeleton import PAPER_JOINTS, Joint

EPSILON_M, STRAIGHTNESS = 0.05, 0.7
JOINTS = y_joints(place_m=(0.0, 0.0, 0.0))
SHOULDERS, HIPS = (Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER), (Joint.RIGHT_HIP, Joint.LEFT_HIP)


def plan(**settings) -> Plan:
    """Of a person with the lengths of `JOINTS`."""
    tracker = PaperTracker(CAMERAS["kinect_v1"], PaperTrackerConfig(**settings), HumanModel.from_joints(JOINTS))
    tracker.start(JOINTS)
    return tracker.plan()


PRINTED, BARRED = plan(), plan(repaired=True)


def valid(joint: Joint, x_m, joints_m: np.ndarray = JOINTS, geodesic_m: float = 0.0, settings=PRINTED) -> bool:
    return is_valid(np.asarray(x_m, float), geodesic_m, int(joint), joints_m, settings)


def test_true_joints_are_valid() -> None:
    for joint, settings in itertools.product(PAPER_JOINTS, (PRINTED, BARRED)):
        assert valid(joint, JOINTS[joint], settings=settings)


def rule(joint: Joint, x_m: np.ndarray, joints_m: np.ndarray, geodesic_m: float) -> bool:
    """The slow twin: Eqs. (5) to (10), with the lengths of `JOINTS`."""

    def keeps_distance_to(*others: Joint) -> bool:
        lengths_m = [np.linalg.norm(JOINTS[joint] - JOINTS[other]) for other in others]
        return all(np.abs(np.linalg.norm(x_m - joints_m[list(others)], axis=1) - lengths_m) <= EPSILON_M)

    def is_from_line(point: Joint, opposite: Joint, length_m: float) -> bool:
        along_m, away_m = x_m - joints_m[opposite], joints_m[point] - joints_m[opposite]
        return abs(np.linalg.norm(np.cross(along_m, away_m)) / np.linalg.norm(along_m) - length_m) <= EPSILON_M

    if joint in LIMB_PARENTS:
        parent = LIMB_PARENTS[joint]
        return keeps_distance_to(parent) and np.linalg.norm(x_m - joints_m[parent]) > STRAIGHTNESS * geodesic_m
    if joint in SHOULDERS:
        opposite = Joint(sum(SHOULDERS) - joint)
        return keeps_distance_to(opposite) and is_from_line(Joint.HEAD, opposite, 0.2)
    if joint in HIPS:
        return keeps_distance_to(*SHOULDERS) and is_from_line(Joint.TORSO, Joint(sum(HIPS) - joint), 0.25)
    return keeps_distance_to(*((Joint.TORSO,) if joint == Joint.HEAD else (*SHOULDERS, Joint.HEAD)))


@pytest.mark.parametrize("joint", PAPER_JOINTS)
def test_a_candidate_is_valid_where_the_equations_hold(joint: Joint) -> None:
    rng, found = np.random.default_rng(int(joint)), []
    for _ in range(500):
        joints_m = JOINTS + rng.normal(0, 0.02, JOINTS.shape)
        x_m, geodesic_m = joints_m[joint] + rng.normal(0, 0.04, 3), rng.uniform(0, 0.8)
        found.append(valid(joint, x_m, joints_m, geodesic_m))
        assert found[-1] == rule(joint, x_m, joints_m, geodesic_m)
    assert 0.1 < np.mean(found) < 0.9


def test_candidates_whose_way_over_the_body_is_long_are_dropped() -> None:
    """Eq. (10) by the ways to the candidates' cells: of two at one place one is reached along another limb."""
    hand, way_m = Joint.LEFT_HAND, float(np.linalg.norm(JOINTS[Joint.LEFT_HAND] - JOINTS[Joint.LEFT_ELBOW]))
    points, cells = np.tile(JOINTS[hand], (2, 1)), np.array([0, 1])
    found = collect(int(hand), points, cells, np.array([1.1, 1.6]) * way_m, JOINTS, PRINTED)
    assert found.near.all() and found.valid.tolist() == [True, False] and found.count == 1


def test_joints_are_estimated_from_the_trunk_outwards_with_the_printed_settings() -> None:
    order = JOINT_ORDER.tolist()
    assert order[0] == Joint.HEAD and sorted(order) == sorted(PAPER_JOINTS)
    assert all(order.index(parent) < order.index(joint) for joint, parent in LIMB_PARENTS.items())
    printed = PaperTrackerConfig()
    assert (printed.r_m, printed.epsilon_m, printed.epsilon_r, printed.straightness) == (0.11, 0.05, 0.3, 0.7)


def test_both_shoulders_may_slide_along_their_line_unless_the_head_holds_them() -> None:
    """Eq. (6) bounds the shoulders' distance and the head's perpendicular, which a common slide leaves as they are."""
    for slide_m in (-0.15, 0.15, 1.0):
        slid = JOINTS.copy()
        slid[list(SHOULDERS), 0] += slide_m
        for joint in SHOULDERS:
            assert valid(joint, slid[joint], slid)
            assert not valid(joint, slid[joint], slid, settings=BARRED)
