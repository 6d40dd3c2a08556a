"""What training loses to preparing its data, how fast it is, and how long one frame takes."""

import os
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np

from kpopnet.data.batches import CropBatches, ShuffledOrder, batch_loader
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.training.loop import Run, TrainingConfig, join_processes, set_up_torch
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SensorConfig
from tests.speed.generated import generated_set

ROUNDS, STEPS, SAMPLES = 5, 12, 512


def measure() -> dict[str, tuple[float, str, str]]:
    """The default network on the CPU, steps on one and the same batch in turn with steps on fresh ones."""
    threads = set_up_torch(0, workers=1)
    model, config = ModelConfig(), TrainingConfig()
    with tempfile.TemporaryDirectory() as folder, join_processes("cpu") as processes:
        shards = generated_set(Path(folder), SAMPLES)
        source = Observer(shards, SensorConfig(), ExtractionConfig(), seed=0)
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
        depth = shards[0].depth_mm[None]
        estimator = NetworkEstimator(
            save_checkpoint(Path(folder), run.average, {}, {"step": 0, "config": {}, "metrics": {}}, best=True)
        )
        latencies = []
        for _ in range(40):
            started = time.perf_counter()
            estimator.estimate(depth, shards.camera)
            latencies.append(time.perf_counter() - started)
    with_data, without = float(np.mean(fresh)), float(np.mean(repeated))
    machine = f"dense network at {model.crop_px} px, {threads} threads of {os.cpu_count()} cores"
    return {
        "train.data_loss_percent": (100 * (1 - without / with_data), "%", "at most 10; one data worker, no ridge"),
        "train.samples_per_second": (config.batch_size / with_data, "1/s", f"with data; {machine}"),
        "network.latency_ms": (1000 * median(latencies), "ms a frame", f"320x240 depth to joints; {machine}"),
    }


def _seconds(run: Run, batches) -> list[float]:
    """Of each step, the waiting for its batch included."""
    times = [time.perf_counter()]
    for batch in batches:
        run.update(batch)
        times.append(time.perf_counter())
    return np.diff(times).tolist()
