"""Writes sets of samples as shards (the layout is `kpopnet.shards`): any shard alone, in any order, on any machine.

A shard is written beside its name and renamed when it is whole, so a file of that name is never torn, and a run that
was killed goes on by making only what is missing.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.replacing import replacing
from kpopnet.ridge import RidgeConfig
from kpopnet.shards import FORMAT, VERSION, Sample, read_header, shard_path
from kpopnet.skeleton import JOINT_NAMES, NUM_JOINTS
from synth.body import ASSET
from synth.observe import ExtractionConfig, freeze
from synth.observe import Room as ObservedRoom
from synth.sample import BLOCK, RenderedRoom, SampleConfig, Sampler, silhouette_box
from synth.sensor import SensorConfig

GENERATOR = 1
"""Raised with every change after which the same configuration gives other samples."""

PACKAGES = ("kpopnet", "mujoco", "numba", "numpy", "h5py")


@dataclass(frozen=True)
class FreezeConfig:
    """How a frozen set's samples are measured and cut out, once and for all."""

    sensor: SensorConfig
    extraction: ExtractionConfig
    ridge: RidgeConfig


@dataclass(frozen=True)
class SetConfig:
    """One set: `count` samples of a split. What a sample is does not depend on `count`, so a set can grow."""

    sample: SampleConfig
    seed: int
    split: str
    count: int
    shard_size: int
    freeze: FreezeConfig | None

    def __post_init__(self) -> None:
        if self.count < 0 or self.shard_size < 1:
            raise InputError(f"a set needs count >= 0 and shard_size >= 1, not {self.count} and {self.shard_size}")
        if self.sample.renderer == "auto":
            raise InputError("which renderer draws a set is part of what it is: resolve renderer=auto first")

    @property
    def num_shards(self) -> int:
        return -(-self.count // self.shard_size)

    def span(self, shard: int) -> tuple[int, int]:
        """The first sample of a shard and the one after its last."""
        return shard * self.shard_size, min((shard + 1) * self.shard_size, self.count)

    def as_json(self) -> str:
        described = {name: value for name, value in dataclasses.asdict(self).items() if name != "count"}
        body = hashlib.sha256(ASSET.read_bytes()).hexdigest()[:12]
        return json.dumps(described | {"version": VERSION, "generator": GENERATOR, "body_asset": body}, sort_keys=True)

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits that differ when any sample might."""
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]


def is_finished(config: SetConfig, folder: Path, shard: int) -> bool:
    """Whether this very shard lies there whole.

    Raises:
        InputError: another set's shard lies there.
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
    """Makes one shard. `on_sample` is called after every sample."""
    path = shard_path(folder, shard)
    path.parent.mkdir(parents=True, exist_ok=True)
    sampler = _sampler(config)
    with replacing(path) as part, h5py.File(part, "w") as file:
        _fill(file, config, shard, sampler, on_sample)


_samplers: dict[tuple, Sampler] = {}


def _sampler(config: SetConfig) -> Sampler:
    """One compiled scene a process and set."""
    key = (config.hash, config.split)
    if key not in _samplers:
        for sampler in _samplers.values():
            sampler.close()
        _samplers.clear()
        _samplers[key] = Sampler(config.sample, config.seed, config.split)
    return _samplers[key]


def _fill(file: h5py.File, config: SetConfig, shard: int, sampler: Sampler, on_sample: Callable[[], None]) -> None:
    start, stop = config.span(shard)
    count, camera = stop - start, sampler.scene.camera
    size = (camera.height, camera.width)
    image = {"chunks": (1, *size), "compression": "gzip", "compression_opts": 1, "shuffle": True}
    depth_mm = file.create_dataset("depth_mm", (count, *size), "u2", **image)
    ridge = file.create_dataset("ridge", (count, *size), "u1", **image) if config.freeze else None
    columns = {
        "box": np.zeros((count, 4), np.int16),
        "joints_m": np.zeros((count, NUM_JOINTS, 3), np.float32),
        "visible": np.zeros((count, NUM_JOINTS), bool),
        "body": np.zeros(count, np.int64),
        "motion": np.zeros(count, "S48"),
        "yaw": np.zeros(count, np.float32),
        "room": np.zeros(count, np.int16),
    }
    rooms: dict[int, RenderedRoom] = {}
    refused = forced = 0
    pictures, ridges = [], []  # written some at a time: a write costs as much for one as for many
    for row, rendered in enumerate(sampler.samples(start, stop)):
        sample = rendered.sample
        room = rooms.setdefault(sample.room - sampler.room_of(start), sampler.room(sample.room))
        if config.freeze:
            sample, its_ridge = _frozen(sample, room, camera, config, start + row)
            ridges.append(its_ridge)
        pictures.append(sample.depth_mm)
        if len(pictures) == BLOCK or row == count - 1:
            rows = slice(row + 1 - len(pictures), row + 1)
            depth_mm[rows] = np.stack(pictures)
            if config.freeze:
                ridge[rows] = np.stack(ridges)
            pictures, ridges = [], []
        columns["box"][row] = sample.box
        columns["joints_m"][row] = sample.joints_camera_m
        columns["visible"][row] = sample.visible
        columns["body"][row] = sample.body
        columns["motion"][row] = sample.motion.encode()[:48].decode(errors="ignore").encode()
        columns["yaw"][row] = sample.yaw_rad
        columns["room"][row] = sample.room - sampler.room_of(start)
        refused += rendered.refused
        forced += rendered.forced
        on_sample()
    for name, values in columns.items():
        file.create_dataset(name, data=values)
    file.create_dataset("room_mm", data=np.stack([rooms[k].depth_mm for k in sorted(rooms)]), **image)
    file.create_dataset("floor", data=np.stack([rooms[k].floor for k in sorted(rooms)]))
    file.attrs.update(
        format=FORMAT,
        version=VERSION,
        kind="frozen" if config.freeze else "clean",
        config=config.as_json(),
        config_hash=config.hash,
        seed=config.seed,
        split=config.split,
        shard=shard,
        start=start,
        stop=stop,
        camera=[camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height],
        joint_names=list(JOINT_NAMES),
        packages=json.dumps({name: importlib.metadata.version(name) for name in PACKAGES}),
        refused_poses=refused,
        forced_samples=forced,
    )


def _frozen(
    sample: Sample, room: RenderedRoom, camera: Camera, config: SetConfig, index: int
) -> tuple[Sample, np.ndarray]:
    """The sample as measured and cut out, once and for all, and its ridge (H, W) uint8."""
    how = config.freeze
    rng = np.random.default_rng([config.seed, *config.split.encode(), index])
    depth_mm, ridge = freeze(
        sample, ObservedRoom(room.depth_mm, room.floor), camera, how.sensor, how.extraction, how.ridge, rng
    )
    return dataclasses.replace(sample, depth_mm=depth_mm, box=silhouette_box(depth_mm)), ridge
