"""Data-parallel training: the processes of a run, their devices, and the set-up of torch."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel

from kpopnet.errors import InputError, check_one_of
from kpopnet.networks.network import PoseNetwork
from kpopnet.runtime.cpu import available_cores, keep_freed_memory


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
        if self.device.type == "cuda":
            network = nn.SyncBatchNorm.convert_sync_batchnorm(network)
            return DistributedDataParallel(network, device_ids=[self.device.index], broadcast_buffers=False)
        return DistributedDataParallel(network, broadcast_buffers=False)

    def describe(self, threads: int) -> str:
        """Describes the devices and the precision, for the log."""
        if self.device.type == "cuda":
            return f"{self.count} GPU(s) ({torch.cuda.get_device_name(self.device)}), encoder in bfloat16, the rest in float32"
        return (
            f"CPU ({self.count} process(es) of {threads} thread(s)) in float32: bfloat16 is slower on CPUs, and can crash "
            "the process on machines that advertise AMX wrongly"
        )


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
    shares its core with a worker holds all up (on two cores two threads train at 380 samples/s, one at 570).
    """
    torch.use_deterministic_algorithms(True, warn_only=torch.cuda.is_available())
    # Filling only affects code that reads uninitialised memory, and takes a tenth of the time of a step.
    torch.utils.deterministic.fill_uninitialized_memory = False
    keep_freed_memory()
    threads = threads or max(1, available_cores() // int(os.environ.get("LOCAL_WORLD_SIZE", "1")) - workers)
    torch.set_num_threads(threads)
    return threads
