"""Runs a finder's network: ONNX files with ONNX Runtime, which is twice as fast on a CPU, weights of a training with torch."""

from functools import cache
from pathlib import Path

import numpy as np

from kpopnet.data.canvas import STRIDE, Reduced
from kpopnet.finder.people import INPUTS, OUTPUT_NAMES, PROBLEM, Cells, Network
from kpopnet.runtime.input_files import read_with

ONNX_SUFFIX = ".onnx"


def cells_of(network: Network, canvas: Reduced) -> Cells:
    """What a network says of the cells of an image."""
    probability, torso_m = network(canvas.depth_m[None], canvas.intrinsics[None])
    depth_m = np.ascontiguousarray(canvas.depth_m[::STRIDE, ::STRIDE])
    area_m2 = depth_m**2 * np.float32(STRIDE**2 / (canvas.intrinsics[0] * canvas.intrinsics[1]))
    return Cells(depth_m, area_m2, probability, torso_m)


@cache
def open_finder(path: str) -> Network:
    """The network of a file, opened once, on one thread; raises InputError if it is missing or no finder."""
    if not path.endswith(ONNX_SUFFIX):
        from kpopnet.finder.network import torch_finder  # takes a second to import

        return torch_finder(path)
    import onnxruntime  # takes a tenth of a second to import

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1

    def opened(path: Path):
        return onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])

    session = read_with(opened, Path(path), PROBLEM)
    return lambda depth_m, intrinsics: session.run(list(OUTPUT_NAMES), dict(zip(INPUTS, (depth_m, intrinsics), strict=True)))
