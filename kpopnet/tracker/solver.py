"""The linear system of a Gauss-Newton step."""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def solve(matrix, rhs):
    """Solves a symmetric positive definite system in place by Cholesky factorisation with skyline storage.

    Zeros left of each row's first entry are skipped: eliminated from hands and feet inwards, the equations cost less than the
    search for the nearest parts. Only the lower half of the matrix is read. The solution replaces `rhs`.
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
