"""What a training sample costs, what training loses to preparing its data, and how much memory it takes."""

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from timeit import repeat

import numpy as np

from kpopnet.data.batches import AugmentConfig, CropBatches, ShuffledOrder, batch_loader
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.training.distributed import try_bfloat16
from kpopnet.training.loop import Run, TrainingConfig, join_processes, set_up_torch
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SensorConfig
from tests.speed.common import Figures, generated_set

ROUNDS, STEPS, SAMPLES = 5, 12, 512
PREPARED = 64
SHARDS, PER_SHARD, MEMORY_STEPS, POLL_S = 60, 20, 40, 0.25


def measure() -> Figures:
    figures = _preparing() | _steps()
    with contextlib.suppress(InputError):  # a processor that cannot
        try_bfloat16()
        figures |= {f"{name}_bfloat16": figure for name, figure in _steps(bfloat16=True).items()}
    return figures | _memory()


def _preparing() -> Figures:
    """Making training samples of stored ones: Kinect v1 at 320x240, one core; medians over rounds of the same samples."""
    with tempfile.TemporaryDirectory() as folder:
        shards = generated_set(Path(folder), PREPARED)

        def prepared_ms(name: str) -> float:
            def prepare() -> None:
                observer = Observer(shards, SensorConfig(), ExtractionConfig(), seed=0)
                CropBatches(observer, ModelConfig(input=name), ShuffledOrder(PREPARED, PREPARED, 0), 0, AugmentConfig())[0]

            prepare()
            return 1000 * median(repeat(prepare, number=1, repeat=9)) / PREPARED

        against = f"read, noise, cut-out, ridge, augmented crop; {prepared_ms('depth'):.2f} without ridge"
        return {"train.sample_ms": (prepared_ms("depth_ridge"), "ms a sample", against)}


def _steps(bfloat16: bool = False) -> Figures:
    """The default network on the CPU, steps on one and the same batch in turn with steps on fresh ones."""
    threads, model, config = set_up_torch(0, workers=1), ModelConfig(), TrainingConfig(bfloat16=bfloat16)
    with tempfile.TemporaryDirectory() as folder, join_processes("cpu") as processes:
        source = Observer(generated_set(Path(folder), SAMPLES), SensorConfig(), ExtractionConfig(), seed=0)
        batches = CropBatches(source, model, ShuffledOrder(SAMPLES, config.batch_size, 0), 0, config.augment)
        run = Run(config, model, 0, processes)
        same = next(iter(batch_loader(batches, 0, 1, workers=0)))
        fresh, repeated = [], []
        for _ in range(ROUNDS):
            # The worker prepares ahead; steps count from where its queue has run out or settled.
            loader = iter(batch_loader(batches, run.step, run.step + 3 * STEPS, workers=1))
            fresh += _seconds(run, (next(loader) for _ in range(2 * STEPS)))[STEPS:]
            del loader
            repeated += _seconds(run, (same for _ in range(STEPS + 2)))[2:]
    with_data, without = float(np.mean(fresh)), float(np.mean(repeated))
    machine = f"dense network at {model.crop_px} px, {threads} threads of {os.cpu_count()} cores"
    return {
        "train.data_loss_percent": (100 * (1 - without / with_data), "%", "one data worker, no ridge"),
        "train.samples_per_second": (config.batch_size / with_data, "1/s", f"with data; {machine}"),
    }


def _seconds(run: Run, batches) -> list[float]:
    """Of each step, the waiting for its batch included."""
    times = [time.perf_counter()]
    for batch in batches:
        run.update(batch)
        times.append(time.perf_counter())
    return np.diff(times).tolist()


def _memory() -> Figures:
    """train.py as it is, on more shards than a small set has; the most that all its processes hold together (Linux)."""
    if not Path("/proc/self/smaps_rollup").exists():
        return {}
    with tempfile.TemporaryDirectory() as folder:
        generated_set(Path(folder, "set"), PER_SHARD, SHARDS, "poses")
        generated_set(Path(folder, "validation"), PER_SHARD, SHARDS, "poses", "validation")
        command = [sys.executable, "train.py", f"data.train={folder}/set", f"data.validation={folder}/validation"]
        command += [f"training.steps={MEMORY_STEPS}", f"hydra.run.dir={folder}/run", "device=cpu"]
        training = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        most_kb = 0
        while training.poll() is None:
            most_kb = max(most_kb, _held_kb(training.pid))
            time.sleep(POLL_S)
    if training.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {training.returncode}")
    against = f"{SHARDS} shards, one data worker, {SHARDS * PER_SHARD} validation crops"
    return {"train.memory_mb": (most_kb / 1024, "MB, all processes", against)}


def _held_kb(group: int) -> int:
    """The memory of all processes of a group, what they share counted once."""
    held = 0
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            if int((path / "stat").read_text().rpartition(")")[2].split()[2]) == group:
                rollup = (path / "smaps_rollup").read_text()
                held += int(next(line for line in rollup.splitlines() if line.startswith("Pss:")).split()[1])
    return held
