"""Regression trees of directions, grown node by node."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.errors import InputError
from kpopnet.tree_walk.image import features

KMEANS_ROUNDS = 10


@dataclass(frozen=True)
class GrowthConfig:
    """How a tree is grown.

    Attributes:
        depth: the most questions on the way to a leaf.
        leaf_samples: the fewest samples in a leaf.
        features: tried at every node.
        bins: equally spaced thresholds tried of each feature.
        judged: at most so many of a node's samples choose its question; all of them are divided by it.
        probe_m: probes lie within this of the place.
        directions: that a leaf keeps, by k-means.
    """

    depth: int = 20
    leaf_samples: int = 40
    features: int = 100
    bins: int = 24
    judged: int = 1000
    probe_m: float = 0.8
    directions: int = 5

    def __post_init__(self) -> None:
        for name in ("depth", "leaf_samples", "features", "bins", "judged", "directions"):
            if getattr(self, name) < 1:
                raise InputError(f"growth.{name}={getattr(self, name)}: expected 1 or more")
        if not 0 < self.probe_m <= 5:
            raise InputError(f"growth.probe_m={self.probe_m}: expected metres, above 0, at most 5")


class Tree(NamedTuple):
    """One joint's tree: the fields of `kpopnet.tree_walk.walking.Trees`, with nodes and leaves counted from 0."""

    child: np.ndarray
    threshold: np.ndarray
    probe: np.ndarray
    direction: np.ndarray
    share: np.ndarray


class Samples(NamedTuple):
    """Places in images, and the directions to be told there.

    Attributes:
        images: (M, S, S) int16 `integer_image`.
        image: (N,) int32, which of them each sample looks at.
        place: (N, 3) int32 row, column and depth (`kpopnet.tree_walk.image.features`).
        direction: (N, 3) float32 unit vectors.
    """

    images: np.ndarray
    image: np.ndarray
    place: np.ndarray
    direction: np.ndarray


def grow(samples: Samples, config: GrowthConfig, probe_px: int, seed: tuple[int, ...]) -> Tree:
    """Grows a tree that tells the direction at a place.

    A question is the best of some random features and thresholds: that with the least sum of squared deviations of the
    directions within its two sides. A node of few samples, or without a question that divides them, becomes a leaf.

    Args:
        samples: what to learn.
        config: how.
        probe_px: the farthest of a probe.
        seed: of the features.
    """
    order = np.random.default_rng([*seed, 0]).permutation(len(samples.image))
    child, threshold, probe, direction, share = [0], [0], [np.zeros(5, np.int16)], [], []
    waiting = [(0, 0, len(order), 0)]
    while waiting:
        node, start, stop, depth = waiting.pop()
        members = order[start:stop]
        fewest = config.leaf_samples
        question, middle = None, start
        if depth < config.depth and len(members) >= 2 * fewest:
            probes = draw_probes(np.random.default_rng([*seed, 1, node]), config.features, probe_px)
            question = best_question(samples, members[: config.judged], probes, config.bins, fewest)
        if question is not None and question[0] >= 0:
            chosen, limit = question
            large = answers(samples, members, probes[chosen], limit)
            order[start:stop] = np.concatenate([members[~large], members[large]])
            middle = stop - int(np.count_nonzero(large))
        if start < middle < stop:
            probe[node], threshold[node], child[node] = probes[chosen], limit, len(child)
            waiting += [(len(child) + 1, middle, stop, depth + 1), (len(child), start, middle, depth + 1)]
            child += [0, 0]
            threshold += [0, 0]
            probe += [np.zeros(5, np.int16)] * 2
        else:
            child[node] = -1 - len(direction)
            means, shares = cluster(samples.direction[members], config.directions)
            direction.append(means)
            share.append(np.cumsum(shares))
    return Tree(
        np.array(child, np.int32),
        np.array(threshold, np.int32),
        np.stack(probe),
        np.stack(direction).astype(np.float32),
        np.stack(share).astype(np.float32),
    )


def draw_probes(rng: np.random.Generator, count: int, farthest_px: int) -> np.ndarray:
    """(count, 5) int16 random probes (`kpopnet.tree_walk.image.features`), half of them pairs; more near than far."""
    distance = farthest_px * rng.random((count, 2)) ** 2
    angle = rng.uniform(0, 2 * np.pi, (count, 2))
    ends = np.rint(distance[..., None] * np.stack([np.sin(angle), np.cos(angle)], axis=-1)).reshape(count, 4)
    return np.concatenate([ends, rng.integers(0, 2, (count, 1))], axis=1).astype(np.int16)


def answers(samples: Samples, members: np.ndarray, probe: np.ndarray, threshold: int) -> np.ndarray:
    """(n,) bool: whose feature is not below the threshold."""
    return measured(samples, members, probe[None])[:, 0] >= threshold


@njit(cache=True)
def measured(samples, members, probes):
    """(n, F) int32 features of some samples."""
    values = np.empty((len(members), len(probes)), np.int32)
    for i, sample in enumerate(members):
        row, column, depth = samples.place[sample]
        features(samples.images[samples.image[sample]], row, column, depth, probes, values[i])
    return values


@njit(cache=True)
def best_question(samples, members, probes, bins, fewest):
    """The number of the best probe and its threshold; -1 if none leaves `fewest` members on both sides.

    The sum of squared deviations within both sides is least where |sum of directions|^2 / number, summed over both, is
    most: the squares of unit vectors add up to a constant.
    """
    count = len(members)
    values = measured(samples, members, probes)
    best, best_probe, best_threshold = -1.0, -1, 0
    sums, below, above = np.empty((bins, 4)), np.zeros(4), np.zeros(4)
    for k in range(len(probes)):
        least = most = values[0, k]
        for i in range(count):
            least, most = min(least, values[i, k]), max(most, values[i, k])
        width = (most - least) // bins + 1
        sums[:] = 0
        for i, sample in enumerate(members):
            into = (values[i, k] - least) // width
            for axis in range(3):
                sums[into, axis] += samples.direction[sample, axis]
            sums[into, 3] += 1
        total = sums.sum(axis=0)
        below[:] = 0
        for b in range(bins - 1):
            for axis in range(4):
                below[axis] += sums[b, axis]
                above[axis] = total[axis] - below[axis]
            if min(below[3], above[3]) >= fewest:
                gain = _dot(below, below) / below[3] + _dot(above, above) / above[3]
                if gain > best:
                    best, best_probe, best_threshold = gain, k, least + (b + 1) * width
    return best_probe, best_threshold


@njit(cache=True)
def cluster(directions, count):
    """Spherical k-means of unit vectors.

    The first mean is the first vector, every further one begins as the vector that is least like those before it.

    Args:
        directions: (n, 3) float32.
        count: of means, K.

    Returns:
        (K, 3) float64 unit vectors, and (K,) the share of the vectors that each stands for; one that none chose has 0.
    """
    number = len(directions)
    means = np.zeros((count, 3))
    likeness = np.full(number, -np.inf)
    latest = 0
    for k in range(count):
        means[k] = directions[latest]
        for i in range(number):
            likeness[i] = max(likeness[i], _dot(means[k], directions[i]))
        latest = np.argmin(likeness)
    chosen = np.zeros(number, np.int64)
    for _ in range(KMEANS_ROUNDS):
        sums = np.zeros((count, 3))
        for i in range(number):
            nearest = 0
            for k in range(1, count):
                if _dot(means[k], directions[i]) > _dot(means[nearest], directions[i]):
                    nearest = k
            chosen[i] = nearest
            for axis in range(3):
                sums[nearest, axis] += directions[i, axis]
        for k in range(count):
            length = np.sqrt(_dot(sums[k], sums[k]))
            if length > 1e-9:
                means[k] = sums[k] / length
    shares = np.zeros(count)
    for i in range(number):
        shares[chosen[i]] += 1 / number
    return means, shares


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
