"""Tips of silhouettes."""

import numpy as np
import pytest
from cone_people import CAMERA, cone_joints, seen

from kpopnet.geometry.body import LIMBS
from kpopnet.geometry.depth_grid import UNREACHABLE_M, build_depth_grid, geodesic_distances
from kpopnet.skeleton import Joint
from kpopnet.tracker.tips import MAX_TIPS, MIN_TIP_DISTANCE_M, MIN_TIP_SEPARATION_M, limb_tips, torso_points


@pytest.mark.parametrize("rays", [3, 5, 7])
def test_a_star_has_a_tip_at_every_ray(rays: int) -> None:
    v, u = np.mgrid[:240, :320]
    aside, below = u - 160, v - 120
    star = np.hypot(aside, below) < 18
    angles = 0.3 + 2 * np.pi * np.arange(rays) / rays
    ends = []
    for angle in angles:
        along = aside * np.cos(angle) + below * np.sin(angle)
        across = -aside * np.sin(angle) + below * np.cos(angle)
        star |= (along > 0) & (along < 90) & (np.abs(across) < 6)
        ends.append((160 + 90 * np.cos(angle), 120 + 90 * np.sin(angle), 2.5))
    grid = build_depth_grid(np.where(star, np.float32(2.5), np.float32(0)), CAMERA)
    centre = CAMERA.back_project(np.array((160, 120, 2.5)))
    source = np.linalg.norm(grid.points_m - centre, axis=1) < 0.1
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = grid.points_m[limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, length)]
    assert len(tips) == rays
    away = np.linalg.norm(tips[:, None] - CAMERA.back_project(np.array(ends)), axis=-1)
    assert sorted(away.argmin(1)) == list(range(rays)) and away.min(1).max() < 0.1


def test_torso_points_lie_on_torso_and_head() -> None:
    joints = cone_joints(elevation_deg=20)
    body, grid = seen(joints)
    on = grid.points_m[torso_points(joints, grid.points_m, body)]
    assert len(on) > 20
    for end in LIMBS[:, 1:].ravel():
        assert np.linalg.norm(on - joints[end], axis=1).min() > 0.08
    for joint in (Joint.HEAD, Joint.TORSO):
        u, v, _ = CAMERA.project(joints[joint])
        pixels = CAMERA.project(on)[:, :2]
        assert np.linalg.norm(pixels - (u, v), axis=1).min() < 4


@pytest.mark.parametrize("elevation_deg", [-40, 10, 50])
def test_tips_agree_with_brute_force(elevation_deg: float) -> None:
    joints = cone_joints(elevation_deg=elevation_deg, yaw_deg=15)
    body, grid = seen(joints)
    source = torso_points(joints, grid.points_m, body)
    length, _ = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    apart = np.linalg.norm(grid.points_m[:, None] - grid.points_m[None], axis=-1)
    reached = length < 1e8
    expected = [
        i
        for i in np.flatnonzero(reached & (length >= MIN_TIP_DISTANCE_M))
        if not ((apart[i] < MIN_TIP_SEPARATION_M) & reached & (length > length[i])).any()
        and not ((apart[i] < MIN_TIP_SEPARATION_M) & (length == length[i]))[:i].any()
    ]
    assert len(expected) >= 3
    np.testing.assert_array_equal(limb_tips(grid.points_m, grid.neighbours, grid.edge_lengths_m, length), expected[:MAX_TIPS])
