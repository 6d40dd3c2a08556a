"""The random walks of all joints through the cube around the person."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.baselines.tree_walk.image import UNITS, depth_difference, pixel_index
from kpopnet.errors import InputError
from kpopnet.skeleton import BONES, NUM_JOINTS, Joint

MAX_STEPS = 10_000


@dataclass(frozen=True)
class WalkConfig:
    """Parameters of the walks.

    Attributes:
        steps: number of steps of each joint's walk.
        settling: number of steps at the start of a walk that are excluded from the mean.
        step_m: length of a step in metres.
    """

    steps: int = 128
    settling: int = 32
    step_m: float = 0.05

    def __post_init__(self) -> None:
        whole = isinstance(self.steps, int) and isinstance(self.settling, int)
        if not (whole and 0 <= self.settling < self.steps <= MAX_STEPS):
            raise InputError(
                f"walk: expected whole numbers, 0 <= settling < steps <= {MAX_STEPS}, found settling={self.settling}, "
                f"steps={self.steps}"
            )
        if not 0 < self.step_m <= 0.5:
            raise InputError(f"walk.step_m={self.step_m}: expected metres, above 0, at most 0.5")


class Trees(NamedTuple):
    """The trees of all joints, concatenated into one set of arrays for numba.

    Attributes:
        root: (15,) int32 root node of each joint's tree.
        child: (N,) int32 child for features below the threshold, the other child is the next node; or -1 - leaf.
        threshold: (N,) int32 threshold of the feature.
        probe: (N, 5) int16, see `image.features`.
        direction: (L, K, 3) float32 unit vectors in (u, v, d), the directions of each leaf.
        share: (L, K) float32 cumulative probabilities of the directions, up to 1.
    """

    root: np.ndarray
    child: np.ndarray
    threshold: np.ndarray
    probe: np.ndarray
    direction: np.ndarray
    share: np.ndarray


PARENT = {child: parent for parent, child in BONES}


def _parents_first() -> list[Joint]:
    """The joints, parents first."""
    order = [Joint.TORSO]
    for joint in order:
        order += [child for child, parent in PARENT.items() if parent == joint]
    return order


ORDER = np.array(_parents_first(), np.int32)
"""(15,) joints in the order of their walks, parents before children."""

START = np.array([PARENT.get(joint, -1) for joint in Joint], np.int32)
"""(15,) the joint at whose estimate the walk of each joint starts; -1 for the centre of the silhouette."""


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
    side = image.shape[0]
    row, column, depth = pixel_index(v, side), pixel_index(u, side), np.int32(np.rint(d * UNITS))
    node = trees.root[joint]
    child, threshold, probe = trees.child, trees.threshold, trees.probe
    while child[node] >= 0:
        value = depth_difference(image, row + probe[node, 0], column + probe[node, 1], depth)
        if probe[node, 4]:
            value -= depth_difference(image, row + probe[node, 2], column + probe[node, 3], depth)
        node = child[node] + (1 if value >= threshold[node] else 0)
    return -1 - child[node]


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
