"""Checkpoints come back as they were written, appear whole or not at all; foreign ones are refused."""

import json
import shutil

import numpy as np
import pytest
import torch
from capsule_people import CAMERA, draw_depth, draw_joints

import kpopnet.checkpoint as checkpoint_module
from kpopnet.checkpoint import load_network, load_state, read_meta, run_folder, save_checkpoint
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig, build_network
from kpopnet.networks.cube import Cube, crop, person_centre
from kpopnet.networks.estimator import NetworkEstimator

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])


def save(run, step=5, best=True, model=MODEL, seed=1, config=None):
    network = build_network(model, seed)
    meta = {"step": step, "config": config or {}, "metrics": {}, "mean_pose_m": np.zeros((15, 3)).tolist()}
    return save_checkpoint(run, network, {"step": step, "moments": torch.arange(3.0)}, meta, best=best), network


def test_a_network_comes_back(tmp_path):
    folder, network = save(tmp_path)
    loaded, meta = load_network(folder)
    assert not loaded.training
    assert loaded.config == MODEL
    for name, value in network.state_dict().items():
        assert torch.equal(value, loaded.state_dict()[name])
    assert meta["step"] == 5
    assert np.shape(meta["mean_pose_m"]) == (15, 3)
    assert load_state(folder)["moments"].tolist() == [0, 1, 2]


def test_last_and_best_are_kept_and_no_more(tmp_path):
    save(tmp_path, 1, best=True)
    save(tmp_path, 2, best=False)
    save(tmp_path, 3, best=False)
    assert read_meta(tmp_path / "last")["step"] == 3
    assert read_meta(tmp_path / "best")["step"] == 1
    assert sorted(path.name for path in (tmp_path / "checkpoints").iterdir()) == ["step_00000001", "step_00000003"]
    save(tmp_path, 4, best=True)
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["step_00000004"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["best", "checkpoints", "last"]


@pytest.mark.parametrize("dies_in", ["save_file", "_sync", "_point"])
def test_a_run_that_dies_while_writing_leaves_the_last_checkpoint(tmp_path, monkeypatch, dies_in):
    save(tmp_path, 1)

    def die(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint_module, dies_in, die)
        with pytest.raises(KeyboardInterrupt):
            save(tmp_path, 2)
    assert load_network(tmp_path / "last")[1]["step"] == 1
    save(tmp_path, 2)
    assert load_network(tmp_path / "last")[1]["step"] == 2
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["step_00000002"]


def test_a_run_that_dies_between_its_links_does_not_lose_the_best(tmp_path, monkeypatch):
    save(tmp_path, 1)
    point = checkpoint_module._point

    def die_at_last(link, folder):
        if link.name == "last":
            raise KeyboardInterrupt
        point(link, folder)

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint_module, "_point", die_at_last)
        with pytest.raises(KeyboardInterrupt):
            save(tmp_path, 2, best=True)
    assert [load_network(tmp_path / link)[1]["step"] for link in ("best", "last")] == [2, 1]
    save(tmp_path, 2, best=True)  # what going on from `last` comes to
    assert [load_network(tmp_path / link)[1]["step"] for link in ("best", "last")] == [2, 2]


def test_a_run_that_dies_while_removing_what_it_replaces_leaves_a_checkpoint(tmp_path, monkeypatch):
    save(tmp_path, 1)
    remove = shutil.rmtree

    def die_removing(folder, **how):
        if folder.exists():
            remove(folder, **how)
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint_module.shutil, "rmtree", die_removing)
        with pytest.raises(KeyboardInterrupt):
            save(tmp_path, 1)
    assert [load_network(tmp_path / link)[1]["step"] for link in ("best", "last")] == [1, 1]
    save(tmp_path, 1)
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["step_00000001"]


def test_a_run_folder_can_be_moved(tmp_path):
    save(tmp_path / "here")
    (tmp_path / "here").rename(tmp_path / "there")
    assert read_meta(tmp_path / "there" / "best")["step"] == 5


def test_a_resumed_run_goes_on_in_its_folder(tmp_path):
    save(tmp_path / "run")
    assert run_folder(None, "fresh") == "fresh"
    assert run_folder(str(tmp_path / "run" / "last"), "fresh") == str((tmp_path / "run").resolve())
    assert run_folder(str(tmp_path / "copied"), "fresh") == "fresh"


def break_file(folder, name, how):
    file = folder / name
    if how == "missing":
        file.unlink()
    elif how == "truncated":
        file.write_bytes(file.read_bytes()[:100])
    elif how == "foreign":
        file.write_bytes(b"\x80\x04K\x01." + bytes(200))


@pytest.mark.parametrize("how", ["missing", "truncated", "foreign"])
@pytest.mark.parametrize("name", ["model.safetensors", "meta.json"])
def test_a_damaged_network_is_refused(tmp_path, name, how):
    folder, _ = save(tmp_path)
    break_file(folder, name, how)
    with pytest.raises(InputError) as refusal:
        load_network(folder)
    assert str(tmp_path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("how", ["missing", "truncated", "foreign"])
def test_a_damaged_state_is_refused(tmp_path, how):
    folder, _ = save(tmp_path)
    break_file(folder, "state.pt", how)
    load_network(folder)  # prediction does not need it
    with pytest.raises(InputError, match=r"state\.pt.*cannot go on"):
        load_state(folder)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": 99}, "of version 1, found kpopnet-checkpoint of version 99"),
        ({"format": "pudding"}, "found pudding"),
        ({"model": {"kind": "dense", "dephts": 3}}, "unknown here.*dephts"),
        ({"model": {"kind": "denser"}}, "denser"),
        ({"model": {"kind": "dense", "crop_px": 32, "widths": [16, 16, 16, 16]}}, "not the weights"),
    ],
)
def test_a_foreign_description_is_refused(tmp_path, change, said):
    folder, _ = save(tmp_path)
    meta = read_meta(folder)
    (folder / "meta.json").write_text(json.dumps({**meta, **change}))
    with pytest.raises(InputError, match=said):
        load_network(folder)


def test_a_folder_without_a_checkpoint_is_refused(tmp_path):
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(InputError, match="no checkpoint there"):
            load_network(folder)


@pytest.mark.parametrize("model", [MODEL, ModelConfig(input="depth_ridge", crop_px=32, widths=[8, 8, 16, 16])])
def test_the_estimator_is_the_network_on_plain_crops(tmp_path, model):
    folder, network = save(tmp_path, model=model)
    estimator = NetworkEstimator(folder)
    depth = np.stack([draw_depth(draw_joints(np.random.default_rng(seed))) for seed in range(40)])
    depth[7] = 0
    estimate = estimator.estimate(depth, CAMERA)
    assert estimate.joints_camera_m.shape == (40, 15, 3)
    assert np.isnan(estimate.joints_camera_m[7]).all()
    assert (estimate.confidence[7] == 0).all()
    others = np.delete(np.arange(40), 7)
    assert np.isfinite(estimate.joints_camera_m[others]).all()
    assert ((estimate.confidence[others] > 0) & (estimate.confidence[others] < 1)).all()
    if model.input == "depth":
        for frame in (0, 39):
            cube = Cube(person_centre(depth[frame], CAMERA), model.half_size_m)
            image = torch.from_numpy(crop(depth[frame], CAMERA, cube, 32))
            with torch.inference_mode():
                uvd = network.eval()(image[None]).joints[0].numpy()
            np.testing.assert_allclose(estimate.joints_camera_m[frame], cube.to_metres(uvd), atol=1e-4)
    in_mm = (depth * 1000).round().astype(np.uint16)
    np.testing.assert_allclose(estimator.estimate(in_mm, CAMERA).joints_camera_m, estimate.joints_camera_m, atol=0.05)


def test_a_frame_alone_is_estimated_as_among_others_and_leaves_the_threads_as_they_were(tmp_path):
    estimator = NetworkEstimator(save(tmp_path)[0])
    depth = np.stack([draw_depth(draw_joints(np.random.default_rng(seed))) for seed in range(3)])
    together = estimator.estimate(depth, CAMERA)
    used, before = [], torch.get_num_threads()
    estimator.network.register_forward_pre_hook(lambda *_: used.append(torch.get_num_threads()))
    torch.set_num_threads(2)
    try:
        alone = [estimator.estimate(depth[i : i + 1], CAMERA) for i in range(3)]
        estimator.estimate(depth, CAMERA)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert used == [1, 1, 1, 2]
    for i in range(3):
        np.testing.assert_allclose(alone[i].joints_camera_m[0], together.joints_camera_m[i], atol=1e-5)


def test_the_estimator_of_nobody(tmp_path):
    estimate = NetworkEstimator(save(tmp_path)[0]).estimate(np.zeros((2, 120, 160), np.float32), CAMERA)
    assert np.isnan(estimate.joints_camera_m).all()
    assert (estimate.confidence == 0).all()


@pytest.mark.parametrize(
    ("depth", "said"),
    [
        (np.zeros((120, 160), np.float32), r"expected shape \(T, H, W\)"),
        (np.zeros((1, 60, 160), np.float32), "its pixels are 160x60"),
        (np.zeros((1, 120, 160), np.int32), "got int32"),
        ([[0.0]], "expected a numpy array"),
    ],
)
def test_the_estimator_refuses_depth_of_another_kind(tmp_path, depth, said):
    with pytest.raises(InputError, match=said):
        NetworkEstimator(save(tmp_path)[0]).estimate(depth, CAMERA)


def test_the_estimator_refuses_a_device_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="device=tpu"):
        NetworkEstimator(save(tmp_path)[0], device="tpu")


def test_copies_work_like_the_original(tmp_path):
    folder, _ = save(tmp_path / "run")
    shutil.copytree(folder, tmp_path / "copy")
    assert load_network(tmp_path / "copy")[1]["step"] == 5
