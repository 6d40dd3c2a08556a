"""An exported network gives what the network gives, describes itself, and needs no torch."""

import json
import pickle
import shutil
import subprocess
import sys

import numpy as np
import onnx
import pytest
import safetensors.torch
import torch
from checkpoints import save_untrained
from programs import ROOT

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.networks import PERSON, ModelConfig
from kpopnet.networks.backend import read_description
from kpopnet.networks.checkpoint import load_network
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import PersonHead
from kpopnet.networks.onnx_export import export_network
from kpopnet.skeleton import JOINT_NAMES


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """The folder of a run with the checkpoint of a small network of random weights, which also judges whether a crop shows a
    person, and the exported file beside it; the largest difference, and the network.
    """
    folder = tmp_path_factory.mktemp("run")
    model = ModelConfig("dense", "depth_ridge", crop_px=32, widths=[8, 8, 16, 16])
    config = {"ridge": {"epsilon_r": 0.5}, "data": {"train": "/home/me/data/train"}, "crops": "/home/me/crops"}
    save_untrained(folder, model, config=config)
    torch.manual_seed(1)
    (folder / "best" / PERSON).write_bytes(safetensors.torch.save(PersonHead(16).state_dict()))
    network, meta = load_network(folder / "best")
    return folder, export_network(network, meta, folder / "pose.onnx"), network


@pytest.fixture
def run(exported):
    return exported[0]


def test_both_predict_the_same_joints_from_any_number_of_crops(exported):
    run, difference, network = exported
    assert difference < 1e-5
    one, other = NetworkEstimator(run / "best"), NetworkEstimator(str(run / "pose.onnx"))
    assert (one.name, one.model, one.ridge) == (other.name, other.model, other.ridge)
    for count in (1, 7):
        crops = np.random.default_rng(count).uniform(-1, 1, (count, 2, 32, 32)).astype(np.float32)
        by_torch = one.backend(crops)
        for expected, found in zip(by_torch, other.backend(crops), strict=True):
            assert found.dtype == np.float32
            np.testing.assert_allclose(found, expected, atol=1e-5)
    # What is cached while torch traces would stay a trace: exporting leaves the network as it was.
    with torch.inference_mode():
        np.testing.assert_array_equal(network(torch.from_numpy(crops)).joints.numpy(), by_torch[0])


def test_whether_a_crop_shows_a_person_is_judged_by_both_where_the_checkpoint_has_a_head_for_it(run, tmp_path):
    depth_m = np.zeros((3, 60, 80), np.float32)
    depth_m[1, 10:50, 30:40], depth_m[2, 10:50, 30:60] = 2, 2.5
    camera = Camera.centred(70.0, 80, 60)
    images = [(image_m, camera) for image_m in depth_m]
    (_, expected), (estimate, found) = (NetworkEstimator(run / one).judge(images) for one in ("best", "pose.onnx"))
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert found[0] == -np.inf and np.isfinite(found[1:]).all() and found[1] != found[2]
    np.testing.assert_array_equal(estimate.confidence[0], 0)
    copy = pickle.loads(pickle.dumps(NetworkEstimator(run / "pose.onnx")))  # for worker processes
    np.testing.assert_array_equal(copy.judge(images)[1], found)
    shutil.copytree(run / "best", tmp_path / "other")
    (tmp_path / "other" / PERSON).write_bytes(safetensors.torch.save(PersonHead(8).state_dict()))
    with pytest.raises(InputError, match=r"person\.safetensors: missing, damaged"):
        NetworkEstimator(tmp_path / "other")
    (tmp_path / "other" / PERSON).unlink()
    assert NetworkEstimator(tmp_path / "other").judge(images)[1] is None


def test_the_file_describes_itself_and_not_the_machine(run):
    model = onnx.load(run / "pose.onnx")
    onnx.checker.check_model(model, full_check=True)
    meta = json.loads({entry.key: entry.value for entry in model.metadata_props}["kpopnet"])
    assert meta == read_description(run / "pose.onnx")
    assert meta["format"] == "kpopnet-onnx" and meta["version"] == 1
    assert meta["model"]["half_size_m"] == 1.15 and meta["model"]["kind"] == "dense"
    assert meta["config"] == {"ridge": {"epsilon_r": 0.5}} and meta["joint_names"] == list(JOINT_NAMES)
    (crops,) = model.graph.input
    assert crops.type.tensor_type.shape.dim[0].dim_param == "batch"
    content = (run / "pose.onnx").read_bytes()
    assert b"/home" not in content and str(ROOT).encode() not in content and b".py" not in content


def test_prediction_with_a_file_and_by_the_package_loads_no_torch(run):
    code = f"""
import sys
import numpy as np
from kpopnet.camera import Camera
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose import PoseEstimator
depth_m = np.zeros((2, 120, 160), np.float32)
depth_m[:, 20:100, 60:100] = 2.5
camera = Camera.centred(140.0, 160, 120)
assert np.isfinite(NetworkEstimator({str(run / "pose.onnx")!r}).estimate(depth_m, camera).joints_camera_m).all()
PoseEstimator.load({str(run / "pose.onnx")!r}).estimate(depth_m, camera, segmented=True)
PoseEstimator.load().estimate(depth_m, camera, segmented=True)
heavy = ("torch", "mujoco", "hydra", "omegaconf", "tensorboard", "onnxscript", "matplotlib.pyplot", "trimesh")
print([name for name in heavy if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.strip() == "[]", done.stderr


def test_what_cannot_be_exported_or_run_is_refused(run, tmp_path, monkeypatch):
    network, meta = load_network(run / "best")
    with pytest.raises(InputError, match=r"pose\.pt: expected a name that ends in \.onnx"):
        export_network(network, meta, tmp_path / "pose.pt")
    with pytest.raises(InputError, match="device=cuda: ONNX files run on the cpu"):
        NetworkEstimator(run / "pose.onnx", device="cuda")
    with pytest.raises(InputError, match=r"nowhere\.onnx: cannot be read"):
        NetworkEstimator(tmp_path / "nowhere.onnx")
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(InputError, match=r"exporting: needs .* onnxscript, .* pip install .*\[export\]"):
        export_network(network, meta, tmp_path / "pose.onnx")
    with pytest.raises(InputError, match=r"pose\.onnx: needs onnxruntime, .* pip install .*\[onnx\]"):
        NetworkEstimator(run / "pose.onnx")
    assert not list(tmp_path.glob("*.onnx"))


def in_double(model):
    (joints,) = (one for one in model.graph.output if one.name == "joints")
    (node,) = (one for one in model.graph.node if "joints" in one.output)
    node.output[list(node.output).index("joints")] = "joints_float"
    model.graph.node.append(onnx.helper.make_node("Cast", ["joints_float"], ["joints"], to=onnx.TensorProto.DOUBLE))
    joints.type.tensor_type.elem_type = onnx.TensorProto.DOUBLE


def lead_out(model):
    weight = model.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = onnx.TensorProto.EXTERNAL
    weight.external_data.add(key="location", value="../../../etc/passwd")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (None, "not an ONNX file, or a damaged one"),
        (lambda model: model.ClearField("metadata_props"), "no entry kpopnet"),
        (in_double, r"expected float32 values, found tensor\("),
        (lead_out, "not an ONNX file, or a damaged one .*(External data path|Initializer)"),
    ],
    ids=["cut", "undescribed", "double", "external"],
)
def test_other_files_are_refused_in_one_line(run, tmp_path, change, message):
    content = (run / "pose.onnx").read_bytes()
    if change is None:
        content = content[: len(content) // 2]
    else:
        model = onnx.load_model_from_string(content)
        change(model)
        content = model.SerializeToString()
    (tmp_path / "pose.onnx").write_bytes(content)
    with pytest.raises(InputError, match=message) as refusal:
        NetworkEstimator(tmp_path / "pose.onnx")
    assert "\n" not in str(refusal.value)
