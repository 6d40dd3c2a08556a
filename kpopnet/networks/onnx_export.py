"""Writes a checkpoint's network as an ONNX file, and compares the two (`kpopnet.networks.backend.OnnxBackend` runs it)."""

import json
import logging
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

import kpopnet
from kpopnet.data.cube import INPUTS
from kpopnet.errors import InputError
from kpopnet.networks import portable
from kpopnet.networks.backend import INPUT, KEY, ONNX_FORMAT, ONNX_SUFFIX, OUTPUTS, PERSON_LOGIT, OnnxBackend
from kpopnet.networks.network import PoseNetwork
from kpopnet.runtime.atomic_write import write_whole
from kpopnet.runtime.provenance import optional_library

OPSET = 18

ABOUT = """3D joints of a person in a depth image (kpopnet).
crops: (N, C, S, S) float32 views of a cube around the person, side 2 x half_size_m. Channel 0 is the depth minus that of the
cube's centre in half sizes, clipped to -1..1, and 1 where nothing was measured; channel 1, if any, the ridge probability.
joints: (N, 15, 3) u, v, d in half sizes from the centre, right, down and forward; u and v are in perspective:
X = (u + cx) / cz * Z, Y = (v + cy) / cz * Z, Z = d + cz with the centre (cx, cy, cz) in half sizes.
confidence: (N, 15) estimated probability that a joint is within 10 cm of the truth.
person_logit, where it is there: (N,) its sigmoid is the estimated probability that the crop shows a person.
The metadata entry kpopnet has the model's settings, the ridge's, and the joints' names as JSON."""


class JointsAndConfidence(nn.Module):
    """The network with the outputs of prediction alone."""

    def __init__(self, network: PoseNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, crops: Tensor) -> tuple[Tensor, ...]:
        prediction = self.network(crops)
        judged = () if prediction.person_logit is None else (prediction.person_logit,)
        return prediction.joints, prediction.confidence, *judged


def export_network(network: PoseNetwork, meta: dict, path: Path) -> float:
    """Writes the `portable` description and a network in evaluation mode, on the CPU, to an ONNX file, and runs that.

    Returns the largest difference between the outputs of torch and of ONNX Runtime, in cube units and probabilities. Raises
    InputError: the name ends in another suffix than .onnx, or a library is missing.
    """
    if path.suffix != ONNX_SUFFIX:
        raise InputError(f"{path}: expected a name that ends in .onnx")
    with optional_library("exporting", "onnx, onnxruntime and onnxscript", "export"):
        import onnx
        import onnxruntime  # noqa: F401
        import onnxscript  # noqa: F401
    model = network.config
    noise = np.random.default_rng(0).uniform(-1, 1, (5, INPUTS[model.input], model.crop_px, model.crop_px))
    crops = noise.astype(np.float32)
    # Before it is traced: what the network caches must not be a part of the trace.
    with torch.inference_mode():
        expected = _comparable([value.numpy() for value in JointsAndConfidence(network)(torch.from_numpy(crops))])
    outputs = [*OUTPUTS, *([] if network.person is None else [PERSON_LOGIT])]
    content = traced(
        "kpopnet", JointsAndConfidence(network), [torch.from_numpy(crops[:2])], [INPUT], outputs, opset_version=OPSET,
        dynamic_shapes=({0: torch.export.Dim("batch")},),
    )  # fmt: skip
    content.producer_version, content.doc_string = kpopnet.__version__, ABOUT
    onnx.helper.set_model_props(content, {KEY: json.dumps(portable(meta) | {"format": ONNX_FORMAT})})
    onnx.checker.check_model(content, full_check=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content.SerializeToString())
    found = _comparable([value for value in OnnxBackend(path)(crops) if value is not None])
    return max(float(np.abs(one - other).max()) for one, other in zip(expected, found, strict=True))


def _comparable(outputs: list[np.ndarray]) -> list[np.ndarray]:
    """Joints in cube units, and probabilities."""
    joints, confidence, *person_logits = outputs
    return [joints, confidence, *(1 / (1 + np.exp(-logit)) for logit in person_logits)]


def traced(
    name: str, network: nn.Module, example: Sequence[Tensor], inputs: Sequence[str], outputs: Sequence[str], **options: Any
) -> Any:
    """A network as onnx.ModelProto, from an example of its inputs; `options` are those of torch.onnx.export."""
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it warns of torchvision, which is not needed
    with warnings.catch_warnings(action="ignore"):  # torch's exporter warns of its own code
        content = torch.onnx.export(
            network.eval(), tuple(example), dynamo=True, verbose=False, input_names=inputs, output_names=outputs, **options
        ).model_proto
    graph = content.graph
    for part in (graph, *graph.node, *graph.initializer, *graph.value_info, *graph.input, *graph.output):
        part.ClearField("metadata_props")  # names of source files and lines, which torch writes
        part.ClearField("doc_string")
    graph.name = content.producer_name = name
    return content
