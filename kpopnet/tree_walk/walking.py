"""The walk of every joint through the cube around the person."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.errors import InputError
from kpopnet.skeleton import BONES, NUM_JOINTS, Joint
from kpopnet.tree_walk.image import UNITS, pixel, reading

MOST_STEPS = 10_000


@dataclass(frozen=True)
class WalkConfig:
    """How a walk goes.

    Attributes:
        steps: of each joint's walk.
        settling: the first so many find the way and do not count for the mean.
        step_m: length of a step.
    """

    steps: int = 128
    settling: int = 32
    step_m: float = 0.05

    def __post_init__(self) -> None:
        whole = isinstance(self.steps, int) and isinstance(self.settling, int)
        if not (whole and 0 <= self.settling < self.steps <= MOST_STEPS):
            raise InputError(
                f"walk: expected whole numbers, 0 <= settling < steps <= {MOST_STEPS}, found settling={self.settling}, "
                f"steps={self.steps}"
            )
        if not 0 < self.step_m <= 0.5:
            raise InputError(f"walk.step_m={self.step_m}: expected metres, above 0, at most 0.5")


class Trees(NamedTuple):
    """The trees of all joints in one; what numba walks through.

    Attributes:
        root: (15,) int32 the first node of each joint's tree.
        child: (N,) int32: the child for small features, the other one follows it; or -1 - leaf.
        threshold: (N,) int32: features below it are small.
        probe: (N, 5) int16, see `feature`.
        direction: (L, K, 3) float32 unit vectors in (u, v, d) that a leaf may answer with.
        share: (L, K) float32 how often, cumulated: rises to 1.
    """

    root: np.ndarray
    child: np.ndarray
    threshold: np.ndarray
    probe: np.ndarray
    direction: np.ndarray
    share: np.ndarray


PARENT = {child: parent for parent, child in BONES}


def _ordered() -> list[Joint]:
    """The joints, parents first."""
    order = [Joint.TORSO]
    for joint in order:
        order += [child for child, parent in PARENT.items() if parent == joint]
    return order


ORDER = np.array(_ordered(), np.int32)
"""(15,) joints in the order of their walks."""

START = np.array([PARENT.get(joint, -1) for joint in Joint], np.int32)
"""(15,) the joint at whose estimate each one's walk starts; -1 for the middle of the silhouette."""


@njit(cache=True)
def uniform(key, count):
    """A number in 0..1, 1 excluded, by a seed and a running number: splitmix64."""
    z = np.uint64(key) + np.uint64(count + 1) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return np.float64(z >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True)
def leaf_at(trees, joint, image, u, v, d):
    """The leaf that a joint's tree sends a place to."""
    side = image.shape[0]
    row, column, depth = pixel(v, side), pixel(u, side), np.int32(np.rint(d * UNITS))
    node = trees.root[joint]
    child, threshold, probe = trees.child, trees.threshold, trees.probe
    while child[node] >= 0:
        value = reading(image, row + probe[node, 0], column + probe[node, 1], depth)
        if probe[node, 4]:
            value -= reading(image, row + probe[node, 2], column + probe[node, 3], depth)
        node = child[node] + (1 if value >= threshold[node] else 0)
    return -1 - child[node]


@njit(cache=True)
def walk(image, trees, steps, settling, step, key):
    """All joints' walks through one image, none of which leaves its cube.

    Args:
        image: (S, S) `integer_image`.
        trees: Trees.
        steps: of each walk.
        settling: the first so many do not count.
        step: its length in cube units.
        key: seed of this image's chance.

    Returns:
        (15, 3) float32 mean place in (u, v, d), and (15,) float32 root mean square distance from it, in cube units.
    """
    mean = np.zeros((NUM_JOINTS, 3), np.float32)
    spread = np.zeros(NUM_JOINTS, np.float32)
    counted = steps - settling
    for joint in ORDER:
        u = v = d = 0.0
        if START[joint] >= 0:
            u, v, d = mean[START[joint]]
        sum_u = sum_v = sum_d = squares = 0.0
        for number in range(steps):
            leaf = leaf_at(trees, joint, image, u, v, d)
            chance = uniform(key, joint * steps + number)
            chosen = 0
            while trees.share[leaf, chosen] <= chance and chosen < trees.share.shape[1] - 1:
                chosen += 1
            # No tree knows a way back from outside the cube.
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
        spread[joint] = np.sqrt(max(squares / counted - square, 0.0))
    return mean, spread
