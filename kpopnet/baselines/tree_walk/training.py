"""Trains a random tree walk: images, positions in them and a tree for each joint."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from tqdm import tqdm

from kpopnet.baselines.tree_walk.walking import HALF_SIZE_M, UNITS, Trees, TreeWalkModel, feature, integer_image
from kpopnet.dance.vectors import dot
from kpopnet.data.batches import AugmentConfig, CropBatches, ShuffledOrder, batch_loader
from kpopnet.data.cube import check_crop_px
from kpopnet.data.observation import ObservationSource
from kpopnet.errors import check_between
from kpopnet.networks import ModelConfig
from kpopnet.skeleton import NUM_JOINTS

BATCH = 50
AUGMENT = AugmentConfig()
AROUND_M = 0.3
"""Largest distance from the joint of the positions from which the direction to it is learned."""

POSITIONS_STREAM, GROWTH_STREAM = 0x91AC, 0x7EEE
"""Make these random draws independent of each other and of those of the observations, which have the same seed."""

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


@dataclass
class TreeWalkConfig:
    """How a model is trained.

    Attributes:
        images: number of images; more than the training set has show its people again, with other noise and augmentation.
        places: number of positions around each joint in every image, from which its tree learns the direction to the joint.
        crop_px: side of the image of the cube in pixels.
        leaf_samples: smallest number of samples in a leaf.
        features: number of random features tried at every node.
    """

    images: int = 80_000
    places: int = 6
    crop_px: int = 96
    leaf_samples: int = 40
    features: int = 100

    def __post_init__(self) -> None:
        for name in ("images", "places", "leaf_samples", "features"):
            check_between(f"tree_walk.{name}", getattr(self, name), 1, 1e8)
        check_crop_px("tree_walk.crop_px", self.crop_px)


class Samples(NamedTuple):
    """Training samples: positions in images, and the directions from there to the joint."""

    images: np.ndarray  # (M, S, S) int16 `integer_image`
    image: np.ndarray  # (N,) int32 index of each sample's image
    position: np.ndarray  # (N, 3) int32 row, column and depth (`feature`)
    direction: np.ndarray  # (N, 3) float32 unit vectors from the position to the joint


def train(config: TreeWalkConfig, source: ObservationSource, seed: int, workers: int) -> TreeWalkModel:
    """Grows the trees of all joints. `workers` processes prepare images, this one if it is 0."""
    side, count = config.crop_px, config.images
    model = ModelConfig(crop_px=side, half_size_m=HALF_SIZE_M)
    batches = CropBatches(source, model, ShuffledOrder(len(source), BATCH, seed), seed, AUGMENT)
    images, joints_uvd = np.empty((count, side, side), np.int16), np.empty((count, NUM_JOINTS, 3), np.float32)
    loaded = batch_loader(batches, 0, -(-count // BATCH), workers)
    for step, batch in enumerate(tqdm(loaded, desc="training images", unit="batch")):
        rows = slice(step * BATCH, min((step + 1) * BATCH, count))
        crops, joints_uvd[rows] = (np.asarray(part)[: rows.stop - rows.start] for part in (batch.crop, batch.target))
        images[rows] = integer_image(crops[:, 0])
    samples = (
        draw_positions(images, joints_uvd[:, joint], config.places, np.random.default_rng([seed, POSITIONS_STREAM, joint]))
        for joint in tqdm(range(NUM_JOINTS), desc="trees", unit="joint")
    )
    return TreeWalkModel(side, grow(samples, config, seed))


def grow(samples_of_joints: Iterable[Samples], config: TreeWalkConfig, seed: int) -> Trees:
    """Grows a tree for each joint that predicts the direction at a position.

    The split of a node is the best of `config.features` random features and all thresholds: it minimises the sum of squared
    deviations of the directions from the mean of their side. A node with fewer than twice `config.leaf_samples` samples, or
    without a split that leaves as many on both sides, becomes a leaf.
    """
    farthest_px = round(PROBE_M * (config.crop_px / 2 / HALF_SIZE_M))
    empty = 0, 0, np.zeros(5, np.int16)
    root, nodes, leaves = [], [], []
    for joint, samples in enumerate(samples_of_joints):
        order = np.random.default_rng([seed, GROWTH_STREAM, joint, 0]).permutation(len(samples.image))
        root.append(len(nodes))
        nodes.append(empty)
        open_nodes = [(root[-1], 0, len(order), 0)]
        while open_nodes:
            node, start, stop, depth = open_nodes.pop()
            members, chosen, limit = order[start:stop], -1, 0
            if depth < MAX_DEPTH and len(members) >= 2 * config.leaf_samples:
                rng = np.random.default_rng([seed, GROWTH_STREAM, joint, 1, node - root[-1]])
                probes = draw_probes(rng, config.features, farthest_px)
                chosen, limit = best_split(samples, members[:JUDGED_SAMPLES], probes, config.leaf_samples)
            if chosen < 0:
                nodes[node] = -1 - len(leaves), *empty[1:]
                leaves.append(cluster(samples.direction[members]))
                continue
            large = feature_values(samples, members, probes[chosen : chosen + 1])[:, 0] >= limit
            order[start:stop] = np.concatenate([members[~large], members[large]])
            middle, children = stop - int(np.count_nonzero(large)), len(nodes)
            nodes[node] = children, limit, probes[chosen]
            nodes += [empty] * 2
            open_nodes += [(children + 1, middle, stop, depth + 1), (children, start, middle, depth + 1)]
    child, threshold, probe = zip(*nodes, strict=True)
    direction, share = (np.stack(one).astype(np.float32) for one in zip(*leaves, strict=True))
    return Trees(*(np.array(one, np.int32) for one in (root, child, threshold)), np.stack(probe), direction, share)


def draw_positions(images: np.ndarray, joint_uvd: np.ndarray, places: int, rng: np.random.Generator) -> Samples:
    """Draws the positions from which the direction to a joint, (M, 3), is learned, `places` in each of M images.

    The positions are isotropic around the joint, although walks come from its parent: an uncertain tree returns the most
    frequent direction of its samples. With positions along the way from the parent, walks drifted past the joint. The
    distance from the joint is uniform, so the density is highest at the joint, where walks take most steps.
    """
    count = len(images) * places
    image = np.repeat(np.arange(len(images), dtype=np.int32), places)
    offset = rng.normal(size=(count, 3)).astype(np.float32)
    offset *= AROUND_M / HALF_SIZE_M * rng.random((count, 1)) / np.linalg.norm(offset, axis=1, keepdims=True)
    direction = -offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-9)
    u, v, d = (joint_uvd[image] + offset).T
    half = images.shape[1] / 2
    position = np.stack([np.floor((v + 1) * half), np.floor((u + 1) * half), np.rint(d * UNITS)], axis=1)  # as the walks do
    return Samples(images, image, position.astype(np.int32), direction.astype(np.float32))


def draw_probes(rng: np.random.Generator, count: int, farthest_px: int) -> np.ndarray:
    """(count, 5) int16 random probes (`feature`), half of them pairs.

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
def best_split(samples, members, probes, min_samples):
    """The index of the best probe and its threshold; index -1 if no split leaves `min_samples` members on both sides.

    Minimising the sum of squared deviations within both sides is equivalent to maximising |sum of directions|^2 / number,
    summed over both sides, since the squared norms of unit vectors sum to a constant.
    """
    count = len(members)
    values = feature_values(samples, members, probes)
    best, best_probe, best_threshold = -1.0, -1, 0
    sums, below, above = np.empty((BINS, 4)), np.zeros(4), np.zeros(4)
    for k in range(len(probes)):
        low = high = values[0, k]
        for i in range(count):
            low, high = min(low, values[i, k]), max(high, values[i, k])
        width = (high - low) // BINS + 1
        sums[:] = 0
        for i, sample in enumerate(members):
            bin_index = (values[i, k] - low) // width
            for axis in range(3):
                sums[bin_index, axis] += samples.direction[sample, axis]
            sums[bin_index, 3] += 1
        total = sums.sum(axis=0)
        below[:] = 0
        for b in range(BINS - 1):
            for axis in range(4):
                below[axis] += sums[b, axis]
                above[axis] = total[axis] - below[axis]
            if min(below[3], above[3]) >= min_samples:
                gain = dot(below, below) / below[3] + dot(above, above) / above[3]
                if gain > best:
                    best, best_probe, best_threshold = gain, k, low + (b + 1) * width
    return best_probe, best_threshold


def cluster(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Spherical k-means of (n, 3) unit vectors: (DIRECTIONS, 3) means, and (DIRECTIONS,) the cumulative share of the vectors
    nearest to each, float64.

    The first mean is initialised with the first vector, every further mean with the vector farthest in angle from the
    means before it.
    """
    directions = directions.astype(np.float64)
    means = np.zeros((DIRECTIONS, 3))
    similarity, latest = np.full(len(directions), -np.inf), 0
    for k in range(DIRECTIONS):
        means[k] = directions[latest]
        similarity = np.maximum(similarity, _cosines(directions, means[k : k + 1])[:, 0])
        latest = similarity.argmin()
    for _ in range(KMEANS_ITERATIONS):
        nearest = _cosines(directions, means).argmax(axis=1)
        sums = np.stack([np.bincount(nearest, axis, DIRECTIONS) for axis in directions.T], axis=1)
        length = np.linalg.norm(sums, axis=1, keepdims=True)
        means = np.where(length > 1e-9, sums / np.maximum(length, 1e-9), means)
    return means, np.bincount(nearest, np.full(len(directions), 1 / len(directions)), DIRECTIONS).cumsum()


def _cosines(directions: np.ndarray, means: np.ndarray) -> np.ndarray:
    """(n, K) cosines of the angles between (n, 3) and (K, 3) unit vectors."""
    return sum(directions[:, axis, None] * means[:, axis] for axis in range(3))
