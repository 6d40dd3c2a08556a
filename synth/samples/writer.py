"""Writes sets of samples as HDF5 shards (layout: `kpopnet.data.shards`).

Shards are independent: each can be written alone, in any order, on any machine. A shard is written to a temporary file
and renamed when it is complete, so a file under the final name is never partial. A run that was killed continues by
writing only the missing shards.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.data.shards import FORMAT, VERSION, Sample, read_header, shard_path
from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.ridge import RidgeConfig
from kpopnet.runtime.atomic_write import atomic_hdf5
from kpopnet.skeleton import JOINT_NAMES
from synth.body.asset import ASSET
from synth.samples.layers import silhouette_box
from synth.samples.observe import Background, ExtractionConfig, freeze
from synth.samples.sampler import BLOCK, RenderedRoom, SampleConfig, Sampler
from synth.sensor.model import SensorConfig

GENERATOR = 2
"""Version of the generator. Increase it with every change after which the same configuration gives different samples."""

PACKAGES = ("kpopnet", "mujoco", "numba", "numpy", "h5py")

MAX_SHARDS, MAX_SHARD_SIZE = 100_000, 100_000
"""Most shards in a set, whose names have five digits, and most samples in a shard, which is put together in memory."""


@dataclass(frozen=True)
class FreezeConfig:
    """How the samples of a frozen set are measured and segmented before they are stored.

    Attributes:
        sensor: the depth-camera model.
        extraction: the failures of the person segmentation.
        ridge: parameters of the ridge image.
    """

    sensor: SensorConfig
    extraction: ExtractionConfig
    ridge: RidgeConfig


@dataclass(frozen=True)
class SetConfig:
    """One set: `count` samples of a split. No sample depends on `count`, so a set can grow.

    Attributes:
        sample: everything that a sample depends on besides seed, split and index.
        seed: seed of the set.
        split: train, validation or test.
        count: number of samples.
        shard_size: samples per shard.
        freeze: how the stored images of a frozen set are measured; None stores clean renders.
    """

    sample: SampleConfig
    seed: int
    split: str
    count: int
    shard_size: int
    freeze: FreezeConfig | None

    def __post_init__(self) -> None:
        check_between("shard_size", self.shard_size, 1, MAX_SHARD_SIZE)
        if not 0 <= self.count <= MAX_SHARDS * self.shard_size:
            raise InputError(
                f"splits.{self.split}={self.count}: expected at most {MAX_SHARDS:,} shards of "
                f"shard_size={self.shard_size} samples"
            )
        check_seed("seed", self.seed)
        if self.sample.renderer == "auto":
            raise InputError("the renderer is part of a set's identity: resolve renderer=auto to gl or cpu first")

    @property
    def num_shards(self) -> int:
        """Number of shards."""
        return -(-self.count // self.shard_size)

    def span(self, shard: int) -> tuple[int, int]:
        """Index of the first sample of a shard, and of its last sample plus one."""
        return shard * self.shard_size, min((shard + 1) * self.shard_size, self.count)

    def as_json(self) -> str:
        """Everything that the samples depend on, as JSON: the settings but `count`, the versions and the body asset."""
        described = {name: value for name, value in dataclasses.asdict(self).items() if name != "count"}
        body = hashlib.sha256(ASSET.read_bytes()).hexdigest()[:12]
        return json.dumps(described | {"version": VERSION, "generator": GENERATOR, "body_asset": body}, sort_keys=True)

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits of the SHA-256 of `as_json`. They differ whenever a sample could differ."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]


def is_finished(config: SetConfig, folder: Path, shard: int) -> bool:
    """Whether the folder already holds this shard, complete.

    Raises:
        InputError: the file belongs to another set.
    """
    path = shard_path(folder, shard)
    if not path.exists():
        return False
    header = read_header(path)
    if (header.config_hash, header.split) != (config.hash, config.split):
        raise InputError(
            f"{path}: belongs to another set (made with other settings, {header.config_hash} against {config.hash}); "
            "choose another out=, or delete that folder"
        )
    return (header.start, header.stop) == config.span(shard)


def write_shard(config: SetConfig, folder: Path, shard: int, on_sample: Callable[[], None] = lambda: None) -> None:
    """Writes one shard. `on_sample` is called after every sample."""
    path = shard_path(folder, shard)
    path.parent.mkdir(parents=True, exist_ok=True)
    sampler = _sampler(config)
    with atomic_hdf5(path) as file:
        _fill(file, config, shard, sampler, on_sample)


_samplers: dict[tuple, Sampler] = {}


def _sampler(config: SetConfig) -> Sampler:
    """The sampler of a set. Each process keeps the sampler (one compiled scene) of the last set only."""
    key = (config.hash, config.split)
    if key not in _samplers:
        while _samplers:
            _samplers.popitem()[1].close()
        _samplers[key] = Sampler(config.sample, config.seed, config.split)
    return _samplers[key]


COLUMNS = {
    "box": (np.int16, lambda sample: sample.box),
    "joints_m": (np.float32, lambda sample: sample.joints_camera_m),
    "visible": (bool, lambda sample: sample.visible),
    "body": (np.int64, lambda sample: sample.body),
    "motion": ("S48", lambda sample: sample.motion.encode()[:48].decode(errors="ignore").encode()),
    "yaw": (np.float32, lambda sample: sample.yaw_rad),
    "room": (np.int32, lambda sample: sample.room),
}
"""Type and value of each label of a sample, by the name of its dataset; rooms are numbered from the shard's first."""


def _fill(file: h5py.File, config: SetConfig, shard: int, sampler: Sampler, on_sample: Callable[[], None]) -> None:
    """Writes the samples, rooms and attributes of a shard into an open file."""
    start, stop = config.span(shard)
    count, camera = stop - start, sampler.scene.camera
    size = (camera.height, camera.width)
    image = {"chunks": (1, *size), "compression": "gzip", "compression_opts": 1, "shuffle": True}
    depth_mm = file.create_dataset("depth_mm", (count, *size), "u2", **image)
    ridge = file.create_dataset("ridge", (count, *size), "u1", **image) if config.freeze else None
    labels: dict[str, list] = {name: [] for name in COLUMNS}
    rooms: dict[int, RenderedRoom] = {}
    totals = {"refused_poses": 0, "refused_places": 0, "forced_samples": 0}
    images, ridges = [], []  # written in blocks: the cost of a write hardly depends on its size
    for row, rendered in enumerate(sampler.samples(start, stop)):
        room = rooms.setdefault(rendered.sample.room, sampler.room(rendered.sample.room))
        sample = dataclasses.replace(rendered.sample, room=rendered.sample.room - sampler.room_of(start))
        if config.freeze:
            sample, ridge_image = _frozen(sample, room, camera, config, start + row)
            ridges.append(ridge_image)
        images.append(sample.depth_mm)
        if len(images) == BLOCK or row == count - 1:
            rows = slice(row + 1 - len(images), row + 1)
            depth_mm[rows] = np.stack(images)
            if config.freeze:
                ridge[rows] = np.stack(ridges)
            images, ridges = [], []
        for name, (_, value) in COLUMNS.items():
            labels[name].append(value(sample))
        for name, more in zip(totals, (rendered.rejected, rendered.refused_places, rendered.forced), strict=True):
            totals[name] += more
        on_sample()
    for name, (kind, _) in COLUMNS.items():
        file.create_dataset(name, data=np.array(labels[name], kind))
    file.create_dataset("room_mm", data=np.stack([rooms[number].depth_mm for number in sorted(rooms)]), **image)
    file.create_dataset("floor", data=np.stack([rooms[number].floor for number in sorted(rooms)]))
    file.attrs.update(_attributes(config, shard, camera) | totals)


def _attributes(config: SetConfig, shard: int, camera: Camera) -> dict[str, Any]:
    """The HDF5 attributes of a shard, but for the counts of what was rejected and forced."""
    start, stop = config.span(shard)
    return {
        "format": FORMAT,
        "version": VERSION,
        "kind": "frozen" if config.freeze else "clean",
        "config": config.as_json(),
        "config_hash": config.hash,
        "seed": config.seed,
        "split": config.split,
        "shard": shard,
        "start": start,
        "stop": stop,
        "camera": [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height],
        "joint_names": list(JOINT_NAMES),
        "packages": json.dumps({name: importlib.metadata.version(name) for name in PACKAGES}),
    }


def _frozen(sample: Sample, room: RenderedRoom, camera: Camera, config: SetConfig, index: int) -> tuple[Sample, np.ndarray]:
    """The sample with its measured and segmented depth, and its ridge image (H, W) uint8."""
    settings = config.freeze
    rng = np.random.default_rng([config.seed, *config.split.encode(), index])
    background = Background(room.depth_mm, room.floor)
    depth_mm, ridge = freeze(sample, background, camera, settings.sensor, settings.extraction, settings.ridge, rng)
    return dataclasses.replace(sample, depth_mm=depth_mm, box=silhouette_box(depth_mm)), ridge
