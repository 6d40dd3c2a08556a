"""Trains a random tree walk: images, positions in them, trees, and the calibration of the confidence."""

import logging
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.baselines.tree_walk.growing import GrowthConfig, Samples, Tree, grow
from kpopnet.baselines.tree_walk.image import UNITS, integer_image
from kpopnet.baselines.tree_walk.model import TreeWalkModel
from kpopnet.baselines.tree_walk.walking import Trees, WalkConfig
from kpopnet.data.batches import AugmentConfig, CropBatches, EvenOrder, Order, ShuffledOrder, batch_loader
from kpopnet.data.cube import Cube
from kpopnet.data.observation import ObservationSource
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

BATCH = 50
WITHIN_M = 0.1
POSITIONS_STREAM, GROWTH_STREAM = 0x91AC, 0x7EEE
"""Make these random draws independent of each other and of those of the observations, which have the same seed."""

log = logging.getLogger(__name__)


MAX_COUNT = 10**8


@dataclass
class TreeWalkConfig:
    """How a model is trained.

    Attributes:
        images: number of images of the training set, each used once.
        places: number of positions around each joint in every image, from which its tree learns the direction to the joint.
        around_m: largest distance of these positions from the joint in metres.
        crop_px: side of the image of the cube in pixels.
        half_size_m: half the cube's edge in metres.
        growth: how the trees are grown.
        walk: parameters of the walks.
        augment: augmentation of the training images.
        validation_images: number of images of the validation set that evaluate the model and calibrate its confidence.
        confidence_bins: number of levels of the confidence.
    """

    images: int = 80_000
    places: int = 6
    around_m: float = 0.3
    crop_px: int = 96
    half_size_m: float = 1.15
    growth: GrowthConfig = field(default_factory=GrowthConfig)
    walk: WalkConfig = field(default_factory=WalkConfig)
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    validation_images: int = 4000
    confidence_bins: int = 10

    def __post_init__(self) -> None:
        for name in ("images", "places", "validation_images", "confidence_bins"):
            if not 1 <= getattr(self, name) <= MAX_COUNT:
                raise InputError(f"{name}={getattr(self, name)}: expected 1 or more, at most {MAX_COUNT:,}")
        if not 0 < self.around_m <= 2:
            raise InputError(f"around_m={self.around_m}: expected metres, above 0, at most 2")
        ModelConfig(crop_px=self.crop_px, half_size_m=self.half_size_m)  # refuses invalid crops


class CropImages(NamedTuple):
    """Images of M people with their ground truth.

    Attributes:
        images: (M, S, S) int16 `integer_image`.
        joints_uvd: (M, 15, 3) float32 ground-truth joints in the coordinates of the image's cube.
        cubes_m: (M, 4) float32 the cube's centre in the camera frame and its half size, metres.
    """

    images: np.ndarray
    joints_uvd: np.ndarray
    cubes_m: np.ndarray


def train(
    config: TreeWalkConfig, source: ObservationSource, validation: ObservationSource, seed: int, workers: int
) -> tuple[TreeWalkModel, dict]:
    """Grows the trees of all joints and evaluates them.

    Args:
        config: how the model is trained.
        source: training observations.
        validation: validation observations.
        seed: of sample order, augmentation, positions and features.
        workers: processes that prepare images; 0 prepares them in this process.

    Returns:
        The model, and its metrics on the validation set by name.
    """
    order = ShuffledOrder(len(source), BATCH, seed)
    images = collect_images(source, config, order, config.images, config.augment, seed, workers, "training images")
    trees = []
    for joint in tqdm(range(NUM_JOINTS), desc="trees", unit="joint"):
        samples = draw_positions(images, joint, config, np.random.default_rng([seed, POSITIONS_STREAM, joint]))
        farthest_px = round(config.growth.probe_m / config.half_size_m * config.crop_px / 2)
        trees.append(grow(samples, config.growth, farthest_px, (seed, GROWTH_STREAM, joint)))
    one_bin = np.zeros((NUM_JOINTS, 0), np.float32), np.ones((NUM_JOINTS, 1), np.float32)
    model = TreeWalkModel(config.crop_px, config.half_size_m, config.walk, merge_trees(trees), *one_bin)
    count = min(config.validation_images, len(validation))
    order = EvenOrder(len(validation), BATCH, count)
    images = collect_images(validation, config, order, count, None, seed, workers, "validation images")
    return calibrate(model, images, config)


def collect_images(
    source: ObservationSource,
    config: TreeWalkConfig,
    order: Order,
    count: int,
    augment: AugmentConfig | None,
    seed: int,
    workers: int,
    what: str,
) -> CropImages:
    """Collects the first `count` images of an order, with a progress bar labelled `what`; see CropBatches for the rest."""
    side = config.crop_px
    batches = CropBatches(source, ModelConfig(crop_px=side, half_size_m=config.half_size_m), order, seed, augment)
    images = CropImages(
        np.empty((count, side, side), np.int16),
        np.empty((count, NUM_JOINTS, 3), np.float32),
        np.empty((count, 4), np.float32),
    )
    filled = skipped = 0
    with tqdm(total=count, desc=what, unit="image") as bar:
        for batch in batch_loader(batches, 0, -(-count // BATCH), workers):
            rows = slice(filled, min(filled + len(batch.crop), count))
            added = rows.stop - rows.start
            crops, targets, cubes_m = (np.asarray(part)[:added] for part in batch[:3])
            images.images[rows], images.joints_uvd[rows], images.cubes_m[rows] = integer_image(crops[:, 0]), targets, cubes_m
            filled += added
            skipped += batch.skipped
            bar.update(added)
    if skipped:
        log.info(f"{what}: {skipped} observations with an empty silhouette were replaced by the next one")
    return images


def draw_positions(crops: CropImages, joint: int, config: TreeWalkConfig, rng: np.random.Generator) -> Samples:
    """Draws the positions from which the direction to a joint is learned, `config.places` in each image.

    The positions are isotropic around the joint, although walks come from its parent: an uncertain tree returns the most
    frequent direction of its samples. With positions along the way from the parent, walks drifted past the joint. The
    distance from the joint is uniform, so the density is highest at the joint, where walks take most steps.
    """
    count = len(crops.images) * config.places
    image = np.repeat(np.arange(len(crops.images), dtype=np.int32), config.places)
    target = crops.joints_uvd[image, joint]
    offset = rng.normal(size=(count, 3)).astype(np.float32)
    offset *= config.around_m / config.half_size_m * rng.random((count, 1)) / np.linalg.norm(offset, axis=1, keepdims=True)
    position = target + offset
    direction = -offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-9)
    return Samples(crops.images, image, pixel_positions(position, config.crop_px), direction.astype(np.float32))


def pixel_positions(position_uvd: np.ndarray, side: int) -> np.ndarray:
    """Converts (N, 3) u, v, d to (N, 3) int32 row, column and depth in UNITS, as the walks do."""
    u, v, d = position_uvd.T
    half = side / 2
    return np.stack([np.floor((v + 1) * half), np.floor((u + 1) * half), np.rint(d * UNITS)], axis=1).astype(np.int32)


def merge_trees(trees: list[Tree]) -> Trees:
    """Concatenates the trees of all joints into one set of arrays."""
    nodes = np.cumsum([0, *(len(tree.child) for tree in trees)])
    leaves = np.cumsum([0, *(len(tree.share) for tree in trees)])
    child = [
        np.where(tree.child >= 0, tree.child + node, tree.child - leaf).astype(np.int32)
        for tree, node, leaf in zip(trees, nodes[:-1], leaves[:-1], strict=True)
    ]
    parts = (np.concatenate([getattr(tree, name) for tree in trees]) for name in Tree._fields[1:])
    return Trees(nodes[:-1].astype(np.int32), np.concatenate(child), *parts)


def calibrate(model: TreeWalkModel, crops: CropImages, config: TreeWalkConfig) -> tuple[TreeWalkModel, dict]:
    """Calibrates the confidence of a model on images; returns the model and its metrics on these images."""
    errors_m = np.empty((len(crops.images), NUM_JOINTS))
    deviations_m = np.empty((len(crops.images), NUM_JOINTS), np.float32)
    for number, (image, truth, (*centre_m, half_size_m)) in enumerate(zip(*crops, strict=True)):
        uvd, deviations_m[number] = model.run_walks(image, number)
        cube = Cube(np.array(centre_m, np.float32), half_size_m)
        errors_m[number] = np.linalg.norm(cube.to_metres(uvd) - cube.to_metres(truth), axis=-1)
    within = errors_m < WITHIN_M
    bins = config.confidence_bins
    bounds_m = np.quantile(deviations_m, np.arange(1, bins) / bins, axis=0).T.astype(np.float32).reshape(NUM_JOINTS, bins - 1)
    bin_of = (deviations_m[:, :, None] >= bounds_m).sum(axis=-1)
    shares = np.empty((NUM_JOINTS, bins), np.float32)
    for joint in range(NUM_JOINTS):
        for k in range(bins):
            in_bin = within[bin_of[:, joint] == k, joint]
            shares[joint, k] = in_bin.mean() if len(in_bin) else within[:, joint].mean()
    metrics = {
        "mean_error_cm": 100 * float(errors_m.mean()),
        "within_10cm": float(within.mean()),
        "within_10cm_per_joint": dict(zip(JOINT_NAMES, within.mean(axis=0).tolist(), strict=True)),
    }
    return replace(model, deviation_bounds_m=bounds_m, within_10cm=shares), metrics
