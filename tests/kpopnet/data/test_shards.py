"""The door of shards: what does not fit their description is refused in one line."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from factories import write_shard

from kpopnet.camera import Camera
from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SENSORS

CAMERA = Camera.centred(50.0, 64, 48)
COUNT = 4


@pytest.fixture
def shard(tmp_path: Path) -> Path:
    return write_shard(tmp_path, camera=CAMERA, kind="frozen")


def read_everything(path: Path) -> None:
    shards = ShardedSet(path.parent)
    for index in range(len(shards)):
        sample = shards[index]
        shards.room(index, sample.room)
    shards.column("joints_m")


def test_a_path_that_is_none_is_refused():
    with pytest.raises(InputError, match="expected the path of a file or folder, got None"):
        ShardedSet(None)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("version", 2, "attribute version: expected 1, found 2"),
        ("config", "[]", "attribute config: expected a JSON object"),
        ("start", COUNT, r"depth_mm: expected the shape \(0, 48, 64\) by its attributes, found \(4, 48, 64\)"),
        ("split", None, "attributes: lacks split"),
    ],
)
def test_invalid_attributes_are_refused(shard, name, value, message):
    with h5py.File(shard, "a") as file:
        del file.attrs[name]
        if value is not None:
            file.attrs[name] = value
    with pytest.raises(InputError, match=rf"shard_00000\.h5: .*{message}"):
        read_everything(shard)


def test_a_joint_that_is_not_known_is_refused(shard):
    with h5py.File(shard, "a") as file:
        file["joints_m"][2, 3] = np.nan
    with pytest.raises(InputError, match=r"shard_00000\.h5: joints_m: expected finite metres, found \w+ of row 2 unknown"):
        read_everything(shard)


def test_of_many_shards_few_are_open_and_all_can_be_read(tmp_path, monkeypatch):
    monkeypatch.setattr("kpopnet.runtime.hdf5_files.most_open", lambda: 3)
    for number in range(8):
        write_shard(tmp_path, number, camera=CAMERA, kind="frozen")
    shards = ShardedSet(tmp_path)
    first = [shards[index].depth_mm for index in range(len(shards))]
    for index in np.random.default_rng(0).permutation(len(shards)):
        np.testing.assert_array_equal(shards[index].depth_mm, first[index])
        assert len(shards._open) <= 3 and all(one.file.id.valid for one in shards._open.values())


def test_a_damaged_chunk_is_refused(shard):
    with h5py.File(shard, "a") as file:
        file["depth_mm"].id.write_direct_chunk((1, 0, 0), b"not zlib")
    shards = ShardedSet(shard.parent)
    assert shards[0].depth_mm.any()
    with pytest.raises(InputError, match=r"a shard cannot be read \(.*delete it and make it again"):
        shards[1]


@pytest.mark.parametrize(
    ("shard", "settings", "message"),
    [
        (1, {"camera": CAMERA, "kind": "frozen"}, r"shard_00001\.h5: frozen.*expected clean"),
        (
            1,
            {"camera": Camera.centred(50.0, 64, 50)},
            r"shard_00001\.h5: clean, Camera.*height=50.*expected clean.*as in shard",
        ),
        (2, {"camera": CAMERA}, r"shard_00002\.h5: starts with sample 8, but those before end at 4"),
    ],
)
def test_shards_of_a_set_have_one_camera_and_kind_and_none_is_missing(tmp_path, shard, settings, message):
    write_shard(tmp_path, 0, camera=CAMERA)
    write_shard(tmp_path, shard, **settings)
    with pytest.raises(InputError, match=message):
        ShardedSet(tmp_path)


def test_a_shard_that_changes_after_it_was_checked_is_checked_again(tmp_path):
    path = write_shard(tmp_path, camera=CAMERA)
    shards = ShardedSet(tmp_path)
    with h5py.File(path, "a") as file:
        del file["room_mm"]
        file["room_mm"] = np.ones((1, 20, 30), np.uint16)
    observer = Observer(shards, SENSORS["kinect_v1"], ExtractionConfig(), 0)
    with pytest.raises(InputError, match="room_mm: shape"):
        observer.observe(0, 0)
