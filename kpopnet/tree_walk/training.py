"""Makes a tree walk model of observations: images, places in them, trees, and what the spread of a walk means."""

import logging
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kpopnet.crops import AugmentConfig, CropBatches, EvenOrder, Order, ShuffledOrder, batch_loader
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.networks.cube import Cube
from kpopnet.observation import ObservationSource
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS
from kpopnet.tree_walk.growing import GrowthConfig, Samples, Tree, grow
from kpopnet.tree_walk.image import UNITS, integer_image
from kpopnet.tree_walk.model import TreeWalkModel
from kpopnet.tree_walk.walking import Trees, WalkConfig

BATCH = 50
WITHIN_M = 0.1
PLACES_STREAM, GROWTH_STREAM = 0x91AC, 0x7EEE
"""Keep these draws apart from one another and from those of the observations, whose seed is the same."""

log = logging.getLogger(__name__)


@dataclass
class TreeWalkConfig:
    """How a model is made.

    Attributes:
        images: of the training set, each seen once.
        places: around each joint in every image, from which its tree learns the way.
        around_m: they lie within this of the joint.
        crop_px: side of the image of the cube.
        half_size_m: half the cube's edge.
        growth: of the trees.
        walk: how walks go.
        augment: how images are varied.
        validation_images: of the validation set; they judge the model and tell what a walk's spread means.
        confidence_bins: so many degrees of confidence.
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
            if getattr(self, name) < 1:
                raise InputError(f"{name}={getattr(self, name)}: expected 1 or more")
        if not 0 < self.around_m <= 2:
            raise InputError(f"around_m={self.around_m}: expected metres, above 0, at most 2")
        ModelConfig(crop_px=self.crop_px, half_size_m=self.half_size_m)  # refuses what makes no crop


class Seen(NamedTuple):
    """M people as trees see them.

    Attributes:
        images: (M, S, S) int16 `integer_image`.
        joints_uvd: (M, 15, 3) float32 true joints in the coordinates of the image's cube.
        cubes_m: (M, 4) float32 the cube's centre in the camera frame and its half size.
    """

    images: np.ndarray
    joints_uvd: np.ndarray
    cubes_m: np.ndarray


def train(
    config: TreeWalkConfig, source: ObservationSource, validation: ObservationSource, seed: int, workers: int
) -> tuple[TreeWalkModel, dict]:
    """Grows the trees of all joints and judges them.

    Args:
        config: how.
        source: training observations.
        validation: validation observations.
        seed: of order, augmentation, places and features.
        workers: processes that prepare images; 0 does it here.

    Returns:
        The model, and its metrics on the validation set by name.
    """
    order = ShuffledOrder(len(source), BATCH, seed)
    seen = see(source, config, order, config.images, config.augment, seed, workers, "training images")
    trees = []
    for joint in tqdm(range(NUM_JOINTS), desc="trees", unit="joint"):
        samples = draw_places(seen, joint, config, np.random.default_rng([seed, PLACES_STREAM, joint]))
        farthest_px = round(config.growth.probe_m / config.half_size_m * config.crop_px / 2)
        trees.append(grow(samples, config.growth, farthest_px, (seed, GROWTH_STREAM, joint)))
    every_walk = np.zeros((NUM_JOINTS, 0), np.float32), np.ones((NUM_JOINTS, 1), np.float32)
    model = TreeWalkModel(config.crop_px, config.half_size_m, config.walk, joined(trees), *every_walk)
    count = min(config.validation_images, len(validation))
    order = EvenOrder(len(validation), BATCH, count)
    return calibrated(model, see(validation, config, order, count, None, seed, workers, "validation images"), config)


def see(
    source: ObservationSource,
    config: TreeWalkConfig,
    order: Order,
    count: int,
    augment: AugmentConfig | None,
    seed: int,
    workers: int,
    what: str,
) -> Seen:
    """The first `count` images of an order, with a progress bar called `what`; see CropBatches for the rest."""
    side = config.crop_px
    batches = CropBatches(source, ModelConfig(crop_px=side, half_size_m=config.half_size_m), order, seed, augment)
    seen = Seen(
        np.empty((count, side, side), np.int16),
        np.empty((count, NUM_JOINTS, 3), np.float32),
        np.empty((count, 4), np.float32),
    )
    filled = skipped = 0
    with tqdm(total=count, desc=what, unit="image") as bar:
        for batch in batch_loader(batches, 0, -(-count // BATCH), workers):
            rows = slice(filled, min(filled + len(batch.crop), count))
            taken = rows.stop - rows.start
            crops, targets, cubes_m = (np.asarray(part)[:taken] for part in batch[:3])
            seen.images[rows], seen.joints_uvd[rows], seen.cubes_m[rows] = integer_image(crops[:, 0]), targets, cubes_m
            filled += taken
            skipped += batch.skipped
            bar.update(taken)
    if skipped:
        log.info(f"{what}: {skipped} observations with an empty silhouette were replaced by the next one")
    return seen


def draw_places(seen: Seen, joint: int, config: TreeWalkConfig, rng: np.random.Generator) -> Samples:
    """Places from which the way to a joint is learned, `config.places` in each image.

    They lie the same way around the joint on all sides, although walks come from its parent's: a tree that is in doubt
    answers with the direction that its places had most, and where the places lay along the way from the parent, walks did
    not end at the joint but drifted past it. Their distance is drawn evenly, so the density is highest at the joint,
    where walks spend most steps.
    """
    count = len(seen.images) * config.places
    image = np.repeat(np.arange(len(seen.images), dtype=np.int32), config.places)
    target = seen.joints_uvd[image, joint]
    aside = rng.normal(size=(count, 3)).astype(np.float32)
    aside *= config.around_m / config.half_size_m * rng.random((count, 1)) / np.linalg.norm(aside, axis=1, keepdims=True)
    place = target + aside
    direction = -aside / np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-9)
    return Samples(seen.images, image, pixel_places(place, config.crop_px), direction.astype(np.float32))


def pixel_places(place_uvd: np.ndarray, side: int) -> np.ndarray:
    """(N, 3) u, v, d to (N, 3) int32 row, column and depth, as walks have them."""
    u, v, d = place_uvd.T
    half = side / 2
    return np.stack([np.floor((v + 1) * half), np.floor((u + 1) * half), np.rint(d * UNITS)], axis=1).astype(np.int32)


def joined(trees: list[Tree]) -> Trees:
    """The trees of all joints in one."""
    nodes = np.cumsum([0, *(len(tree.child) for tree in trees)])
    leaves = np.cumsum([0, *(len(tree.share) for tree in trees)])
    child = [
        np.where(tree.child >= 0, tree.child + node, tree.child - leaf).astype(np.int32)
        for tree, node, leaf in zip(trees, nodes[:-1], leaves[:-1], strict=True)
    ]
    parts = (np.concatenate([getattr(tree, name) for tree in trees]) for name in Tree._fields[1:])
    return Trees(nodes[:-1].astype(np.int32), np.concatenate(child), *parts)


def calibrated(model: TreeWalkModel, seen: Seen, config: TreeWalkConfig) -> tuple[TreeWalkModel, dict]:
    """The model with confidences as these people show them, and its metrics on them."""
    errors_m = np.empty((len(seen.images), NUM_JOINTS))
    spreads_m = np.empty((len(seen.images), NUM_JOINTS), np.float32)
    for number, (image, truth, (*centre_m, half_size_m)) in enumerate(zip(*seen, strict=True)):
        uvd, spreads_m[number] = model.walked(image, number)
        cube = Cube(np.array(centre_m, np.float32), half_size_m)
        errors_m[number] = np.linalg.norm(cube.to_metres(uvd) - cube.to_metres(truth), axis=-1)
    within = errors_m < WITHIN_M
    bins = config.confidence_bins
    bounds_m = np.quantile(spreads_m, np.arange(1, bins) / bins, axis=0).T.astype(np.float32).reshape(NUM_JOINTS, bins - 1)
    into = (spreads_m[:, :, None] >= bounds_m).sum(axis=-1)
    shares = np.empty((NUM_JOINTS, bins), np.float32)
    for joint in range(NUM_JOINTS):
        for k in range(bins):
            alike = within[into[:, joint] == k, joint]
            shares[joint, k] = alike.mean() if len(alike) else within[:, joint].mean()
    metrics = {
        "mean_error_cm": 100 * float(errors_m.mean()),
        "within_10cm": float(within.mean()),
        "within_10cm_per_joint": dict(zip(JOINT_NAMES, within.mean(axis=0).tolist(), strict=True)),
    }
    return replace(model, spread_m=bounds_m, within_10cm=shares), metrics
