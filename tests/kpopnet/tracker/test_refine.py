"""Joints detected by another estimator, refined by fitting the body; its lengths and its thickness."""

from unittest.mock import Mock

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, error_m, filmed, moved, seen

from kpopnet.camera import CAMERAS
from kpopnet.estimator import Estimate
from kpopnet.geometry.body import PART_KIND
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.tracker import refine
from kpopnet.tracker.body_estimate import MAX_CORRECTION_M, BodyEstimate, fit_thickness
from kpopnet.tracker.refine import FittedEstimator, compile_refining

CAMERA = CAMERAS["kinect_v1"]


def refined(detected_m: np.ndarray, depth_m: np.ndarray) -> Estimate:
    """The joints that an estimator gives with a confidence of 0.75, refined."""
    detected = Estimate(detected_m.astype(np.float32), np.full(detected_m.shape[:2], 0.75, np.float32))
    return FittedEstimator(Mock(**{"estimate.return_value": detected})).estimate(depth_m, CAMERA)


@pytest.fixture(scope="module")
def film():
    """(8, 15, 3) true joints, (8, H, W) metres of a person who lowers the arms and turns, and joints with 3 to 5 cm error."""
    joints = np.stack([cone_joints(30 - 8 * t, yaw_deg=6 * t) for t in range(8)])
    return joints, filmed(joints, CAMERA), np.stack([moved(pose, seed) for seed, pose in enumerate(joints)])


def test_refinement_reduces_the_error_and_no_frame_depends_on_a_later_one(film) -> None:
    joints, depth_m, detected = film
    whole = refined(detected, depth_m)
    assert error_m(whole.joints_camera_m, joints).mean() < 0.65 * error_m(detected, joints).mean()
    assert whole.joints_camera_m.dtype == whole.confidence.dtype == np.float32
    part = refined(detected[:5], depth_m[:5])
    np.testing.assert_array_equal(part.joints_camera_m, whole.joints_camera_m[:5])
    np.testing.assert_array_equal(part.confidence, whole.confidence[:5])


def test_frames_with_missing_joints_or_without_a_person_are_unchanged(film) -> None:
    _, depth_m, detected = film
    detected, depth_m = detected.astype(np.float32), depth_m.copy()
    detected[2, 5], depth_m[[4, 6]] = np.nan, 0
    depth_m[6, 100, 100] = 2.0
    found, confidence = refined(detected, depth_m)
    np.testing.assert_array_equal(found[[2, 4, 6]], detected[[2, 4, 6]])
    assert (confidence[[2, 4, 6]] == 0.75).all()
    assert (found[[0, 1, 3, 5, 7]] != detected[[0, 1, 3, 5, 7]]).all() and (confidence[[0, 1, 3, 5, 7]] != 0.75).all()


def test_lengths_are_medians_over_frames_with_valid_lengths(film) -> None:
    joints, depth_m, detected = film
    truth, person, grids = cone_body(joints[0]), BodyEstimate(), [build_depth_grid(image, CAMERA) for image in depth_m]
    assert person.update(np.full((15, 3), np.nan), grids[0]) is None
    bodies = [person.update(pose, grid) for pose, grid in zip(detected, grids, strict=True)]
    off_one, *_, off = (np.abs(body.limbs_m - truth.limbs_m).mean() for body in bodies)
    assert off < 0.02 < off_one
    for name in ("limbs_m", "trunk_offsets_m", "elevation_gain_m"):
        expected = np.median([getattr(cone_body(pose), name) for pose in detected], axis=0)
        np.testing.assert_allclose(getattr(bodies[-1], name), expected)
    assert person.update(np.full((15, 3), np.nan), grids[0]) is bodies[-1]


@pytest.mark.parametrize("wrong", [0.3, 0.85, 1.15])
def test_wrong_radii_are_corrected_within_limits(wrong: float) -> None:
    joints_m = cone_joints(20, yaw_deg=15)
    body, grid = seen(joints_m)
    given = body._replace(radii_m=body.radii_m * wrong)
    found = fit_thickness(given, joints_m, grid)
    assert np.array_equal(given.radii_m, body.radii_m * wrong)  # the given body is not changed
    off_m = np.abs(found.radii_m - body.radii_m).mean()
    assert off_m < 0.4 * np.abs(given.radii_m - body.radii_m).mean()
    changed_m = found.radii_m - given.radii_m
    assert np.abs(changed_m).max() < MAX_CORRECTION_M + 1e-9 and (found.radii_m > given.radii_m / 2 - 1e-9).all()
    assert all(len(np.unique(changed_m[kind == PART_KIND].round(9))) == 1 for kind in PART_KIND), "both sides, both ends"


def test_what_is_compiled_beforehand_is_all_of_the_refinement(monkeypatch) -> None:
    parts = {name: Mock(wraps=getattr(refine, name)) for name in ("build_depth_grid", "fit", "fit_score", "refined_evidence")}
    for name, part in parts.items():
        monkeypatch.setattr(refine, name, part)
    compile_refining()
    assert all(part.call_count == 1 for part in parts.values())
