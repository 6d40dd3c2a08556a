"""The fitted body: people of round cones, whose truth is known, and the pieces of the way there."""

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker.body import LIMBS, PARTS
from kpopnet.tracker.fitting import (
    CELL_PX,
    _axes,
    _nearest,
    _nearest_parts,
    _off_surface,
    cells_of,
    fit,
    knees_backwards,
    misfit,
)
from kpopnet.tracker.model import LIMB_PARENTS

CAMERA = CAMERAS["kinect_v1"]
POSES = {
    "y": {},
    "arms down": {"elevation_deg": -50, "spread_deg": 8, "yaw_deg": 20},
    "elbows bent": {"elevation_deg": 10, "elbow_deg": 70, "yaw_deg": -15},
}


@pytest.fixture(scope="module", params=POSES)
def person(request):
    """A person of round cones: true joints, body, cells."""
    joints = cone_joints(**POSES[request.param])
    body = cone_body(joints)
    return joints, body, cells_of(draw_cones(joints, body, CAMERA), CAMERA)


def moved(joints: np.ndarray, seed: int, least_m: float = 0.03, most_m: float = 0.05) -> np.ndarray:
    """Every joint somewhere else, so far away."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=joints.shape)
    return joints + way / np.linalg.norm(way, axis=1, keepdims=True) * rng.uniform(least_m, most_m, (len(joints), 1))


# --- cells --------------------------------------------------------------------------------------------------------


def test_cells_hold_what_is_seen_at_their_middles() -> None:
    depth = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    depth[40:80, 101:140] = 2.5
    cells = cells_of(depth, CAMERA)
    points = CAMERA.points(depth)[CELL_PX // 2 :: CELL_PX, CELL_PX // 2 :: CELL_PX]
    assert cells.index.shape == points.shape[:2]
    measured = cells.index >= 0
    np.testing.assert_array_equal(measured, points[..., 2] > 0)
    np.testing.assert_allclose(cells.points_m[cells.index[measured]], points[measured], atol=1e-5)
    assert sorted(cells.index[measured]) == list(range(len(cells.points_m)))


@pytest.mark.parametrize(("height", "width"), [(240, 320), (5, 7), (1, 1), (3, 401)])
def test_images_of_any_size_have_cells(height: int, width: int) -> None:
    cells = cells_of(np.full((height, width), 2, np.float32), CAMERA)
    assert cells.index.shape == (-(-height // CELL_PX), -(-width // CELL_PX))
    assert len(cells.points_m) == cells.index.size and (cells.nearest >= 0).all()


def test_an_empty_image_has_no_points() -> None:
    cells = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    assert cells.points_m.shape == (0, 3) and (cells.index < 0).all() and (cells.nearest < 0).all()


@given(arrays(bool, st.tuples(st.integers(1, 24), st.integers(1, 24)), elements=st.sampled_from([False] * 9 + [True])))
@settings(deadline=None)
def test_the_nearest_cell_is_off_by_a_cell_at_worst(measured: np.ndarray) -> None:
    nearest = _nearest(np.where(measured, 0, -1).astype(np.int32))
    rows, columns = measured.nonzero()
    if not len(rows):
        assert (nearest < 0).all()
        return
    assert measured[nearest[..., 0], nearest[..., 1]].all()
    y, x = np.mgrid[: measured.shape[0], : measured.shape[1]]
    brute = np.sqrt(((y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2).min(axis=-1))
    away = np.hypot(nearest[..., 0] - y, nearest[..., 1] - x)
    assert (away - brute <= 1).all() and (away == 0)[measured].all()


# --- one part -----------------------------------------------------------------------------------------------------


def test_distances_to_a_cone() -> None:
    joints = np.array([(0.0, 0, 2), (0, 1, 2)])
    axes = _axes(joints, np.array([(0, 1)]), np.array([(0.1, 0.2)]))
    assert _off_surface(axes, 0, 0.5, 0.5, 2) == pytest.approx((0.5 - 0.15, 0.5, 0.5), abs=1e-8)
    assert _off_surface(axes, 0, 0, 0.25, 2) == pytest.approx((-0.125, 0.25, 0.0), abs=1e-8)
    assert _off_surface(axes, 0, 0, -0.3, 2.4) == pytest.approx((0.5 - 0.1, 0.0, 0.5), abs=1e-8)
    assert _off_surface(axes, 0, 0, 1.3, 2.4) == pytest.approx((0.5 - 0.2, 1.0, 0.5), abs=1e-8)


@pytest.mark.parametrize("every", [1, 2, 7, 10**6])
def test_the_nearest_parts_are_those_of_a_plain_search(person, every: int) -> None:
    joints, body, cells = person
    axes = _axes(moved(joints, 3), PARTS, body.radii_m)
    part, off = _nearest_parts(axes, cells.points_m, every)
    points = cells.points_m[::every]
    plain = np.array([[_off_surface(axes, k, *point)[0] for k in range(len(axes))] for point in points])
    np.testing.assert_array_equal(part, np.abs(plain).argmin(axis=1))
    np.testing.assert_array_equal(off, plain[np.arange(len(points)), part])


# --- the whole body -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_who_starts_a_little_off_comes_back(person, seed: int) -> None:
    joints, body, cells = person
    start = moved(joints, seed)
    found = fit(start, cells, body, rounds=15)
    error = np.linalg.norm(found - joints, axis=1)
    assert error.mean() < 0.02 < 0.03 < np.linalg.norm(start - joints, axis=1).min()
    assert misfit(found, cells, body) < misfit(start, cells, body)


def test_the_truth_is_a_place_to_stay(person) -> None:
    joints, body, cells = person
    assert np.linalg.norm(fit(joints, cells, body, rounds=30) - joints, axis=1).mean() < 0.02


@pytest.mark.parametrize("seed", range(3))
def test_limbs_keep_their_lengths(person, seed: int) -> None:
    joints, body, cells = person
    found = fit(moved(joints, seed, 0.05, 0.15), cells, body, rounds=15)
    for child, parent in LIMB_PARENTS.items():
        true = np.linalg.norm(joints[child] - joints[parent])
        assert np.linalg.norm(found[child] - found[parent]) == pytest.approx(true, abs=0.02)


def test_the_truth_fits_best(person) -> None:
    joints, body, cells = person
    least = misfit(joints, cells, body)
    assert least < 2e-4
    for seed in range(20):
        assert misfit(moved(joints, seed), cells, body) > least
        assert misfit(moved(joints, seed, 0.1, 0.2), cells, body) > 3 * least
    # One limb in a wrong place is enough.
    for _, _, end in LIMBS:
        for way in np.eye(3):
            wrong = joints.copy()
            wrong[end] += 0.15 * way
            assert misfit(wrong, cells, body) > least


def test_a_body_before_what_was_measured_or_outside_of_it_does_not_fit(person) -> None:
    joints, body, cells = person
    for way in ((0, 0, -0.3), (0.4, 0, 0), (0, 0, 0.5)):
        assert misfit(joints + way, cells, body) > 10 * misfit(joints, cells, body)


def test_every_so_many_points_say_about_the_same(person) -> None:
    joints, body, cells = person
    wrong = moved(joints, 1, 0.1, 0.1)
    assert misfit(wrong, cells, body, every=3) == pytest.approx(misfit(wrong, cells, body), rel=0.2)
    few = fit(moved(joints, 1), cells, body, rounds=15, every=3)
    assert np.linalg.norm(few - joints, axis=1).mean() < 0.025


def test_no_points_pull_at_nothing() -> None:
    joints = cone_joints()
    body = cone_body(joints)
    cells = cells_of(np.zeros((240, 320), np.float32), CAMERA)
    assert np.isfinite(fit(joints, cells, body, rounds=10)).all()
    assert misfit(joints, cells, body) == pytest.approx(0, abs=1e-9)


def test_a_body_beside_behind_and_beyond_the_camera_is_no_error(person) -> None:
    joints, body, cells = person
    for way in ((9, 0, 0), (0, -9, 0), (0, 0, -3.2), (0, 0, -9), (0, 0, 90)):
        assert np.isfinite(fit(joints + way, cells, body, rounds=4)).all()
        assert np.isfinite(misfit(joints + way, cells, body))
    one = np.zeros((NUM_JOINTS, 3))
    assert np.isfinite(fit(one, cells, body, rounds=4)).all() and np.isfinite(misfit(one, cells, body))


def test_the_start_is_not_written_to(person) -> None:
    joints, body, cells = person
    start = joints.copy()
    fit(start, cells, body, rounds=3)
    np.testing.assert_array_equal(start, joints)


# --- knees --------------------------------------------------------------------------------------------------------


def bent(right_m: float, left_m: float) -> np.ndarray:
    """Standing, facing the camera, each knee so far before the line from hip to foot (to smaller z)."""
    joints = cone_joints(spread_deg=0)
    joints[Joint.RIGHT_KNEE, 2] -= right_m
    joints[Joint.LEFT_KNEE, 2] -= left_m
    for side in ("RIGHT", "LEFT"):
        # The knee in the middle, so that its way out is the whole of it.
        hip, foot = joints[Joint[f"{side}_HIP"]], joints[Joint[f"{side}_FOOT"]]
        joints[Joint[f"{side}_KNEE"], :2] = (hip + foot)[:2] / 2
    return joints


@given(st.floats(0, 0.3), st.floats(0, 0.3), st.floats(-np.pi, np.pi))
@settings(deadline=None)
def test_knees_bend_one_way(right_m: float, left_m: float, yaw: float) -> None:
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    assert knees_backwards(bent(right_m, left_m) @ turn.T) == pytest.approx(0, abs=1e-12)
    assert knees_backwards(bent(-right_m, -left_m) @ turn.T) == pytest.approx(right_m**2 + left_m**2, abs=1e-7)
    assert knees_backwards(bent(right_m, -left_m) @ turn.T) == pytest.approx(left_m**2, abs=1e-7)


def test_somebody_who_is_taken_for_their_own_back_bends_their_knees_backwards(person) -> None:
    joints = person[0]
    knees = joints.copy()
    knees[[Joint.RIGHT_KNEE, Joint.LEFT_KNEE], 2] -= 0.1
    back = knees.copy()
    for a, b in ((Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER), (Joint.RIGHT_HIP, Joint.LEFT_HIP)):
        back[[a, b]] = back[[b, a]]
    assert knees_backwards(knees) < 1e-3 < knees_backwards(back)
