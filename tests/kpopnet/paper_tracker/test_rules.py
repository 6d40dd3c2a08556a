"""Every rule of Algorithm 2 on constructed points, and straightness on tubes."""

import itertools

import numpy as np
import pytest
from y_people import y_joints

from kpopnet.camera import CAMERAS
from kpopnet.geometry.human_model import LIMB_PARENTS, HumanModel
from kpopnet.paper_tracker.algorithm2 import (
    HEAD,
    Plan,
    frame_of,
    geodesics_to,
    is_valid,
)
from kpopnet.paper_tracker.tracker import PaperTracker, PaperTrackerConfig
from kpopnet.skeleton import NUM_JOINTS, PAPER_JOINTS, Joint

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
STRUCTURE = BARRED.structure
SHOULDERS, HIPS = (Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER), (Joint.RIGHT_HIP, Joint.LEFT_HIP)


def valid(joint: Joint, x_m, joints_m: np.ndarray = JOINTS, geodesic_m: float = 0.0, settings=PRINTED) -> bool:
    return is_valid(np.asarray(x_m, float), geodesic_m, int(joint), joints_m, settings)


@pytest.mark.parametrize("settings", [PRINTED, BARRED])
@pytest.mark.parametrize("joint", PAPER_JOINTS)
def test_true_joints_are_valid(joint: Joint, settings) -> None:
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


def test_shoulders_of_hanging_arms_are_nearer_to_the_hips_and_farther_from_the_head() -> None:
    hanging = y_joints(elevation_deg=-80, place_m=(0.0, 0.0, 0.0))
    low = plan(hanging, repaired=True).structure
    changed = low.distance_m - STRUCTURE.distance_m
    for shoulder in SHOULDERS:
        assert -0.1 < changed[shoulder, HIPS].max() < -0.02 and -0.1 < changed[shoulder, Joint.TORSO] < -0.01
        assert 0.01 < changed[HEAD, shoulder] < 0.06
    np.testing.assert_array_equal(changed, changed.T)
    assert 0.01 < low.head_to_shoulder_line_m - STRUCTURE.head_to_shoulder_line_m < 0.06
    assert not any(changed[pair] for pair in LIMB_PARENTS.items()), "limbs keep their lengths"
    # One arm moves its own shoulder alone.
    one = hanging.copy()
    left = [Joint.LEFT_ELBOW, Joint.LEFT_HAND]
    one[left] = JOINTS[left] - JOINTS[Joint.LEFT_SHOULDER] + hanging[Joint.LEFT_SHOULDER]
    half = plan(one, repaired=True).structure.distance_m - STRUCTURE.distance_m
    assert half[Joint.RIGHT_SHOULDER, Joint.TORSO] == pytest.approx(changed[Joint.RIGHT_SHOULDER, Joint.TORSO], abs=1e-3)
    assert abs(half[Joint.LEFT_SHOULDER, Joint.TORSO]) < 0.005


# --- straightness, Eq. (10) ---------------------------------------------------------------------------------------


def tube(way_px: list[tuple[int, int]], z_m: float = 2.5, half_px: int = 8) -> np.ndarray:
    """(240, 320) a flat tube along a polyline of u, v."""
    v, u = np.mgrid[:240, :320]
    depth = np.zeros((240, 320), np.float32)
    for (u0, v0), (u1, v1) in itertools.pairwise(way_px):
        fraction = ((u - u0) * (u1 - u0) + (v - v0) * (v1 - v0)) / ((u1 - u0) ** 2 + (v1 - v0) ** 2)
        fraction = np.clip(fraction, 0, 1)
        depth[np.hypot(u - u0 - fraction * (u1 - u0), v - v0 - fraction * (v1 - v0)) <= half_px] = z_m
    return depth


def straightness(depth: np.ndarray, begin_px: tuple[int, int], end_m: np.ndarray) -> float:
    """P_L of Eq. (10) between an elbow at a pixel and the point nearest to another one."""
    frame = frame_of(depth, np.zeros_like(depth, bool), CAMERA)
    joints = np.zeros((NUM_JOINTS, 3))
    joints[Joint.LEFT_ELBOW] = CAMERA.back_project(np.array((*begin_px, 2.5)))
    geodesics = geodesics_to(int(Joint.LEFT_HAND), frame, joints, plan(straightness=0.0))
    k = np.linalg.norm(frame.cells_m - end_m, axis=1).argmin()
    return np.linalg.norm(frame.cells_m[k] - joints[Joint.LEFT_ELBOW]) / geodesics[k]


def at(u: int, v: int, z_m: float = 2.5) -> np.ndarray:
    return CAMERA.back_project(np.array((u, v, z_m)))


def test_a_depth_jump_between_crossing_limbs_lengthens_the_path() -> None:
    behind, before = tube([(60, 120), (260, 120)]), tube([(160, 40), (160, 200)], z_m=2.2)
    assert straightness(np.where(before > 0, before, behind), (90, 120), at(160, 190, 2.2)) < 0.7
