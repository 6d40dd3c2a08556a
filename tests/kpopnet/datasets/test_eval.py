"""The reader of EVAL on valid and invalid files, packed by hand in the published layout."""

import importlib
import json
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from damaged_files import survives_damage, survives_hostile_json
from hydra import compose, initialize_config_dir
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf
from programs import ROOT
from slopes import joints_m, slope_m

from kpopnet.camera import Camera
from kpopnet.datasets.eval.benchmark import EvalBenchmark, EvalConfig, EvalSimBenchmark, EvalSimConfig
from kpopnet.datasets.eval.format import FRAME, FRAMES_PER_BLOCK, read_sequence
from kpopnet.datasets.heading import heading_rad
from kpopnet.datasets.point_clouds.joint_maps import checked_map
from kpopnet.datasets.point_clouds.organised import fit_camera
from kpopnet.datasets.protocol import Origin
from kpopnet.errors import InputError
from kpopnet.evaluation.registry import BENCHMARKS
from kpopnet.skeleton import JOINT_NAMES, MIRROR, Joint

FRAME_BYTES = 930_704
CAMERA = Camera(285.7, 281.3, 158.2, 121.9, 320, 240)
SLOPES = CAMERA.points(np.ones((240, 320), np.float32)) * np.float32([1, -1, -1])
IDS = {name: [number] for number, name in enumerate(JOINT_NAMES, start=40)}


def packed(frame: int, *, magic=7, joints=None, markers=None, xyz=None, njoints=None, nmarkers=None) -> bytes:
    """One frame, field by field; joints and markers are (id or name, position in the camera frame)."""
    joints = list(zip(range(40, 55), joints_m(frame), strict=True)) if joints is None else joints
    markers = [("LSHO", (0.2, -0.4, 2.4))] if markers is None else markers
    points = SLOPES * slope_m(frame)[..., None] if xyz is None else xyz
    parts = [struct.pack("<ii", magic, frame), points.astype("<f4").tobytes()]
    parts.append(struct.pack("<i", len(markers) if nmarkers is None else nmarkers))
    for slot in range(32):
        name, (x, y, z) = markers[slot] if slot < len(markers) else ("", (0, 0, 0))
        # A C string ends at its zero byte; the rest of the buffer and the padding are undefined.
        name = name.encode() + b"\0" + b"leftover" if name else b""
        parts.append(struct.pack("<255sx3f", name, x, -y, -z))
    parts.append(struct.pack("<i", len(joints) if njoints is None else njoints))
    for slot in range(32):
        number, (x, y, z) = joints[slot] if slot < len(joints) else (0, (0, 0, 0))
        parts.append(struct.pack("<i3f", number, x, -y, -z))
    whole = b"".join(parts)
    assert len(whole) == FRAME_BYTES
    return whole


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three frames of one sequence."""
    (tmp_path / "seq_a_0.bin").write_bytes(b"".join(packed(frame) for frame in range(3)))
    return tmp_path


def read(folder: Path, joints=None):
    return EvalBenchmark(EvalConfig(path=str(folder), joints=IDS if joints is None else joints)).read("seq_a_0")


def test_the_layout_is_the_published_one(folder):
    assert FRAME.itemsize == FRAME_BYTES
    whole = packed(5, magic=-1982)
    frame = np.frombuffer(whole, FRAME)[0]
    assert (frame["magic"], frame["frame"], frame["nmarkers"], frame["njoints"]) == (-1982, 5, 1, 15)
    row, column = 100, 200
    x, y, z = struct.unpack_from("<3f", whole, 8 + 12 * (row * 320 + column))
    np.testing.assert_array_equal(frame["xyz"][row, column], np.float32([x, y, z]))
    assert z < 0 and -z == slope_m(5)[row, column]
    assert frame.tobytes() == whole


def test_a_sequence_reads_as_depth_camera_and_joints(folder):
    sequence = read(folder)
    assert (sequence.name, sequence.identity, sequence.fps, sequence.is_segmented) == ("seq_a_0", "a", 30.0, False)
    np.testing.assert_array_equal(sequence.depth_m, np.stack([slope_m(frame) for frame in range(3)]))
    np.testing.assert_allclose(sequence.joints_camera_m, np.stack([joints_m(frame) for frame in range(3)]), atol=1e-6)
    assert sequence.visible.all() and sequence.camera.width == 320
    found = [sequence.camera.fx, sequence.camera.fy, sequence.camera.cx, sequence.camera.cy]
    np.testing.assert_allclose(found, [CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy], atol=1e-3)


def test_more_frames_than_one_block(tmp_path):
    frames = FRAMES_PER_BLOCK + 2
    (tmp_path / "seq_a_0.bin").write_bytes(b"".join(packed(frame) for frame in range(frames)))
    sequence = read(tmp_path)
    for frame in (0, FRAMES_PER_BLOCK - 1, FRAMES_PER_BLOCK, frames - 1):
        np.testing.assert_array_equal(sequence.depth_m[frame], slope_m(frame))
        np.testing.assert_allclose(sequence.joints_camera_m[frame], joints_m(frame), atol=1e-6)


@settings(max_examples=15, deadline=None)
@given(
    fx=st.floats(150, 600), fy=st.floats(150, 600), cx=st.floats(100, 220), cy=st.floats(60, 180),
    seed=st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_the_camera_is_fitted_to_the_points(fx, fy, cx, cy, seed):
    rng = np.random.default_rng(seed)
    camera = Camera(fx, fy, cx, cy, 320, 240)
    depth = rng.uniform(0.5, 5, (240, 320)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.6] = 0
    points = camera.points(depth) * np.float32([1, -1, -1])
    points[3, 4] = np.nan
    found = fit_camera(points, "here")
    np.testing.assert_allclose([found.fx, found.fy, found.cx, found.cy], [fx, fy, cx, cy], rtol=1e-4, atol=0.02)


def test_points_that_no_camera_fits_are_rejected(folder):
    transposed = SLOPES[..., [1, 0, 2]] * slope_m(0)[..., None]
    (folder / "seq_a_0.bin").write_bytes(packed(0, xyz=transposed))
    with pytest.raises(InputError, match=r"seq_a_0\.bin: the best-fitting camera .* pixels; .* x right, y up, z negative"):
        read(folder)
    (folder / "seq_a_0.bin").write_bytes(packed(0, xyz=np.zeros((240, 320, 3))))
    with pytest.raises(InputError, match=r"no point in front of the camera is measured in its 1 frames \(all are 0\)"):
        read(folder)
    single = np.zeros((240, 320, 3))
    single[7, 9] = 0.1, 0.2, -1
    (folder / "seq_a_0.bin").write_bytes(packed(0, xyz=single))
    with pytest.raises(InputError, match="too few measured points"):
        read(folder)


def test_a_sequence_may_start_with_empty_frames(folder):
    (folder / "seq_a_0.bin").write_bytes(packed(0, xyz=np.zeros((240, 320, 3))) + packed(1))
    sequence = read(folder)
    assert not sequence.depth_m[0].any() and abs(sequence.camera.fx - CAMERA.fx) < 1e-3


@pytest.mark.parametrize("cut", [1, 8, 600, FRAME_BYTES - 1])
def test_a_truncated_file_is_named_with_the_frame(folder, cut):
    path = folder / "seq_a_0.bin"
    path.write_bytes(path.read_bytes()[: 2 * FRAME_BYTES + cut])
    with pytest.raises(InputError, match=rf"seq_a_0\.bin: ends {cut} bytes into frame 2; .*930704 bytes.*download it again"):
        read(folder)


def test_empty_and_missing_files_are_rejected(folder):
    (folder / "seq_a_1.bin").write_bytes(b"")
    benchmark = EvalBenchmark(EvalConfig(path=str(folder), joints=IDS))
    with pytest.raises(InputError, match=r"seq_a_1\.bin: holds no frame"):
        benchmark.read("seq_a_1")
    (folder / "seq_a_1.bin").unlink()
    with pytest.raises(InputError, match=r"seq_a_1\.bin: no such file"):
        benchmark.read("seq_a_1")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"magic": 8}, r"frame 2 has magic 8 \(frame 0 has 7\)"),
        ({"njoints": 33}, "frame 2 .*33 joints"),
        ({"njoints": -1}, "frame 2 .*-1 joints"),
        ({"nmarkers": 2**30}, "frame 2 .*1073741824 markers"),
    ],
)
def test_an_invalid_frame_is_named(folder, changes, message):
    (folder / "seq_a_0.bin").write_bytes(packed(0) + packed(1) + packed(2, **changes))
    with pytest.raises(InputError, match=rf"seq_a_0\.bin: {message}.*not an EVAL sequence, or it is damaged"):
        read(folder)


def test_another_file_of_the_right_length_is_rejected(folder):
    rng = np.random.default_rng(3)
    (folder / "seq_a_0.bin").write_bytes(rng.bytes(2 * FRAME_BYTES))
    with pytest.raises(InputError, match=r"seq_a_0\.bin"):
        read(folder)


def test_values_that_are_left_out_are_counted_and_logged(folder, caplog):
    points = SLOPES * slope_m(0)[..., None]
    points[50, 60:70] = np.nan
    points[51, 60] = np.inf, 0, -2
    points[52, 61] = 0.1, 0.1, 2.0
    joints = [(40, (0.1, 0.2, 2.5)), (41, (0, 0, 0)), (99, (0.5, 0.5, 2.0)), (42, (np.nan, 0, 2))]
    markers = [("LSHO", (0.1, 0.2, 2.4)), ("RSHO", (0, 0, 0))]
    (folder / "seq_a_0.bin").write_bytes(packed(0, xyz=points, joints=joints, markers=markers) + packed(1))
    with caplog.at_level(logging.WARNING):
        sequence = read(folder)
    found = read_sequence(folder / "seq_a_0.bin", IDS)
    assert found.skipped == {
        "points that are not finite": 11,
        "points behind the camera": 1,
        "joints that are absent": 2,
        "joint id 99, which is not in the map": 1,
        "markers that are absent": 1,
    }
    for what, count in found.skipped.items():
        assert f"{count} {what}" in caplog.text
    assert "seq_a_0: left out" in caplog.text and len(caplog.records) == 1
    assert not sequence.depth_m[0, 50, 60:70].any() and not sequence.depth_m[0, 51:53, 60:62].diagonal().any()
    assert np.isfinite(sequence.depth_m).all()
    present = np.isfinite(sequence.joints_camera_m).all(axis=-1)
    assert present[0].tolist() == [True] + [False] * 14 and present[1].all()
    np.testing.assert_array_equal(sequence.visible, present)
    np.testing.assert_allclose(found.markers_camera_m["LSHO"], [[0.1, 0.2, 2.4], [0.2, -0.4, 2.4]], atol=1e-6)
    assert set(found.markers_camera_m) == {"LSHO"}


def test_slots_beyond_the_count_are_ignored(folder):
    joints = [(40, (0.1, 0.2, 2.5)), (41, (0.3, 0.2, 2.5))]
    (folder / "seq_a_0.bin").write_bytes(packed(0, joints=joints, njoints=1))
    assert np.isfinite(read(folder).joints_camera_m).all(axis=-1).sum() == 1


def test_the_mean_of_several_ids_is_used_where_all_are_present(folder):
    joints = [(1, (0.1, 0.2, 2.5)), (2, (0.3, 0.4, 2.7))]
    (folder / "seq_a_0.bin").write_bytes(packed(0, joints=joints) + packed(1, joints=joints[:1]))
    sequence = read(folder, {"torso": [1, 2], "neck": 1})
    np.testing.assert_allclose(sequence.joints_camera_m[0, Joint.TORSO], (0.2, 0.3, 2.6), atol=1e-6)
    assert np.isnan(sequence.joints_camera_m[1, Joint.TORSO]).all() and sequence.visible[1, Joint.NECK]
    assert sequence.visible.sum() == 3


def test_without_a_map_the_error_lists_the_ids_in_the_files(folder):
    with pytest.raises(InputError, match=r"needs benchmark\.joints.*Frame 0 of .*seq_a_0\.bin holds joint ids 40 at .*LSHO"):
        EvalBenchmark(EvalConfig(path=str(folder)))


def test_the_map_is_given_on_the_command_line(folder):
    given = ["benchmark=eval", f"benchmark.path={folder}", "benchmark.joints={head: 40, torso: [41, 48]}"]
    with initialize_config_dir(str(ROOT / "configs"), version_base="1.3"):
        importlib.import_module("kpopnet.programs.evaluate")  # registers the schemas
        config = OmegaConf.to_object(compose("evaluate", given).benchmark)
    assert isinstance(config, EvalConfig)
    sequence = EvalBenchmark(config).read("seq_a_0")
    np.testing.assert_allclose(sequence.joints_camera_m[0, Joint.HEAD], joints_m(0)[0], atol=1e-6)
    np.testing.assert_allclose(sequence.joints_camera_m[0, Joint.TORSO], joints_m(0)[[1, 8]].mean(axis=0), atol=1e-6)
    assert sequence.visible[0].sum() == 2


def test_a_map_without_matching_ids_is_shown_beside_the_ids_in_the_file(folder):
    with pytest.raises(InputError, match=r"no frame holds the joints .*Joint map: head: \[3\]\. Frame 0 .*54 at"):
        read(folder, {"head": 3})


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ({"nose": 3}, "nose is not a joint; the joints are head, neck"),
        ({"head": "three"}, "head is 'three'"),
        ({"head": []}, "head is"),
        ({"head": True}, "head is True"),
        ({"head": 3, "neck": [3]}, r"head and neck both have id \[3\]"),
    ],
)
def test_invalid_maps_are_rejected(joints, message):
    with pytest.raises(InputError, match=f"benchmark.joints: {message}"):
        checked_map(joints)


def test_sequences_are_listed_by_number_then_subject(folder):
    for name in ("seq_b_0", "seq_a_10", "seq_a_2", "notes"):
        (folder / f"{name}.bin").write_bytes(packed(0))
    names = EvalBenchmark(EvalConfig(path=str(folder), joints=IDS)).sequence_names()
    assert names == ["seq_a_0", "seq_b_0", "seq_a_2", "seq_a_10"]


def test_a_folder_without_the_set_is_rejected(tmp_path):
    with pytest.raises(InputError, match=r"needs benchmark\.path"):
        EvalBenchmark(EvalConfig(joints=IDS))
    with pytest.raises(InputError, match=r"no seq_<subject>_<number>\.bin"):
        EvalBenchmark(EvalConfig(path=str(tmp_path), joints=IDS))
    with pytest.raises(InputError, match=r"no manifest\.json.*python -m synth benchmark=eval_sim"):
        EvalSimBenchmark(EvalSimConfig(path=str(tmp_path)))


def manifest(folder: Path, **changes) -> None:
    content = {"simulated": True, "benchmark": "eval_sim", "seed": 5, "hash": "abc", "sequences": 1}
    content["config"] = {"generator": 4}
    content["joint_ids"] = {name: ids[0] for name, ids in IDS.items()}
    (folder / "manifest.json").write_text(json.dumps(content | changes))


def test_simulated_files_are_never_read_as_real_nor_real_files_as_simulated(folder):
    with pytest.raises(InputError, match=r"no manifest\.json"):
        EvalSimBenchmark(EvalSimConfig(path=str(folder)))
    manifest(folder)
    with pytest.raises(InputError, match=r"simulated according to its manifest\.json, and not EVAL: use benchmark=eval_sim"):
        EvalBenchmark(EvalConfig(path=str(folder), joints=IDS))
    benchmark = EvalSimBenchmark(EvalSimConfig(path=str(folder)))
    assert benchmark.origin is Origin.SIMULATED and EvalBenchmark.origin is Origin.REAL
    assert "SIMULATED" in benchmark.about and "seed 5" in benchmark.about and "abc" in benchmark.about
    assert benchmark.provenance == {"seed": 5, "version": 4, "config_hash": "abc"}
    np.testing.assert_allclose(benchmark.read("seq_a_0").joints_camera_m[1], joints_m(1), atol=1e-6)


def test_an_unreadable_manifest_does_not_make_a_set_real(folder):
    for text in ("{", "[]", "{}", "3", '"simulated"'):
        (folder / "manifest.json").write_text(text)
        for open_set in (
            lambda: EvalBenchmark(EvalConfig(path=str(folder), joints=IDS)),
            lambda: EvalSimBenchmark(EvalSimConfig(path=str(folder))),
        ):
            with pytest.raises(InputError, match=r"manifest\.json.*make the set again"):
                open_set()


def test_memory_is_bounded(folder, monkeypatch):
    path = folder / "seq_a_0.bin"
    path.write_bytes(b"".join(packed(t, markers=[(f"M{t}.{slot}", (0.2, -0.4, 2.4)) for slot in range(32)]) for t in range(9)))
    with pytest.raises(InputError, match=r"seq_a_0\.bin: names 288 markers, expected at most 256"):
        read_sequence(path, IDS)
    monkeypatch.setenv("KPOPNET_FILE_BUDGET_GB", "0.002")
    with pytest.raises(InputError, match="its 9 frames would take"):
        read_sequence(path, IDS)


def test_damaged_files_are_refused_in_one_line(tmp_path):
    path = tmp_path / "seq_a_0.bin"
    path.write_bytes(packed(0))
    assert survives_damage(path, lambda: EvalBenchmark(EvalConfig(path=str(tmp_path), joints=IDS)).read("seq_a_0"), 90) > 30


def test_a_hostile_manifest_is_refused_in_one_line(folder):
    manifest(folder)
    for open_set in (
        lambda: EvalBenchmark(EvalConfig(path=str(folder), joints=IDS)),
        lambda: EvalSimBenchmark(EvalSimConfig(path=str(folder))),
    ):
        survives_hostile_json(folder / "manifest.json", open_set)
        survives_damage(folder / "manifest.json", open_set)


def test_an_unfinished_set_is_reported(folder, caplog):
    manifest(folder, sequences=8)
    with caplog.at_level(logging.WARNING):
        benchmark = EvalSimBenchmark(EvalSimConfig(path=str(folder)))
    assert "only 1 of its 8 sequences exist" in caplog.text and "1 of 24" in benchmark.about


def test_both_benchmarks_are_registered():
    assert BENCHMARKS["eval"] == (EvalConfig, EvalBenchmark)
    assert BENCHMARKS["eval_sim"] == (EvalSimConfig, EvalSimBenchmark)


def facing_camera() -> np.ndarray:
    joints = np.zeros((15, 3))
    for side, sign in (("LEFT", 1), ("RIGHT", -1)):
        joints[Joint[f"{side}_SHOULDER"]] = 0.2 * sign, -0.5, 0
        joints[Joint[f"{side}_HIP"]] = 0.1 * sign, 0, 0
    return joints


@given(turn=st.floats(-3.1, 3.1), direction=st.floats(-0.5, 0.5), upside_down=st.booleans())
def test_the_heading_is_relative_to_the_direction_to_the_camera(turn, direction, upside_down):
    joints = facing_camera()
    if upside_down:
        joints[:, :2] *= -1
    # A turn to the person's left is counter-clockwise seen from above: from -z towards x.
    angle = turn - direction
    x, z = joints[:, 0].copy(), joints[:, 2].copy()
    joints[:, 0], joints[:, 2] = x * np.cos(angle) - z * np.sin(angle), x * np.sin(angle) + z * np.cos(angle)
    joints += 3 * np.array([np.sin(direction), 0, np.cos(direction)])
    found = heading_rad(joints[None].astype(np.float32))[0]
    assert abs(np.angle(np.exp(1j * (found - turn)))) < 1e-4
    mirrored = (joints * [-1, 1, 1])[MIRROR]
    assert abs(np.angle(np.exp(1j * (heading_rad(mirrored[None])[0] + turn)))) < 1e-4


def test_the_heading_is_unknown_if_joints_are_missing():
    joints = np.tile(facing_camera() + np.array([0, 0, 3]), (2, 1, 1))
    joints[1, Joint.LEFT_HIP] = np.nan
    found = heading_rad(joints)
    assert found[0] == pytest.approx(0) and np.isnan(found[1])
