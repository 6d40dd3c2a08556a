"""A checkpoint, run by torch."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import torch

from kpopnet.errors import InputError
from kpopnet.networks.checkpoint import load_network


class TorchBackend:
    """Implements kpopnet.networks.estimator.Backend."""

    def __init__(self, folder: Path | str, device: str = "cpu") -> None:
        """Loads a checkpoint.

        Raises:
            InputError: no checkpoint in the folder, or a damaged one; or no such device.
        """
        if device not in ("cpu", "cuda") or (device == "cuda" and not torch.cuda.is_available()):
            raise InputError(f"device={device}: expected cpu, or cuda on a machine with a GPU")
        self.network, self.meta = load_network(folder, device)
        self.device = torch.device(device)

    @torch.inference_mode()
    def __call__(self, crops: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Backend`."""
        batch = torch.from_numpy(crops).to(self.device)
        with _one_thread() if len(crops) == 1 else nullcontext():
            prediction = self.network(batch)
        return prediction.joints.cpu().numpy(), prediction.confidence.cpu().numpy()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limits torch to one thread, with which a batch of one crop takes a third of the time that it takes with two.

    For such a batch torch uses many small matrix products instead of oneDNN, and each waits for the other threads.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
