"""What runs a network: torch, or ONNX Runtime; found by what the network is stored as."""

from pathlib import Path
from typing import Protocol

import numpy as np

from kpopnet.errors import InputError
from kpopnet.networks.description import read_meta
from kpopnet.networks.onnx.session import OnnxBackend
from kpopnet.weights import shipped_network

ONNX_SUFFIX = ".onnx"
"""Of the files of `kpopnet export`; another path is a checkpoint's folder."""


class Backend(Protocol):
    """Runs a network.

    Attributes:
        meta: its checked description (kpopnet.networks.description).
    """

    meta: dict

    def __call__(self, crops: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predicts.

        Args:
            crops: (N, C, S, S) float32, N >= 1 (kpopnet.data.cube.crop).

        Returns:
            (N, 15, 3) joints in cube units, and (N, 15) confidence.
        """
        ...


def open_network(checkpoint: Path | str | None, device: str = "cpu") -> Backend:
    """Opens a network, and loads only the library that runs it.

    Raises:
        InputError: no network there, a damaged one, or no such device.
    """
    place = Path(shipped_network() if checkpoint is None else checkpoint)
    if place.suffix == ONNX_SUFFIX:
        if device != "cpu":
            raise InputError(f"device={device}: ONNX files run on the cpu")
        return OnnxBackend(place)
    from kpopnet.networks.torch_backend import TorchBackend  # takes a second to import

    return TorchBackend(place, device)


def read_description(checkpoint: Path | str | None) -> dict:
    """The description of a network.

    Args:
        checkpoint: a checkpoint's folder, a file of `kpopnet export`, or None for the network that comes with the package.

    Raises:
        InputError: no network there, one of another version, or a damaged one.
    """
    place = Path(shipped_network() if checkpoint is None else checkpoint)
    if place.suffix == ONNX_SUFFIX:
        return OnnxBackend(place).meta
    return read_meta(place)
