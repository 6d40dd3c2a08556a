"""What several measures need: one core, a small set of real samples, an untrained network."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import torch

from kpopnet.data.shards import ShardedSet
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import save_checkpoint
from kpopnet.networks.network import build_network
from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, write_shard

Figures = dict[str, tuple[float, str, str]]


@contextmanager
def one_core() -> Iterator[None]:
    """Lets OpenCV and torch use one thread."""
    threads = cv2.getNumThreads(), torch.get_num_threads()
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    yield
    cv2.setNumThreads(threads[0])
    torch.set_num_threads(threads[1])


def generated_set(folder: Path, count: int, shards: int = 1, source: str = "mix", split: str = "train") -> ShardedSet:
    """Clean samples, by default of the default mixture; `count` in each shard."""
    sample = SampleConfig(renderer="cpu", motion=MotionConfig(source=source))
    config = SetConfig(sample, seed=0, split=split, count=shards * count, shard_size=count, freeze=None)
    for shard in range(shards):
        write_shard(config, folder, shard)
    return ShardedSet(folder)


def untrained(folder: Path) -> Path:
    """A checkpoint of the default network with depth and ridge; its random weights do not change its speed."""
    meta = {"step": 0, "config": {}, "metrics": {}}
    return save_checkpoint(folder, build_network(ModelConfig(input="depth_ridge")), {}, meta, best=True)
