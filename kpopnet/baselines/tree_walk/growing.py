"""Growing of regression trees whose leaves hold directions, node by node."""

from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.baselines.tree_walk.walking import Trees, feature

MAX_DEPTH = 20
"""Largest number of splits between the root and a leaf."""

BINS = 24
"""Number of equal intervals of each feature's range; their bounds are the thresholds tried."""

JUDGED_SAMPLES = 1000
"""Largest number of a node's samples that are used to select its split; the split divides all of them."""

PROBE_M = 0.8
"""Largest distance of a probe from the position."""

DIRECTIONS, KMEANS_ITERATIONS = 5, 10
"""Number of directions that a leaf stores, found by k-means, as Jung et al. do."""


class Samples(NamedTuple):
    """Training samples: positions in images, and the directions from there to the joint."""

    images: np.ndarray  # (M, S, S) int16 `integer_image`
    image: np.ndarray  # (N,) int32 index of each sample's image
    position: np.ndarray  # (N, 3) int32 row, column and depth (`kpopnet.baselines.tree_walk.walking.feature`)
    direction: np.ndarray  # (N, 3) float32 unit vectors from the position to the joint


def grow(samples: Samples, leaf_samples: int, num_features: int, px_per_m: float, seed: tuple[int, ...]) -> Trees:
    """Grows a tree that predicts the direction at a position; nodes and leaves are numbered from 0.

    The split of a node is the best of `num_features` random features and all thresholds: it minimises the sum of squared
    deviations of the directions from the mean of their side. A node with fewer than twice `leaf_samples` samples, or without
    a split that leaves as many on both sides, becomes a leaf. `seed` is of the features.
    """
    order = np.random.default_rng([*seed, 0]).permutation(len(samples.image))
    child, threshold, probe, direction, share = [0], [0], [np.zeros(5, np.int16)], [], []
    open_nodes = [(0, 0, len(order), 0)]
    while open_nodes:
        node, start, stop, depth = open_nodes.pop()
        members = order[start:stop]
        chosen, middle = -1, start
        if depth < MAX_DEPTH and len(members) >= 2 * leaf_samples:
            probes = draw_probes(np.random.default_rng([*seed, 1, node]), num_features, round(PROBE_M * px_per_m))
            chosen, limit = best_split(samples, members[:JUDGED_SAMPLES], probes, BINS, leaf_samples)
        if chosen >= 0:
            large = feature_values(samples, members, probes[chosen : chosen + 1])[:, 0] >= limit
            order[start:stop] = np.concatenate([members[~large], members[large]])
            middle = stop - int(np.count_nonzero(large))
        if start < middle < stop:
            probe[node], threshold[node], child[node] = probes[chosen], limit, len(child)
            open_nodes += [(len(child) + 1, middle, stop, depth + 1), (len(child), start, middle, depth + 1)]
            child += [0, 0]
            threshold += [0, 0]
            probe += [np.zeros(5, np.int16)] * 2
        else:
            child[node] = -1 - len(direction)
            means, shares = cluster(samples.direction[members], DIRECTIONS)
            direction.append(means)
            share.append(np.cumsum(shares))
    return Trees(
        np.zeros(1, np.int32),
        np.array(child, np.int32),
        np.array(threshold, np.int32),
        np.stack(probe),
        np.stack(direction).astype(np.float32),
        np.stack(share).astype(np.float32),
    )


def draw_probes(rng: np.random.Generator, count: int, farthest_px: int) -> np.ndarray:
    """(count, 5) int16 random probes (`kpopnet.baselines.tree_walk.walking.feature`), half of them pairs.

    The distance of a probe is farthest_px times the square of a uniform number, so that near probes are more frequent.
    """
    distance = farthest_px * rng.random((count, 2)) ** 2
    angle = rng.uniform(0, 2 * np.pi, (count, 2))
    ends = np.rint(distance[..., None] * np.stack([np.sin(angle), np.cos(angle)], axis=-1)).reshape(count, 4)
    return np.concatenate([ends, rng.integers(0, 2, (count, 1))], axis=1).astype(np.int16)


@njit(cache=True)
def feature_values(samples, members, probes):
    """(n, F) int32 features of the members, which are indices of samples."""
    values = np.empty((len(members), len(probes)), np.int32)
    for i, sample in enumerate(members):
        row, column, depth = samples.position[sample]
        for k in range(len(probes)):
            values[i, k] = feature(samples.images[samples.image[sample]], row, column, depth, probes[k])
    return values


@njit(cache=True)
def best_split(samples, members, probes, bins, min_samples):
    """The index of the best probe and its threshold; index -1 if no split leaves `min_samples` members on both sides.

    Minimising the sum of squared deviations within both sides is equivalent to maximising |sum of directions|^2 / number,
    summed over both sides, since the squared norms of unit vectors sum to a constant.
    """
    count = len(members)
    values = feature_values(samples, members, probes)
    best, best_probe, best_threshold = -1.0, -1, 0
    sums, below, above = np.empty((bins, 4)), np.zeros(4), np.zeros(4)
    for k in range(len(probes)):
        low = high = values[0, k]
        for i in range(count):
            low, high = min(low, values[i, k]), max(high, values[i, k])
        width = (high - low) // bins + 1
        sums[:] = 0
        for i, sample in enumerate(members):
            bin_index = (values[i, k] - low) // width
            for axis in range(3):
                sums[bin_index, axis] += samples.direction[sample, axis]
            sums[bin_index, 3] += 1
        total = sums.sum(axis=0)
        below[:] = 0
        for b in range(bins - 1):
            for axis in range(4):
                below[axis] += sums[b, axis]
                above[axis] = total[axis] - below[axis]
            if min(below[3], above[3]) >= min_samples:
                gain = _dot(below, below) / below[3] + _dot(above, above) / above[3]
                if gain > best:
                    best, best_probe, best_threshold = gain, k, low + (b + 1) * width
    return best_probe, best_threshold


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cluster(directions: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Spherical k-means of (n, 3) unit vectors: (count, 3) float64 means, and (count,) the share of the vectors nearest to
    each.

    The first mean is initialised with the first vector, every further mean with the vector farthest in angle from the
    means before it.
    """
    directions = directions.astype(np.float64)
    means = np.zeros((count, 3))
    similarity, latest = np.full(len(directions), -np.inf), 0
    for k in range(count):
        means[k] = directions[latest]
        similarity = np.maximum(similarity, _cosines(directions, means[k : k + 1])[:, 0])
        latest = similarity.argmin()
    for _ in range(KMEANS_ITERATIONS):
        nearest = _cosines(directions, means).argmax(axis=1)
        sums = np.stack([np.bincount(nearest, axis, count) for axis in directions.T], axis=1)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        means = np.where(length > 1e-9, sums / np.maximum(length, 1e-9), means)
    return means, np.bincount(nearest, np.full(len(directions), 1 / len(directions)), count)


def _cosines(directions: np.ndarray, means: np.ndarray) -> np.ndarray:
    """(n, K) cosines of the angles between (n, 3) and (K, 3) unit vectors."""
    return sum(directions[:, axis, None] * means[:, axis] for axis in range(3))


def merge_trees(trees: list[Trees]) -> Trees:
    """Concatenates the trees of all joints."""
    nodes = np.cumsum([0, *(len(tree.child) for tree in trees)])
    leaves = np.cumsum([0, *(len(tree.share) for tree in trees)])
    child = [
        np.where(tree.child >= 0, tree.child + nodes[joint], tree.child - leaves[joint]) for joint, tree in enumerate(trees)
    ]
    parts = (np.concatenate([getattr(tree, name) for tree in trees]) for name in Trees._fields[2:])
    return Trees(nodes[:-1].astype(np.int32), np.concatenate(child).astype(np.int32), *parts)
