"""Checkpoints are read as they were written, are written atomically, and are refused if damaged or of another format."""

import errno
import json
import os

import numpy as np
import pytest
import torch
from capsule_people import CAMERA, draw_depth, draw_joints

import kpopnet.networks.checkpoint as checkpoint_module
from kpopnet.data.cube import Cube, crop, person_centre
from kpopnet.errors import InputError
from kpopnet.networks import WEIGHTS, ModelConfig
from kpopnet.networks.checkpoint import (
    load_network,
    load_state,
    load_weights,
    read_meta,
    refuse_copied_links,
    resumable,
    run_folder,
    save_checkpoint,
)
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])


NETWORK, OTHER = build_network(MODEL, 1), build_network(MODEL, 2)


def save(run, step=5, best=True, network=NETWORK):
    meta = {"step": step, "config": {}, "metrics": {}, "mean_pose_m": np.zeros((15, 3)).tolist()}
    return save_checkpoint(run, network, {"step": step, "moments": torch.arange(3.0)}, meta, best=best)


def whole(folder):
    """The step of a checkpoint all files of which are whole."""
    load_weights(OTHER, folder / WEIGHTS)
    assert load_state(folder)["step"] == read_meta(folder)["step"]
    return read_meta(folder)["step"]


def test_a_network_is_read_as_it_was_written(tmp_path):
    folder = save(tmp_path)
    loaded, meta = load_network(folder)
    assert not loaded.training and loaded.config == MODEL and meta["step"] == 5
    for name, value in NETWORK.state_dict().items():
        assert torch.equal(value, loaded.state_dict()[name])
    assert load_state(folder)["moments"].tolist() == [0, 1, 2]


def test_the_best_stays_the_best_until_a_better_one_comes(tmp_path):
    for step, best, expected in ((1, True, 1), (2, False, 1), (3, False, 1), (4, True, 4)):
        save(tmp_path, step, best)
        assert (whole(tmp_path / "last"), whole(tmp_path / "best")) == (step, expected)


def test_without_links_both_are_the_checkpoints_themselves_and_a_run_goes_on_in_its_folder(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.EPERM, "A required privilege is not held by the client")  # Windows' words

    monkeypatch.setattr(os, "symlink", refuse)
    (tmp_path / "checkpoints/.step_00000000.7").mkdir(parents=True)  # of a run that was killed
    for step, best, expected in ((1, True, 1), (2, False, 1), (3, True, 3), (4, False, 3)):
        save(tmp_path, step, best)
        assert (whole(tmp_path / "last"), whole(tmp_path / "best")) == (step, expected)
        assert not list((tmp_path / "checkpoints").iterdir())
        assert sorted(path.name for path in tmp_path.iterdir()) == ["best", "checkpoints", "last"]
    refuse_copied_links(tmp_path)
    assert run_folder(str(tmp_path / "last"), "elsewhere") == str(tmp_path)


class Killed(BaseException):
    """Stands for a SIGKILL at a certain change of the file system."""


def die_after(monkeypatch, change):
    """Lets the process die after that change, counted from 0, of names in the file system; returns the changes."""
    done = []

    def dying(original):
        def call(*args, **kwargs):
            done.append(original.__name__)
            count = len(done)
            try:
                return original(*args, **kwargs)
            finally:
                if count - 1 == change:
                    raise Killed

        return call

    for name in ("mkdir", "rename", "replace", "symlink", "unlink", "rmdir"):
        monkeypatch.setattr(os, name, dying(getattr(os, name)))
    return done


@pytest.mark.parametrize("before", [[], [(1, True), (3, False)]], ids=["first", "again"])
def test_wherever_a_run_is_killed_both_links_point_to_whole_checkpoints(tmp_path, monkeypatch, before):
    monkeypatch.setattr(checkpoint_module, "git_revision", dict)  # asking git takes longest
    killed = 0
    for change in range(100):
        run = tmp_path / str(change)
        for step, was_best in before:
            save(run, step, was_best)
        steps = {link: read_meta(run / link)["step"] for link in ("last", "best") if (run / link).exists()}
        with monkeypatch.context() as patch:
            done = die_after(patch, change)
            try:
                save(run, 3, True)
            except Killed:
                killed += 1
            else:
                break
        assert all(whole(run / link) in (step, 3) for link, step in steps.items()), (change, done)
        assert all(map(whole, (run / "checkpoints").glob("step_*"))), (change, done)  # what is left of a removed one is hidden
        assert resumable(run) is not None or not steps
        assert resumable(run) or not list((run / "checkpoints").glob("step_*"))
        assert not resumable(run) or (whole(run / "best") and whole(run / "last"))
        save(run, 3, True)
        assert whole(run / "last") == whole(run / "best") == 3
        assert len(list((run / "checkpoints").iterdir())) == 1
        assert sorted(path.name for path in run.iterdir() if path.name[0] != ".") == ["best", "checkpoints", "last"]
    assert 4 <= killed < 100


@pytest.mark.parametrize("name", ["model.safetensors", "meta.json", "state.pt"])
def test_a_damaged_checkpoint_is_refused_in_one_line(tmp_path, name):
    file = save(tmp_path) / name
    content = file.read_bytes()
    for damage in (lambda: file.write_bytes(content[:100]), file.unlink):
        damage()
        if name == "state.pt":
            load_network(file.parent)  # prediction does not need it
        with pytest.raises(InputError, match="cannot be resumed" if name == "state.pt" else str(tmp_path)) as refusal:
            (load_state if name == "state.pt" else load_network)(file.parent)
        assert "\n" not in str(refusal.value)


class RunsCode:
    def __reduce__(self):
        return os.mkdir, ("ran",)


def test_a_state_of_other_objects_is_refused_and_runs_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = save(tmp_path / "run")
    torch.save(RunsCode(), folder / "state.pt")
    with pytest.raises(InputError, match=r"state\.pt"):
        load_state(folder)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 99}, "of version 1, found kpopnet-checkpoint of version 99"),
        ({"model": {"kind": "dense", "dephts": 3}}, "unknown to this version.*dephts"),
        ({"model": {"widths": [100_000] * 4}}, "widths"),  # would take 300 GB
        ({"model": {"kind": "dense", "crop_px": 32, "widths": [16, 16, 16, 16]}}, "not the weights"),
    ],
)
def test_another_description_is_refused(tmp_path, change, message):
    folder = save(tmp_path)
    meta = read_meta(folder)
    (folder / "meta.json").write_text(json.dumps({**meta, **change}))
    with pytest.raises(InputError, match=message):
        load_network(folder)


def test_the_estimators_first_look_is_the_network_on_plain_crops(tmp_path, monkeypatch):
    monkeypatch.setattr("kpopnet.networks.estimator.CHILD_SIZE", 0)
    estimator = NetworkEstimator(save(tmp_path))
    depth = np.stack([draw_depth(draw_joints(np.random.default_rng(seed))) for seed in range(40)])
    depth[7] = 0
    estimate, _ = estimator.judge([(image_m, CAMERA) for image_m in depth], second_pass_confidence=0)
    shown = np.arange(40) != 7
    np.testing.assert_array_equal(np.isfinite(estimate.joints_camera_m).all(axis=(1, 2)), shown)
    np.testing.assert_array_equal((estimate.confidence > 0).all(axis=1), shown)
    for frame in (0, 39):
        cube = Cube(person_centre(depth[frame], CAMERA), MODEL.half_size_m)
        image = torch.from_numpy(crop(depth[frame], CAMERA, cube, 32))
        with torch.inference_mode():
            uvd = load_network(tmp_path / "last")[0](image[None]).joints[0].numpy()
        np.testing.assert_allclose(estimate.joints_camera_m[frame], cube.to_metres(uvd), atol=1e-4)
    in_mm = (depth * 1000).round().astype(np.uint16)
    twice_m, twice_mm = (estimator.estimate(one, CAMERA).joints_camera_m for one in (depth, in_mm))
    np.testing.assert_allclose(twice_mm, twice_m, atol=0.05)


def test_a_single_frame_is_estimated_on_one_thread_as_in_a_sequence(tmp_path):
    estimator = NetworkEstimator(save(tmp_path))
    depth = np.stack([draw_depth(draw_joints(np.random.default_rng(seed))) for seed in range(2)])
    used, before = [], torch.get_num_threads()
    estimator.backend.network.register_forward_pre_hook(lambda *_: used.append(torch.get_num_threads()))
    torch.set_num_threads(2)
    try:
        single = estimator.estimate(depth[1:], CAMERA)
        assert set(used) == {1}
        used.clear()
        together = estimator.estimate(depth, CAMERA)
        assert used[0] == 2  # who is not upright is looked at again
    finally:
        torch.set_num_threads(before)
    np.testing.assert_allclose(single.joints_camera_m[0], together.joints_camera_m[1], atol=1e-5)
