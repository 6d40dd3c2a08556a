"""The reader of SMMC-10 on valid and invalid files, packed by hand in the published layout."""

import importlib
import json
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from damaged_files import survives_damage
from hydra import compose, initialize_config_dir
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf
from programs import ROOT
from slopes import slope_m

from kpopnet.camera import Camera
from kpopnet.datasets.protocol import Origin
from kpopnet.datasets.smmc10.benchmark import (
    KNOWN_MARKERS,
    Smmc10Benchmark,
    Smmc10Config,
    Smmc10SimBenchmark,
    Smmc10SimConfig,
)
from kpopnet.datasets.smmc10.format import FRAMES_PER_BLOCK, PACKED, PADDED, image_points, read_sequence, stored_points
from kpopnet.errors import InputError
from kpopnet.evaluation.registry import BENCHMARKS
from kpopnet.skeleton import JOINT_NAMES, Joint

PACKED_BYTES, PADDED_BYTES = 458_004, 458_008
CAMERA = Camera(204.8, 203.1, 72.3, 87.6, 144, 176)
MARKERS = {"head": [1, 3], "neck": [5], "left_hand": [24]}


def scene(frame: int) -> np.ndarray:
    return slope_m(frame, 176, 144)


def position(number: int, frame: int = 0) -> tuple[float, float, float]:
    """(3,) position of a marker in the camera frame, in metres."""
    return (0.01 * number + 0.01 * frame, -0.02 * number, 2.0 + 0.01 * number)


def points_of(depth: np.ndarray) -> list[tuple[float, float, float]]:
    """The 25,344 points in the order of the file: point i at row i % 176 and column i // 176; y up, z negative."""
    points = []
    for i in range(25344):
        row, column = i % 176, i // 176
        z = float(depth[row, column])
        points.append(((column - CAMERA.cx) * z / CAMERA.fx, -(row - CAMERA.cy) * z / CAMERA.fy, -z))
    return points


POINTS = {frame: np.array(points_of(scene(frame)), "<f4") for frame in range(3)}


def packed(frame: int, *, magic=-1982, markers=None, points=None, nmarkers=None, padding=b"") -> bytes:
    """One frame, field by field; a marker is (id, position in the camera frame, cond)."""
    if markers is None:
        markers = [(number, position(number, frame), 1.0) for number in (1, 3, 5, 24)]
    points = POINTS[frame % 3] if points is None else points
    parts = [struct.pack("<iiq", magic, frame, 40_000 * frame), points.astype("<f4").tobytes()]
    for values in (np.arange(25344) % 60000, np.arange(25344) % 7, np.full(25344, 9)):  # dist, amp, conf
        parts.append(values.astype("<u2").tobytes())
    parts.append(struct.pack("<i", len(markers) if nmarkers is None else nmarkers))
    for slot in range(64):
        number, (x, y, z), cond = markers[slot] if slot < len(markers) else (77, (5, 5, 5), 9.0)
        parts.append(struct.pack("<ii4fI", number, frame, x, -y, -z, cond, 3))
    whole = b"".join(parts)
    assert len(whole) == PACKED_BYTES
    return whole + padding


@pytest.fixture(params=[b"", b"\xaa\xbb\xcc\xdd"], ids=["packed", "padded"])
def padding(request) -> bytes:
    return request.param


@pytest.fixture
def folder(tmp_path: Path, padding: bytes) -> Path:
    """Three frames of one sequence."""
    (tmp_path / "real01_7.cal.bin").write_bytes(b"".join(packed(frame, padding=padding) for frame in range(3)))
    return tmp_path


def read(folder: Path, joints=None):
    return Smmc10Benchmark(Smmc10Config(path=str(folder), joints=joints or MARKERS)).read("real01_7")


def test_the_layouts_are_the_published_ones():
    assert (PACKED.itemsize, PADDED.itemsize) == (PACKED_BYTES, PADDED_BYTES)
    for layout, padding in ((PACKED, b""), (PADDED, bytes(4))):
        whole = packed(2, padding=padding)
        frame = np.frombuffer(whole, layout)[0]
        assert (frame["magic"], frame["frame"], frame["timestamp"], frame["nmarkers"]) == (-1982, 2, 80_000, 4)
        assert (frame["dist"][300], frame["amp"][300], frame["conf"][300]) == (300, 300 % 7, 9)
        marker = frame["markers"][3]
        assert (marker["id"], marker["frame"], marker["cond"], marker["flag"]) == (24, 2, 1.0, 3)
        i = 100 * 176 + 33  # column 100, row 33
        x, y, z = struct.unpack_from("<3f", whole, 16 + 12 * i)
        np.testing.assert_array_equal(image_points(frame["points"])[33, 100], np.float32([x, y, z]))
        assert -z == scene(2)[33, 100]
        assert frame.tobytes() == whole


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_stored_points_inverts_image_points(seed):
    stored = np.random.default_rng(seed).standard_normal((25344, 3))
    np.testing.assert_array_equal(stored_points(image_points(stored)), stored)


def test_a_sequence_reads_as_depth_camera_and_joints(folder):
    sequence = read(folder)
    assert (sequence.name, sequence.identity, sequence.fps, sequence.is_segmented) == ("real01_7", "", 25.0, False)
    np.testing.assert_array_equal(sequence.depth_m, np.stack([scene(frame) for frame in range(3)]))
    for frame in range(3):
        joints = sequence.joints_camera_m[frame]
        head = np.mean([position(1, frame), position(3, frame)], axis=0)
        np.testing.assert_allclose(joints[Joint.HEAD], head, atol=1e-6)
        np.testing.assert_allclose(joints[Joint.NECK], position(5, frame), atol=1e-6)
        np.testing.assert_allclose(joints[Joint.LEFT_HAND], position(24, frame), atol=1e-6)
    assert sequence.visible.sum() == 9 and (sequence.camera.width, sequence.camera.height) == (144, 176)
    found = [sequence.camera.fx, sequence.camera.fy, sequence.camera.cx, sequence.camera.cy]
    np.testing.assert_allclose(found, [CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy], atol=1e-3)


def test_more_frames_than_one_block(tmp_path, padding):
    frames = FRAMES_PER_BLOCK + 2
    (tmp_path / "real01_7.cal.bin").write_bytes(b"".join(packed(frame, padding=padding) for frame in range(frames)))
    sequence = read(tmp_path)
    assert len(sequence.depth_m) == frames
    for frame in (0, FRAMES_PER_BLOCK - 1, FRAMES_PER_BLOCK, frames - 1):
        np.testing.assert_array_equal(sequence.depth_m[frame], scene(frame % 3))
        np.testing.assert_allclose(sequence.joints_camera_m[frame, Joint.NECK], position(5, frame), atol=1e-6)


def test_the_layout_of_a_single_frame_is_detected_by_its_length(tmp_path, padding):
    path = tmp_path / "real01_7.cal.bin"
    path.write_bytes(packed(1, padding=padding))
    assert len(read(tmp_path).depth_m) == 1
    path.write_bytes(packed(1, padding=padding)[:-1])
    with pytest.raises(InputError, match=r"458003 bytes|458007 bytes"):
        read(tmp_path)


@pytest.mark.parametrize("cut", [1, 8, 600, PACKED_BYTES - 1])
def test_a_truncated_last_frame_is_named(folder, padding, cut):
    path = folder / "real01_7.cal.bin"
    size = PACKED_BYTES + len(padding)
    path.write_bytes(path.read_bytes()[: 2 * size + cut])
    with pytest.raises(
        InputError, match=rf"real01_7\.cal\.bin: ends {cut} bytes into frame 2; .*{size} bytes.*download it again"
    ):
        read(folder)


def test_empty_and_missing_files_are_rejected(tmp_path):
    path = tmp_path / "real01_7.cal.bin"
    path.write_bytes(b"")
    benchmark = Smmc10Benchmark(Smmc10Config(path=str(tmp_path), joints=MARKERS))
    with pytest.raises(InputError, match=r"real01_7\.cal\.bin: holds no frame"):
        benchmark.read("real01_7")
    path.unlink()
    with pytest.raises(InputError, match=r"real01_7\.cal\.bin: no such file"):
        benchmark.read("real01_7")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"magic": 1982}, "frame 2 has magic 1982"),
        ({"nmarkers": 65}, "frame 2 .*65 markers"),
        ({"nmarkers": -1}, "frame 2 .*-1 markers"),
    ],
)
def test_an_invalid_frame_is_named(tmp_path, padding, changes, message):
    frames = [packed(0, padding=padding), packed(1, padding=padding), packed(2, padding=padding, **changes)]
    (tmp_path / "real01_7.cal.bin").write_bytes(b"".join(frames))
    with pytest.raises(InputError, match=rf"real01_7\.cal\.bin: {message}.*not an SMMC-10 sequence, or it is damaged"):
        read(tmp_path)


def test_other_files_are_rejected(tmp_path):
    path = tmp_path / "real01_7.cal.bin"
    rng = np.random.default_rng(3)
    for content, message in (
        (packed(0, magic=7) + packed(1), "begins with magic 7, SMMC-10 with -1982"),
        (rng.bytes(2 * PACKED_BYTES), "begins with magic"),
        (b"\x01", "begins with magic None"),
        (struct.pack("<i", -1982) + rng.bytes(3 * PACKED_BYTES), "no second frame begins after 458004 or 458008"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"real01_7\.cal\.bin: .*{message}"):
            read(tmp_path)


def test_points_that_no_camera_fits_are_rejected(tmp_path):
    path = tmp_path / "real01_7.cal.bin"
    landscape = stored_points(scene(0)[:, :, None] * np.random.default_rng(0).uniform(-1, -0.5, (176, 144, 3)))
    path.write_bytes(packed(0, points=landscape))
    with pytest.raises(InputError, match=r"the best-fitting camera .* pixels; .*144x176 organised points"):
        read(tmp_path)
    path.write_bytes(packed(0, points=np.zeros((25344, 3))))
    with pytest.raises(InputError, match=r"no point in front of the camera is measured in its 1 frames \(all are 0\)"):
        read(tmp_path)


def test_values_that_are_left_out_are_counted_and_logged(tmp_path, caplog):
    points = POINTS[0].copy()
    points[1000:1010] = np.nan
    points[2000] = 0.1, 0.1, 2.0  # behind the camera
    markers = [
        (1, position(1), 1.0),
        (3, position(3), -1.0),  # not visible
        (5, (np.nan, 0, 2), 1.0),
        (24, position(24), 0.5),
        (24, position(25), 0.5),  # the same id again
        (60, position(60), 1.0),  # not in the map
    ]
    (tmp_path / "real01_7.cal.bin").write_bytes(packed(0, points=points, markers=markers) + packed(1))
    with caplog.at_level(logging.WARNING):
        sequence = read(tmp_path, MARKERS | {"right_hand": [16]})
    found = read_sequence(tmp_path / "real01_7.cal.bin", MARKERS | {"right_hand": [16]})
    assert found.skipped == {
        "points that are not finite": 10,
        "points behind the camera": 1,
        "markers that were not visible": 1,
        "visible markers whose position is not finite": 1,
        "markers with the id of another marker of the frame": 1,
        "positions of markers that are not in the map (60)": 1,
        "frames without marker 16, which is in the map": 2,
    }
    for what, count in found.skipped.items():
        assert f"{count} {what}" in caplog.text
    assert "real01_7: left out" in caplog.text and len(caplog.records) == 1
    assert np.isfinite(sequence.depth_m).all() and not sequence.depth_m[0, 1000 % 176, 1000 // 176]
    present = np.isfinite(sequence.joints_camera_m).all(axis=-1)
    named = [Joint.HEAD, Joint.NECK, Joint.LEFT_HAND]
    # The head needs both of its markers.
    assert np.flatnonzero(present[0]).tolist() == [Joint.LEFT_HAND] and np.flatnonzero(present[1]).tolist() == sorted(named)
    np.testing.assert_array_equal(sequence.visible, present)
    np.testing.assert_allclose(sequence.joints_camera_m[0, Joint.LEFT_HAND], position(24), atol=1e-6)
    np.testing.assert_allclose(found.markers_camera_m[60], [position(60), (np.nan,) * 3], atol=1e-6)


def test_slots_beyond_the_count_are_ignored(folder):
    found = read_sequence(folder / "real01_7.cal.bin", MARKERS)
    assert 77 not in found.markers_camera_m and found.skipped == {}


def test_a_map_without_matching_ids_is_shown_beside_the_ids_in_the_file(folder):
    with pytest.raises(InputError, match=r"no frame shows .*Joint map: head: \[2\]\. Frame 0 .*holds markers 1 at .*24 at"):
        read(folder, {"head": 2})


def test_the_known_markers_are_the_default_and_the_map_is_given_on_the_command_line(folder):
    assert Smmc10Config().joints == dict.fromkeys(JOINT_NAMES) | KNOWN_MARKERS
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        importlib.import_module("kpopnet.programs.evaluate")  # registers the schemas
        as_published = OmegaConf.to_object(compose("evaluate", ["benchmark=smmc10"]).benchmark)
        given = ["benchmark=smmc10", f"benchmark.path={folder}", "benchmark.joints={head: 1, left_hand: [5, 24]}"]
        config = OmegaConf.to_object(compose("evaluate", given).benchmark)
    assert as_published == Smmc10Config()
    sequence = Smmc10Benchmark(config).read("real01_7")
    np.testing.assert_allclose(sequence.joints_camera_m[0, Joint.HEAD], position(1), atol=1e-6)
    np.testing.assert_allclose(
        sequence.joints_camera_m[0, Joint.LEFT_HAND], np.mean([position(5), position(24)], axis=0), atol=1e-6
    )
    # The default marker of the right hand remains in the map, but these files do not contain it.
    assert not sequence.visible[:, Joint.RIGHT_HAND].any() and sequence.visible.sum() == 6


def test_an_empty_map_is_rejected_with_the_ids_in_the_files(folder):
    with pytest.raises(InputError, match=r"needs benchmark\.joints.*holds markers 1 at \(0\.01, -0\.02, 2\.01\)"):
        Smmc10Benchmark(Smmc10Config(path=str(folder), joints=dict.fromkeys(JOINT_NAMES)))


def test_sequences_are_listed_by_number(tmp_path):
    for name in ("real01_10", "real01_9", "real01_1", "notes"):
        (tmp_path / f"{name}.cal.bin").write_bytes(packed(0))
    names = Smmc10Benchmark(Smmc10Config(path=str(tmp_path))).sequence_names()
    assert names == ["real01_1", "real01_9", "real01_10"]


def test_a_folder_without_the_set_is_rejected(tmp_path):
    with pytest.raises(InputError, match=r"needs benchmark\.path"):
        Smmc10Benchmark(Smmc10Config())
    with pytest.raises(InputError, match=r"no real01_<number>\.cal\.bin"):
        Smmc10Benchmark(Smmc10Config(path=str(tmp_path)))
    with pytest.raises(InputError, match=r"no manifest\.json.*python -m synth benchmark=smmc10_sim"):
        Smmc10SimBenchmark(Smmc10SimConfig(path=str(tmp_path)))


def manifest(folder: Path, **changes) -> None:
    content = {"simulated": True, "benchmark": "smmc10_sim", "seed": 5, "hash": "abc", "sequences": 2}
    content |= {"config": {"generator": 1}, "joint_markers": MARKERS}
    (folder / "manifest.json").write_text(json.dumps(content | changes))


def test_simulated_files_are_never_read_as_real_nor_real_files_as_simulated(folder, caplog):
    with pytest.raises(InputError, match=r"no manifest\.json"):
        Smmc10SimBenchmark(Smmc10SimConfig(path=str(folder)))
    manifest(folder)
    with pytest.raises(
        InputError, match=r"simulated according to its manifest\.json, and not SMMC-10: use benchmark=smmc10_sim"
    ):
        Smmc10Benchmark(Smmc10Config(path=str(folder)))
    with caplog.at_level(logging.WARNING):
        benchmark = Smmc10SimBenchmark(Smmc10SimConfig(path=str(folder)))
    assert "only 1 of its 2 sequences exist" in caplog.text
    assert benchmark.origin is Origin.SIMULATED and Smmc10Benchmark.origin is Origin.REAL
    assert "SIMULATED" in benchmark.about and "seed 5" in benchmark.about and "simulated" in benchmark.truth
    assert benchmark.provenance == {"seed": 5, "version": 1, "config_hash": "abc"}
    assert benchmark.read("real01_7").visible.sum() == 9
    manifest(folder, benchmark="eval_sim")
    with pytest.raises(InputError, match="holds eval_sim, not smmc10_sim: use benchmark=eval_sim"):
        Smmc10SimBenchmark(Smmc10SimConfig(path=str(folder)))
    manifest(folder, joint_markers={"nose": 3})
    with pytest.raises(InputError, match="nose is not a joint"):
        Smmc10SimBenchmark(Smmc10SimConfig(path=str(folder)))


def test_both_benchmarks_are_registered():
    assert BENCHMARKS["smmc10"] == (Smmc10Config, Smmc10Benchmark)
    assert BENCHMARKS["smmc10_sim"] == (Smmc10SimConfig, Smmc10SimBenchmark)


def test_memory_is_bounded(tmp_path, monkeypatch):
    path = tmp_path / "real01_7.cal.bin"
    path.write_bytes(b"".join(packed(t, markers=[(100 * t + slot, position(1), 1.0) for slot in range(64)]) for t in range(5)))
    with pytest.raises(InputError, match=r"names 320 markers, expected at most 256"):
        read(tmp_path)
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "0.0005")
    with pytest.raises(InputError, match="its 5 frames would take"):
        read(tmp_path)


def test_damaged_files_are_refused_in_one_line(tmp_path):
    (tmp_path / "real01_7.cal.bin").write_bytes(packed(0))
    assert survives_damage(tmp_path / "real01_7.cal.bin", lambda: read(tmp_path), 150) > 50
