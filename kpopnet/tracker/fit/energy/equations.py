"""The normal equations of a step, (45, 45) `matrix` @ displacements of the joints = (45,) `rhs`."""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import PARTS, ROW_TO_JOINT, TORSO_JOINTS
from kpopnet.skeleton import NUM_JOINTS, Joint

_ELIMINATION = [
    *(Joint.RIGHT_HAND, Joint.RIGHT_ELBOW, Joint.LEFT_HAND, Joint.LEFT_ELBOW),
    *(Joint.RIGHT_FOOT, Joint.RIGHT_KNEE, Joint.LEFT_FOOT, Joint.LEFT_KNEE),
    *TORSO_JOINTS,
]
COLUMN = np.empty(len(ROW_TO_JOINT), np.int64)
"""(25,) the first of the three unknowns of every row."""
COLUMN[_ELIMINATION] = 3 * np.arange(NUM_JOINTS)
COLUMN[NUM_JOINTS:] = COLUMN[ROW_TO_JOINT[NUM_JOINTS:]]

PART_COLUMNS = COLUMN[PARTS]
"""(P, 2) the first unknowns of both ends of every part."""


@njit(cache=True)
def add_residual(matrix, rhs, ends, coefficients, direction, residual, weight):
    """Adds weight (residual + n . (c_i dx_i + c_j dx_j))^2 for the unknowns i, j = `ends`, and n = `direction`."""
    (i, j), (ci, cj) = ends, coefficients
    for c in range(3):
        rhs[i + c] -= weight * ci * direction[c] * residual
        rhs[j + c] -= weight * cj * direction[c] * residual
        for d in range(3):
            product = weight * direction[c] * direction[d]
            matrix[i + c, i + d] += ci * ci * product
            matrix[j + c, j + d] += cj * cj * product
            matrix[i + c, j + d] += ci * cj * product
            matrix[j + d, i + c] += ci * cj * product


@njit(cache=True)
def solve(matrix, rhs):
    """Solves a symmetric positive definite system in place by Cholesky factorisation with skyline storage.

    Zeros left of each row's first entry are skipped. Only the lower half of the matrix is read. The solution replaces `rhs`.
    """
    size = len(rhs)
    first_nonzero = np.empty(size, np.int64)
    for i in range(size):
        start = 0
        while matrix[i, start] == 0.0 and start < i:
            start += 1
        first_nonzero[i] = start
        for j in range(start, i):
            total = matrix[i, j]
            for k in range(max(start, first_nonzero[j]), j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        total = matrix[i, i]
        for k in range(start, i):
            total -= matrix[i, k] * matrix[i, k]
        matrix[i, i] = math.sqrt(max(total, 1e-12))
    for i in range(size):
        for k in range(first_nonzero[i], i):
            rhs[i] -= matrix[i, k] * rhs[k]
        rhs[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        rhs[i] /= matrix[i, i]
        for k in range(first_nonzero[i], i):
            rhs[k] -= matrix[i, k] * rhs[i]
