"""Limbs refitted along the silhouette, and the silhouette's tips."""

import numpy as np
import pytest
from cone_people import CAMERA, cone_joints, seen

from kpopnet.geometry import depth_grid
from kpopnet.geometry.body import LIMBS
from kpopnet.geometry.cones import body_segments
from kpopnet.geometry.depth_grid import MIN_TIP_SEPARATION_M, farthest_points, geodesic_distances
from kpopnet.skeleton import MIRROR, Joint
from kpopnet.tracker.fit import pose_cost
from kpopnet.tracker.limbs import refit_limbs, swap_crossed_limbs, torso_points


def swung(joints: np.ndarray, limb: int, angle_deg: float) -> np.ndarray:
    """A whole limb rotated about its root in the image plane."""
    joints = joints.copy()
    root, *others = LIMBS[limb]
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    joints[others] = (joints[others] - joints[root]) @ np.array([(cos, sin, 0), (-sin, cos, 0), (0, 0, 1)]) + joints[root]
    return joints


@pytest.mark.parametrize(
    ("limb", "pose", "angle_deg", "middle_m", "end_m"),
    [
        (0, {"elevation_deg": 15}, -100, 0.1, 0.1),
        (1, {"elevation_deg": 15, "elbow_deg": 60}, -60, 0.1, 0.1),
        (1, {"elevation_deg": 15}, 60, 0.1, 0.1),
        (2, {"abduction_deg": 12}, 50, 0.2, 0.12),  # a silhouette hardly constrains the knee along the leg; the fit corrects it
        (3, {"abduction_deg": 12}, -50, 0.2, 0.12),
    ],
)
def test_a_lost_limb_is_recovered(limb: int, pose: dict, angle_deg: float, middle_m: float, end_m: float) -> None:
    joints = cone_joints(**pose)
    body, grid = seen(joints)
    wrong = swung(joints, limb, angle_deg)
    found, changes = refit_limbs(wrong, joints, grid, body, 1)
    middle, end = np.linalg.norm(found - joints, axis=1)[LIMBS[limb, 1:]]
    assert changes >= 1 and middle < middle_m and end < end_m
    assert pose_cost(found, grid, body, 1) < pose_cost(wrong, grid, body, 1)


@pytest.mark.parametrize("pose", [{"elevation_deg": 10, "elbow_deg": 60}, {"elevation_deg": -40, "yaw_deg": 25}])
def test_a_correct_pose_is_kept(pose: dict) -> None:
    joints = cone_joints(**pose)
    body, grid = seen(joints)
    found, changes = refit_limbs(joints, joints, grid, body, 1)
    assert changes == 0 and np.array_equal(found, joints)


def test_refitted_limbs_keep_lengths_and_roots() -> None:
    joints = cone_joints(elevation_deg=15, elbow_deg=40)
    body, grid = seen(joints)
    wrong = swung(swung(joints, 0, -90), 1, 80)
    found, changes = refit_limbs(wrong, joints, grid, body, 1)
    kept = [joint for joint in Joint if joint not in LIMBS[:2, 1:]]
    assert changes == 2 and np.array_equal(found[kept], wrong[kept])
    lengths_m = np.linalg.norm(found[LIMBS[:, 1:]] - found[LIMBS[:, :2]], axis=-1)
    np.testing.assert_allclose(lengths_m, body.limbs_m, atol=1e-6)


@pytest.mark.parametrize(("lower", "whole"), [(Joint.RIGHT_HAND, False), (Joint.RIGHT_FOOT, True)])
def test_crossed_limbs_exchange_ends_or_middles_and_ends(lower: Joint, whole: bool) -> None:
    joints = cone_joints()
    assert swap_crossed_limbs(joints) == []
    crossed = joints.copy()
    exchanged = [lower, lower + 1, *((lower - 2, lower - 1) if whole else ())]
    crossed[exchanged] = joints[MIRROR[exchanged]]
    found = swap_crossed_limbs(crossed)
    assert len(found) == 2
    np.testing.assert_array_equal(found[whole], joints)


# --- tips ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("elevation_deg", [-40, 20])
def test_tips_are_the_points_farthest_from_torso_and_head(elevation_deg: float) -> None:
    joints = cone_joints(elevation_deg=elevation_deg, yaw_deg=15)
    body, grid = seen(joints)
    source, points = torso_points(body_segments(joints, body), grid.points_m), grid.points_m
    for joint in (Joint.HEAD, Joint.TORSO):
        assert np.linalg.norm(CAMERA.project(points[source])[:, :2] - CAMERA.project(joints[joint])[:2], axis=1).min() < 4
    for end in LIMBS[:, 1:].ravel():
        assert np.linalg.norm(points[source] - joints[end], axis=1).min() > 0.07
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, depth_grid.UNREACHABLE_M)
    apart, reached = np.linalg.norm(points[:, None] - points[None], axis=-1), length < 1e8
    expected = [
        i
        for i in np.flatnonzero(reached & (length >= depth_grid.MIN_TIP_DISTANCE_M))
        if not ((apart[i] < MIN_TIP_SEPARATION_M) & reached & (length > length[i])).any()
        and not ((apart[i] < MIN_TIP_SEPARATION_M) & (length == length[i]))[:i].any()
    ]
    assert len(expected) >= 3
    np.testing.assert_array_equal(
        farthest_points(points, grid.neighbours, grid.edge_lengths_m, length), expected[: depth_grid.MAX_TIPS]
    )
