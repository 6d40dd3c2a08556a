"""What several measures need: times, one core, a small set of real samples.

Libraries are imported where they are needed: one measure is of the memory of its process.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from kpopnet.data.shards import ShardedSet
from synth.motion import MotionConfig
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, write_shard

R = TypeVar("R")

Figures = dict[str, tuple[float, str, str]]
"""Value, unit, and against what it is measured, by name."""


def timed(work: Callable[..., R], *given, clock: Callable[[], float] = time.process_time) -> tuple[float, R]:
    """The milliseconds that work takes, by default of processor time, and what it returns."""
    start = clock()
    result = work(*given)
    return 1000 * (clock() - start), result


@contextmanager
def one_core() -> Iterator[None]:
    """Lets OpenCV and torch use one thread."""
    import cv2
    import torch

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
