import numpy as np
import pytest
from shard_sets import write_shard

from kpopnet.datasets.protocol import BenchmarkConfig, Origin
from kpopnet.datasets.synthetic import SyntheticBenchmark
from kpopnet.errors import InputError


def benchmark(folder) -> SyntheticBenchmark:
    return SyntheticBenchmark(BenchmarkConfig("synthetic", str(folder)))


def test_consecutive_samples_of_a_person_in_a_room_are_a_sequence_even_across_shards(tmp_path):
    write_shard(tmp_path, [5, 5, 5, 8], rooms=[0, 0, 1, 1])
    write_shard(tmp_path, [8, 9, 9], shard=1, start=4, rooms=[1, 2, 2])
    write_shard(tmp_path, [5], shard=2, start=7, rooms=[3])
    found = benchmark(tmp_path)
    assert found.origin is Origin.SIMULATED and "synthetic" in found.truth
    assert found.samples.room_numbers().tolist() == [0, 0, 1, 1, 1, 2, 2, 3]
    sequences = [found.read(name) for name in found.sequence_names()]
    assert [(s.identity, len(s.depth_m)) for s in sequences] == [("5", 2), ("5", 1), ("8", 2), ("9", 2), ("5", 1)]
    assert len({s.name for s in sequences}) == 5 and found.sequence_names() == sorted(found.sequence_names())
    for name, column in (("joints_camera_m", "joints_m"), ("yaw_rad", "yaw")):
        stored = np.concatenate([getattr(s, name) for s in sequences])
        np.testing.assert_array_equal(stored, found.samples.column(column))
    first, second, third, fourth, last = (s.room for s in sequences)
    assert second == third and len({first, second, fourth, last}) == 4 and all(s.room for s in sequences)


def test_a_clean_set_is_rejected_with_instructions(tmp_path):
    write_shard(tmp_path, [1], kind="clean")
    with pytest.raises(InputError, match=r"clean set.*frozen"):
        benchmark(tmp_path)
    with pytest.raises(InputError, match="no shards"):
        benchmark(tmp_path / "nowhere")
