"""The readers of EVAL and SMMC-10 on files packed by hand, field by field, in the published layouts."""

import logging
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from point_cloud_files import CAMERAS, FIRST, frame_of, points_of, position_m, scene

from kpopnet.datasets import describe
from kpopnet.datasets.point_clouds import EvalBenchmark, PointCloudConfig, Smmc10Benchmark
from kpopnet.errors import InputError
from kpopnet.evaluation.registry import build_benchmark
from kpopnet.skeleton import Joint

FRAME_BYTES = {"eval": 930_704, "smmc10": 458_004}
MAP = {"head": [1, 3], "neck": 5, "left_hand": [24]}


@pytest.fixture(params=["eval", "smmc10"])
def name(request) -> str:
    return request.param


@pytest.fixture
def path(tmp_path: Path, name: str) -> Path:
    """Three frames of one sequence."""
    path = tmp_path / FIRST[name]
    path.write_bytes(b"".join(frame_of(name, frame) for frame in range(3)))
    return path


def read(path: Path, joints=MAP):
    name = "eval" if path.name.startswith("seq") else "smmc10"
    benchmark = build_benchmark(PointCloudConfig(name, str(path.parent), joints))
    return benchmark.read(path.name.partition(".")[0])


def test_the_layouts_are_the_published_ones():
    packed, padded = Smmc10Benchmark.layouts
    assert (EvalBenchmark.layouts[0].itemsize, packed.itemsize, padded.itemsize) == (930_704, 458_004, 458_008)
    for layout, padding in ((packed, b""), (padded, bytes(4))):
        frame = np.frombuffer(frame_of("smmc10", 2, padding=padding), layout)[0]
        assert (frame["dist"][300], frame["amp"][300], frame["conf"][300]) == (300, 7, 9)
        assert tuple(frame["markers"][3][["id", "frame", "cond", "flag"]]) == (24, 2, 1.0, 3)


def test_a_sequence_reads_as_depth_camera_and_joints(path, name):
    sequence = read(path)
    assert (sequence.identity, sequence.fps) == (("a", 30.0) if name == "eval" else ("", 25.0)) and not sequence.is_segmented
    np.testing.assert_array_equal(sequence.depth_m, np.stack([scene(name, frame) for frame in range(3)]))
    for frame in range(3):
        head = np.mean([position_m(1, frame), position_m(3, frame)], axis=0)
        np.testing.assert_allclose(sequence.joints_camera_m[frame, Joint.HEAD], head, atol=1e-6)
        np.testing.assert_allclose(sequence.joints_camera_m[frame, Joint.LEFT_HAND], position_m(24, frame), atol=1e-6)
    assert sequence.visible.sum() == 9 and not sequence.visible[:, Joint.TORSO].any()
    found, true = sequence.camera, CAMERAS[name]
    np.testing.assert_allclose([found.fx, found.fy, found.cx, found.cy], [true.fx, true.fy, true.cx, true.cy], atol=1e-3)


def test_padded_frames_of_smmc10_are_recognised(tmp_path):
    path = tmp_path / FIRST["smmc10"]
    path.write_bytes(b"".join(frame_of("smmc10", frame, padding=b"\xaa\xbb\xcc\xdd") for frame in range(3)))
    sequence = read(path)
    np.testing.assert_array_equal(sequence.depth_m[-1], scene("smmc10", 2))
    assert sequence.visible.sum() == 9


def test_a_truncated_file_and_an_invalid_frame_are_named(path, name):
    path.write_bytes(path.read_bytes()[: 2 * FRAME_BYTES[name] + 600])
    with pytest.raises(InputError, match=rf"{path.name}: truncated 600 bytes into frame 2; .*{FRAME_BYTES[name]} bytes"):
        read(path)
    for changes in ({"magic": 8}, {"njoints": 65}):
        path.write_bytes(frame_of(name, 0) + frame_of(name, 1, **changes))
        with pytest.raises(InputError, match=rf"{path.name}: frame 1 is damaged"):
            read(path)


def test_joints_far_beyond_any_camera_are_refused(path, name):
    joints = [(number, (1e30 if number == 24 else 0, 0, -2)) for number in (1, 3, 5, 24)]
    path.write_bytes(frame_of(name, 0) + frame_of(name, 1, joints=joints))
    with pytest.raises(InputError, match=rf"{path.name}: expected joints in metres, at most 100 m"):
        read(path)


def test_what_is_left_out_is_logged(path, name, caplog):
    points = points_of(name, 0).copy()
    points[50, 60:70] = np.nan
    points[52, 61] = 0.1, 0.1, 2.0  # behind the camera
    absent = (3, (0, 0, 0)) if name == "eval" else (3, position_m(3), -1.0)
    joints = [(1, position_m(1)), absent, (5, (np.nan, 0, 2)), (24, position_m(24)), (60, position_m(60))]
    path.write_bytes(frame_of(name, 0, points=points, joints=joints) + frame_of(name, 1))
    with caplog.at_level(logging.WARNING):
        sequence = read(path, MAP | {"right_hand": [16]})
    assert "left out 11 points" in caplog.text and "ids [60] are not in the map; ids [16] of the map" in caplog.text
    assert np.isfinite(sequence.depth_m).all() and not sequence.depth_m[0, 50, 60:70].any()
    present = np.isfinite(sequence.joints_camera_m).all(axis=-1)
    # The head needs both of its ids.
    assert np.flatnonzero(present[0]).tolist() == [Joint.LEFT_HAND] and present[1].sum() == 3
    np.testing.assert_array_equal(sequence.visible, present)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (dict.fromkeys(MAP), r"needs benchmark\.joints.*`kpopnet describe .*` lists"),
        ({"head": 2}, r"holds the joints of the map.*`kpopnet describe .*` lists"),
        ({"nose": 3}, "benchmark.joints: nose: expected one of the joints head, neck"),
        ({"head": True}, "benchmark.joints: head: expected ids, found True"),
        ({"head": 3, "neck": [3]}, r"benchmark.joints: head and neck: expected different ids, found \[3\] for both"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(path, joints, message):
    with pytest.raises(InputError, match=message):
        read(path, joints)


def test_sequences_are_listed_by_number_then_subject(tmp_path):
    for other in ("seq_a_0", "seq_b_0", "seq_a_10", "seq_a_2", "notes"):
        (tmp_path / f"{other}.bin").touch()
    assert EvalBenchmark.names_in(tmp_path) == ["seq_a_0", "seq_b_0", "seq_a_2", "seq_a_10"]
    for other in ("real01_10", "real01_9", "notes"):
        (tmp_path / f"{other}.cal.bin").touch()
    assert Smmc10Benchmark.names_in(tmp_path) == ["real01_9", "real01_10"]


def test_a_folder_without_the_set_and_a_simulated_one_are_refused(path, name, tmp_path):
    (path.parent / "manifest.json").write_text("{")
    with pytest.raises(InputError, match=r"simulated according to its manifest\.json, and not"):
        read(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"no sequence of .* in it; give the folder that holds"):
        build_benchmark(PointCloudConfig(name, str(tmp_path / "empty"), MAP))


def test_ids_are_listed_with_their_positions_and_drawn_there(tmp_path, name, monkeypatch, capsys):
    """Two frames: id 7 in both, id 3 in the first."""
    joints, file, camera = [(7, (0.25, -0.5, 1.75)), (3, (-0.5, 0.25, 1.5))], tmp_path / FIRST[name], CAMERAS[name]
    file.write_bytes(frame_of(name, 0, joints=joints) + frame_of(name, 1, joints=joints[:1]))
    for given in (tmp_path, file):
        monkeypatch.setattr(sys, "argv", ["describe", str(given), "--figure", str(tmp_path / "ids.png")])
        describe.main()
        text = capsys.readouterr().out
        assert "2 frames" in text and f"benchmark={name} benchmark.path={tmp_path} " in text
        assert "  3: in 50 % of the frames, first at (-0.50, 0.25, 1.50) m" in text
        assert "  7: in 100 % of the frames, first at (0.25, -0.50, 1.75) m" in text
    monkeypatch.setattr(sys, "argv", ["describe", str(file), "--figure", str(tmp_path / "ids.jpg")])
    with pytest.raises(SystemExit):
        describe.main()
    assert "ids.jpg: expected a name that ends in .png" in capsys.readouterr().err and not (tmp_path / "ids.jpg").exists()
    figure, scale = cv2.imread(str(tmp_path / "ids.png")), 960 / camera.width
    u, v, _ = camera.project(np.array([0.25, -0.5, 1.75]))
    blue, _, red = figure[round((v + 0.5) * scale), round((u + 0.5) * scale)].astype(int)
    assert figure.shape[1] == 960 and red > 180 and blue < 80
    assert np.percentile(figure[::20, ::20], 99) < 130  # white ids can be read on the nearest surfaces
    (tmp_path / "other").mkdir()
    with pytest.raises(InputError, match="expected sequences of SMMC-10 or EVAL, whose joints have ids, found nothing"):
        describe.recognised(tmp_path / "other")
