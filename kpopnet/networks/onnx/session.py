"""A network in an ONNX file, run by ONNX Runtime on the CPU. Torch is not needed."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.data.cube import INPUTS
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.networks.onnx.file import INPUT, OUTPUTS, read_onnx
from kpopnet.runtime.input_files import read_with


class OnnxBackend:
    """Implements kpopnet.networks.estimator.Backend. It can be pickled for worker processes.

    It computes on one thread: for several sequences there are several processes.
    """

    def __init__(self, path: Path | str) -> None:
        """Reads a file of `kpopnet export`.

        Raises:
            InputError: as `read_onnx`; or ONNX Runtime cannot run it, or is not installed.
        """
        self.path = Path(path)
        self.content, self.meta = read_onnx(self.path)
        model = ModelConfig(**self.meta["model"])
        crop = np.zeros((1, INPUTS[model.input], model.crop_px, model.crop_px), np.float32)
        read_with(lambda _: self(crop), self.path, "ONNX Runtime cannot run it")

    def __call__(self, crops: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Backend`."""
        joints, confidence = self._session.run(list(OUTPUTS), {INPUT: crops})
        return joints, confidence

    def __getstate__(self) -> dict:
        return {"path": self.path, "content": self.content, "meta": self.meta}

    @cached_property
    def _session(self) -> Any:
        try:
            import onnxruntime
        except ImportError as error:
            raise InputError("running ONNX files needs the package onnxruntime: pip install 'kpopnet[onnx]'") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3  # errors, which are raised too
        return onnxruntime.InferenceSession(self.content, options, providers=["CPUExecutionProvider"])
