"""The door of shards: what does not fit their description is refused in one line."""

import json
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from factories import write_shard

from kpopnet.camera import Camera
from kpopnet.data.shards import ShardedSet, shard_path
from kpopnet.errors import InputError
from synth.samples.observe import PERFECT, Observer
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


def replace(path: Path, name: str, values: np.ndarray | None, **options) -> None:
    with h5py.File(path, "a") as file:
        stored = file[name][()]
        del file[name]
        if values is not None:
            file.create_dataset(name, data=stored if values is ... else values, **options)


def test_valid_shards_are_read_as_hdf5_reads_them(shard):
    read_everything(shard)
    shards = ShardedSet(shard.parent)
    with h5py.File(shard, locking=False) as file:
        for row in range(COUNT):
            sample = shards[row]
            np.testing.assert_array_equal(sample.depth_mm, file["depth_mm"][row])
            np.testing.assert_array_equal(sample.ridge, file["ridge"][row])
            np.testing.assert_array_equal(sample.joints_camera_m, file["joints_m"][row])
        np.testing.assert_array_equal(shards.room(0, 0)[0], file["room_mm"][0])


def test_missing_joints_are_allowed(shard):
    joints = np.zeros((COUNT, 15, 3), np.float32)
    joints[2, 5] = np.nan
    visible = np.ones((COUNT, 15), bool)
    replace(shard, "joints_m", joints)
    replace(shard, "visible", visible)
    with pytest.raises(InputError, match=r"visible: row 2 is .* expected no joint whose joints_m is missing"):
        ShardedSet(shard.parent)[2]
    visible[2, 5] = False
    replace(shard, "visible", visible)
    assert np.isnan(ShardedSet(shard.parent)[2].joints_camera_m[5]).all()


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("room_mm", np.ones((1, 20, 30), np.uint16), r"room_mm: shape \(1, 20, 30\), expected \(R, H = 48, W = 64\)"),
        ("depth_mm", np.ones((COUNT, 48, 65), np.uint16), r"depth_mm: shape \(4, 48, 65\)"),
        ("depth_mm", np.ones((COUNT, 48, 64), np.float32), r"depth_mm: type float32, expected kind u"),
        ("depth_mm", np.ones((COUNT, 48, 64), np.uint32), r"depth_mm: numbers of 4 bytes, expected 2"),
        ("ridge", np.ones((COUNT - 1, 48, 64), np.uint8), r"ridge: shape \(3, 48, 64\)"),
        ("ridge", None, r"expected an array ridge in a frozen shard"),
        ("floor", np.ones((2, 4), np.float32), r"expected \(R, 4\)|expected \(R = 2, 48, 64\)|floor: shape"),
        ("floor", np.full((1, 4), np.nan, np.float32), r"floor: row 0 is .*nan.*, expected finite"),
        ("box", np.full((COUNT, 4), 65, np.int16), r"box: row 0 is \[65 65 65 65\], expected .* within 64x48"),
        ("box", np.tile(np.array([5, 5, 3, 9], np.int16), (COUNT, 1)), r"box: row 0"),
        ("box", np.full((COUNT, 4), -1, np.int16), r"box: row 0"),
        ("room", np.array([0, 0, 1, 0], np.int16), r"room: row 2 is 1, expected a row of the 1 in room_mm"),
        ("room", np.array([0, -1, 0, 0], np.int16), r"room: row 1 is -1"),
        ("yaw", np.array([0, np.inf, 0, 0], np.float32), r"yaw: row 1 is inf, expected finite numbers"),
        ("joints_m", np.full((COUNT, 15, 3), 1800.0), r"joints_m: row 0 .*expected metres up to 1000"),
        ("joints_m", np.full((COUNT, 15, 3), np.inf), r"joints_m: row 0"),
        ("joints_m", np.zeros((COUNT, 14, 3)), r"expected \(N = 4, 15, 3\)"),
        ("visible", np.ones((COUNT, 15), np.float32), r"visible: type float32, expected kind b"),
        ("motion", np.array(["a"] * COUNT, object), r"motion: values of variable length"),
        ("body", np.arange(COUNT + 1), r"body: shape \(5,\), expected \(N = 4\)"),
        ("body", None, r"expected an array body, found box, "),
    ],
)
def test_invalid_arrays_are_refused(shard, name, values, message):
    replace(shard, name, values)
    with pytest.raises(InputError, match=rf"shard_00000\.h5.*({message})"):
        read_everything(shard)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("version", 2, "attribute version: 2, expected 1"),
        ("kind", "dirty", "attribute kind: dirty, expected clean, frozen"),
        ("kind", 7, "attribute kind: kind i and shape .*, expected text, a single value"),
        ("config", "{", "attribute config: not valid JSON"),
        ("config", "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("config", "[]", "attribute config: expected a JSON object"),
        ("seed", -1, "attribute seed: -1, expected 0 to"),
        ("seed", 0.5, "attribute seed: kind f"),
        ("start", COUNT, "start 4, stop 4: expected start < stop"),
        ("stop", 2**40, r"expected \(N = 1099511627776"),
        ("camera", [50.0, 50, 31, 23, 64], r"camera: kind f and shape \(5,\), expected number or integer or integer, \(6,\)"),
        ("camera", [50.0, 50, 31, 23, 1e5, 1e5], "attribute camera: an image of .*at most 16,000,000 pixels"),
        ("camera", [50.0, 50, 31, 23, 64.5, 48], "attribute camera: an image of 64.5 x 48.* whole numbers"),
        ("camera", [-50.0, 50, 31, 23, 64, 48], "attribute camera: a camera needs finite intrinsics"),
        ("camera", [np.nan, 50, 31, 23, 64, 48], "attribute camera: .*nan"),
        ("joint_names", ["head"] * 15, "attribute joint_names: head, head, .*expected head, neck"),
        ("split", None, "attribute split: expected to find it in a shard"),
    ],
)
def test_invalid_attributes_are_refused(shard, name, value, message):
    with h5py.File(shard, "a") as file:
        del file.attrs[name]
        if value is not None:
            file.attrs[name] = value
    with pytest.raises(InputError, match=rf"shard_00000\.h5: .*{message}"):
        read_everything(shard)


def test_a_declared_column_of_any_length_takes_no_memory(shard):
    with h5py.File(shard, "a") as file:
        file.attrs["stop"] = 2**33
        for name in ("depth_mm", "ridge", "box", "joints_m", "visible", "body", "motion", "yaw", "room"):
            stored = file[name]
            shape, dtype = (2**33, *stored.shape[1:]), stored.dtype
            del file[name]
            file.create_dataset(name, shape, dtype, chunks=(1, *shape[1:]))
    with pytest.raises(InputError, match=r"box .* would take .* GB of memory"):
        read_everything(shard)


def test_links_and_data_elsewhere_are_refused(shard, tmp_path):
    whole = shard.read_bytes()
    other = tmp_path / "other.h5"
    other.write_bytes(whole)
    (tmp_path / "raw").write_bytes(bytes(8 * COUNT))
    layout = h5py.VirtualLayout((COUNT,), "i8")
    layout[:] = h5py.VirtualSource(str(other), "body", (COUNT,))
    for put in (
        lambda file: file.__setitem__("body", h5py.ExternalLink(str(other), "/body")),
        lambda file: file.__setitem__("body", h5py.SoftLink("/room")),
        lambda file: file.create_dataset("body", (COUNT,), "i8", external=[(str(tmp_path / "raw"), 0, 8 * COUNT)]),
        lambda file: file.create_virtual_dataset("body", layout),
    ):
        shard.write_bytes(whole)
        with h5py.File(shard, "a") as file:
            del file["body"]
            put(file)
        with pytest.raises(InputError, match="body is a link or lies in other files; expected an array stored in this file"):
            ShardedSet(tmp_path)
    shard.write_bytes(whole)
    with h5py.File(shard, "a") as file:
        del file["body"]
        file.create_group("body")
    with pytest.raises(InputError, match="body cannot be read"):
        ShardedSet(tmp_path)


@pytest.mark.parametrize(
    ("chunk", "skipped"),
    [
        (zlib.compress(b"x" * 100), 0),  # libhdf5 gives what lies behind the 100 bytes in memory
        (b"x" * 100, 3),
        (zlib.compress(bytes(50_000_000)), 0),
        (zlib.compress(bytes(2 * 48 * 64))[:-3], 0),
        (b"not zlib", 0),
    ],
)
def test_a_chunk_that_unpacks_to_another_size_is_refused(shard, chunk, skipped):
    with h5py.File(shard, "a") as file:
        file["depth_mm"].id.write_direct_chunk((1, 0, 0), chunk, skipped)
    shards = ShardedSet(shard.parent)
    assert shards[0].depth_mm.any()
    with pytest.raises(InputError, match=r"a part of it cannot be read \(.*chunk.*delete it and make it again"):
        shards[1]


def test_shards_of_one_set_have_one_camera_and_kind(tmp_path):
    write_shard(tmp_path, 0, camera=CAMERA)
    write_shard(tmp_path, 1, camera=CAMERA, kind="frozen")
    with pytest.raises(InputError, match=r"shard_00001\.h5: frozen.*expected clean"):
        ShardedSet(tmp_path)
    write_shard(tmp_path, 1, camera=Camera.centred(50.0, 64, 50))
    with pytest.raises(InputError, match=r"shard_00001\.h5: clean, Camera.*height=50.*expected clean.*as in shard_00000"):
        ShardedSet(tmp_path)


def test_a_shard_that_changes_after_it_was_checked_is_checked_again(tmp_path):
    path = write_shard(tmp_path, camera=CAMERA)
    shards = ShardedSet(tmp_path)
    replace(path, "room_mm", np.ones((1, 20, 30), np.uint16))
    observer = Observer(shards, SENSORS["kinect_v1"], PERFECT, 0)
    with pytest.raises(InputError, match="room_mm: shape"):
        observer.observe(0, 0)


def test_the_configuration_is_kept_as_it_is(tmp_path):
    path = write_shard(tmp_path, camera=CAMERA)
    with h5py.File(path, "a") as file:
        file.attrs["config"] = json.dumps({"path": "${oc.env:HOME}"})
    assert ShardedSet(tmp_path).header.config == {"path": "${oc.env:HOME}"}
    assert shard_path(tmp_path, 0) == path
