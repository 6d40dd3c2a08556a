"""Vectors in kernels: tuples of three numbers, for which no array is made."""

import math

import numpy as np
from numba import njit


@njit(cache=True)
def at(points, row):
    """A row of (N, 3) points."""
    return points[row, 0], points[row, 1], points[row, 2]


@njit(cache=True)
def plus(a, b, factor):
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@njit(cache=True)
def times(a, factor):
    return a[0] * factor, a[1] * factor, a[2] * factor


@njit(cache=True)
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def norm(a):
    return math.sqrt(dot(a, a))


@njit(cache=True)
def unit(a, least):
    """A vector of length 1 in the direction of another; NaN where that is shorter than `least`."""
    length = norm(a)
    return times(a, 1 / length if length >= least else np.nan)


@njit(cache=True)
def in_frame(frame, a):
    """A vector in a frame of three axes."""
    return dot(frame[0], a), dot(frame[1], a), dot(frame[2], a)
