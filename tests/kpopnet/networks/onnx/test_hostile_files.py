"""ONNX files are programs: what `kpopnet export` did not write is refused in one line, before a session is made."""

import json

import numpy as np
import onnx
import onnxruntime
import pytest
from damaged_files import HOSTILE_JSON, is_refused, survives_damage
from exported_networks import export
from onnx import helper, numpy_helper

from kpopnet.errors import InputError
from kpopnet.networks.backend import read_description
from kpopnet.networks.estimator import NetworkEstimator

HUGE = 10**9


@pytest.fixture(scope="module")
def content(tmp_path_factory):
    return export(tmp_path_factory.mktemp("run")).file.read_bytes()


@pytest.fixture
def no_session(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("a session was made")

    monkeypatch.setattr(onnxruntime, "InferenceSession", refuse)


def describe(model, text):
    helper.set_model_props(model, {"kpopnet": text})


def redescribed(change):
    def edit(model):
        meta = json.loads(model.metadata_props[0].value)
        describe(model, json.dumps(meta | {"model": meta["model"] | change}))

    return edit


def add_node(model, operator, *inputs, domain="", **attributes):
    model.graph.node.append(helper.make_node(operator, list(inputs), ["more"], domain=domain, **attributes))


def add_weight(model, name, array):
    model.graph.initializer.append(numpy_helper.from_array(array, name))


def lead_out(model):
    weight = model.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = onnx.TensorProto.EXTERNAL
    weight.external_data.add(key="location", value="../../../etc/passwd")


def claim(model):
    weight = model.graph.initializer[0]
    weight.dims[:] = [HUGE, HUGE, HUGE]


def grow_by_padding(model):
    for node in model.graph.node:
        for attribute in node.attribute:
            if attribute.name == "pads":
                attribute.ints[:] = [10**6] * 4


def grow_by_doubling(model):
    last = "crops"
    for number in range(60):
        model.graph.node.append(helper.make_node("Concat", [last, last], [f"double{number}"], axis=1))
        last = f"double{number}"


def grow_by_resizing(model):
    next(one for one in model.graph.initializer if one.name == resize(model).input[2]).raw_data = np.array(
        [1, 1, 1e4, 1e4], np.float32
    ).tobytes()


def resize(model):
    return next(node for node in model.graph.node if node.op_type == "Resize")


def branch(model):
    inner = helper.make_graph([], "inner", [], [])
    add_node(model, "Relu", "crops", body=inner)


def function(model):
    model.functions.append(helper.make_function("f", "Relu", ["x"], ["y"], [], [helper.make_opsetid("", 18)]))


def not_finite(model):
    weight = next(one for one in model.graph.initializer if one.data_type == 1)
    weight.raw_data = np.full(list(weight.dims), np.inf, np.float32).tobytes()


def other_input(model):
    model.graph.input[0].name = "images"


def other_output(model):
    del model.graph.output[1:]


def metadata_of(*texts):
    def edit(model):
        del model.metadata_props[:]
        for text in texts:
            model.metadata_props.add(key="kpopnet", value=text)

    return edit


EDITS = [
    (metadata_of(), "not a network of kpopnet export"),
    (metadata_of("{}", "{}"), "not a network of kpopnet export"),
    (metadata_of("{}"), "expected a kpopnet-onnx of version 1, found None"),
    (metadata_of('{"format": "kpopnet-checkpoint", "version": 1}'), "found kpopnet-checkpoint"),
    (metadata_of('{"format": "kpopnet-onnx", "version": 2}'), "of version 2"),
    (metadata_of("[" * 100_000), "nested too deeply"),
    (metadata_of(" " * 2_000_000), "at most 1,000,000 characters"),
    (redescribed({"input": "depth"}), "as its description says"),
    (redescribed({"crop_px": 64}), "as its description says"),
    (redescribed({"crop_px": 10**9}), "crop_px"),
    (redescribed({"half_size_m": None}), "half_size_m"),
    (lead_out, "lies in another file"),
    (claim, "bytes, found"),
    (grow_by_padding, "its shapes do not fit"),
    (grow_by_doubling, "of memory|not known"),
    (grow_by_resizing, "its shapes do not fit|of memory"),
    (lambda model: add_node(model, "ConstantOfShape", "crops"), "the operator :ConstantOfShape"),
    (lambda model: add_node(model, "Loop", "crops"), "the operator :Loop"),
    (lambda model: add_node(model, "Relu", "crops", domain="com.example"), "the operator com.example:Relu"),
    (branch, "Relu: holds g,"),
    (function, "holds functions"),
    (not_finite, "not finite"),
    (other_input, "expected the input crops"),
    (other_output, "expected the input crops"),
    (lambda model: add_weight(model, "text", np.array(["a"], object)), "holds string_data"),
    (lambda model: add_weight(model, "real", np.zeros(3)), "expected float32 or int64"),
    (lambda model: add_weight(model, "many", np.zeros((1,) * 9, np.float32)), "at most 6 axes"),
    (lambda model: model.opset_import.append(helper.make_opsetid("com.microsoft", 1)), "another domain"),
    (lambda model: model.graph.node.extend([helper.make_node("Relu", ["crops"], ["x"])] * 600), "at most 500 operators"),
    (lambda model: add_node(model, "Relu", "nothing"), "ONNX|shape"),
    (lambda model: model.graph.ClearField("node"), "ONNX|shape"),
]


@pytest.mark.parametrize(("edit", "message"), EDITS, ids=[str(number) for number in range(len(EDITS))])
def test_another_file_is_refused_before_it_is_run(content, tmp_path, no_session, edit, message):
    model = onnx.load_model_from_string(content)
    edit(model)
    path = tmp_path / "pose.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(InputError, match=message) as refusal:
        NetworkEstimator(path)
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 400


def test_other_bytes_are_refused(content, tmp_path, no_session):
    path = tmp_path / "pose.onnx"
    for data in (b"", b"\x80\x04K\x01.", content[:1000], content[: len(content) // 2], bytes(1000)):
        path.write_bytes(data)
        with pytest.raises(InputError, match=r"pose\.onnx: "):
            NetworkEstimator(path)


def test_memory_is_bounded_before_it_is_taken(content, tmp_path, no_session, monkeypatch):
    path = tmp_path / "pose.onnx"
    path.write_bytes(content)
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "0.003")
    with pytest.raises(InputError, match=r"its content would take .* of memory"):
        NetworkEstimator(path)
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", str(1.1 * 80 * len(content) / 1e9))
    assert read_description(path)["step"] == 5


def test_hostile_descriptions_are_refused_in_one_line(content, tmp_path, no_session):
    path = tmp_path / "pose.onnx"
    model = onnx.load_model_from_string(content)
    meta = json.loads(model.metadata_props[0].value)
    refused = 0
    for name in meta:
        for hostile in HOSTILE_JSON:
            describe(model, json.dumps(meta | {name: "@"}).replace('"@"', hostile))
            path.write_bytes(model.SerializeToString())
            refused += is_refused(lambda: read_description(path))
    assert refused > 100


def test_damaged_files_are_refused_in_one_line_or_still_run(content, tmp_path):
    path = tmp_path / "pose.onnx"
    path.write_bytes(content)
    crops = np.zeros((1, 2, 32, 32), np.float32)
    assert survives_damage(path, lambda: NetworkEstimator(path).backend(crops)) > 100
