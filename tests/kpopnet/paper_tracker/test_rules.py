"""Every rule of Algorithm 2 on constructed points."""

import itertools

import numpy as np
import pytest
from y_people import y_joints

from kpopnet.camera import CAMERAS
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.paper_tracker.algorithm2 import Plan, is_valid
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig
from kpopnet.skeleton import PAPER_JOINTS, Joint

CAMERA = CAMERAS["kinect_v1"]
EPSILON_M, STRAIGHTNESS = 0.05, 0.7
INSIDE, OUTSIDE = 0.9 * EPSILON_M, 1.1 * EPSILON_M
BOTH_WAYS = ((INSIDE, True), (-INSIDE, True), (OUTSIDE, False), (-OUTSIDE, False))
JOINTS = y_joints(place_m=(0.0, 0.0, 0.0))


def plan(joints_m: np.ndarray = JOINTS, **settings) -> Plan:
    """Of a person with the lengths of `JOINTS` in a pose."""
    tracker = PaperTracker(CAMERA, PaperTrackerConfig(**settings), HumanModel.from_joints(JOINTS))
    tracker.start(joints_m)
    return tracker.plan()


PRINTED, BARRED = plan(), plan(repaired=True)
SHOULDERS, HIPS = (Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER), (Joint.RIGHT_HIP, Joint.LEFT_HIP)


def valid(joint: Joint, x_m, joints_m: np.ndarray = JOINTS, geodesic_m: float = 0.0, settings=PRINTED) -> bool:
    return is_valid(np.asarray(x_m, float), geodesic_m, int(joint), joints_m, settings)


def test_true_joints_are_valid() -> None:
    for joint, settings in itertools.product(PAPER_JOINTS, (PRINTED, BARRED)):
        assert valid(joint, JOINTS[joint], settings=settings)


def test_head_rule_bounds_the_distance_to_the_torso_in_any_direction() -> None:
    torso, length = JOINTS[Joint.TORSO], np.linalg.norm(JOINTS[Joint.HEAD] - JOINTS[Joint.TORSO])
    for direction in ((0, -1, 0), (0.6, 0, 0.8)):
        for by, expected in BOTH_WAYS:
            assert valid(Joint.HEAD, torso + (length + by) * np.array(direction)) is expected


@pytest.mark.parametrize("joint", SHOULDERS)
def test_shoulder_rule_bounds_shoulder_width_and_head_perpendicular(joint: Joint) -> None:
    out = np.sign(JOINTS[joint, 0]) * np.array((1, 0, 0))
    for by, expected in BOTH_WAYS:
        # Along the line of the shoulders the head's perpendicular is constant.
        assert valid(joint, JOINTS[joint] + by * out) is expected
    # On the sphere around the other shoulder the distance is constant and the perpendicular changes.
    opposite = JOINTS[sum(SHOULDERS) - joint]
    width = np.linalg.norm(JOINTS[joint] - opposite)
    rule = []
    for angle in np.radians(np.arange(-60, 61)):
        x = opposite + width * np.array((np.cos(angle) * out[0], np.sin(angle), 0))
        line = np.linalg.norm(np.cross(x - opposite, JOINTS[Joint.HEAD] - opposite)) / width
        assert valid(joint, x) is bool(abs(line - 0.2) <= EPSILON_M)
        rule.append(valid(joint, x))
    assert any(rule) and not all(rule)


def test_both_shoulders_may_slide_along_their_line_unless_the_head_holds_them() -> None:
    """Eq. (6) bounds the shoulders' distance and the head's perpendicular, which a common slide leaves as they are."""
    for slide_m in (-0.15, 0.15, 1.0):
        slid = JOINTS.copy()
        slid[list(SHOULDERS), 0] += slide_m
        for joint in SHOULDERS:
            assert valid(joint, slid[joint], slid)
            assert not valid(joint, slid[joint], slid, settings=BARRED)


@pytest.mark.parametrize(
    ("joint", "other"),
    [*((Joint.TORSO, other) for other in (Joint.HEAD, *SHOULDERS)), *itertools.product(HIPS, (*SHOULDERS, Joint.TORSO))],
)
def test_torso_and_hip_rules_bound_distances_to_other_joints(joint: Joint, other: Joint) -> None:
    """Another joint moves so that one distance alone is wrong: a hip's to the torso is that to the line through the hips."""
    direction = np.array((0, 1, 0)) if joint in HIPS and other == Joint.TORSO else JOINTS[other] - JOINTS[joint]
    for by, expected in BOTH_WAYS:
        joints = JOINTS.copy()
        joints[other] += by * direction / np.linalg.norm(direction)
        assert valid(joint, JOINTS[joint], joints) is expected


@pytest.mark.parametrize("limb", LIMB_PARENTS)
def test_limb_rule_bounds_length_and_straightness(limb: Joint) -> None:
    parent = JOINTS[LIMB_PARENTS[limb]]
    direction = (JOINTS[limb] - parent) / np.linalg.norm(JOINTS[limb] - parent)
    length = float(np.linalg.norm(JOINTS[limb] - parent))
    for by, expected in BOTH_WAYS:
        assert valid(limb, parent + (length + by) * direction) is expected
    assert valid(limb, JOINTS[limb], geodesic_m=0.99 * length / STRAIGHTNESS)
    assert not valid(limb, JOINTS[limb], geodesic_m=1.01 * length / STRAIGHTNESS)
    assert not valid(limb, JOINTS[limb], geodesic_m=1e9)  # without a path
