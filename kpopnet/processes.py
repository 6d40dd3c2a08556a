"""The processes that train together, and what they compute on."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel

from kpopnet.errors import InputError
from kpopnet.machine import cores_at_hand
from kpopnet.networks import PoseNetwork


@dataclass(frozen=True)
class Processes:
    """This process among those that train together, and its device."""

    device: torch.device
    rank: int = 0
    count: int = 1

    def spread(self, network: PoseNetwork) -> nn.Module:
        """The network to be called in training: its gradients come out as the mean over processes.

        On GPUs batch normalisation is over the whole batch; on CPUs, for which torch has no such thing, over each
        process's share, so there only what precedes normalisation is independent of the number of processes. The
        running statistics kept are rank 0's.
        """
        if self.count == 1:
            return network
        if self.device.type == "cuda":
            network = nn.SyncBatchNorm.convert_sync_batchnorm(network)
            return DistributedDataParallel(network, device_ids=[self.device.index], broadcast_buffers=False)
        return DistributedDataParallel(network, broadcast_buffers=False)

    def describe(self, threads: int) -> str:
        """What computes, and how, for the log."""
        if self.device.type == "cuda":
            return (
                f"{self.count} GPU(s) ({torch.cuda.get_device_name(self.device)}), encoder in bfloat16, the rest "
                "in float32"
            )
        return (
            f"CPU ({self.count} process(es) of {threads} thread(s)) in float32: bfloat16 is slower there, and can end "
            "the process on machines that advertise AMX wrongly"
        )


@contextmanager
def join_processes(device: str) -> Iterator[Processes]:
    """Joins the processes that torchrun started, if it did: NCCL on GPUs, gloo on CPUs.

    Args:
        device: cpu, cuda, or auto for a GPU if there is one.

    Raises:
        InputError: unknown device, or no such GPU.
    """
    if device not in ("auto", "cpu", "cuda"):
        raise InputError(f"device={device}: expected auto, cpu or cuda")
    if device == "cuda" and not torch.cuda.is_available():
        raise InputError("device=cuda: torch finds no GPU here; use device=cpu")
    kind = "cuda" if device != "cpu" and torch.cuda.is_available() else "cpu"
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        yield Processes(torch.device(kind))
        return
    here = torch.device(kind, int(os.environ["LOCAL_RANK"])) if kind == "cuda" else torch.device("cpu")
    if kind == "cuda":
        torch.cuda.set_device(here)
    # Rank 0 validates while the others wait, hence the patience.
    distributed.init_process_group("nccl" if kind == "cuda" else "gloo", timeout=timedelta(hours=1))
    try:
        yield Processes(here, distributed.get_rank(), count)
    finally:
        distributed.destroy_process_group()


def set_up_torch(threads: int) -> int:
    """Makes torch repeatable on CPUs and sets its number of threads. Returns the number.

    0 takes all cores at hand, or this process's part of them where torchrun started several on this machine.
    """
    torch.use_deterministic_algorithms(True, warn_only=torch.cuda.is_available())
    # Only matters to code that reads what it never wrote, and takes a tenth of the time of a step.
    torch.utils.deterministic.fill_uninitialized_memory = False
    threads = threads or max(1, cores_at_hand() // int(os.environ.get("LOCAL_WORLD_SIZE", "1")))
    torch.set_num_threads(threads)
    return threads
