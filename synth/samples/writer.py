"""Makes sets of samples: the missing HDF5 shards (layout: `kpopnet.data.shards`), then a summary and a contact sheet.

Shards are independent: each can be written alone, in any order, on any machine.
"""

import dataclasses
import hashlib
import importlib.metadata
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from kpopnet.camera import MM_PER_METRE, Camera
from kpopnet.data.shards import FORMAT, VERSION, Sample, ShardedSet, open_shard, read_header, shard_path
from kpopnet.errors import InputError, check_between, check_seed
from kpopnet.runtime.atomic_write import atomic_hdf5, remove_unfinished, write_json
from kpopnet.skeleton import JOINT_NAMES
from kpopnet.viz.drawing import TRUE, depth_rgb, enlarged, probability_rgb, save_png, scene_tile, sheet, with_captions
from synth.body.asset import digest
from synth.motion import identity_of_recordings
from synth.resumable import differences, make_missing
from synth.samples.layers import silhouette_box
from synth.samples.observe import FreezeConfig, freeze
from synth.samples.placing import Site
from synth.samples.sampler import BLOCK, SampleConfig, Sampler

GENERATOR = 4
"""Version of the generator. Increase it with every change after which the same configuration gives different samples."""

TILE_PX = 240
TOTALS = ("refused_poses", "refused_places", "forced_samples")
PACKAGES = ("kpopnet", "mujoco", "numba", "numpy", "h5py")
MAX_SHARDS, MAX_SHARD_SIZE = 100_000, 100_000
"""Most shards in a set, whose names have five digits, and most samples in a shard, which is put together in memory."""


@dataclass(frozen=True)
class SetConfig:
    """One set: `count` samples of a split. No sample depends on `count`, so a set can grow."""

    sample: SampleConfig  # everything that a sample depends on besides seed, split and index
    seed: int
    split: str
    count: int
    shard_size: int
    freeze: FreezeConfig | None  # how the stored images of a frozen set are measured; None stores clean renders

    def __post_init__(self) -> None:
        check_between("shard_size", self.shard_size, 1, MAX_SHARD_SIZE)
        if not 0 <= self.count <= MAX_SHARDS * self.shard_size:
            raise InputError(
                f"splits.{self.split}={self.count}: expected 0 or more, and at most {MAX_SHARDS:,} shards "
                f"of shard_size={self.shard_size} samples"
            )
        check_seed("seed", self.seed)
        if self.sample.renderer == "auto":
            raise InputError("the renderer is part of a set's identity: resolve renderer=auto to gl or cpu first")

    @property
    def num_shards(self) -> int:
        return -(-self.count // self.shard_size)

    def span(self, shard: int) -> tuple[int, int]:
        """Index of the first sample of a shard, and of its last sample plus one."""
        return shard * self.shard_size, min((shard + 1) * self.shard_size, self.count)

    def as_json(self) -> str:
        """Everything that the samples depend on, as JSON: settings but `count`, versions, the body asset and BVH files."""
        described = {name: value for name, value in dataclasses.asdict(self).items() if name != "count"}
        children = described["sample"]["body"].pop("children")
        if children:  # sets of adults are known by the settings of before there were children
            described["sample"]["body"]["children"] = children
        described |= {"version": VERSION, "generator": GENERATOR, "body_asset": digest(children > 0)}
        return json.dumps(described | identity_of_recordings(self.sample.motion), sort_keys=True)

    @property
    def hash(self) -> str:
        """Twelve hexadecimal digits of the SHA-256 of `as_json`.

        They differ whenever a sample could differ, but for the content of recordings: of a motion pack only the path is in
        them, of BVH files path, names and sizes.
        """
        return hashlib.sha256(self.as_json().encode()).hexdigest()[:12]


def generate(config: SetConfig, folder: Path, shards: range, processes: int) -> None:
    """Makes missing shards; raises InputError if the folder holds another set, or a worker process died."""
    make, finished = partial(write_shard, config, folder), partial(is_finished, config, folder)
    make_missing(make, shards, finished, folder, "shard", "sample", lambda shard: len(range(*config.span(shard))), processes)


def finish(config: SetConfig, folder: Path, look: FreezeConfig) -> dict | None:
    """Writes set.json and contact_sheet.png once every shard is finished, and returns the summary; else returns None.

    The contact sheet shows a clean set through `look`.
    """
    if not all(is_finished(config, folder, shard) for shard in range(config.num_shards)):
        return None
    remove_unfinished(folder, ".shard_*.tmp")
    stored = ShardedSet(folder)
    summary = {"samples": len(stored), "shards": len(stored.paths), "hash": config.hash}
    totals = dict.fromkeys(TOTALS, 0)
    for path in stored.paths:
        with open_shard(path) as file:
            for name in totals:
                totals[name] += int(file.attrs[name])
    summary |= totals | {"bytes": sum(path.stat().st_size for path in stored.paths)}
    # Jobs that end at the same time may both write: each replaces the whole file.
    write_json(folder / "set.json", summary | {"config": json.loads(config.as_json())})
    save_png(folder / "contact_sheet.png", draw_contact_sheet(stored, look, config.seed))
    return summary


def is_finished(config: SetConfig, folder: Path, shard: int) -> bool:
    """Whether the folder already holds this shard, complete; raises InputError if it is one of another set."""
    path = shard_path(folder, shard)
    if not path.exists():
        return False
    header = read_header(path)
    if (header.config_hash, header.split) != (config.hash, config.split):
        other = differences(header.config, json.loads(config.as_json()))
        raise InputError(f"{path}: belongs to another set ({other}); choose another out=, or delete that folder")
    start, stop = config.span(shard)
    return header.start == start and header.stop >= stop  # a larger set stays whole where a part of it is asked for


def write_shard(config: SetConfig, folder: Path, shard: int, on_sample: Callable[[], None] = lambda: None) -> None:
    """Writes one shard, whole or not at all; calls `on_sample` after each sample."""
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
    rooms: dict[int, Site] = {}
    totals = dict.fromkeys(TOTALS, 0)
    images, ridges = [], []
    for row, rendered in enumerate(sampler.samples(start, stop)):
        room = rooms.setdefault(rendered.sample.room, sampler.room(rendered.sample.room))
        sample = dataclasses.replace(rendered.sample, room=rendered.sample.room - sampler.room_of(start))
        if config.freeze:
            sample, ridge_image = _frozen(sample, room, camera, config, start + row)
            ridges.append(ridge_image)
        images.append(sample.depth_mm)
        if len(images) == BLOCK or row == count - 1:  # the cost of a write hardly depends on its size
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
    attributes = {
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
        "camera": dataclasses.astuple(camera),
        "joint_names": list(JOINT_NAMES),
        "packages": json.dumps({name: _version(name) for name in PACKAGES}),
    }
    file.attrs.update(attributes | totals)


def _version(package: str) -> str | None:
    """The version of a package; None for one that is used from a copied checkout."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _frozen(sample: Sample, room: Site, camera: Camera, config: SetConfig, index: int) -> tuple[Sample, np.ndarray]:
    """The sample with its measured and segmented depth, and its ridge image (H, W) uint8."""
    rng = np.random.default_rng([config.seed, *config.split.encode(), index])
    depth_mm, ridge = freeze(sample, (room.depth_mm, room.floor), camera, config.freeze, rng)
    return dataclasses.replace(sample, depth_mm=depth_mm, box=silhouette_box(depth_mm)), ridge


def draw_contact_sheet(shards: ShardedSet, look: FreezeConfig, seed: int, count: int = 12) -> np.ndarray:
    """RGB contact sheet of `count` samples at even distances in the set.

    Each row: the rendered depth, the person's depth after sensor and extraction, its ridge probability, and the skeleton.
    """
    camera, shown = shards.camera, []
    for index in np.linspace(0, len(shards) - 1, min(count, len(shards))).astype(int).tolist():
        sample = shards[index]
        room = shards.room(index, sample.room)
        noisy_mm, ridge = sample.depth_mm, sample.ridge
        if shards.kind == "clean":
            rng = np.random.default_rng([seed, index])
            noisy_mm, ridge = freeze(sample, room, camera, look, rng)
        whole_m = np.where(sample.depth_mm > 0, sample.depth_mm, room[0]) / np.float32(MM_PER_METRE)
        noisy_m = noisy_mm / np.float32(MM_PER_METRE)
        skeleton = scene_tile(noisy_m, camera, ((sample.joints_camera_m, TRUE),), TILE_PX)
        images = depth_rgb(whole_m), depth_rgb(noisy_m), probability_rgb(ridge / np.float32(255))
        tiles = [enlarged(image, TILE_PX) for image in images]
        caption = f"sample {index}, person {sample.body}, {sample.motion}"
        shown.append(with_captions(np.concatenate([*tiles, skeleton], axis=1), (caption,)))
    rows = [("", shown[k : k + 2]) for k in range(0, len(shown), 2)]
    title = f"simulated: depth, after {look.sensor.name}, ridge probability, true joints"
    return sheet(rows, (TRUE,), title)
