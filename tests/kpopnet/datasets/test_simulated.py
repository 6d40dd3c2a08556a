"""The files of simulated sequences: written files are read again, and what does not fit is refused."""

import logging
from contextlib import nullcontext
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from simulated_files import write_simulated
from slopes import joints_m, slope_m

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import BenchmarkConfig, Origin
from kpopnet.datasets.simulated import PeopleSet, SimulatedBenchmark, StoredSequence, read_sequence
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

CAMERA = Camera(50.1, 50.2, 31.5, 23.5, 64, 48)
DEPTH_M = np.stack([slope_m(frame, 48, 64) for frame in range(3)])
JOINTS_M = np.stack([joints_m(frame) for frame in range(3)]).astype(np.float32)[:, None]
MARKERS_M = np.full((3, 1, 2, 3), np.float32(0.1))
PIXELS = [np.arange(start, start + 3)[:, None] for start in (20, 30, 10)]
SEQUENCE = StoredSequence("", "kicks", 25.0, CAMERA, ("sim01",), DEPTH_M, JOINTS_M, MARKERS_M, ("LFHD", "RFHD"), *PIXELS)


def benchmark(folder: Path) -> SimulatedBenchmark:
    return SimulatedBenchmark(BenchmarkConfig("smmc10_sim", str(folder)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_simulated(tmp_path, "smmc10_sim", {"sim01_10": SEQUENCE, "sim02_2": SEQUENCE, "sim01_1": SEQUENCE})
    return tmp_path


def test_a_written_sequence_is_read_again(folder):
    found = read_sequence(folder / "sim02_2.h5")
    for one in fields(StoredSequence):
        before, after = getattr(SEQUENCE, one.name), getattr(found, one.name)
        np.testing.assert_array_equal(after, "sim02_2" if one.name == "name" else before)
        assert not isinstance(before, np.ndarray) or before.dtype == after.dtype
    assert (folder / "sim02_2.h5").read_bytes() == (folder / "sim01_1.h5").read_bytes()


@pytest.mark.parametrize("millimetres", [False, True])
def test_a_set_is_read_as_a_benchmark_that_calls_itself_simulated(folder, millimetres):
    unknown = JOINTS_M.copy()
    unknown[1, 0, Joint.HEAD] = np.nan
    depth = np.rint(1000 * DEPTH_M).astype(np.uint16) if millimetres else DEPTH_M
    changed = replace(SEQUENCE, depth=depth, joints_m=unknown)
    write_simulated(folder, "smmc10_sim", {"sim02_2": changed}, sequences=3)
    found = benchmark(folder)
    assert found.sequence_names() == ["sim01_1", "sim02_2", "sim01_10"]
    assert found.origin is Origin.SIMULATED and "SIMULATED" in found.about and "Seed 3" in found.about
    assert found.provenance == {"seed": 3, "version": 2, "config_hash": "0" * 12}
    sequence = found.read("sim02_2")
    assert (sequence.name, sequence.identity, sequence.fps, sequence.camera) == ("sim02_2", "sim01", 25.0, CAMERA)
    np.testing.assert_allclose(sequence.depth_m, DEPTH_M, atol=0.00051 if millimetres else 0)
    np.testing.assert_array_equal(sequence.joints_camera_m, unknown[:, 0])
    assert sequence.visible.sum() == 44 and not sequence.visible[1, Joint.HEAD] and not sequence.is_segmented


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, ""),
        ({"depth": DEPTH_M}, "depth: expected uint16"),
        ({"seen_px": None}, "expected arrays seen_px"),
        ({"seen_px": PIXELS[1] + 1}, "seen_px: expected at least 0"),
    ],
)
def test_people_without_what_is_seen_of_them_are_refused(tmp_path, changes, message):
    depth_mm = np.rint(1000 * DEPTH_M).astype(np.uint16)
    write_simulated(tmp_path, "rooms", {"a": replace(SEQUENCE, **{"depth": depth_mm} | changes)})
    with pytest.raises(InputError, match=message) if message else nullcontext():
        np.testing.assert_array_equal(PeopleSet(BenchmarkConfig("rooms", str(tmp_path))).read("a").depth, depth_mm)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": DEPTH_M[:2]}, r"shape|T ="),
        ({"people": ("ann", "bob")}, "a name for each person"),
        ({"joints_m": np.zeros((3, 1, 14, 3), np.float32)}, "joints_m"),
        ({"fps": 0.0}, "fps"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(folder, changes, message):
    write_simulated(folder, "smmc10_sim", {"sim02_2": replace(SEQUENCE, **changes)})
    with pytest.raises(InputError, match=rf"sim02_2\.h5.*({message})"):
        benchmark(folder).read("sim02_2")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"hash": 1}, r"manifest\.json.*make the set again"),
        ({"benchmark": "eval_sim"}, "holds eval_sim"),
        ({"simulated": False}, "called simulated"),
    ],
)
def test_another_set_is_refused(folder, changes, message):
    write_simulated(folder, **{"benchmark": "smmc10_sim", "files": {}} | changes)
    with pytest.raises(InputError, match=message):
        benchmark(folder)


def test_an_unfinished_set_is_reported_and_a_missing_one_refused(folder, caplog, tmp_path_factory):
    write_simulated(folder, "smmc10_sim", {}, sequences=8)
    (folder / "._seq_00.h5").write_bytes(b"what macOS writes beside a file")
    with caplog.at_level(logging.WARNING):
        benchmark(folder)
    assert "only 3 of its 8 sequences exist" in caplog.text
    with pytest.raises(InputError, match=r"no manifest\.json in it; `python -m synth benchmark=smmc10_sim"):
        benchmark(tmp_path_factory.mktemp("empty"))
