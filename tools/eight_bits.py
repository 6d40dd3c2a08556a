"""Has levels of an exported network compute in 8 bits, which takes a third of their time where processors have VNNI: the
coarser ones, and in the finder's networks the convolution that joins all levels; of the finder the finest level as well.

What a level is given and gives is rounded to 256 steps of its range in some inputs, each filter to 129 of its own, by
`onnxruntime.quantization`: no sum of two products exceeds 16 bits, so that processors without VNNI give the same. The finest
level sees millimetres of depth: rounded too, it moves joints by centimetres. In the network of joints it computes in float32,
as does what follows in all networks (docs/ledger.md).
"""

import logging
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from kpopnet.runtime.provenance import optional_library

COARSER = ("network.encoder.middle.", "network.encoder.coarse.", "network.smooth.")
FINDER = (*COARSER, "network.encoder.fine.")
"""How the names of the filters begin that are computed with in 8 bits, of the networks of joints and of masks, and of the
finder."""


def in_eight_bits(content: bytes, inputs: Iterable[dict[str, np.ndarray]], begins: tuple[str, ...] = COARSER) -> bytes:
    """An exported network (kpopnet.networks.onnx_export.traced), in 8 bits where the names of filters begin so.

    The `inputs`, by name, are what it is likely to be given; their ranges are what is rounded. Its filters stay in float32,
    and are rounded when it is opened.
    """
    with optional_library("rounding a network to 8 bits", "onnx and onnxruntime", "export"):
        import onnx
        from onnxruntime import quantization
    model, levels, within = onnx.load_from_string(content), [], set()
    for node in model.graph.node:
        first = node.op_type == "Conv" and node.input[1].startswith(begins)
        if first or (node.op_type in ("Relu", "Add") and within.intersection(node.input)):
            levels.append(node.name)
            within.update(node.output)
    rounded = iter(inputs)
    reader = type("Inputs", (quantization.CalibrationDataReader,), {"get_next": lambda _: next(rounded, None)})()
    logging.getLogger().addFilter(_no_advice)
    try:
        with tempfile.TemporaryDirectory() as place:
            path = Path(place) / "eight_bits.onnx"
            quantization.quantize_static(
                model, path, reader, nodes_to_quantize=levels, per_channel=True, reduce_range=True,
                activation_type=quantization.QuantType.QUInt8, weight_type=quantization.QuantType.QInt8,
                extra_options={"AddQDQPairToWeight": True},
            )  # fmt: skip
            quantised = onnx.load(path)
    finally:
        logging.getLogger().removeFilter(_no_advice)
    quantised.producer_name, quantised.producer_version = model.producer_name, model.producer_version
    quantised.doc_string = model.doc_string
    del quantised.metadata_props[:]
    quantised.metadata_props.extend(model.metadata_props)
    return quantised.SerializeToString()


def _no_advice(record: logging.LogRecord) -> bool:
    """Not that a model should be optimised first: what it would do was done when the network was traced."""
    return "pre-processing" not in record.getMessage()
