"""The coarser levels of a network that is shipped compute in 8 bits, as its float32 twin up to rounding."""

import numpy as np
import onnx
import pytest
import torch
from onnx import numpy_helper
from programs import tool

from kpopnet.networks import ModelConfig
from kpopnet.networks.backend import onnx_session
from kpopnet.networks.network import build_network
from kpopnet.networks.onnx_export import JointsAndConfidence, traced

eight_bits = tool("eight_bits")

ABOUT = {"kpopnet": "what it is"}


@pytest.fixture(scope="module")
def exported():
    """A network with statistics of its own, as an ONNX file, and crops."""
    torch.manual_seed(0)
    network = build_network(ModelConfig(crop_px=32, widths=[8, 8, 16, 24]))
    crops = torch.rand(64, 1, 32, 32) * 2 - 1
    for _ in range(30):  # so that batch normalisation does what it does in a trained network
        network.train()(crops)
    about = traced("kpopnet", JointsAndConfidence(network), [crops[:2]], ["crops"], ["joints", "confidence"],
                   dynamic_shapes=({0: torch.export.Dim("batch")},))  # fmt: skip
    about.doc_string = "joints"
    onnx.helper.set_model_props(about, ABOUT)
    return about.SerializeToString(), crops.numpy()


def opened(tmp_path, content):
    path = tmp_path / "network.onnx"
    path.write_bytes(content)
    return onnx_session(path, content, {})


def test_joints_stay_where_they_are_and_coarser_levels_alone_are_rounded(tmp_path, exported):
    content, crops = exported
    rounded = eight_bits.in_eight_bits(content, [{"crops": crops[:32]}, {"crops": crops[32:]}])
    expected, found = (opened(tmp_path, one).run(None, {"crops": crops})[0] for one in (content, rounded))
    assert 1e-6 < np.abs(found - expected).max() < 0.02
    assert np.abs(found - expected).mean() < 0.1 * np.abs(expected - expected.mean(0)).mean()
    model = onnx.load_from_string(rounded)
    assert model.doc_string == "joints" and {one.key: one.value for one in model.metadata_props} == ABOUT
    made = {name: node for node in model.graph.node for name in node.output}
    for node in model.graph.node:
        if node.op_type == "Conv":
            by_integers = all(made.get(name) and made[name].op_type == "DequantizeLinear" for name in node.input[:2])
            assert by_integers == any(level in " ".join(node.input) for level in ("middle.", "coarse."))


def test_two_products_fit_into_16_bits(exported):
    """Processors without VNNI add two products of 8 bits in 16, and more would be cut off there and nowhere else."""
    content, crops = exported
    model = onnx.load_from_string(eight_bits.in_eight_bits(content, [{"crops": crops}]))
    values = {one.name: numpy_helper.to_array(one) for one in model.graph.initializer}
    filters = [name for name in values if f"{name}_scale" in values and values[name].ndim == 4]
    assert len(filters) == 14
    for name in filters:
        steps = np.rint(values[name] / values[f"{name}_scale"][:, None, None, None])
        assert np.abs(steps).max() == 64 and 2 * 255 * 64 < 2**15


def test_what_lies_beyond_the_ranges_is_cut_off(tmp_path, exported):
    """An input that is like none of those that told the ranges costs accuracy, and gives no nonsense."""
    content, crops = exported
    rounded = eight_bits.in_eight_bits(content, [{"crops": 0.1 * crops}])
    joints = opened(tmp_path, rounded).run(None, {"crops": crops})[0]
    assert np.isfinite(joints).all() and np.abs(joints[..., :2]).max() <= 1
