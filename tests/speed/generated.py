"""A small set of real samples to measure on."""

from pathlib import Path

from kpopnet.data.shards import ShardedSet
from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, write_shard


def generated_set(folder: Path, count: int) -> ShardedSet:
    """`count` clean samples of the default mixture, in one shard."""
    sample = SampleConfig(renderer="cpu", motion=MotionConfig(source="mix"))
    write_shard(SetConfig(sample, seed=0, split="train", count=count, shard_size=count, freeze=None), folder, 0)
    return ShardedSet(folder)
