"""train.py as a user runs it: real configurations, tiny shards."""

import json
import shutil
from functools import partial

import h5py
import numpy as np
import pytest
import torch
from factories import write_shard
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from programs import ROOT, run_program

from kpopnet.data.shards import ShardedSet
from kpopnet.networks.checkpoint import load_network, read_meta
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.programs.train import NetworkTrainingConfig

run = partial(run_program, "train.py")
SHORT = (
    "data.train=train", "data.validation=validation", "model.crop_px=32", "model.widths=[8,8,16,16]",
    "training.batch_size=4", "training.validate_every=2", "training.validation_samples=4",
    "workers=0", "threads=1", "device=cpu",
)  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("training")
    write_shard(folder / "train", 0, 6, empty=(2,))
    write_shard(folder / "train", 1, 6)
    write_shard(folder / "validation", 0, 4)
    write_shard(folder / "test", 0, 4, kind="frozen", empty=(1,))
    return folder


def tear(shard, row):
    """Overwrites a part of one stored image."""
    with h5py.File(shard, "r") as file:
        where = file["depth_mm"].id.get_chunk_info_by_coord((row, 0, 0)).byte_offset
    data = bytearray(shard.read_bytes())
    data[where : where + 64] = bytes(64)
    shard.write_bytes(data)


def test_a_run_leaves_a_network_and_says_what_it_does(place):
    network = ("model=holistic", "model.input=depth_ridge", "seed=3")
    whole = run(place, *SHORT, *network, "training.steps=4", "hydra.run.dir=whole")
    assert whole.returncode == 0, whole.stderr
    # The log names size, machine, data, folder and result.
    for expected in ("parameters", "CPU (1 process(es) of 1 thread(s))", "12 training and 4 validation samples",
                 "step 4 of 4: mean error", "whole/best", "empty silhouette"):  # fmt: skip
        assert expected in whole.stderr + whole.stdout, expected
    assert {path.name for path in (place / "whole").iterdir()} >= {"best", "last", "checkpoints", ".hydra", "train.log"}
    meta = read_meta(place / "whole" / "last")
    assert meta["model"]["kind"] == "holistic" and meta["config"]["seed"] == 3
    assert meta["config"]["sensor"]["name"] == "kinect_v1"
    # A depth + ridge network estimates from the depth alone: it makes its own ridge images.
    shards = ShardedSet(place / "validation")
    depth = np.stack([shards[index].depth_mm for index in range(2)])
    estimate = NetworkEstimator(place / "whole" / "best").estimate(depth, shards.camera)
    assert np.isfinite(estimate.joints_camera_m).all()


@pytest.fixture(scope="module")
def general(place):
    """A finished run of two steps."""
    done = run(place, *SHORT, "training.steps=2", "ridge.epsilon_r=0.6", "hydra.run.dir=general")
    assert done.returncode == 0, done.stderr
    return place / "general"


def test_resuming_takes_the_runs_own_configuration_and_folder(place, general):
    shutil.copytree(general, place / "first", symlinks=True)
    # Make of the finished run of 2 steps a checkpoint of a run of 4.
    meta = read_meta(place / "first" / "last")
    meta["config"]["training"]["steps"] = 4
    (place / "first" / "last" / "meta.json").write_text(json.dumps(meta))
    refused = run(place, "training.resume=first/last", "training.lr=1", "seed=7")
    assert refused.returncode == 1 and "training.lr, seed" in refused.stderr
    assert refused.stderr.startswith("error: training.resume goes on with the run as it was configured")
    composed = (place / "first" / ".hydra" / "config.yaml").read_text()
    resumed = run(place, "training.resume=first/last", "workers=0")
    assert resumed.returncode == 0, resumed.stderr
    assert (place / "first" / ".hydra" / "config.yaml").read_text() == composed
    meta = read_meta(place / "first" / "last")
    assert meta["step"] == 4 and meta["config"]["training"]["batch_size"] == 4
    assert not (place / "outputs").exists()


def test_a_run_begins_with_the_weights_of_another(place, general):
    # So slow that the weights stay what they were; the checkpoint says which model it is.
    settings = [word for word in SHORT if not word.startswith("model")]
    (place / "own/mine").mkdir(parents=True)
    (place / "own/mine/sharp.yaml").write_text("# @package _global_\nridge:\n  sharpness: 4\n")
    settings += ["training.steps=2", "training.start=general/best", "training.lr=1e-12", "seed=5"]
    settings = ["--config-dir=own", *settings, "+mine=sharp", "ridge.edge_threshold_m=0.07"]
    second = run(place, *settings, "hydra.run.dir=special")
    assert second.returncode == 0, second.stderr
    (old, _), (special, meta) = (load_network(folder / "best") for folder in (general, place / "special"))
    for expected, weight in zip(old.parameters(), special.parameters(), strict=True):
        torch.testing.assert_close(weight, expected, atol=1e-6, rtol=0)
    begun = meta["config"]
    assert begun["training"]["start"] == "general/best"
    assert begun["ridge"] == {"epsilon_r": 0.6, "edge_threshold_m": 0.07, "sharpness": 4}  # what was not said otherwise
    meta_path = shutil.copytree(place / "general/best", place / "other_ridge", symlinks=False) / "meta.json"
    content = json.loads(meta_path.read_text())
    content["config"]["ridge"]["window"] = 3
    meta_path.write_text(json.dumps(content))
    refused = run(place, "training.start=other_ridge", "hydra.run.dir=third").stderr
    assert refused.startswith("error: other_ridge: its ridge settings") and refused.count("\n") == 1


def test_a_torn_shard_in_the_middle_of_a_training_is_named(place):
    shutil.copytree(place / "train", place / "torn")
    tear(place / "torn" / "shard_00001.h5", 3)
    done = run(place, *SHORT, "data.train=torn", "workers=1", "training.steps=6", "hydra.run.dir=broken")
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("error: torn/shard_00001.h5") and "make it again" in last, done.stderr


def test_a_tree_walk_is_trained_and_judged(place):
    tree_walk = "tree_walk.crop_px=48", "tree_walk.images=40", "tree_walk.leaf_samples=10", "tree_walk.features=20"
    words = "--config-name", "tree_walk", "out=model", "data.train=train", "data.validation=validation", "workers=0", *tree_walk
    done = run(place, *words)
    assert done.returncode == 0, done.stderr
    assert "kpopnet evaluate 'estimator=[tree_walk]' estimator.tree_walk.path=model" in done.stdout + done.stderr
    again = run(place, *words, "seed=3")
    assert again.returncode == 1 and "model: holds a model; give another folder" in again.stderr
    assert "seed=3" not in (place / "model" / ".hydra" / "overrides.yaml").read_text()
    meta = json.loads((place / "model" / "meta.json").read_text())
    assert meta["config"]["tree_walk"]["images"] == 40 and meta["config"]["sensor"]["name"] == "kinect_v1"

    done = run_program(
        "evaluate.py", place, "estimator=[tree_walk]", "estimator.tree_walk.path=model", "benchmark.path=test",
        "hydra.run.dir=judged", "processes=1",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads((place / "judged" / "metrics.json").read_text())
    assert list(found["estimators"]) == ["tree_walk"] and found["missing"]["images_without_estimate"] == 1
    assert 0 < found["estimators"]["tree_walk"]["mean_error_cm"] < 200


def test_every_configuration_composes_to_real_objects():
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        for group in ("model", "training"):
            for choice in sorted(path.stem for path in (ROOT / "configs" / group).glob("*.yaml")):
                config = OmegaConf.to_object(compose("train", [f"{group}={choice}"]))
                assert isinstance(config, NetworkTrainingConfig)
                assert config.model.kind == (choice if group == "model" else "dense")
