"""Trains a random tree walk: images, positions in them and a tree for each joint; judges it on other images."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from tqdm import tqdm

from kpopnet.baselines.tree_walk.growing import Samples, grow, merge_trees
from kpopnet.baselines.tree_walk.walking import HALF_SIZE_M, UNITS, TreeWalkModel, integer_image
from kpopnet.data.batches import AugmentConfig, CropBatches, EvenOrder, ShuffledOrder, batch_loader
from kpopnet.data.cube import Cube, check_crop_px
from kpopnet.data.observation import ObservationSource
from kpopnet.errors import check_between
from kpopnet.networks import ModelConfig
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS

BATCH = 50
WITHIN_M = 0.1
AROUND_M = 0.3
"""Largest distance from the joint of the positions from which the direction to it is learned."""

POSITIONS_STREAM, GROWTH_STREAM = 0x91AC, 0x7EEE
"""Make these random draws independent of each other and of those of the observations, which have the same seed."""


@dataclass
class TreeWalkAugmentConfig(AugmentConfig):
    """The same, of a random tree walk."""

    group: ClassVar[str] = "tree_walk.augment"


@dataclass
class TreeWalkConfig:
    """How a model is trained.

    Attributes:
        images: number of images of the training set, each used once.
        places: number of positions around each joint in every image, from which its tree learns the direction to the joint.
        crop_px: side of the image of the cube in pixels.
        leaf_samples: smallest number of samples in a leaf.
        features: number of random features tried at every node.
        augment: augmentation of the training images.
        validation_images: number of images of the validation set that judge the model.
    """

    images: int = 80_000
    places: int = 6
    crop_px: int = 96
    leaf_samples: int = 40
    features: int = 100
    augment: AugmentConfig = field(default_factory=TreeWalkAugmentConfig)
    validation_images: int = 4000

    def __post_init__(self) -> None:
        for name in ("images", "places", "leaf_samples", "features", "validation_images"):
            check_between(f"tree_walk.{name}", getattr(self, name), 1, 1e8)
        check_crop_px("tree_walk.crop_px", self.crop_px)


def train(
    config: TreeWalkConfig, source: ObservationSource, validation: ObservationSource, seed: int, workers: int
) -> tuple[TreeWalkModel, dict]:
    """Grows the trees of all joints; returns the model and its metrics on the validation set.

    `workers` processes prepare images, this one if it is 0.
    """
    order = ShuffledOrder(len(source), BATCH, seed)
    batches = CropBatches(source, ModelConfig(crop_px=config.crop_px, half_size_m=HALF_SIZE_M), order, seed, config.augment)
    images, joints_uvd, _ = collect_images(batches, config.images, workers, "training images")
    trees = []
    for joint in tqdm(range(NUM_JOINTS), desc="trees", unit="joint"):
        samples = draw_positions(
            images, joints_uvd[:, joint], config.places, np.random.default_rng([seed, POSITIONS_STREAM, joint])
        )
        half_px = config.crop_px / 2 / HALF_SIZE_M
        trees.append(grow(samples, config.leaf_samples, config.features, half_px, (seed, GROWTH_STREAM, joint)))
    model = TreeWalkModel(config.crop_px, merge_trees(trees))
    count = min(config.validation_images, len(validation))
    order = EvenOrder(len(validation), BATCH, count)
    batches = CropBatches(validation, ModelConfig(crop_px=config.crop_px, half_size_m=HALF_SIZE_M), order, seed, None)
    return model, judge(model, *collect_images(batches, count, workers, "validation images"))


def collect_images(batches: CropBatches, count: int, workers: int, what: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The first M = `count` images of the batches: (M, S, S) int16 `integer_image` of people, (M, 15, 3) float32 true joints in
    the coordinates of the image's cube, and (M, 4) float32 the cube's centre in the camera frame and its half size, metres.
    """
    side = batches.model.crop_px
    images = np.empty((count, side, side), np.int16)
    joints_uvd, cubes_m = np.empty((count, NUM_JOINTS, 3), np.float32), np.empty((count, 4), np.float32)
    filled = 0
    with tqdm(total=count, desc=what, unit="image") as bar:
        for batch in batch_loader(batches, 0, -(-count // BATCH), workers):
            added = min(len(batch.crop), count - filled)
            crops, targets, cubes = (np.asarray(part)[:added] for part in batch[:3])
            rows = slice(filled, filled + added)
            images[rows], joints_uvd[rows], cubes_m[rows] = integer_image(crops[:, 0]), targets, cubes
            filled += added
            bar.update(added)
    return images, joints_uvd, cubes_m


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
    position = pixel_positions(joint_uvd[image] + offset, images.shape[1])
    return Samples(images, image, position, direction.astype(np.float32))


def pixel_positions(position_uvd: np.ndarray, side: int) -> np.ndarray:
    """Converts (N, 3) u, v, d to (N, 3) int32 row, column and depth in UNITS, as the walks do."""
    u, v, d = position_uvd.T
    half = side / 2
    return np.stack([np.floor((v + 1) * half), np.floor((u + 1) * half), np.rint(d * UNITS)], axis=1).astype(np.int32)


def judge(model: TreeWalkModel, images: np.ndarray, joints_uvd: np.ndarray, cubes_m: np.ndarray) -> dict:
    """The metrics of a model on `collect_images`."""
    errors_m = np.empty((len(images), NUM_JOINTS))
    for number, (image, true_uvd, (*centre_m, half_size_m)) in enumerate(zip(images, joints_uvd, cubes_m, strict=True)):
        cube = Cube(np.array(centre_m, np.float32), half_size_m)
        found_m = cube.to_metres(model.joints_uvd(image, number))
        errors_m[number] = np.linalg.norm(found_m - cube.to_metres(true_uvd), axis=-1)
    within = errors_m < WITHIN_M
    return {
        "mean_error_cm": 100 * float(errors_m.mean()),
        "within_10cm": float(within.mean()),
        "within_10cm_per_joint": dict(zip(JOINT_NAMES, within.mean(axis=0).tolist(), strict=True)),
    }
