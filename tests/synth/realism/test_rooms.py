"""Bodies inside boxes, and the geometry of stored samples drawn again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from synth.motion import MotionConfig
from synth.realism.rooms import FURNITURE, TOUCH_M, _built, is_inside, overlaps
from synth.samples.sampler import SampleConfig
from synth.samples.writer import SetConfig, write_shard
from synth.scene.room import Room

WEIGHTS = {"poses": 0.5, "choreography": 0.5}  # sorted, as JSON stores them, they would draw other poses
CONFIG = SampleConfig(renderer="cpu", motion=MotionConfig(source="mix", dances=2, seconds=5.0, weights=WEIGHTS))
SET = SetConfig(CONFIG, seed=3, split="train", count=6, shard_size=6, freeze=None)


def test_a_point_is_inside_a_turned_box_if_deeper_than_a_touch() -> None:
    room = Room(np.zeros((5, 3)), np.concatenate([np.zeros((4, 3)), [[1.0, 0.2, 0.5]]]), np.array([0, 0, 0, 0, np.pi / 4]))
    along = np.array([[np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0]])  # the box's long axis
    assert is_inside(room, 0.9 * along, *FURNITURE)
    assert not is_inside(room, (1 - TOUCH_M / 2) * along, *FURNITURE)
    assert not is_inside(room, np.array([[0.5, -0.5, 0.0]]), *FURNITURE)
    assert not is_inside(room, 0.9 * along, 1, 4)


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> ShardedSet:
    folder = tmp_path_factory.mktemp("set")
    write_shard(SET, folder, 0)
    return ShardedSet(folder)


def test_settings_come_back_from_the_header(shards: ShardedSet) -> None:
    rebuilt = _built(SampleConfig, shards.header.config["sample"])
    assert rebuilt == CONFIG
    assert list(rebuilt.motion.weights) == list(WEIGHTS)


def test_bodies_are_found_in_furniture_and_walls(shards: ShardedSet, monkeypatch: pytest.MonkeyPatch) -> None:
    assert overlaps(shards, range(6)).shape == (6, 2)
    asked = []

    def everything_from_the_walls_on(room: Room, points_m: np.ndarray, first: int, last: int | None) -> bool:
        joints_m = points_m.mean(axis=0)
        asked.append(joints_m)
        return first == FURNITURE[0]

    monkeypatch.setattr("synth.realism.rooms.is_inside", everything_from_the_walls_on)
    assert overlaps(shards, [0, 3]).tolist() == [[True, False]] * 2
    # The vertices are those of the sample itself: their middle lies as far away as its joints.
    for index, middle_m in zip((0, 3), asked[::2], strict=True):
        torso_z_m = np.nanmean(shards[index].joints_camera_m[:, 2])
        assert middle_m[1] == pytest.approx(torso_z_m, abs=0.5)


def test_samples_of_another_generator_are_refused(shards: ShardedSet, tmp_path: Path) -> None:
    write_shard(replace(SET, seed=4), tmp_path, 0)
    other = ShardedSet(tmp_path)
    other.header = replace(other.header, seed=3)
    with pytest.raises(InputError, match="draws other samples"):
        overlaps(other, [0])
    other.header = replace(other.header, config={"sample": {"colour": 1}})
    with pytest.raises(InputError, match="other settings"):
        overlaps(other, [0])
