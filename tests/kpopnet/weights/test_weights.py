"""The networks that come with the package are checked when they are loaded, and are written from a checkpoint: in float16, and
for ONNX Runtime with coarser levels that compute in 8 bits.
"""

import re
import runpy
import shutil
import sys
from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch
from capsule_people import CAMERA, draw_depth, draw_joints
from checkpoints import save_untrained
from onnx import numpy_helper
from programs import tool
from room_image_files import write_person_masks, write_room_images
from safetensors.torch import load_file
from safetensors.torch import save as save_weights
from shard_sets import write_shard

import kpopnet.weights
from kpopnet.errors import InputError
from kpopnet.finder.finder import open_finder
from kpopnet.finder.masks import open_masks
from kpopnet.finder.network import CellsOfCrops, FinderNetwork, MaskNetwork
from kpopnet.networks import PERSON, ModelConfig
from kpopnet.networks.backend import onnx_session
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import PersonHead, build_network
from kpopnet.networks.onnx_export import JointsAndConfidence, traced

ship_weights, eight_bits = tool("ship_weights"), tool("eight_bits")

FOLDER, SHA256 = kpopnet.weights.FOLDER, kpopnet.weights.SHA256
MODEL = ModelConfig(input="depth_ridge", crop_px=32, widths=[8, 8, 16, 16])
CONFIG = {
    "sensor": {"name": "kinect_v1"},
    "ridge": {"epsilon_r": 0.5, "edge_threshold_m": 0.08, "sharpness": 3.0},
    "training": {"steps": 7, "start": "/home/me/run/best", "resume": None},
    "data": {"train": "/home/me/data/train"},
    "device": "cuda",
    "threads": 3,
    "workers": 2,
    "seed": 4,
}
DEPTH_M = np.stack([draw_depth(draw_joints(np.random.default_rng(seed))) for seed in range(4)])
IMAGES = [(image_m, CAMERA) for image_m in DEPTH_M]


def ship(*words):
    """The program, as a user runs it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["ship_weights", *map(str, words)])
        ship_weights.main()


def save(run, network=None, **more):
    return save_untrained(run, MODEL, network, **({"config": CONFIG} | more))


def digests(weights):
    return runpy.run_path(str(weights / "__init__.py"))["SHA256"]


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """A run whose network was shipped after one with a head that judges, of which nothing must stay; each takes seconds, and
    the one that judges is holistic, which takes half as many.
    """
    place = tmp_path_factory.mktemp("once")
    weights = place / "weights"
    weights.mkdir()
    for name in ("__init__.py", *SHA256["over_time"]):
        shutil.copy(FOLDER / name, weights)
    judging = save(place / "judging", build_network(replace(MODEL, kind="holistic")))
    (judging / PERSON).write_bytes(save_weights(PersonHead(MODEL.widths[-1]).state_dict()))
    write_shard(place / "images", [0] * 40)
    for run, judges in ((judging, True), (save(place / "run"), False)):
        ship(run, "--set", place / "images", "--out", weights)
        does_judge = NetworkEstimator(weights).judge(IMAGES)[1] is not None
        assert {does_judge, PERSON in digests(weights)["joints"], (weights / PERSON).is_file()} == {judges}
    return place


@pytest.fixture
def shipped(tmp_path, monkeypatch, once):
    shutil.copytree(once, tmp_path, dirs_exist_ok=True, symlinks=True)
    monkeypatch.setattr(kpopnet.weights, "FOLDER", tmp_path / "weights")
    monkeypatch.setattr(kpopnet.weights, "SHA256", digests(tmp_path / "weights"))
    return tmp_path / "weights"


def test_without_a_checkpoint_the_estimator_takes_it(tmp_path, shipped):
    trained, found = NetworkEstimator(tmp_path / "run" / "best"), NetworkEstimator()
    assert found.model == MODEL and found.ridge.epsilon_r == 0.5
    expected = {"sensor": CONFIG["sensor"], "ridge": CONFIG["ridge"], "training": {"steps": 7}, "seed": 4}
    assert found.meta["config"] == expected  # how it was trained, and not where
    expected, estimate = (one.estimate(DEPTH_M, CAMERA) for one in (trained, found))
    difference_m = np.abs(expected.joints_camera_m - estimate.joints_camera_m).max()
    assert 0 < difference_m < 0.003  # float16 has 11 bits
    np.testing.assert_allclose(estimate.confidence, expected.confidence, atol=0.003)
    by_torch = NetworkEstimator(shipped).estimate(DEPTH_M, CAMERA)  # the same filters, none of them rounded to 8 bits
    moved_m = np.abs(estimate.joints_camera_m - by_torch.joints_camera_m)
    assert 1e-5 < moved_m.max() < 0.003
    np.testing.assert_allclose(estimate.confidence, by_torch.confidence, atol=0.003)


def test_weights_are_half_the_size_and_computed_with_in_float32(shipped):
    stored = load_file(shipped / "model.safetensors")
    types = {(value.ndim > 1, value.dtype) for value in stored.values()}  # statistics may exceed float16
    assert types == {(True, torch.float16), (False, torch.float32), (False, torch.int64)}
    network = NetworkEstimator(shipped).backend.network
    for name, value in network.state_dict().items():
        assert value.dtype == (torch.float32 if value.is_floating_point() else torch.int64)
        assert torch.equal(value, stored[name].to(value.dtype))


@pytest.mark.parametrize(("network", "name"), [(network, name) for network, files in SHA256.items() for name in files])
def test_files_of_another_version_are_refused(tmp_path, monkeypatch, network, name):
    for file in SHA256[network]:
        shutil.copy(FOLDER / file, tmp_path)
    monkeypatch.setattr(kpopnet.weights, "FOLDER", tmp_path)
    assert kpopnet.weights.shipped(network)[0].parent == tmp_path
    content = bytearray((tmp_path / name).read_bytes())
    content[-2] ^= 1
    for damage in (lambda: (tmp_path / name).write_bytes(content), (tmp_path / name).unlink):
        damage()
        with pytest.raises(InputError, match=rf"{name}: .*install kpopnet again$"):
            kpopnet.weights.shipped(network)


def test_what_this_checkout_ships_can_be_loaded():
    estimator = NetworkEstimator()
    assert sum(file.stat().st_size for file in FOLDER.glob("*.*")) < 10e6
    card = (FOLDER / "MODEL_CARD.md").read_text()
    digests = {digest for files in SHA256.values() for digest in files.values()}
    stated = re.findall("[0-9a-f]{64}", card)
    assert len(stated) == len(set(stated)) >= 8 and set(stated) <= digests
    assert {files[name] for files in SHA256.values() for name in files if name.endswith(".safetensors")} <= set(stated)
    assert not any("/" in text for text in ship_weights.texts_in(estimator.meta))
    assert np.isfinite(estimator.estimate(DEPTH_M, CAMERA).joints_camera_m).all()


def test_a_folder_without_a_module_for_the_digests_is_left_as_it_is(tmp_path):
    causal, future = kpopnet.weights.shipped("over_time")
    (tmp_path / "new").mkdir()
    with pytest.raises(InputError, match=r"new: no __init__\.py to hold the digests; copy kpopnet/weights there"):
        ship_weights.ship_over_time(causal, future, tmp_path / "new")
    assert not list((tmp_path / "new").iterdir())


def test_a_finder_is_shipped_beside_the_network(tmp_path, shipped, monkeypatch):
    mine = tmp_path / "mine.safetensors"
    mine.write_bytes(save_weights(FinderNetwork().state_dict()))
    ship(mine, "--set", write_room_images(tmp_path / "images"), "--out", shipped)
    assert digests(shipped)["joints"] == kpopnet.weights.SHA256["joints"]
    monkeypatch.setattr(kpopnet.weights, "SHA256", digests(shipped))
    stored, graph = kpopnet.weights.shipped("finder")
    assert stored.stat().st_size < 0.6 * mine.stat().st_size and graph.stat().st_size < 2e5
    depth_m, intrinsics = ship_weights.images_of(tmp_path / "images")[3].values()
    finders = open_finder.__wrapped__(), open_finder(str(stored)), open_finder(str(mine))
    for one, same, close in zip(*(finder(depth_m, intrinsics) for finder in finders), strict=True):
        assert 1e-6 < np.abs(one - same).max() < 0.01  # 8 bits
        np.testing.assert_allclose(same, close, atol=0.01)  # float16


def test_a_mask_network_is_shipped_beside_the_finder(tmp_path, shipped, monkeypatch):
    mine, network = tmp_path / "mine.safetensors", MaskNetwork()
    mine.write_bytes(save_weights(network.state_dict()))
    ship("--masks", mine, "--set", write_person_masks(tmp_path / "masks"), "--out", shipped)
    monkeypatch.setattr(kpopnet.weights, "SHA256", digests(shipped))
    stored, graph = kpopnet.weights.shipped("masks")
    assert stored.stat().st_size < 0.6 * mine.stat().st_size and graph.stat().st_size < 1e5
    for people in (1, 3):
        crops = [one[:people] for one in ship_weights.masks_of(tmp_path / "masks")[0].values()]
        said = open_masks.__wrapped__()(*crops)
        with torch.inference_mode():
            expected = CellsOfCrops(network.eval())(*map(torch.from_numpy, crops)).numpy()
        np.testing.assert_allclose(said, expected, atol=0.01)  # float16 and 8 bits
    with pytest.raises(InputError, match="not a finder of this version"):
        ship_weights.ship_finder(mine, shipped, "finder", FinderNetwork, [])


def test_other_networks_are_shipped_as_they_are_and_no_other_files(tmp_path, shipped):
    causal, future, lifting = (
        shutil.copy(FOLDER / name, tmp_path / f"mine_{name}") for name in (*SHA256["over_time"], *SHA256["lifting"])
    )
    ship_weights.ship_over_time(causal, future, shipped)
    ship_weights.ship_lifting(lifting, shipped)
    for network in ("over_time", "lifting"):
        assert digests(shipped)[network] == SHA256[network]
        kpopnet.weights.shipped(network)
    with pytest.raises(InputError, match=r"future\.safetensors: expected a network that does not know later frames"):
        ship_weights.ship_over_time(future, causal, shipped)
    with pytest.raises(InputError, match="no network that lifts joints"):
        ship_weights.ship_lifting(causal, shipped)


def test_what_cannot_be_shipped_is_refused(tmp_path, shipped):
    wide = build_network(MODEL, 1)
    with torch.no_grad():
        wide.head.maps.weight[3] = 1e5
    with pytest.raises(InputError, match=r"head\.maps\.weight does not fit into float16"):
        ship_weights.ship(save(tmp_path / "wide", wide), shipped, [])
    with pytest.raises(InputError, match="looks like a path"):
        ship_weights.ship(save(tmp_path / "path", metrics={"page": "/home/me/report.html"}), shipped, [])
    NetworkEstimator()  # what was there is as it was


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
    onnx.helper.set_model_props(about, {"kpopnet": "what it is"})
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
    assert model.doc_string == "joints" and {one.key: one.value for one in model.metadata_props} == {"kpopnet": "what it is"}
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
    """So the ranges are those of the inputs that are given, and such as are too narrow cost accuracy."""
    content, crops = exported
    exact, right, narrow = (
        opened(tmp_path, one).run(None, {"crops": crops})[0]
        for one in (content, *(eight_bits.in_eight_bits(content, [{"crops": scale * crops}]) for scale in (1, 0.1)))
    )
    assert np.abs(narrow - exact).mean() > 2 * np.abs(right - exact).mean()


@pytest.mark.parametrize("network", ["joints", "finder", "masks"])
def test_the_networks_of_the_package_compute_with_integers_at_the_levels_that_are_said_alone(network):
    graph = onnx.load(next(FOLDER / name for name in SHA256[network] if name.endswith(".onnx")), load_external_data=False).graph
    made = {name: node for node in graph.node for name in node.output}
    begins, rounded = eight_bits.FINDER if network == "finder" else eight_bits.COARSER, 0
    for node in graph.node:
        if node.op_type == "Conv":
            sources = [made.get(name) for name in node.input[:2]]
            by_integers = all(source and source.op_type == "DequantizeLinear" for source in sources)
            filters = made[sources[1].input[0]].input[0] if by_integers else node.input[1]
            assert by_integers == filters.startswith(begins), filters
            rounded += by_integers
    # Seven in each coarser level, the one that joins all, and five in the finest.
    assert rounded == {"joints": 14, "masks": 15, "finder": 20}[network]
