"""Depth of noisy sensors, smoothed: a time-of-flight camera's pixel errs by 3 to 6 cm at 2.5 to 4 m, more than a limb is thick.

Points that scatter so far pull in all directions, and a fit to one pixel in a cell cannot average over them. Structured light's
pixels are good to a centimetre and stay as they are.
"""

import numpy as np
from numba import njit

MAX_NOISE_M = 0.025
"""Depth with a greater standard deviation of its noise is smoothed: a simulated Kinect's is smaller up to
5 m, a SwissRanger's greater from 2.2 m on."""

MEDIAN_DIFFERENCE = 0.6745 * np.sqrt(1.25)
"""Median absolute difference between a pixel and the mean of its four neighbours, for Gaussian noise of unit variance."""

ROW_STRIDE = 4
"""The noise is measured in every fourth row."""

WINDOW = 5
"""Side of the median filter's window, pixels: 3 finds hands better, 5 feet, 7 neither (docs/ledger.md)."""


def denoised(depth_m: np.ndarray) -> np.ndarray:
    """The depth of a person, each pixel replaced by the median of the measured ones around it where the sensor is noisy.

    Args:
        depth_m: (H, W) float32 metres, 0 where nothing was measured; not changed.

    Returns:
        (H, W) float32 metres, measured at the same pixels; `depth_m` itself where the noise is at most `MAX_NOISE_M`.
    """
    return _medians(depth_m) if _is_noisy(depth_m) else depth_m


@njit(cache=True)
def _is_noisy(depth):
    """Whether most pixels differ from the mean of their four neighbours as they would with noise above `MAX_NOISE_M`."""
    height, width = depth.shape
    limit = np.float32(MAX_NOISE_M * MEDIAN_DIFFERENCE)
    inner = noisy = 0
    for y in range(1, height - 1, ROW_STRIDE):
        above, row, below = depth[y - 1], depth[y], depth[y + 1]
        for x in range(1, width - 1):
            if row[x] > 0 and row[x - 1] > 0 and row[x + 1] > 0 and above[x] > 0 and below[x] > 0:
                inner += 1
                mean = (row[x - 1] + row[x + 1] + above[x] + below[x]) / np.float32(4)
                noisy += abs(row[x] - mean) > limit
    return 2 * noisy > inner


@njit(cache=True)
def _medians(depth):
    """(H, W) the median of the measured pixels in the window around each measured pixel, 0 elsewhere."""
    height, width = depth.shape
    reach = WINDOW // 2
    smooth, around = np.zeros_like(depth), np.empty(WINDOW * WINDOW, depth.dtype)
    for y in range(height):
        for x in range(width):
            if depth[y, x] == 0:
                continue
            count = 0
            for v in range(max(y - reach, 0), min(y + reach + 1, height)):
                for u in range(max(x - reach, 0), min(x + reach + 1, width)):
                    if depth[v, u] > 0:
                        # Insertion into the sorted ones before
                        at = count
                        while at > 0 and around[at - 1] > depth[v, u]:
                            around[at] = around[at - 1]
                            at -= 1
                        around[at] = depth[v, u]
                        count += 1
            smooth[y, x] = (around[(count - 1) // 2] + around[count // 2]) / np.float32(2)
    return smooth
