"""Figures that need no label: each rises with its own fault, by what was put in."""

import numpy as np
import pytest
from cone_people import cone_joints, filmed

from kpopnet.camera import CAMERAS
from kpopnet.evaluation.poses.label_free import _jitter_mm2, label_free, pooled
from kpopnet.skeleton import Joint

CAMERA, FPS = CAMERAS["kinect_v1"], 30.0
TRUE_M = np.repeat(cone_joints(40, 12)[None], 24, axis=0)


@pytest.fixture(scope="module")
def depth_m():
    return np.repeat(filmed(TRUE_M[:1], CAMERA), len(TRUE_M), axis=0)


def figures(joints_m, depth_m):
    return pooled([label_free(joints_m, depth_m, CAMERA, FPS)])


def test_true_joints_of_a_person_at_rest(depth_m):
    found = figures(TRUE_M, depth_m)
    for name in ("bone_spread_cm", "jitter_core_mm", "jitter_ends_mm", "spikes"):
        assert found[name] == pytest.approx(0, abs=1e-9)
    assert found["surface_cm"] < 1.5
    once_m = np.where(np.arange(len(TRUE_M))[:, None, None] == 5, TRUE_M, np.nan)
    assert np.isnan(figures(once_m, depth_m)["bone_spread_cm"])  # one image says nothing of steadiness


def test_noise_is_measured_by_its_size_whether_or_not_the_person_sways(depth_m):
    noise_m = 0.004 * np.random.default_rng(0).standard_normal(TRUE_M.shape)
    swaying_m = np.linspace(0, 0.05, len(TRUE_M))[:, None, None]
    for joints_m in (TRUE_M + noise_m, TRUE_M + noise_m + swaying_m):
        found = figures(joints_m, depth_m)
        for name in ("jitter_core_mm", "jitter_ends_mm"):
            assert found[name] == pytest.approx(4 * np.sqrt(3), rel=0.25)
    assert found["bone_spread_cm"] == pytest.approx(0.4 * np.sqrt(2), rel=0.2)


def test_a_moving_joint_does_not_rest_and_a_jump_is_a_spike(depth_m):
    joints_m = TRUE_M.copy()
    joints_m[:, Joint.LEFT_HAND, 0] += 0.3 * np.sin(np.linspace(0, 6, len(TRUE_M)))
    found = figures(joints_m, depth_m)
    assert found["jitter_ends_mm"] < 1e-6 and found["spikes"] == 0
    joints_m[12, Joint.RIGHT_FOOT, 1] -= 0.3
    assert figures(joints_m, depth_m)["spikes"] == pytest.approx(3 / (22 * 15))  # it begins, turns and ends


def test_a_pose_away_from_the_points_is_far_from_their_surface(depth_m):
    away_m = TRUE_M.copy()
    away_m[:, [Joint.LEFT_ELBOW, Joint.LEFT_HAND], 1] += 0.4
    assert figures(away_m, depth_m)["surface_cm"] > figures(TRUE_M, depth_m)["surface_cm"] + 0.3


def test_jitter_is_unbiased():
    noise_m = 0.004 * np.random.default_rng(0).standard_normal((1200, 15, 3))
    assert np.sqrt(np.nanmean(_jitter_mm2(noise_m, 12))) == pytest.approx(4 * np.sqrt(3), rel=0.03)
