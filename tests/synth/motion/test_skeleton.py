import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.rotations import about, conjugate, multiply, rotate
from synth.motion.skeleton import (
    LEG_M,
    NUM_JOINTS,
    PARENTS,
    REST_OFFSETS_M,
    facing_front,
    forward_kinematics,
    height_above_floor,
)


def random_quats(n, seed=0):
    quats = np.random.default_rng(seed).standard_normal((n, NUM_JOINTS, 4))
    return quats / np.linalg.norm(quats, axis=-1, keepdims=True)


def reference_forward_kinematics(quats, root, offsets):
    """p_j = p_parent + R_parent offset_j, R_j = R_parent r_j, one joint at a time."""
    points, world = [root], [Rotation.from_quat(quats[0], scalar_first=True)]
    for j in range(1, len(offsets)):
        points.append(points[PARENTS[j]] + world[PARENTS[j]].apply(offsets[j]))
        if j < NUM_JOINTS:
            world.append(world[PARENTS[j]] * Rotation.from_quat(quats[j], scalar_first=True))
    return np.array(points), world


def test_forward_kinematics_equals_the_reference():
    quats, root = random_quats(5), np.random.default_rng(1).standard_normal((5, 3))
    points, turned = forward_kinematics(quats, root)
    for n in range(5):
        expected, world = reference_forward_kinematics(quats[n], root[n], REST_OFFSETS_M)
        np.testing.assert_allclose(points[n], expected, atol=1e-12)
        for j in range(NUM_JOINTS):
            np.testing.assert_allclose(
                Rotation.from_quat(turned[n, j], scalar_first=True).as_matrix(), world[j].as_matrix(), atol=1e-12
            )


def test_quaternion_algebra_agrees_with_scipy():
    a, b = random_quats(2, seed=3)
    vectors = np.random.default_rng(4).standard_normal((NUM_JOINTS, 3))
    ra, rb = (Rotation.from_quat(q, scalar_first=True) for q in (a, b))
    np.testing.assert_allclose(multiply(a, b), (ra * rb).as_quat(canonical=False, scalar_first=True), atol=1e-12)
    np.testing.assert_allclose(rotate(a, vectors), ra.apply(vectors), atol=1e-12)
    np.testing.assert_allclose(rotate(conjugate(a), rotate(a, vectors)), vectors, atol=1e-12)
    angle = np.array(0.7)
    np.testing.assert_allclose(about(1, angle), Rotation.from_euler("Y", 0.7).as_quat(scalar_first=True), atol=1e-12)


def test_facing_front_removes_the_heading_only():
    quats = random_quats(6, seed=6)
    heading = about(1, np.linspace(-3, 3, 6))
    turned = quats.copy()
    turned[:, 0] = multiply(heading, quats[:, 0])
    # q and -q are the same rotation.
    same = np.abs((facing_front(turned)[:, 0] * facing_front(quats)[:, 0]).sum(axis=1))
    np.testing.assert_allclose(same, 1, atol=1e-9)
    upside_down = quats[:1].copy()
    upside_down[0, 0] = [0, 0, 0, 1]
    np.testing.assert_array_equal(facing_front(upside_down), upside_down)


def test_height_above_floor_is_that_of_the_lowest_surface_point():
    quats = np.tile([1.0, 0, 0, 0], (2, NUM_JOINTS, 1))
    lowest_m = -0.1026 - LEG_M - 0.07
    np.testing.assert_allclose(
        height_above_floor(quats, np.array([[0, 1.2, 0], [0, 0, 0]])), [1.2 + lowest_m, lowest_m], atol=0.01
    )


def test_a_skeleton_of_another_size_is_as_high_in_proportion():
    quats, root_m = random_quats(4), np.random.default_rng(1).uniform(0.5, 2, (4, 3))
    size = np.array([0.5, 0.8, 1.0, 1.3])
    np.testing.assert_allclose(
        height_above_floor(quats, size[:, None] * root_m, size * LEG_M), size * height_above_floor(quats, root_m), atol=1e-9
    )
