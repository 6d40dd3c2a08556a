"""What it costs to make a training sample of a stored one: reading, noise, cut-out, ridge, crop."""

import tempfile
from pathlib import Path
from statistics import median
from timeit import repeat

import numpy as np

from kpopnet.data.batches import AugmentConfig, CropBatches, ShuffledOrder
from kpopnet.networks import ModelConfig
from kpopnet.ridge import RidgeConfig, ridge_probability
from synth.samples.observe import Background, ExtractionConfig, Observer, observe_sample
from synth.sensor.model import SensorConfig
from tests.speed.generated import generated_set

SAMPLES = 64


def measure() -> dict[str, tuple[float, str, str]]:
    """Kinect v1 at 320x240, one core; medians over rounds of the same samples."""
    with tempfile.TemporaryDirectory() as folder:
        shards = generated_set(Path(folder), SAMPLES)
        samples = [shards[index] for index in range(SAMPLES)]
        rooms = [Background(*shards.room(index, sample.room)) for index, sample in enumerate(samples)]

        def observe() -> None:
            for index, (sample, room) in enumerate(zip(samples, rooms, strict=True)):
                rng = np.random.default_rng([0, 0, index])
                seen = observe_sample(sample, room, shards.camera, SensorConfig(), ExtractionConfig(), rng)
                ridge_probability(seen.depth_m, RidgeConfig())

        def prepare(name: str) -> None:
            observer = Observer(shards, SensorConfig(), ExtractionConfig(), seed=0)
            CropBatches(observer, ModelConfig(input=name), ShuffledOrder(SAMPLES, SAMPLES, 0), 0, AugmentConfig())[0]

        def per_sample_ms(work) -> float:
            work()
            return 1000 * median(repeat(work, number=1, repeat=9)) / SAMPLES

        return {
            "synth.observe_ms": (per_sample_ms(observe), "ms a sample", "noise, cut-out and ridge"),
            "train.sample_ms": (
                per_sample_ms(lambda: prepare("depth_ridge")),
                "ms a sample",
                "at most 2: read, noise, cut-out, ridge, augmented crop; "
                f"{per_sample_ms(lambda: prepare('depth')):.2f} without ridge",
            ),
        }
