"""train.py --config-name tree_walk and its model in evaluate.py, as a user runs them: real configurations, tiny shards."""

import json

import pytest
from factories import write_shard
from programs import run_program

SHORT = (
    "data.train=train", "data.validation=validation", "workers=0", "tree_walk.crop_px=48", "tree_walk.images=40",
    "tree_walk.leaf_samples=10", "tree_walk.features=20",
)  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tree_walk")
    write_shard(folder / "train", 0, 6, empty=(2,))
    write_shard(folder / "validation", 0, 4)
    write_shard(folder / "test", 0, 4, kind="frozen", empty=(1,))
    return folder


def test_a_model_is_trained_and_judged(place):
    done = run_program("train.py", place, "--config-name", "tree_walk", "out=model", *SHORT)
    assert done.returncode == 0, done.stderr
    assert "% within 10 cm on validation people" in done.stdout + done.stderr
    again = run_program("train.py", place, "--config-name", "tree_walk", "out=model", "seed=3", *SHORT)
    assert again.returncode == 1 and "model: holds a model; give another folder" in again.stderr
    meta = json.loads((place / "model" / "meta.json").read_text())
    assert meta["config"]["tree_walk"]["images"] == 40 and meta["config"]["sensor"]["name"] == "kinect_v1"
    assert set(meta["metrics"]["within_10cm_per_joint"]) == set(meta["joint_names"])

    done = run_program(
        "evaluate.py", place, "estimator=[tree_walk]", "estimator.tree_walk.path=model", "benchmark.path=test",
        "hydra.run.dir=judged", "processes=1",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads((place / "judged" / "metrics.json").read_text())
    assert list(found["estimators"]) == ["tree_walk"] and found["missing"]["images_without_estimate"] == 1
    assert 0 < found["estimators"]["tree_walk"]["mean_error_cm"] < 200
