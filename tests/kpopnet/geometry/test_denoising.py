"""Depth of noisy sensors is smoothed before a body is fitted to it; that of others is not touched."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones, moved
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.camera import CAMERAS
from kpopnet.geometry.depth_grid import WINDOW, _medians, build_depth_grid, denoised
from kpopnet.tracker.solver import fit

CAMERA = CAMERAS["smmc10"]


def noisy_wall(deviation_m: float, seed: int = 0) -> np.ndarray:
    """(60, 50) float32 metres: a wall at 3 m with unmeasured pixels and a border around it."""
    rng = np.random.default_rng(seed)
    depth_m = rng.normal(3.0, deviation_m, (60, 50)).astype(np.float32)
    depth_m[rng.random(depth_m.shape) < 0.02] = 0
    depth_m[:5], depth_m[:, :5] = 0, 0
    return depth_m


def reference(depth_m: np.ndarray) -> np.ndarray:
    """The medians of the measured pixels around each measured pixel, window by window."""
    reach, known = WINDOW // 2, np.where(depth_m > 0, depth_m, np.nan)
    smooth = np.zeros_like(depth_m)
    for y, x in np.argwhere(depth_m > 0):
        smooth[y, x] = np.nanmedian(known[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1])
    return smooth


@settings(deadline=None)
@given(arrays(np.float32, st.tuples(st.integers(1, 8), st.integers(1, 8)), elements=st.sampled_from([0, 1, 1.5, 2.25, 3])))
def test_the_kernel_equals_the_reference(depth_m: np.ndarray) -> None:
    np.testing.assert_allclose(_medians(depth_m), reference(depth_m), rtol=1e-6)


@pytest.mark.parametrize("deviation_m", [0.035, 0.06])
def test_noise_of_a_time_of_flight_camera_is_smoothed(deviation_m: float) -> None:
    depth_m = noisy_wall(deviation_m)
    before = depth_m.copy()
    smooth_m = denoised(depth_m)
    assert np.array_equal(depth_m, before)
    assert np.array_equal(smooth_m > 0, depth_m > 0) and smooth_m.dtype == np.float32
    assert smooth_m[smooth_m > 0].std() < 0.35 * deviation_m


@pytest.mark.parametrize("deviation_m", [0.0, 0.005, 0.015, 0.02])
def test_depth_of_structured_light_is_returned_as_it_is(deviation_m: float) -> None:
    depth_m = noisy_wall(deviation_m)
    assert denoised(depth_m) is depth_m


def test_a_fit_to_noisy_depth_is_better_for_it() -> None:
    joints_m = cone_joints(20, yaw_deg=15)
    body, clean_m = cone_body(joints_m), draw_cones(joints_m, cone_body(joints_m), CAMERA)
    noise_m = np.random.default_rng(0).normal(0, 0.05, clean_m.shape)
    noisy_m = np.where(clean_m > 0, clean_m + noise_m, 0).astype(np.float32)
    grid = build_depth_grid(noisy_m, CAMERA)
    raw = grid._replace(points_m=CAMERA.points(noisy_m)[noisy_m > 0].astype(np.float64), depth_m=noisy_m)
    starts_m = [moved(joints_m, seed) for seed in range(6)]

    def error_m(used: object) -> float:
        return float(np.mean([np.linalg.norm(fit(start, used, body, 10) - joints_m, axis=1).mean() for start in starts_m]))

    assert error_m(grid) < 0.9 * error_m(raw)
