"""What it costs to make a training sample of a clean one: noise, cut-out and ridge."""

import tempfile
from pathlib import Path
from timeit import repeat

import numpy as np
from factories import write_shard

from kpopnet.ridge import RidgeConfig
from kpopnet.shards import ShardedSet
from synth.observe import ExtractionConfig, Room, observe_sample
from synth.sensor import SENSORS


def measure() -> dict[str, tuple[float, str, str]]:
    """A 320x240 Kinect v1 sample without the reading of its file."""
    with tempfile.TemporaryDirectory() as folder:
        write_shard(Path(folder), 0, 4)
        shards = ShardedSet(folder)
        samples = [shards[index] for index in range(4)]
        room = Room(*shards.room(0, 0))

    def observe(ridge: RidgeConfig | None) -> None:
        for index, sample in enumerate(samples):
            rng = np.random.default_rng([0, 0, index])
            observe_sample(sample, room, shards.camera, SENSORS["kinect_v1"], ExtractionConfig(), ridge, rng)

    figures = {}
    for name, ridge in (("synth.observe_ms", RidgeConfig()), ("synth.observe_without_ridge_ms", None)):
        observe(ridge)
        seconds = min(repeat(lambda ridge=ridge: observe(ridge), number=5, repeat=10)) / 5 / len(samples)
        figures[name] = (1000 * seconds, "ms a sample", "at most 2 with ridge and crop")
    return figures
