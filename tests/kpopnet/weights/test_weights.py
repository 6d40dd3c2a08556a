"""The network that comes with the package is checked when it is loaded, and is written from a checkpoint in float16."""

import runpy
import shutil

import numpy as np
import pytest
import torch
from capsule_people import CAMERA, draw_depth, draw_joints
from checkpoints import save_untrained
from programs import tool
from safetensors.torch import load_file
from safetensors.torch import save as save_weights

import kpopnet.weights
from kpopnet.errors import InputError
from kpopnet.finder.finder import open_finder
from kpopnet.finder.network import FinderNetwork
from kpopnet.networks import PERSON, ModelConfig
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import PersonHead, build_network

ship_weights = tool("ship_weights")

LIFTING = kpopnet.weights.shipped_lifting()
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


def save(run, network=None, **more):
    return save_untrained(run, MODEL, network, **({"config": CONFIG} | more))


def judging_run(folder):
    """A run whose network has a head that judges."""
    torch.manual_seed(1)
    run = save(folder)
    (run / PERSON).write_bytes(save_weights(PersonHead(MODEL.widths[-1]).state_dict()))
    return run


def judges(weights) -> set[bool]:
    """Whether what is shipped judges, by what it does, by its list of files and by its files."""
    depth_m = draw_depth(draw_joints(np.random.default_rng(0)))[None]
    listed = runpy.run_path(str(weights / "__init__.py"))["SHA256"]
    return {NetworkEstimator(weights).judge(depth_m, CAMERA)[1] is not None, PERSON in listed, (weights / PERSON).is_file()}


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """A run, and its network shipped after one that judges, as `judged` notes; each takes seconds."""
    place = tmp_path_factory.mktemp("once")
    weights = place / "weights"
    weights.mkdir()
    for name in ("__init__.py", *kpopnet.weights.OVER_TIME_SHA256):
        shutil.copy(kpopnet.weights.FOLDER / name, weights)
    judged = []
    for run in (judging_run(place / "judging"), save(place / "run")):
        ship_weights.ship(run, weights)
        judged.append(judges(weights))
    return place, judged


@pytest.fixture
def shipped(tmp_path, monkeypatch, once):
    shutil.copytree(once[0], tmp_path, dirs_exist_ok=True, symlinks=True)
    monkeypatch.setattr(kpopnet.weights, "FOLDER", tmp_path / "weights")
    monkeypatch.setattr(kpopnet.weights, "SHA256", runpy.run_path(str(tmp_path / "weights/__init__.py"))["SHA256"])
    return tmp_path / "weights"


def test_without_a_checkpoint_the_estimator_takes_it(tmp_path, shipped):
    trained, found = NetworkEstimator(tmp_path / "run" / "best"), NetworkEstimator()
    assert found.model == MODEL and found.ridge.epsilon_r == 0.5
    expected = {"sensor": CONFIG["sensor"], "ridge": CONFIG["ridge"], "training": {"steps": 7}, "seed": 4}
    assert found.meta["config"] == expected  # how it was trained, and not where
    depth_m = np.stack([draw_depth(draw_joints(np.random.default_rng(seed))) for seed in range(4)])
    expected, estimate = (one.estimate(depth_m, CAMERA) for one in (trained, found))
    difference_m = np.abs(expected.joints_camera_m - estimate.joints_camera_m).max()
    assert 0 < difference_m < 0.003  # float16 has 11 bits
    np.testing.assert_allclose(estimate.confidence, expected.confidence, atol=0.003)
    by_torch = NetworkEstimator(shipped).estimate(depth_m, CAMERA)  # the same filters, and statistics that are no filters yet
    np.testing.assert_allclose(estimate.joints_camera_m, by_torch.joints_camera_m, atol=1e-5)
    np.testing.assert_allclose(estimate.confidence, by_torch.confidence, atol=1e-5)


def test_a_network_without_a_head_that_judges_is_not_given_that_of_the_one_before(once):
    assert once[1] == [{True}, {False}]


def test_weights_are_half_the_size_and_computed_with_in_float32(tmp_path, shipped):
    stored = load_file(shipped / "model.safetensors")
    types = {(value.ndim > 1, value.dtype) for value in stored.values()}  # statistics may exceed float16
    assert types == {(True, torch.float16), (False, torch.float32), (False, torch.int64)}
    network = NetworkEstimator(shipped).backend.network
    for name, value in network.state_dict().items():
        assert value.dtype == (torch.float32 if value.is_floating_point() else torch.int64)
        assert torch.equal(value, stored[name].to(value.dtype))
    assert (shipped / "model.safetensors").stat().st_size < 0.6 * (tmp_path / "run/best/model.safetensors").stat().st_size


@pytest.mark.parametrize("name", ["model.safetensors", "meta.json", "graph.onnx"])
def test_files_of_another_version_are_refused(shipped, name):
    file = shipped / name
    content = bytearray(file.read_bytes())
    content[-2] ^= 1
    for damage in (lambda: file.write_bytes(content), file.unlink):
        damage()
        with pytest.raises(InputError, match=rf"{name}: .*install kpopnet again$"):
            NetworkEstimator()


def test_what_this_checkout_ships_can_be_loaded():
    estimator = NetworkEstimator()
    assert sum(file.stat().st_size for file in kpopnet.weights.FOLDER.glob("*.*")) < 10e6
    card = (kpopnet.weights.FOLDER / "MODEL_CARD.md").read_text()
    assert kpopnet.weights.SHA256["model.safetensors"] in card
    assert kpopnet.weights.FINDER_SHA256["finder.safetensors"] in card
    for digests in (kpopnet.weights.OVER_TIME_SHA256, kpopnet.weights.LIFTING_SHA256):
        assert all(digest in card for digest in digests.values())
    assert not any("/" in text for text in ship_weights.texts_in(estimator.meta))
    estimate = estimator.estimate(draw_depth(draw_joints(np.random.default_rng(0)))[None], CAMERA)
    assert np.isfinite(estimate.joints_camera_m).all()


def test_a_finder_is_shipped_beside_the_network(tmp_path, shipped, monkeypatch):
    network = FinderNetwork()
    (tmp_path / "mine.safetensors").write_bytes(save_weights(network.state_dict()))
    ship_weights.ship_finder(tmp_path / "mine.safetensors", shipped)
    digests = runpy.run_path(str(shipped / "__init__.py"))
    assert digests["SHA256"] == kpopnet.weights.SHA256
    sizes = [(shipped / name).stat().st_size for name in digests["FINDER_SHA256"]]
    assert sizes[0] < 0.6 * (tmp_path / "mine.safetensors").stat().st_size and sizes[1] < 2e5
    monkeypatch.setattr(kpopnet.weights, "FINDER_SHA256", digests["FINDER_SHA256"])
    depth_m = np.random.default_rng(0).uniform(0.5, 6, (1, 128, 160)).astype(np.float32)
    intrinsics = np.array([[120, 120, 79.5, 59.5]], np.float32)
    by_onnx, stored, mine = (
        one(depth_m, intrinsics)
        for one in (
            open_finder.__wrapped__(),
            open_finder(str(shipped / "finder.safetensors")),
            open_finder(str(tmp_path / "mine.safetensors")),
        )
    )
    for one, same, close in zip(by_onnx, stored, mine, strict=True):
        np.testing.assert_allclose(one, same, atol=1e-4)
        np.testing.assert_allclose(one, close, atol=0.01)  # float16


@pytest.mark.parametrize("name", ["finder.safetensors", "finder_graph.onnx"])
def test_a_finder_of_another_version_is_refused(tmp_path, monkeypatch, name):
    for file in kpopnet.weights.FINDER_SHA256:
        (tmp_path / file).write_bytes((kpopnet.weights.FOLDER / file).read_bytes() + (b"0" if file == name else b""))
    monkeypatch.setattr(kpopnet.weights, "FOLDER", tmp_path)
    with pytest.raises(InputError, match=rf"{name}: .*install kpopnet again$"):
        open_finder.__wrapped__()


def test_both_networks_over_time_are_shipped_in_their_order(tmp_path, shipped):
    files = [kpopnet.weights.shipped_over_time(future) for future in (False, True)]
    copies = [tmp_path / f"{number}.safetensors" for number in range(2)]
    for file, copy in zip(files, copies, strict=True):
        copy.write_bytes(file.read_bytes())
    ship_weights.ship_over_time(*copies, shipped)
    assert runpy.run_path(str(shipped / "__init__.py"))["OVER_TIME_SHA256"] == kpopnet.weights.OVER_TIME_SHA256
    with pytest.raises(InputError, match=r"1\.safetensors: expected a network that does not know later frames"):
        ship_weights.ship_over_time(copies[1], copies[0], shipped)


def test_a_network_that_lifts_joints_is_shipped_and_no_other_file(tmp_path, shipped):
    copy = tmp_path / "mine.safetensors"
    copy.write_bytes(LIFTING.read_bytes())
    ship_weights.ship_lifting(copy, shipped)
    assert runpy.run_path(str(shipped / "__init__.py"))["LIFTING_SHA256"] == kpopnet.weights.LIFTING_SHA256
    assert kpopnet.weights.shipped_lifting().read_bytes() == LIFTING.read_bytes()
    with pytest.raises(InputError, match="no network that lifts joints"):
        ship_weights.ship_lifting(shipped / "over_time_causal.safetensors", shipped)


def test_what_cannot_be_shipped_is_refused(tmp_path, shipped):
    wide = build_network(MODEL, 1)
    with torch.no_grad():
        wide.head.maps.weight[3] = 1e5
    with pytest.raises(InputError, match=r"head\.maps\.weight does not fit into float16"):
        ship_weights.ship(save(tmp_path / "wide", wide), shipped)
    with pytest.raises(InputError, match="looks like a path"):
        ship_weights.ship(save(tmp_path / "path", metrics={"page": "/home/me/report.html"}), shipped)
    NetworkEstimator()  # what was there is as it was
