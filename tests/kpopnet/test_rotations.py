"""Rotations, against scipy's."""

import numpy as np
from scipy.spatial.transform import Rotation

from kpopnet.rotations import of_matrix, turns


def test_a_matrix_of_a_rotation_and_a_rotation_vector_become_its_quaternion():
    quarters = Rotation.create_group("O")  # which turn the axes of a file to others
    for rotations in (quarters, Rotation.random(200, random_state=0)):
        expected = rotations.as_quat(scalar_first=True)
        found = np.stack([of_matrix(matrix) for matrix in rotations.as_matrix()])
        np.testing.assert_allclose(np.abs((found * expected).sum(axis=-1)), 1, atol=1e-12)
        turned = turns(rotations.as_rotvec())
        np.testing.assert_allclose(np.abs((turned * expected).sum(axis=-1)), 1, atol=1e-12)
    assert (turns(np.zeros((1, 3))) == [1, 0, 0, 0]).all()
