"""Makes whole sets: shards spread over processes, a progress bar, and pictures to look at."""

import json
import multiprocessing
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from kpopnet.camera import MM_PER_METRE
from kpopnet.drawing import (
    TRUE,
    depth_picture,
    draw_skeleton,
    enlarged,
    probability_picture,
    save_png,
    sheet,
    with_captions,
)
from kpopnet.errors import InputError
from kpopnet.replacing import replacing
from kpopnet.shards import ShardedSet, open_shard, shard_path
from synth.observe import Room, freeze
from synth.shards import FreezeConfig, SetConfig, is_finished, write_shard

POLL_S = 0.2
TILE_PX = 240


def generate(config: SetConfig, folder: Path, shards: range, processes: int) -> None:
    """Makes those of the set's shards that are not there yet.

    Raises:
        InputError: the folder holds another set, or a process died; what is finished stays.
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = [shard for shard in shards if not is_finished(config, folder, shard)]
    spans = [config.span(shard) for shard in missing]
    total = sum(stop - start for start, stop in spans)
    if len(missing) < len(shards):
        print(f"{folder}: {len(shards) - len(missing)} of {len(shards)} shards are there already")
    with progress_bar(total, "sample", config.split) as bar:
        in_processes(write_shard, [(config, folder, shard) for shard in missing], folder, processes, bar)


def progress_bar(total: int, unit: str, what: str) -> tqdm:
    """Where no one watches, in a log, a line now and then."""
    return tqdm(total=total, unit=unit, desc=what, smoothing=0.05, mininterval=0.2 if sys.stderr.isatty() else 15.0)


def in_processes(write: Callable, jobs: list[tuple], folder: Path, processes: int, bar: tqdm) -> None:
    """Calls write(*job, on_progress) for every job; the bar moves with every on_progress().

    Several jobs are spread over processes of their own, unless one process is all there is to be.

    Raises:
        InputError: a process died; what is finished stays in the folder.
    """
    if processes == 1 or len(jobs) <= 1:
        for job in jobs:
            write(*job, lambda: bar.update())
        return
    # Spawned, not forked: a forked child would inherit threads and GL state half-way through.
    context = multiprocessing.get_context("spawn")
    done = context.Value("q", 0)
    pool = ProcessPoolExecutor(min(processes, len(jobs)), context, initializer=_start_worker, initargs=(done,))
    try:
        waiting = {pool.submit(_write_counted, write, job) for job in jobs}
        while waiting:
            finished, waiting = wait(waiting, POLL_S, FIRST_COMPLETED)
            bar.update(done.value - bar.n)
            for future in finished:
                future.result()
    except BrokenProcessPool as error:
        raise InputError(
            f"{folder}: a process died (out of memory, or killed); finished shards are kept: run the same command again"
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


_done = None


def _start_worker(done) -> None:
    global _done
    _done = done
    cv2.setNumThreads(1)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A worker whose parent was killed would finish the queue and then wait for ever."""
    multiprocessing.parent_process().join()
    os._exit(1)


def _write_counted(write: Callable, job: tuple) -> None:
    write(*job, _count)


def _count() -> None:
    with _done.get_lock():
        _done.value += 1


def finish(config: SetConfig, folder: Path, look: FreezeConfig) -> dict | None:
    """Once every shard is there: writes set.json and contact_sheet.png, and returns the summary, else None.

    `look` is the sensor through which a clean set's pictures are shown.
    """
    if not all(is_finished(config, folder, shard) for shard in range(config.num_shards)):
        return None
    for torn in folder.glob(".shard_*.tmp"):
        torn.unlink(missing_ok=True)
    summary = {"samples": config.count, "shards": config.num_shards, "hash": config.hash}
    totals = {"refused_poses": 0, "forced_samples": 0}
    for shard in range(config.num_shards):
        with open_shard(shard_path(folder, shard)) as file:
            for name in totals:
                totals[name] += int(file.attrs[name])
    summary |= totals | {"bytes": sum(path.stat().st_size for path in folder.glob("shard_*.h5"))}
    # Jobs that end together may both get here: each replaces the whole file.
    with replacing(folder / "set.json") as part:
        part.write_text(json.dumps(summary | {"config": json.loads(config.as_json())}, indent=1))
    save_png(folder / "contact_sheet.png", draw_contact_sheet(ShardedSet(folder), look, config.seed))
    return summary


def draw_contact_sheet(shards: ShardedSet, look: FreezeConfig, seed: int, count: int = 12) -> np.ndarray:
    """RGB picture of samples spread over the set.

    Each row: the whole depth, what the sensor and the extraction leave of it, its ridge, and the skeleton.
    """
    camera, shown = shards.camera, []
    for index in np.linspace(0, len(shards) - 1, min(count, len(shards))).astype(int).tolist():
        sample = shards[index]
        room = Room(*shards.room(index, sample.room))
        noisy_mm, ridge = sample.depth_mm, sample.ridge
        if shards.kind == "clean":
            rng = np.random.default_rng([seed, index])
            noisy_mm, ridge = freeze(sample, room, camera, look.sensor, look.extraction, look.ridge, rng)
        whole_m = np.where(sample.depth_mm > 0, sample.depth_mm, room.depth_mm) / np.float32(MM_PER_METRE)
        noisy_m = noisy_mm / np.float32(MM_PER_METRE)
        skeleton = enlarged(depth_picture(noisy_m), TILE_PX)
        draw_skeleton(skeleton, sample.joints_camera_m, camera, TRUE)
        pictures = depth_picture(whole_m), depth_picture(noisy_m), probability_picture(ridge / np.float32(255))
        tiles = [enlarged(picture, TILE_PX) for picture in pictures]
        caption = f"sample {index}, person {sample.body}, {sample.motion}"
        shown.append(with_captions(np.concatenate([*tiles, skeleton], axis=1), (caption,)))
    rows = [("", shown[k : k + 2]) for k in range(0, len(shown), 2)]
    title = f"simulated: depth, through {look.sensor.name}, ridge probability, true joints"
    return sheet(rows, (TRUE,), title)
