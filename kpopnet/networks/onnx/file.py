"""The door for ONNX files: what `kpopnet export` writes, and nothing else, comes through.

An ONNX file is a program, and ONNX Runtime computes parts of it as soon as a session is made. So everything is checked before:
operators, shapes and memory of every value, weights inside the file.

The metadata entry `kpopnet` is the network's description (kpopnet.networks.description) as JSON. The input `crops` is
(N, C, S, S) float32 (kpopnet.data.cube.crop); the outputs are `joints`, (N, 15, 3) in cube units, and `confidence`, (N, 15).
"""

import math
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from kpopnet.data.cube import INPUTS
from kpopnet.errors import InputError
from kpopnet.networks import BATCH, ModelConfig
from kpopnet.networks.description import check_description
from kpopnet.runtime.input_files import check_budget, expect, names_in, parse_json, read_with
from kpopnet.skeleton import NUM_JOINTS

KEY, FORMAT = "kpopnet", "kpopnet-onnx"
INPUT, OUTPUTS = "crops", ("joints", "confidence")

OPERATORS = {
    *("Conv", "Relu", "Add", "Mul", "MatMul", "Gemm", "Slice", "Gather", "Split", "Concat", "Reshape", "Flatten"),
    *("Resize", "Softmax", "LogSoftmax", "Exp", "Sigmoid", "ReduceSum"),
}
"""What torch exports our networks to."""

MODEL_FIELDS = {
    *("ir_version", "opset_import", "producer_name", "producer_version", "doc_string", "graph", "metadata_props"),
}
GRAPH_FIELDS = {"node", "name", "initializer", "doc_string", "input", "output", "value_info"}
ATTRIBUTE_FIELDS = {"name", "type", "f", "i", "s", "floats", "ints"}
TENSOR_FIELDS = {"dims", "data_type", "name", "raw_data"}
"""Fields of an ONNX file that may be set: no functions, nested graphs, sparse tensors or training."""

WEIGHT_TYPES = {1: np.dtype("<f4"), 7: np.dtype("<i8")}
"""Types of weights and of constants by their number in ONNX."""

MAX_NODES, MAX_RANK, MAX_DESCRIPTION_BYTES = 500, 6, 1_000_000

INFLATED = 80
"""Memory per byte of a file of empty messages, when it is parsed (measured: 77)."""


def read_onnx(path: Path) -> tuple[bytes, dict]:
    """Reads and checks an exported network.

    Returns:
        The checked content, which alone holds the whole network, and its description.

    Raises:
        InputError: missing, damaged, too large, or something else than `kpopnet export` writes; or the library is missing.
    """
    onnx = import_onnx()
    where, path = str(path), Path(path)
    content = read_with(Path.read_bytes, path, "cannot be read", INFLATED)
    model = read_with(lambda _: onnx.load_model_from_string(content), path, "not an ONNX file, or a damaged one")
    model.DiscardUnknownFields()  # which another library might know
    meta = _description(where, model)
    _check_operators(where, model)
    _check_weights(where, model.graph)
    _check_values(onnx, where, model, ModelConfig(**meta["model"]))
    read_with(lambda _: onnx.checker.check_model(model), path, "not a valid ONNX file")
    return model.SerializeToString(), meta


def import_onnx() -> ModuleType:
    """The library that reads and writes ONNX files.

    Raises:
        InputError: it is not installed.
    """
    try:
        import onnx
    except ImportError as error:
        raise InputError("ONNX files need the packages onnx and onnxruntime: pip install 'kpopnet[onnx]'") from error
    return onnx


def _description(where: str, model: Any) -> dict:
    texts = [entry.value for entry in model.metadata_props if entry.key == KEY]
    if len(texts) != 1:
        raise InputError(f"{where}: not a network of kpopnet export (its metadata has no entry {KEY})")
    expect(len(texts[0]) <= MAX_DESCRIPTION_BYTES, where, f"a description of at most {MAX_DESCRIPTION_BYTES:,} characters")
    return check_description(where, parse_json(texts[0], f"{where}: metadata", non_finite=True), FORMAT)


def _check_operators(where: str, model: Any) -> None:
    for part, names in ((model, MODEL_FIELDS), (model.graph, GRAPH_FIELDS)):
        _check_fields(where, part, names)
    expect([one.domain for one in model.opset_import] == [""], where, "operators of ONNX alone, found another domain's too")
    expect(len(model.graph.node) <= MAX_NODES, where, f"at most {MAX_NODES} operators, found {len(model.graph.node)}")
    for node in model.graph.node:
        if node.domain or node.op_type not in OPERATORS:
            raise InputError(f"{where}: holds the operator {node.domain[:40]}:{node.op_type[:40]}, which no network here has")
        for attribute in node.attribute:
            _check_fields(f"{where}: {node.op_type}", attribute, ATTRIBUTE_FIELDS)


def _check_fields(where: str, message: Any, names: set[str]) -> None:
    if unknown := {field.name for field, _ in message.ListFields()} - names:
        raise InputError(f"{where}: holds {names_in(sorted(unknown))}, which no network here has")


def _check_weights(where: str, graph: Any) -> None:
    """Every weight lies in the file, in full, and is finite."""
    for tensor in graph.initializer:
        name = f"{where}: {tensor.name[:60]}"
        if tensor.external_data or tensor.data_location:
            raise InputError(f"{name}: lies in another file; export the network again, into one")
        _check_fields(name, tensor, TENSOR_FIELDS)
        kind = WEIGHT_TYPES.get(tensor.data_type)
        if kind is None or len(tensor.dims) > MAX_RANK or min(tensor.dims, default=1) < 0:
            raise InputError(f"{name}: expected float32 or int64 of at most {MAX_RANK} axes")
        needed, found = math.prod(tensor.dims) * kind.itemsize, len(tensor.raw_data)
        expect(found == needed, name, f"{needed:,} bytes, found {found:,}")
        if kind.kind == "f" and not np.isfinite(np.frombuffer(tensor.raw_data, kind)).all():
            raise InputError(f"{name}: holds numbers that are not finite")


def _check_values(onnx: ModuleType, where: str, model: Any, described: ModelConfig) -> None:
    """Input and outputs are as described, and all values of a batch have known shapes and fit into memory."""
    side, channels = described.crop_px, INPUTS[described.input]
    wanted = {INPUT: (BATCH, channels, side, side), OUTPUTS[0]: (BATCH, NUM_JOINTS, 3), OUTPUTS[1]: (BATCH, NUM_JOINTS)}
    graph = model.graph
    ends = ([one.name for one in graph.input], [one.name for one in graph.output])
    expect(ends == ([INPUT], list(OUTPUTS)), where, f"the input {INPUT} and the outputs {', '.join(OUTPUTS)}")
    sizes = [size.dim_value for size in graph.input[0].type.tensor_type.shape.dim]
    expect(sizes == [0, *wanted[INPUT][1:]], where, f"{INPUT} of any number x {wanted[INPUT][1:]}, as its description says")

    batch = onnx.ModelProto()
    batch.CopyFrom(model)
    del batch.graph.value_info[:]
    for one in (*batch.graph.input, *batch.graph.output):
        one.type.CopyFrom(onnx.helper.make_tensor_type_proto(1, wanted[one.name]))
    inferred = read_with(
        lambda _: onnx.shape_inference.infer_shapes(batch, strict_mode=True), Path(where), "its shapes do not fit"
    ).graph
    shapes = {one.name: [size.dim_value for size in one.type.tensor_type.shape.dim] for one in inferred.value_info}
    shapes |= wanted
    total = 0
    for node in graph.node:
        for name in node.output:
            shape = shapes.get(name, ())
            if not shape or len(shape) > MAX_RANK or min(shape) < 1:
                raise InputError(f"{where}: {node.op_type}: the shape of {name[:60]!r} is not known; export the network again")
            total += 8 * math.prod(shape)
    check_budget(where, total, f"its values for {BATCH} crops")
