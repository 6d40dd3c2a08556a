"""The trees of all joints, the features that they evaluate, and the random walks through the cube around the person.

Features are depth differences in a small integer depth image of the cube, relative to a position (u, v, d) in the
coordinates of `kpopnet.data.cube`. These are metric at the person's distance, so the offsets of the probes need no division
by depth: the cube has normalised them.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.skeleton import BONES, NUM_JOINTS, Joint

UNITS = 10_000
"""Integer depth units per half edge of the cube; a unit is about a tenth of a millimetre."""

UNMEASURED = np.int16(32_767)
"""Value of pixels without a measurement: behind everything else."""

MAX_DIFFERENCE = 4_000
"""Depth differences are clipped to this, about 45 cm in front of and behind the position. Pixels farther behind and pixels
without a measurement give the same value."""

PARENT = {child: parent for parent, child in BONES}

ORDER = [Joint.TORSO]
"""(15,) joints in the order of their walks, parents before children."""
for _joint in ORDER:
    ORDER += [child for child, parent in PARENT.items() if parent == _joint]
ORDER = np.array(ORDER, np.int32)

START = np.array([PARENT.get(joint, -1) for joint in Joint], np.int32)
"""(15,) the joint at whose estimate the walk of each joint starts; -1 for the centre of the silhouette."""


class Trees(NamedTuple):
    """The trees of all joints, concatenated into one set of arrays for numba.

    Attributes:
        root: (15,) int32 root node of each joint's tree.
        child: (N,) int32 child for features below the threshold, the other child is the next node; or -1 - leaf.
        threshold: (N,) int32 threshold of the feature.
        probe: (N, 5) int16, see `feature`.
        direction: (L, K, 3) float32 unit vectors in (u, v, d), the directions of each leaf.
        share: (L, K) float32 cumulative probabilities of the directions, up to 1.
    """

    root: np.ndarray
    child: np.ndarray
    threshold: np.ndarray
    probe: np.ndarray
    direction: np.ndarray
    share: np.ndarray


def integer_image(crop: np.ndarray) -> np.ndarray:
    """Converts a crop to integer depth.

    Args:
        crop: (..., S, S) float32 cube depth d, 1 where nothing was measured (`kpopnet.data.cube.crop`).

    Returns:
        (..., S, S) int16 in UNITS, UNMEASURED where nothing was measured.
    """
    return np.where(crop < 1, np.rint(crop * np.float32(UNITS)), np.float32(UNMEASURED)).astype(np.int16)


@njit(cache=True)
def depth_difference(image, row, column, depth):
    """Depth of a pixel minus `depth`, clipped to -MAX_DIFFERENCE..MAX_DIFFERENCE; MAX_DIFFERENCE outside the image."""
    side = image.shape[0]
    if row < 0 or column < 0 or row >= side or column >= side:
        return np.int32(MAX_DIFFERENCE)
    return min(max(np.int32(image[row, column]) - depth, np.int32(-MAX_DIFFERENCE)), np.int32(MAX_DIFFERENCE))


@njit(cache=True)
def feature(image, row, column, depth, probe):
    """The feature at a position, int32 UNITS.

    Jung et al. use the depth difference between two probes of the image. Such differences do not depend on the depth of
    the position itself, so a feature may also be the depth difference between one probe and the position.

    Args:
        image: (S, S) `integer_image`.
        row: of the position.
        column: of the position.
        depth: of the position in UNITS.
        probe: (5,) int16: offsets in rows and columns from the position to a first and a second probe, and 1 if there is a
            second.
    """
    value = depth_difference(image, row + probe[0], column + probe[1], depth)
    if probe[4]:
        value -= depth_difference(image, row + probe[2], column + probe[3], depth)
    return value


@njit(cache=True)
def random_uniform(key, count):
    """A pseudo-random number in [0, 1), a function of a seed and a counter: splitmix64."""
    z = np.uint64(key) + np.uint64(count + 1) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return np.float64(z >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True)
def find_leaf(trees, joint, image, u, v, d):
    """The leaf of a joint's tree for a position (u, v, d)."""
    half = 0.5 * image.shape[0]
    row, column = np.int32(np.floor((v + 1) * half)), np.int32(np.floor((u + 1) * half))
    depth = np.int32(np.rint(d * UNITS))
    node = trees.root[joint]
    while trees.child[node] >= 0:
        above = feature(image, row, column, depth, trees.probe[node]) >= trees.threshold[node]
        node = trees.child[node] + (1 if above else 0)
    return -1 - trees.child[node]


@njit(cache=True)
def walk(image, trees, steps, settling, step, key):
    """Walks of all joints through one image, clipped to the cube.

    Args:
        image: (S, S) `integer_image`.
        trees: Trees.
        steps: number of steps of each walk.
        settling: number of steps at the start that are excluded from the mean.
        step: length of a step in cube units.
        key: seed of this image's random numbers.

    Returns:
        (15, 3) float32 mean position in (u, v, d), and (15,) float32 root mean square distance from it, in cube units.
    """
    mean = np.zeros((NUM_JOINTS, 3), np.float32)
    deviation = np.zeros(NUM_JOINTS, np.float32)
    counted = steps - settling
    for joint in ORDER:
        u = v = d = 0.0
        if START[joint] >= 0:
            u, v, d = mean[START[joint]]
        sum_u = sum_v = sum_d = squares = 0.0
        for number in range(steps):
            leaf = find_leaf(trees, joint, image, u, v, d)
            draw = random_uniform(key, joint * steps + number)
            chosen = 0
            while trees.share[leaf, chosen] <= draw and chosen < trees.share.shape[1] - 1:
                chosen += 1
            # Clip to the cube: outside it the trees give no direction back.
            u = min(max(u + step * trees.direction[leaf, chosen, 0], -1.0), 1.0)
            v = min(max(v + step * trees.direction[leaf, chosen, 1], -1.0), 1.0)
            d = min(max(d + step * trees.direction[leaf, chosen, 2], -1.0), 1.0)
            if number >= settling:
                sum_u += u
                sum_v += v
                sum_d += d
                squares += u * u + v * v + d * d
        mean[joint] = sum_u / counted, sum_v / counted, sum_d / counted
        square = (sum_u * sum_u + sum_v * sum_v + sum_d * sum_d) / (counted * counted)
        deviation[joint] = np.sqrt(max(squares / counted - square, 0.0))
    return mean, deviation
