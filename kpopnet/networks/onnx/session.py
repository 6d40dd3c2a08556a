"""A network in an ONNX file (`kpopnet.networks.onnx.export`), run by ONNX Runtime on the CPU. Torch is not needed.

The metadata entry `kpopnet` is the network's description (kpopnet.networks.description) as JSON. The input `crops` is
(N, C, S, S) float32 (kpopnet.data.cube.crop); the outputs are `joints`, (N, 15, 3) in cube units, and `confidence`, (N, 15).
ONNX Runtime itself refuses weights in files outside the working folder.
"""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.data.cube import INPUTS
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.networks.description import check_description
from kpopnet.runtime.input_files import expect, parse_json, read_with
from kpopnet.skeleton import NUM_JOINTS

KEY, FORMAT = "kpopnet", "kpopnet-onnx"
INPUT, OUTPUTS = "crops", ("joints", "confidence")


class OnnxBackend:
    """Implements kpopnet.networks.backend.Backend. It can be pickled for worker processes.

    It computes on one thread: for several sequences there are several processes.
    """

    def __init__(self, path: Path | str) -> None:
        """Reads a file of `kpopnet export`.

        Raises:
            InputError: missing, damaged, or another network; ONNX Runtime cannot run it, or is not installed.
        """
        self.path = Path(path)
        self.content: bytes = read_with(Path.read_bytes, self.path, "cannot be read")
        session = self._session
        described = session.get_modelmeta().custom_metadata_map.get(KEY)
        if described is None:
            raise InputError(f"{path}: not a network of kpopnet export (its metadata has no entry {KEY})")
        self.meta = check_description(str(path), parse_json(described, f"{path}: metadata", non_finite=True), FORMAT)
        model = ModelConfig(**self.meta["model"])
        size = INPUTS[model.input], model.crop_px, model.crop_px
        wanted = {INPUT: size, OUTPUTS[0]: (NUM_JOINTS, 3), OUTPUTS[1]: (NUM_JOINTS,)}
        found = {one.name: tuple(one.shape[1:]) for one in (*session.get_inputs(), *session.get_outputs())}
        expect(found == wanted, str(path), f"values of the shapes {wanted} for each crop, found {found}")
        read_with(lambda _: self(np.zeros((1, *size), np.float32)), self.path, "ONNX Runtime cannot run it")

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
            raise InputError("ONNX files need the package onnxruntime: pip install 'kpopnet[onnx]'") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = 3  # errors, which are raised too
        return read_with(
            lambda _: onnxruntime.InferenceSession(self.content, options, providers=["CPUExecutionProvider"]),
            self.path,
            "not an ONNX file, or a damaged one",
        )
