"""The thickness of a person's parts, measured in a known pose."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones

from kpopnet.camera import CAMERAS
from kpopnet.geometry.body import PART_KIND, PARTS, RADII_M, Body
from kpopnet.geometry.cones import extend_joints, nearest_parts, part_segments
from kpopnet.geometry.depth_grid import DepthGrid, build_depth_grid
from kpopnet.tracker.body_estimate import CORRECTION_ITERATIONS, MAX_CORRECTION_M, MIN_PART_POINTS, fit_thickness

CAMERA = CAMERAS["kinect_v1"]


def reference(body: Body, joints_m: np.ndarray, grid: DepthGrid) -> np.ndarray:
    """(P, 2) the radii of `fit_thickness`, part kind by part kind."""
    radii = body.radii_m.copy()
    for _ in range(CORRECTION_ITERATIONS):
        segments = part_segments(extend_joints(joints_m, body.trunk_offsets_m), PARTS, radii)
        part, distance, _ = nearest_parts(segments, grid.points_m, 1)
        for kind in range(len(RADII_M)):
            of_kind = distance[PART_KIND[part] == kind]
            if len(of_kind) >= MIN_PART_POINTS:
                radii[kind == PART_KIND] += np.median(of_kind)
        radii = np.clip(radii, body.radii_m - MAX_CORRECTION_M, body.radii_m + MAX_CORRECTION_M)
        radii = np.maximum(radii, body.radii_m / 2)
    return radii


@pytest.fixture(scope="module")
def seen() -> tuple[np.ndarray, Body, DepthGrid]:
    joints_m = cone_joints(20, yaw_deg=15)
    body = cone_body(joints_m)
    return joints_m, body, build_depth_grid(draw_cones(joints_m, body, CAMERA), CAMERA)


@pytest.mark.parametrize("wrong", [0.3, 0.9, 1.0, 1.2, 2.5])
def test_the_kernel_equals_the_reference(seen, wrong: float) -> None:
    joints_m, body, grid = seen
    given = body._replace(radii_m=body.radii_m * wrong)
    np.testing.assert_allclose(fit_thickness(given, joints_m, grid).radii_m, reference(given, joints_m, grid), atol=1e-6)


@pytest.mark.parametrize("wrong", [0.85, 1.15])
def test_wrong_radii_are_corrected(seen, wrong: float) -> None:
    joints_m, body, grid = seen
    given = body._replace(radii_m=body.radii_m * wrong)
    found = fit_thickness(given, joints_m, grid)
    assert np.abs(found.radii_m - body.radii_m).mean() < 0.4 * np.abs(given.radii_m - body.radii_m).mean()
    assert np.array_equal(given.radii_m, body.radii_m * wrong)  # the given body is not changed
