"""Data-parallel training: the processes of a run, their devices, and the set-up of torch."""

import logging
import os
import subprocess
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel

from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.networks.network import PoseNetwork
from kpopnet.runtime.cpu import available_cores, keep_freed_memory, own_python

log = logging.getLogger(__name__)

MOST_THREADS = 1024
"""Of torch: where the system starts no more of them, libraries end the process without an error of Python's."""


@dataclass(frozen=True)
class Processes:
    """This process, number `rank` of `count` in a data-parallel training, and its device."""

    device: torch.device
    rank: int = 0
    count: int = 1

    def data_parallel(self, network: PoseNetwork) -> nn.Module:
        """Wraps a network for training; its gradients are averaged over the processes.

        On GPUs, batch normalisation uses the statistics of the whole batch. On CPUs, where torch does not support this, it
        uses those of each process's part of the batch, so results depend on the number of processes. The running
        statistics of rank 0 are kept.
        """
        if self.count == 1:
            return network
        # A 1x1 filter lies in memory alike under the strides of its gradient and those of its bucket: nothing is slower.
        warnings.filterwarnings("ignore", "Grad strides do not match bucket view strides")
        if self.device.type == "cuda":
            network = nn.SyncBatchNorm.convert_sync_batchnorm(network)
            return DistributedDataParallel(network, device_ids=[self.device.index])
        return DistributedDataParallel(network)

    def describe(self, threads: int, bfloat16: bool) -> str:
        """Describes the devices and the precision, for the log."""
        precision = "encoder in bfloat16, the rest in float32" if bfloat16 or self.device.type == "cuda" else "in float32"
        if self.device.type == "cuda":
            return f"{self.count} GPU(s) ({torch.cuda.get_device_name(self.device)}), {precision}"
        return f"CPU ({self.count} process(es) of {threads} thread(s)), {precision}"


TRIAL = """
import time, torch
torch.set_num_threads(1)
layer = torch.nn.Conv2d(64, 64, 3, padding=1).to(memory_format=torch.channels_last)
image = torch.randn(32, 64, 24, 24).to(memory_format=torch.channels_last)
def seconds(enabled):
    began = time.perf_counter()
    with torch.autocast("cpu", torch.bfloat16, enabled=enabled):
        layer(image).float().square().mean().backward()
    return time.perf_counter() - began
times = [(seconds(False), seconds(True)) for _ in range(6)][1:]
print(sum(one for one, _ in times) / sum(other for _, other in times))
"""
"""Prints how many times as fast as in float32 a convolution of the encoder is trained in bfloat16."""


def try_bfloat16() -> None:
    """Trains a convolution in bfloat16, in a process of its own, and warns where that is slower than in float32.

    Raises InputError where it ends the process, as on processors that claim AMX and do not have it.
    """
    words, environment = own_python(TRIAL)
    tried = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    if tried.returncode < 0:
        raise InputError(
            f"training.bfloat16: it ended a process that tried it (exit status {tried.returncode}); this processor claims what "
            "it does not have, leave the setting out"
        )
    if tried.returncode:
        raise InputError(f"training.bfloat16: could not be tried: {(tried.stderr.splitlines() or ['no reason was given'])[-1]}")
    if (gain := float(tried.stdout)) < 1:
        log.warning("training.bfloat16: this processor trains convolutions at %.1f times the speed of float32", gain)


def device_kind(device: str) -> str:
    """`cuda`, which `auto` is where torch finds a GPU, or `cpu`; raises InputError for another name, or cuda without a GPU."""
    check_one_of("device", device, ("auto", "cpu", "cuda"))
    if device == "cuda" and not torch.cuda.is_available():
        raise InputError("device=cuda: torch finds no GPU; use device=cpu")
    return "cuda" if device != "cpu" and torch.cuda.is_available() else "cpu"


@contextmanager
def join_processes(device: str) -> Iterator[Processes]:
    """Joins the processes that torchrun started, if any: NCCL on GPUs, gloo on CPUs.

    Raises InputError if the device is not cpu, cuda or auto (a GPU if available), or there is no GPU.
    """
    kind = device_kind(device)
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        yield Processes(torch.device(kind))
        return
    here = torch.device(kind, int(os.environ["LOCAL_RANK"])) if kind == "cuda" else torch.device("cpu")
    if kind == "cuda":
        if (gpus := torch.cuda.device_count()) <= here.index:
            raise InputError(f"more processes than GPUs: give torchrun --nproc-per-node={gpus}, or device=cpu")
        torch.cuda.set_device(here)
    # The other processes wait while rank 0 validates, hence the long timeout.
    distributed.init_process_group("nccl" if kind == "cuda" else "gloo", timeout=timedelta(hours=1))
    try:
        yield Processes(here, distributed.get_rank(), count)
    finally:
        distributed.destroy_process_group()


def set_up_torch(threads: int, workers: int = 0) -> int:
    """Makes torch deterministic on CPUs, sets and returns its number of threads, and lets it use freed memory again.

    0 threads stand for all available cores, divided by the number of processes that torchrun started on this machine, but for
    those that the workers, which prepare the batches of each, need: threads of one sum wait for the slowest, and one that
    shares its core with a worker holds all up (on two cores two threads trained at 377 samples/s, one at 568: docs/ledger.md).
    Raises InputError for less than 0, or more than MOST_THREADS.
    """
    check_between("threads", threads, 0, MOST_THREADS)
    torch.use_deterministic_algorithms(True, warn_only=torch.cuda.is_available())
    # Filling only affects code that reads uninitialised memory, and takes a tenth of the time of a step.
    torch.utils.deterministic.fill_uninitialized_memory = False
    keep_freed_memory()
    threads = threads or max(1, available_cores() // int(os.environ.get("LOCAL_WORLD_SIZE", "1")) - workers)
    torch.set_num_threads(threads)
    return threads
