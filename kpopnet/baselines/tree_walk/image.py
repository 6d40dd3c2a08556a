"""Features of the trees: depth differences in a small integer depth image of the cube, relative to a position in space.

A position is (u, v, d) in the coordinates of `kpopnet.data.cube`. These are metric at the person's distance, so the
offsets of the probes need no division by depth: the cube has normalised them.
"""

import numpy as np
from numba import njit

UNITS = 10_000
"""Integer depth units per half edge of the cube; a unit is about a tenth of a millimetre."""

UNMEASURED = np.int16(32_767)
"""Value of pixels without a measurement: behind everything else."""

SIDES_PX = (32, 512)
"""Smallest and largest accepted side of the image in pixels."""

MAX_DIFFERENCE = 4_000
"""Depth differences are clipped to this, about 45 cm in front of and behind the position. Pixels farther behind and pixels
without a measurement give the same value."""


def integer_image(crop: np.ndarray) -> np.ndarray:
    """Converts a crop to integer depth.

    Args:
        crop: (..., S, S) float32 cube depth d, 1 where nothing was measured (`kpopnet.data.cube.crop`).

    Returns:
        (..., S, S) int16 in UNITS, UNMEASURED where nothing was measured.
    """
    return np.where(crop < 1, np.rint(crop * np.float32(UNITS)), np.float32(UNMEASURED)).astype(np.int16)


@njit(cache=True)
def pixel_index(coordinate, side):
    """The row of v, or the column of u, in an image of `side` pixels; may lie outside the image."""
    return np.int32(np.floor((coordinate + 1) * (0.5 * side)))


@njit(cache=True)
def depth_difference(image, row, column, depth):
    """Depth of a pixel minus `depth`, clipped to -MAX_DIFFERENCE..MAX_DIFFERENCE; MAX_DIFFERENCE outside the image."""
    side = image.shape[0]
    if row < 0 or column < 0 or row >= side or column >= side:
        return np.int32(MAX_DIFFERENCE)
    return min(max(np.int32(image[row, column]) - depth, np.int32(-MAX_DIFFERENCE)), np.int32(MAX_DIFFERENCE))


@njit(cache=True)
def features(image, row, column, depth, probes, values):
    """Fills `values` (n,) with the features at a position, one per probe pair or single probe.

    Jung et al. use the depth difference between two probes of the image. Such differences do not depend on the depth of
    the position itself, so a feature may also be the depth difference between one probe and the position.

    Args:
        image: (S, S) `integer_image`.
        row: of the position.
        column: of the position.
        depth: of the position in UNITS.
        probes: (n, 5) int16: offsets in rows and columns from the position to a first and a second probe, and 1 if there
            is a second.
        values: (n,) int32.
    """
    for k in range(len(probes)):
        value = depth_difference(image, row + probes[k, 0], column + probes[k, 1], depth)
        if probes[k, 4]:
            value -= depth_difference(image, row + probes[k, 2], column + probes[k, 3], depth)
        values[k] = value
