"""What a tree sees: a small integer depth image of the cube around the person, probed relative to a place in space.

A place is (u, v, d) in the coordinates of `kpopnet.networks.cube`. These are metric at the person's distance, so that
offsets between probes need no division by depth: the cube has divided once for all of them.
"""

import numpy as np
from numba import njit

UNITS = 10_000
"""Integer depth units of half the cube's edge: about a tenth of a millimetre."""

NOTHING = np.int16(32_767)
"""Where nothing was measured: far behind everything."""

SIDES_PX = (32, 512)
"""The smallest and the largest image that makes sense."""

REACH = 4_000
"""Readings end this far before and behind the place, some 45 cm: what is farther, and nothing at all, looks the same."""


def integer_image(crop: np.ndarray) -> np.ndarray:
    """The integer image of a crop.

    Args:
        crop: (..., S, S) float32 cube depth d, 1 where nothing was measured (`kpopnet.networks.cube.crop`).

    Returns:
        (..., S, S) int16 in UNITS, NOTHING where nothing was measured.
    """
    return np.where(crop < 1, np.rint(crop * np.float32(UNITS)), np.float32(NOTHING)).astype(np.int16)


@njit(cache=True)
def pixel(coordinate, side):
    """The row or column of an image of `side` pixels that v or u falls on; may lie outside."""
    return np.int32(np.floor((coordinate + 1) * (0.5 * side)))


@njit(cache=True)
def reading(image, row, column, depth):
    """How far behind `depth` the image is at a pixel, -REACH to REACH; REACH outside."""
    side = image.shape[0]
    if row < 0 or column < 0 or row >= side or column >= side:
        return np.int32(REACH)
    return min(max(np.int32(image[row, column]) - depth, np.int32(-REACH)), np.int32(REACH))


@njit(cache=True)
def features(image, row, column, depth, probes, values):
    """Fills values (n,) with the features at a place: the difference of two readings each, or one reading.

    Jung et al. take differences between two probes of the image. Alone these do not say how deep in the body the place
    lies, so a probe may also be compared with the place itself: its reading is the feature then.

    Args:
        image: (S, S) `integer_image`.
        row: of the place.
        column: of the place.
        depth: of the place in UNITS.
        probes: (n, 5) int16: rows and columns from the place to a first and a second probe; 1 if there is a second.
        values: (n,) int32.
    """
    for k in range(len(probes)):
        value = reading(image, row + probes[k, 0], column + probes[k, 1], depth)
        if probes[k, 4]:
            value -= reading(image, row + probes[k, 2], column + probes[k, 3], depth)
        values[k] = value
