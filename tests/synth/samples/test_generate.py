"""Sets of shards: atomic writes, independence of order and number of processes, and resuming after a kill."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from programs import ROOT, run_program

from kpopnet.data.shards import ShardedSet, shard_path
from kpopnet.errors import InputError
from kpopnet.ridge import RidgeConfig
from synth.motion import MotionConfig
from synth.samples.layers import silhouette_box
from synth.samples.observe import ExtractionConfig, FreezeConfig, freeze
from synth.samples.sampler import SampleConfig, Sampler
from synth.samples.writer import GENERATOR, SetConfig, finish, generate, is_finished, write_shard
from synth.sensor.model import SensorConfig

FREEZE = FreezeConfig(SensorConfig(), ExtractionConfig(), RidgeConfig())
SAMPLE = SampleConfig(renderer="cpu", motion=MotionConfig(source="poses"), samples_per_room=6)
CLEAN = SetConfig(SAMPLE, seed=3, split="train", count=22, shard_size=8, freeze=None)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("shard_*.h5"))}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The set, made by two processes."""
    folder = tmp_path_factory.mktemp("whole")
    generate(CLEAN, folder, range(CLEAN.num_shards), processes=2)
    return folder


def test_a_set_is_read_back_as_it_was_sampled(whole: Path) -> None:
    shards = ShardedSet(whole)
    assert len(shards) == 22 and shards.kind == "clean" and shards.camera == SAMPLE.camera.build()
    sampler = Sampler(SAMPLE, 3, "train")
    for index, rendered in enumerate(sampler.samples(0, 8)):
        read, expected = shards[index], rendered.sample
        np.testing.assert_array_equal(read.depth_mm, expected.depth_mm)
        np.testing.assert_array_equal(read.joints_camera_m, expected.joints_camera_m)
        np.testing.assert_array_equal(read.visible, expected.visible)
        assert (read.box, read.body, read.motion) == (expected.box, expected.body, expected.motion)
        room_mm, floor = shards.room(index, read.room)
        room = sampler.room(expected.room)
        np.testing.assert_array_equal(room_mm, room.depth_mm)
        np.testing.assert_array_equal(floor, room.floor)


def test_a_set_grows_to_the_same_whatever_the_processes_and_is_summarised_in_the_end(whole: Path, tmp_path: Path) -> None:
    small = replace(CLEAN, count=12)
    write_shard(small, tmp_path, 1)  # a part of that shard, alone
    write_shard(small, tmp_path, 0)
    first = shard_path(tmp_path, 0).stat().st_mtime_ns
    assert not is_finished(CLEAN, tmp_path, 1) and finish(CLEAN, tmp_path, FREEZE) is None
    generate(CLEAN, tmp_path, range(CLEAN.num_shards), processes=1)
    assert contents(tmp_path) == contents(whole)
    assert shard_path(tmp_path, 0).stat().st_mtime_ns == first
    summary = finish(CLEAN, tmp_path, FREEZE)
    assert summary["samples"] == 22 and summary["shards"] == 3 and summary["forced_samples"] == 0
    stored = json.loads((tmp_path / "set.json").read_text())
    assert stored["hash"] == CLEAN.hash and stored["config"]["generator"] == GENERATOR
    rendered = list(Sampler(SAMPLE, 3, "train").samples(0, 22))
    assert stored["refused_places"] == sum(one.refused_places for one in rendered) > 0
    assert stored["refused_poses"] == sum(one.rejected for one in rendered)
    assert (tmp_path / "contact_sheet.png").stat().st_size > 10_000
    generate(small, tmp_path, range(small.num_shards), processes=1)  # a part of what is there
    assert contents(tmp_path) == contents(whole) and finish(small, tmp_path, FREEZE)["samples"] == 22


def test_a_checkout_that_is_not_installed_writes_a_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("synth.samples.writer.PACKAGES", ("nowhere", "numpy"))
    write_shard(replace(CLEAN, count=2), tmp_path, 0)
    with h5py.File(shard_path(tmp_path, 0)) as file:
        assert json.loads(file.attrs["packages"]) == {"nowhere": None, "numpy": np.__version__}


def test_another_set_is_not_overwritten_and_the_settings_that_differ_are_named(whole: Path) -> None:
    before = contents(whole)
    others = {
        r"seed=3, not 4": {"seed": 4},
        r"split=train, not test": {"split": "test"},
        r"freeze=None, not \{.*": {"freeze": FREEZE},
        r"shard_size=8, not 9": {"shard_size": 9},
        # As where one of several machines has no GPU, whose renderer=auto is another one.
        r"sample\.renderer=cpu, not gl; sample\.samples_per_body=8, not 3": {
            "sample": replace(SAMPLE, samples_per_body=3, renderer="gl")
        },
    }
    for named, change in others.items():
        with pytest.raises(InputError, match=rf"shard_00000\.h5: belongs to another set \({named}\); choose another out="):
            generate(replace(CLEAN, **change), whole, range(1), processes=1)
    assert contents(whole) == before


def test_a_frozen_set_holds_noisy_depth_and_its_ridge(whole: Path, tmp_path: Path) -> None:
    frozen = replace(CLEAN, freeze=FREEZE, count=8)
    write_shard(frozen, tmp_path, 0)
    shards, clean = ShardedSet(tmp_path), ShardedSet(whole)
    assert shards.kind == "frozen"
    for index in range(len(shards)):
        noisy, expected = shards[index], clean[index]
        rng, room = np.random.default_rng([3, *b"train", index]), clean.room(index, expected.room)
        depth_mm, ridge = freeze(expected, room, clean.camera, FREEZE, rng)
        np.testing.assert_array_equal(noisy.joints_camera_m, expected.joints_camera_m)
        np.testing.assert_array_equal(noisy.depth_mm, depth_mm)
        np.testing.assert_array_equal(noisy.ridge, ridge)
        assert noisy.box == silhouette_box(depth_mm)
    assert any(shards[index].box != clean[index].box for index in range(len(shards)))


def test_a_cluster_job_writes_a_set(tmp_path: Path) -> None:
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher", reason="needs the extra `cluster`")
    out = f"out={tmp_path / 'set'}"
    settings = ["renderer=cpu", "motion=poses", "splits={train: 10, validation: 0, test: 0}", "shards=0:1", "processes=1"]
    done = run_program("-m", ROOT, "synth", "-m", "hydra/launcher=submitit_local", out, *settings)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(ShardedSet(tmp_path / "set" / "train")) == 10 and (tmp_path / "set" / "train" / "set.json").exists()
