"""The fit: people of round cones with known joints, impossible bodies, each term against its numerical gradient, the solver."""

import numpy as np
import pytest
from cone_people import CAMERA, cone_body, cone_joints, error_m, moved, person  # noqa: F401
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kpopnet.geometry.body import COLLISION_PAIRS, LIMB_COLLISIONS, LIMBS, PARTS, ROW_TO_JOINT
from kpopnet.geometry.cones import extend_joints, nearest_parts, part_segments, signed_distance, torso_frame
from kpopnet.geometry.depth_grid import build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.tracker import fit as terms
from kpopnet.tracker.fit import COLUMN, JOINT_PRIOR_WEIGHT, JOINT_PRIORS, fit, penetration_cost, pose_cost, solve

# --- the cost of whole poses --------------------------------------------------------------------------------------


def test_the_true_pose_has_the_lowest_cost(person) -> None:  # noqa: F811
    joints, body, grid = person
    least = pose_cost(joints, grid, body, 1)
    assert least < 2e-4
    for seed in range(5):
        assert pose_cost(moved(joints, seed), grid, body, 1) > least
        assert pose_cost(moved(joints, seed, 0.1, 0.2), grid, body, 1) > 3 * least
    for offset in ((0, 0, -0.3), (0.4, 0, 0), (0, 0, 0.5)):
        assert pose_cost(joints + offset, grid, body, 1) > 10 * least
    for end, offset in ((end, offset) for end in LIMBS[:, 2] for offset in np.eye(3)):
        wrong = joints.copy()
        wrong[end] += 0.15 * offset
        assert pose_cost(wrong, grid, body, 1) > least


@pytest.mark.parametrize(
    ("point_m", "correction_m", "hidden"),
    [
        ((0.0, 0.0, 2.6), (0, 0, 0), False),  # its surface, 10 cm nearer, is the measured one
        ((0.0, 0.0, 2.4), (0, 0, 0.2), False),
        ((0.0, 0.0, 2.57), (0, 0, 0), False),  # within the tolerance
        ((0.0, 0.0, 2.8), (0, 0, 0), True),
        ((0.0, -0.9, 2.5), (0, 0.4, 0), False),
        ((9.0, 0.0, 2.5), (0, 0, 0), False),  # out of view
    ],
)
def test_free_space_is_in_front_of_and_beside_a_wall(point_m, correction_m, hidden: bool) -> None:
    depth_m = np.where((np.abs(CAMERA.points(np.ones((240, 320))))[..., :2] < 0.2).all(-1), np.float32(2.5), np.float32(0))
    grid, segments = build_depth_grid(depth_m, CAMERA), np.array([[*point_m, 0, 0, 0, 1.0, 0.1, 0.0]])
    *found_m, behind = terms.free_space_violation(segments, 0, 0.5, grid.depth_m, grid.nearest, grid.intrinsics)
    assert found_m == pytest.approx(correction_m, abs=0.03) and behind is hidden


def test_knees_bend_forwards_and_the_head_is_in_front_of_the_neck() -> None:
    """A person who faces the camera, to whom the front is smaller z."""
    joints = cone_joints(-60, 0)
    for joint, reference, other in ((Joint.RIGHT_KNEE, Joint.RIGHT_HIP, Joint.RIGHT_FOOT), (Joint.HEAD, *[Joint.NECK] * 2)):
        prior = np.flatnonzero(((joint, reference, other) == JOINT_PRIORS).all(axis=1))[0]
        for ahead_m in (0.1, -0.1):
            joints[joint] = (joints[reference] + joints[other]) / 2 - (0, 0, ahead_m)
            short_m = max(terms.JOINT_PRIOR_MIN_M[prior] - ahead_m, 0)
            cost_m2 = terms.joint_prior(joints, np.array((0.0, 0, -1)), prior, prior + 1)
            assert cost_m2 == pytest.approx(JOINT_PRIOR_WEIGHT[prior] * short_m**2)


# --- the linearisation of each term -------------------------------------------------------------------------------


def downhill(energy, joints: np.ndarray) -> np.ndarray:
    """(15, 3) -1/2 of the numerical gradient."""
    gradient = np.zeros((NUM_JOINTS, 3))
    for joint, axis in np.ndindex(NUM_JOINTS, 3):
        step = np.zeros((NUM_JOINTS, 3))
        step[joint, axis] = 1e-5
        gradient[joint, axis] = (energy(joints + step) - energy(joints - step)) / 2e-5
    return -gradient / 2


def linearised(add, *given) -> np.ndarray:
    """(15, 3) right-hand side of a term's normal equations, whose matrix is symmetric."""
    matrix, rhs = np.zeros((45, 45)), np.zeros(45)
    add(matrix, rhs, *given)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    return rhs[COLUMN[:NUM_JOINTS, None] + np.arange(3)]


@pytest.fixture
def displaced(person):  # noqa: F811
    """Joints up to 20 cm off, a hand in the trunk; a body of cylinders; the grid; and the segments of moved joints, whose toes,
    fingers and trunk points move with them: what the linearisation holds fixed is fixed.
    """
    joints, body, grid = person
    joints = moved(joints, 0, 0.1, 0.2)
    joints[Joint.LEFT_HAND] = joints[Joint.TORSO] + (0.03, 0.05, 0.02)
    body = body._replace(
        radii_m=np.repeat(body.radii_m.mean(1, keepdims=True), 2, 1), elevation_gain_m=0 * body.elevation_gain_m
    )
    rows = extend_joints(joints, body.trunk_offsets_m)
    return joints, body, grid, lambda at: part_segments(rows + (at - joints)[ROW_TO_JOINT], body.radii_m)


def test_points_pull_down_the_slope_of_their_energy(displaced) -> None:
    joints, _, grid, segments_at = displaced
    part, distance, _ = nearest_parts(segments_at(joints), grid.points_m, 1)
    points = grid.points_m[distance + segments_at(joints)[part, 7] > 2 * terms.MIN_AXIS_DISTANCE_M][::3]
    seen = np.repeat(points, 3, axis=0)
    seen[1::3] += 9  # every third counts
    nearest = nearest_parts(segments_at(joints), seen, 3)

    def energy(at: np.ndarray) -> float:  # Geman and McClure's
        segments = segments_at(at)
        squared = np.array([signed_distance(segments, k, *point)[0] ** 2 for k, point in zip(nearest[0], points, strict=True)])
        squared[np.abs(nearest[1]) > terms.MAX_ASSOCIATION_M] = 0
        return np.mean(terms.ROBUST_SCALE_M**2 * squared / (terms.ROBUST_SCALE_M**2 + squared))

    found = linearised(terms.add_points, segments_at(joints), seen, nearest, 3)
    np.testing.assert_allclose(found, downhill(energy, joints), atol=1e-6)
    assert np.abs(found).max() > 1e-3


def test_free_space_pulls_down_the_slope_of_its_energy(displaced) -> None:
    joints, _, grid, segments_at = displaced
    samples = [(k, q) for k in range(len(PARTS)) for q in np.linspace(0, 1, terms.FREE_SPACE_SAMPLES)]
    image = grid.depth_m, grid.nearest, grid.intrinsics

    def axis_points(at: np.ndarray) -> np.ndarray:
        segments = segments_at(at)
        return np.array([segments[k, :3] + q * segments[k, 3:6] for k, q in samples])

    goals = axis_points(joints) + [terms.free_space_violation(segments_at(joints), k, q, *image)[:3] for k, q in samples]

    def energy(at: np.ndarray) -> float:  # Huber's
        away, most = np.linalg.norm(goals - axis_points(at), axis=1), terms.MAX_STEP_RESIDUAL_M
        return terms.FREE_SPACE_WEIGHT * np.mean(np.where(away < most, away**2, 2 * most * away - most**2))

    found = linearised(terms.add_free_space, segments_at(joints), *image)
    np.testing.assert_allclose(found, downhill(energy, joints), atol=1e-7)
    assert np.abs(found).max() > 1e-5


def test_penetration_pulls_down_the_slope_of_its_energy(displaced) -> None:
    joints, _, _, segments_at = displaced
    fixed = segments_at(joints)

    def energy(at: np.ndarray) -> float:
        segments, total = segments_at(at), 0.0
        for lower, other in COLLISION_PAIRS:
            for q in np.linspace(0, 1, terms.COLLISION_SAMPLES):
                inside_m = -signed_distance(fixed, other, *(segments[lower, :3] + q * segments[lower, 3:6]))[0]
                total += max(inside_m - terms.PENETRATION_TOLERANCE_M, 0) ** 2
        return terms.PENETRATION_WEIGHT * total

    found = linearised(terms.add_penetration, fixed)
    np.testing.assert_allclose(found, downhill(energy, joints), atol=1e-7)
    assert energy(joints) == pytest.approx(penetration_cost(fixed, 0, len(COLLISION_PAIRS), np.inf))
    assert energy(joints) == pytest.approx(sum(penetration_cost(fixed, *rows, np.inf) for rows in LIMB_COLLISIONS))
    assert penetration_cost(fixed, *LIMB_COLLISIONS[1], np.inf) > 1e-6 and np.abs(found).max() > 1e-5


def test_lengths_pull_down_the_slope_of_their_energy(displaced) -> None:
    joints, body, _, _ = displaced

    def energy(at: np.ndarray) -> float:
        lengths_m = np.linalg.norm(at[body.pairs[:, 1]] - at[body.pairs[:, 0]], axis=1)
        return terms.LENGTH_WEIGHT * np.mean(body.stiffness * (lengths_m - body.lengths_m) ** 2)

    found = linearised(terms.add_lengths, joints, torso_frame(joints), body)
    np.testing.assert_allclose(found, downhill(energy, joints), atol=1e-7)


def test_joint_priors_pull_down_the_slope_of_their_energy(displaced) -> None:
    joints, *_ = displaced
    forward, pairs = torso_frame(joints)[2], np.flatnonzero(JOINT_PRIORS[:, 1] == JOINT_PRIORS[:, 2])  # of two joints

    def energy(at: np.ndarray) -> float:
        return sum(JOINT_PRIOR_WEIGHT[k] * max(terms.joint_prior_shortfall(at, k, forward), 0) ** 2 for k in pairs)

    # A knee against hip and foot moves the foot alone, by choice.
    others = np.setdiff1d(np.arange(NUM_JOINTS), [Joint.RIGHT_KNEE, Joint.LEFT_KNEE, Joint.RIGHT_FOOT, Joint.LEFT_FOOT])
    found = linearised(terms.add_joint_priors, joints, forward)
    np.testing.assert_allclose(found[others], downhill(energy, joints)[others], atol=1e-7)


@given(st.integers(0, 2**32 - 1), st.integers(1, 20), st.floats(0, 0.9))
@settings(deadline=None)
def test_dense_and_sparse_systems_are_solved(seed: int, size: int, zeros: float) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(size + 5, size)) * (rng.random((size + 5, size)) > zeros)
    matrix, right = rows.T @ rows + 0.1 * np.eye(size), rng.normal(size=size)
    solution = right.copy()
    solve(matrix.copy(), solution)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-7, atol=1e-9)


# --- the fit ------------------------------------------------------------------------------------------------------


def test_the_fit_converges_from_a_small_displacement_and_stays(person) -> None:  # noqa: F811
    joints, body, grid = person
    start = moved(joints, 0)
    found = fit(start, grid, body, iterations=15)
    assert error_m(found, joints).mean() < 0.02 < 0.03 < error_m(start, joints).min()
    assert pose_cost(found, grid, body, 1) < pose_cost(start, grid, body, 1)
    assert error_m(fit(joints, grid, body, iterations=30), joints).mean() < 0.02


def test_a_rotation_of_the_whole_body_is_recovered(person) -> None:  # noqa: F811
    joints, body, grid = person
    for angle_deg in (-20, 20):
        turn = Rotation.from_euler("y", angle_deg, degrees=True)
        start = joints[Joint.TORSO] + turn.apply(joints - joints[Joint.TORSO])
        away = error_m(fit(start, grid, body, iterations=20), joints)
        assert away.mean() < 0.025 < 0.06 < error_m(start, joints)[LIMBS[:2, 2]].min()


def test_bodies_outside_the_view_are_no_error(person) -> None:  # noqa: F811
    joints, body, grid = person
    places = [joints + offset for offset in ((9, 0, 0), (0, -9, 0), (0, 0, -3.2), (0, 0, -9), (0, 0, 90))]
    for pose in (*places, np.zeros((NUM_JOINTS, 3))):
        assert np.isfinite(fit(pose, grid, body, iterations=4)).all() and np.isfinite(pose_cost(pose, grid, body, 1))


def test_shoulders_sink_with_the_arms() -> None:
    """Without points only the lengths act: the distances from hips to shoulders decrease when the arms hang."""
    joints = cone_joints(elevation_deg=40)
    body, nothing = cone_body(joints), build_depth_grid(np.zeros((CAMERA.height, CAMERA.width), np.float32), CAMERA)
    # All but the head, which its prior moves forwards.
    stayed = error_m(fit(joints, nothing, body, iterations=20), joints)
    assert np.delete(stayed, [Joint.HEAD, Joint.TORSO]).max() < 0.01
    hanging = cone_joints(elevation_deg=-80)
    found = fit(hanging, nothing, body, iterations=20)
    assert HumanModel.from_joints(hanging).arms_raised < -0.9
    for shoulder, hip in ((Joint.RIGHT_SHOULDER, Joint.RIGHT_HIP), (Joint.LEFT_SHOULDER, Joint.LEFT_HIP)):
        shorter = np.linalg.norm(hanging[shoulder] - hanging[hip]) - np.linalg.norm(found[shoulder] - found[hip])
        assert 0.02 < shorter < 0.08
