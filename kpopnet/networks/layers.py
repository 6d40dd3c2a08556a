"""Small networks in numpy: linear layers with rectifiers between them, in files of torch's arrays."""

from pathlib import Path
from typing import Self

import numpy as np
import safetensors.numpy

from kpopnet.runtime.input_files import read_with


class Layers:
    """The layers, from their arrays by name: those of torch's Sequential of linear layers with rectifiers between them."""

    OTHERWISE = "no network of such layers"
    """What a file of other weights is, for messages."""

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self._layers = [(arrays[f"{2 * k}.weight"].T, arrays[f"{2 * k}.bias"]) for k in range(len(arrays) // 2)]

    @classmethod
    def load(cls, path: Path) -> Self:
        """The network of a safetensors file; raises InputError if it is missing, damaged or of other weights."""
        return read_with(lambda path: cls(safetensors.numpy.load_file(path)), path, f"missing, damaged, or {cls.OTHERWISE}")

    @property
    def inputs(self) -> int:
        """Numbers that the first layer reads."""
        return self._layers[0][0].shape[0]

    def through(self, seen: np.ndarray) -> np.ndarray:
        """(..., N) what the last layer says of (..., inputs) numbers."""
        out = seen
        for number, (weight, bias) in enumerate(self._layers):
            out = (np.maximum(out, 0) if number else out) @ weight + bias
        return out
