"""Generates whole sets of samples: missing shards in parallel, then a summary and a contact sheet."""

import json
from functools import partial
from pathlib import Path

import numpy as np

from kpopnet.camera import MM_PER_METRE
from kpopnet.data.shards import ShardedSet, open_shard, shard_path
from kpopnet.runtime.atomic_write import atomic_path
from kpopnet.viz.drawing import TRUE, depth_rgb, draw_skeleton, enlarged, probability_rgb, save_png, sheet, with_captions
from synth.resumable import make_missing, remove_unfinished
from synth.samples.observe import Background, freeze
from synth.samples.writer import FreezeConfig, SetConfig, is_finished, write_shard

TILE_PX = 240


def generate(config: SetConfig, folder: Path, shards: range, processes: int) -> None:
    """Makes those of the set's shards that are missing.

    Raises:
        InputError: the folder holds another set, or a worker process died; finished shards stay.
    """
    make, finished = partial(write_shard, config, folder), partial(is_finished, config, folder)
    make_missing(make, shards, finished, folder, "shard", "sample", lambda shard: len(range(*config.span(shard))), processes)


def finish(config: SetConfig, folder: Path, look: FreezeConfig) -> dict | None:
    """Writes set.json and contact_sheet.png once every shard is finished, and returns the summary; else returns None.

    The contact sheet shows a clean set through `look`.
    """
    if not all(is_finished(config, folder, shard) for shard in range(config.num_shards)):
        return None
    remove_unfinished(folder, ".shard_*.tmp")
    summary = {"samples": config.count, "shards": config.num_shards, "hash": config.hash}
    totals = {"refused_poses": 0, "refused_places": 0, "forced_samples": 0}
    for shard in range(config.num_shards):
        with open_shard(shard_path(folder, shard)) as file:
            for name in totals:
                totals[name] += int(file.attrs[name])
    summary |= totals | {"bytes": sum(path.stat().st_size for path in folder.glob("shard_*.h5"))}
    # Jobs that end at the same time may both write: each replaces the whole file.
    with atomic_path(folder / "set.json") as part:
        part.write_text(json.dumps(summary | {"config": json.loads(config.as_json())}, indent=1))
    save_png(folder / "contact_sheet.png", draw_contact_sheet(ShardedSet(folder), look, config.seed))
    return summary


def draw_contact_sheet(shards: ShardedSet, look: FreezeConfig, seed: int, count: int = 12) -> np.ndarray:
    """RGB contact sheet of `count` samples at even distances in the set.

    Each row: the rendered depth, the person's depth after sensor and extraction, its ridge probability, and the skeleton.
    """
    camera, shown = shards.camera, []
    for index in np.linspace(0, len(shards) - 1, min(count, len(shards))).astype(int).tolist():
        sample = shards[index]
        room = Background(*shards.room(index, sample.room))
        noisy_mm, ridge = sample.depth_mm, sample.ridge
        if shards.kind == "clean":
            rng = np.random.default_rng([seed, index])
            noisy_mm, ridge = freeze(sample, room, camera, look.sensor, look.extraction, look.ridge, rng)
        whole_m = np.where(sample.depth_mm > 0, sample.depth_mm, room.depth_mm) / np.float32(MM_PER_METRE)
        noisy_m = noisy_mm / np.float32(MM_PER_METRE)
        skeleton = enlarged(depth_rgb(noisy_m), TILE_PX)
        draw_skeleton(skeleton, sample.joints_camera_m, camera, TRUE)
        images = depth_rgb(whole_m), depth_rgb(noisy_m), probability_rgb(ridge / np.float32(255))
        tiles = [enlarged(image, TILE_PX) for image in images]
        caption = f"sample {index}, person {sample.body}, {sample.motion}"
        shown.append(with_captions(np.concatenate([*tiles, skeleton], axis=1), (caption,)))
    rows = [("", shown[k : k + 2]) for k in range(0, len(shown), 2)]
    title = f"simulated: depth, after {look.sensor.name}, ridge probability, true joints"
    return sheet(rows, (TRUE,), title)
