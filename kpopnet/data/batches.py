"""Batches of crops for a network, made from observations: the torch data set of training and validation.

The samples of a batch and their augmentation are pure functions of (seed, step), in any process. Therefore a resumed run
is exact, and the number of worker processes does not change the batches. (It changes the threads that are left to torch, where
`threads` does not set them, and with these the last digits of the weights.)
"""

import contextlib
import multiprocessing
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple, Protocol

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from kpopnet.camera import Camera
from kpopnet.data.cube import INPUTS, PLAIN_VIEW, Cube, View, check_crop_px, crop, crop_pixels, person_centre
from kpopnet.data.observation import Observation, ObservationSource
from kpopnet.errors import InputError, check_between
from kpopnet.ridge import RidgeConfig, ridge_probability
from kpopnet.runtime.cpu import keep_freed_memory
from kpopnet.runtime.parallel import end_with_parent
from kpopnet.skeleton import NUM_JOINTS

ORDER_STREAM, AUGMENT_STREAM, OCCLUDE_STREAM = 0x0DE5, 0xA063, 0x0CC1
"""Make these random draws independent of each other and of those of a source with the same seed."""

MAX_EMPTY_IN_A_ROW = 100


class CropSettings(Protocol):
    """The input that a network expects: see `kpopnet.networks.ModelConfig`, which lies above this room."""

    input: str
    crop_px: int
    half_size_m: float


@dataclass
class SmallCropsConfig:
    """Smaller crops in the first part of a training: they cost less, and show most of what there is to learn.

    Attributes:
        share: fraction of the steps that take them, below 1: the last steps take the network's own size.
        crop_px: their side in pixels, a multiple of 16.
    """

    share: float = 0.0
    crop_px: int = 64

    def __post_init__(self) -> None:
        check_between("training.small_crops.share", self.share, 0, 1)
        check_crop_px("training.small_crops.crop_px", self.crop_px)


@dataclass
class AugmentConfig:
    """Augmentation of training crops, in addition to the variation of the source.

    Attributes:
        mirror: probability of mirroring, with left and right swapped.
        rotation_deg: largest rotation about the optical axis in degrees, in either direction.
        any_rotation: probability of a rotation by any angle instead: people who lie, cameras that hang.
        scale: largest change of the cube's half size, as a fraction of it.
        jitter_m: largest shift of the cube's centre along each axis in metres.
        occluder: probability of a simulated occluder: an elliptic hole in the depth with half-axes of 5 to 15 cm.
        views: crops that a batch has of each observation, with one noise and occluder, each shifted, turned, scaled, mirrored
            for itself (Hoffer et al. 2020): a further one takes a tenth of the time that another observation takes.
    """

    mirror: float = 0.5
    rotation_deg: float = 30.0
    any_rotation: float = 0.0
    scale: float = 0.1
    jitter_m: float = 0.05
    occluder: float = 0.3
    views: int = 1

    def __post_init__(self) -> None:
        highest = {"mirror": 1, "rotation_deg": 180, "any_rotation": 1, "scale": 0.99, "jitter_m": 0.5, "occluder": 1}
        for name, high in highest.items():
            check_between(f"training.augment.{name}", getattr(self, name), 0, high)
        check_between("training.augment.views", self.views, 1, 64)


class Patches(NamedTuple):
    """What B crops of S x S of the depth of N observations are taken from, as arrays or tensors: a GPU takes them faster."""

    depth_m: torch.Tensor  # (M,) float32 pixels of the observations, one after another, row by row
    sizes: torch.Tensor  # (N, 2) int64 width and height of each
    # (B, 8) float64: the matrix and the point of `kpopnet.data.cube.crop_pixels`, the cube's centre's Z, and 1 / its half size
    warps: torch.Tensor
    crop_px: int  # S

    def crops(self, device: torch.device) -> torch.Tensor:
        """(B, 1, S, S) float32 on the device: what `kpopnet.data.cube.crop` makes of the depth of each."""
        pixels = self.sizes.prod(1)
        of_each = torch.column_stack([pixels.cumsum(0) - pixels, self.sizes]).repeat_interleave(
            len(self.warps) // len(pixels), 0
        )
        depth_m, of_each, warps = (one.to(device, non_blocking=True) for one in (self.depth_m, of_each, self.warps))
        starts, width, height = of_each.T[..., None, None]
        a, b, c, d, first_x, first_y, centre_z, per_half_size = warps.T[..., None, None]
        columns = torch.arange(self.crop_px, device=device, dtype=torch.float64)
        rows = columns[:, None]
        x, y = first_x + b * rows + 0.5 + a * columns, first_y + d * rows + 0.5 + c * columns
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        z = depth_m[torch.where(inside, starts + y.long() * width + x.long(), 0)]
        crops = ((z - centre_z.float()) * per_half_size.float()).clamp(-1, 1)
        return torch.where(inside & (z > 0), crops, 1)[:, None]


class Batch(NamedTuple):
    """B crops of C x S x S, float32, as arrays or tensors."""

    crop: torch.Tensor | Patches  # (B, C, S, S), or what they are taken from
    target: torch.Tensor  # (B, 15, 3) joints in cube units, in the crop's view
    cube_m: torch.Tensor  # (B, 4) the cube's centre in the camera frame and its half size, metres
    # (B, 15, 3) ground-truth joints minus the centre of the silhouette, metres, without augmentation of the view
    offset_m: torch.Tensor
    skipped: int  # number of observations with an empty silhouette, which were replaced


Order = Callable[[int], list[tuple[int, int]]]
"""The (index, epoch) pairs of the samples of a step's batch."""


@dataclass(frozen=True)
class ShuffledOrder:
    """Visits all samples once per epoch, in a new permutation each; a batch may contain samples of two epochs.

    Each of several processes takes an equal part of every batch; `batch_size` is the number of samples over all of them.
    """

    num_samples: int
    batch_size: int
    seed: int
    rank: int = 0
    processes: int = 1

    def __call__(self, step: int) -> list[tuple[int, int]]:
        part = self.batch_size // self.processes
        first = step * self.batch_size + self.rank * part
        positions = (divmod(position, self.num_samples) for position in range(first, first + part))
        return [(int(permutation(self.seed, epoch, self.num_samples)[row]), epoch) for epoch, row in positions]


@dataclass(frozen=True)
class EvenOrder:
    """A fixed selection of `count` evenly spaced samples of the set, as in epoch 0; the last batch may be smaller."""

    num_samples: int
    batch_size: int
    count: int

    def __call__(self, step: int) -> list[tuple[int, int]]:
        rows = range(step * self.batch_size, min((step + 1) * self.batch_size, self.count))
        return [(row * self.num_samples // self.count, 0) for row in rows]


@lru_cache(maxsize=2)
def permutation(seed: int, epoch: int, num_samples: int) -> np.ndarray:
    """The order in which an epoch visits the samples."""
    return np.random.default_rng([seed, ORDER_STREAM, epoch]).permutation(num_samples)


@dataclass(eq=False)
class CropBatches(Dataset):
    """`batches[step]` is the Batch of that step.

    An observation is occluded first; its centre, ridge image and crop are then computed from the depth that is left, as an
    estimator computes them (kpopnet.networks.estimator).

    An observation with an empty silhouette (kpopnet.data.cube.MIN_SILHOUETTE_PX) is replaced by the next one that is not empty,
    and counted in `Batch.skipped`.
    """

    source: ObservationSource  # observations
    model: CropSettings  # the input of the network
    order: Order  # the observations of each batch
    seed: int  # of the augmentation
    augment: AugmentConfig | None  # augmentation, None for plain crops (validation)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)  # of the ridge image, where the model takes one
    # the first step whose crops have the model's size, and the side in pixels of the crops before it
    small_crops: tuple[int, int] = (0, 0)
    patches: bool = False  # whether a batch has `Patches` instead of crops, which must be of depth alone

    def __getitem__(self, step: int) -> Batch:
        keys, px = self.order(step), self.crop_px(step)
        channels, views = INPUTS[self.model.input], 1 if self.augment is None else self.augment.views
        count = views * len(keys)
        depths_m, warps, skipped = [], np.empty((count, 8)), 0
        crops = np.empty((0 if self.patches else count, channels, px, px), np.float32)
        targets, offsets_m = (np.empty((count, NUM_JOINTS, 3), np.float32) for _ in range(2))
        cubes_m = np.empty((count, 4), np.float32)
        for first, (index, epoch) in enumerate(keys):
            index, observation, centre_m, empty = self._observe(index, epoch)
            skipped += empty
            plain = Cube(centre_m, self.model.half_size_m)
            ridge = ridge_probability(observation.depth_m, self.ridge) if channels > 1 else None
            rng = np.random.default_rng([self.seed, AUGMENT_STREAM, epoch, index])
            if self.patches:
                depths_m.append(observation.depth_m)
            for row in range(first * views, (first + 1) * views):
                cube, view = (plain, PLAIN_VIEW) if self.augment is None else draw_view(rng, plain, self.augment)
                offsets_m[row] = observation.joints_camera_m - centre_m
                if self.patches:
                    to_pixels = (one.ravel() for one in crop_pixels(observation.camera, cube, px, view))
                    warps[row] = np.concatenate([*to_pixels, [cube.centre_m[2], 1 / cube.half_size_m]])
                else:
                    crops[row] = crop(observation.depth_m, observation.camera, cube, px, ridge, view)
                targets[row] = view.joints(cube.to_uvd(observation.joints_camera_m))
                cubes_m[row] = (*cube.centre_m, cube.half_size_m)
        if self.patches:
            sizes = np.array([one.shape[::-1] for one in depths_m])
            crops = Patches(np.concatenate([one.ravel() for one in depths_m]), sizes, warps, px)
        return Batch(crops, targets, cubes_m, offsets_m, skipped)

    def crop_px(self, step: int) -> int:
        """The side of a step's crops in pixels."""
        until, small_px = self.small_crops
        return small_px if step < until else self.model.crop_px

    def sizes(self) -> set[int]:
        """The sides of all steps' crops in pixels."""
        return {self.crop_px(0), self.model.crop_px}

    def _observe(self, index: int, epoch: int) -> tuple[int, Observation, np.ndarray, int]:
        for empty in range(MAX_EMPTY_IN_A_ROW):
            observation = self._occluded(self.source.observe(index, epoch), index, epoch)
            centre_m = person_centre(observation.depth_m, observation.camera)
            if centre_m is not None:
                return index, observation, centre_m, empty
            index = (index + 1) % len(self.source)
        raise InputError(f"samples before {index}: {MAX_EMPTY_IN_A_ROW} empty silhouettes in a row; inspect the data")

    def _occluded(self, observation: Observation, index: int, epoch: int) -> Observation:
        """The observation, with the probability `augment.occluder` behind a simulated occluder."""
        rng = np.random.default_rng([self.seed, OCCLUDE_STREAM, epoch, index])
        if self.augment is None or rng.random() >= self.augment.occluder:
            return observation
        return replace(observation, depth_m=occlude(rng, observation.depth_m, observation.camera))


def draw_view(rng: np.random.Generator, cube: Cube, augment: AugmentConfig) -> tuple[Cube, View]:
    """Draws an augmented cube, shifted and scaled, and its view."""
    shift = rng.uniform(-augment.jitter_m, augment.jitter_m, 3).astype(np.float32)
    scale = 1 + rng.uniform(-augment.scale, augment.scale)
    rotation = np.deg2rad(rng.uniform(-augment.rotation_deg, augment.rotation_deg))
    mirrored = bool(rng.random() < augment.mirror)
    if augment.any_rotation and rng.random() < augment.any_rotation:
        rotation = rng.uniform(-np.pi, np.pi)
    return Cube(cube.centre_m + shift, cube.half_size_m * scale), View(rotation, mirrored)


def occlude(rng: np.random.Generator, depth_m: np.ndarray, camera: Camera) -> np.ndarray:
    """(H, W) depth in metres without an ellipse around a random pixel of the person, as human extraction leaves it.

    The half-axes are 5 to 15 cm at the depth of the ellipse's centre.
    """
    body = np.flatnonzero(depth_m)
    if not len(body):
        return depth_m
    row, column = divmod(int(body[int(rng.random() * len(body))]), depth_m.shape[1])
    axes_px = rng.uniform(0.05, 0.15, 2) * camera.fx / depth_m[row, column]
    hidden = np.zeros(depth_m.shape, np.uint8)
    cv2.ellipse(hidden, ((column, row), 2 * axes_px, rng.uniform(0, 180)), 1, thickness=-1)
    return np.where(hidden > 0, np.float32(0), depth_m)


def batch_loader(batches: CropBatches, start: int, stop: int, workers: int, pin_memory: bool = False) -> DataLoader:
    """Loads the batches of steps start..stop-1 in order, in `workers` processes, or in this process if 0."""
    # Not fork: it would copy locks held by threads of torch and TensorBoard. Spawn, whose workers abort with a message when a
    # run ends early, only where there is nothing else, as on Windows.
    method = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    return DataLoader(
        batches,
        batch_size=None,
        sampler=range(start, stop),
        num_workers=workers,
        worker_init_fn=_init_worker,
        multiprocessing_context=method if workers else None,
        prefetch_factor=4 if workers else None,
        pin_memory=pin_memory,
    )


def _init_worker(_: int) -> None:
    """Limits a worker to one thread and a low priority, below the training step; it ends when the training process ends."""
    end_with_parent()
    keep_freed_memory()
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
    with contextlib.suppress(AttributeError):  # where processes have no niceness
        os.nice(10)
