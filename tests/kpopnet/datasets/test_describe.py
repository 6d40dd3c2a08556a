"""`python -m kpopnet.datasets.describe` on complete, incomplete and damaged sets of each format."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from itop_files import write_itop
from kpopnet.datasets.describe.__main__ import id_figure
from kpopnet.datasets.describe.describe import describe
from kpopnet.datasets.eval.format import FRAME
from kpopnet.datasets.point_clouds.organised import FROM_OPENGL
from kpopnet.datasets.smmc10.format import MAGIC, PACKED, PADDED, stored_points
from programs import ROOT
from scipy.io import savemat

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError


def points(camera: Camera) -> np.ndarray:
    """Points of a wall at 2 m, in the stored axes."""
    return camera.points(np.full((camera.height, camera.width), 2, np.float32)) * FROM_OPENGL


def write_eval(folder: Path, name: str = "seq_a_0", frames: int = 4) -> Path:
    """Writes joint 7 in all frames, joint 3 in every second frame, and a marker."""
    stored = np.zeros(frames, FRAME)
    stored["magic"], stored["xyz"] = 5, points(CAMERAS["eval"])
    stored["xyz"][0] = 0  # the first frame has no measured point
    stored["njoints"], stored["nmarkers"] = 2, 1
    stored["joints"]["id"][:, :2] = 7, 3
    stored["joints"]["pos"][:, 0] = 0.25, 0.5, -1.75
    stored["joints"]["pos"][::2, 1] = -0.5, -0.25, -1.5
    stored["markers"]["name"][:, 0] = b"LSHO"
    stored.tofile(folder / f"{name}.bin")
    return folder / f"{name}.bin"


def write_smmc10(folder: Path, name: str = "real01_1", layout: np.dtype = PACKED, frames: int = 4) -> Path:
    """Writes markers 1 and 16 in all frames, 24 in none, 40 in every second frame."""
    stored = np.zeros(frames, layout)
    stored["magic"], stored["points"] = MAGIC, stored_points(points(CAMERAS["smmc10"]))
    stored["nmarkers"] = 4
    stored["markers"]["id"][:, :4] = 1, 16, 24, 40
    stored["markers"]["pos"][:, :4] = 0.25, 0.5, -1.75
    stored["markers"]["cond"][:, :2] = 1
    stored["markers"]["cond"][::2, 3] = 1
    stored.tofile(folder / f"{name}.cal.bin")
    return folder / f"{name}.cal.bin"


def manifest(folder: Path, benchmark: str, **more) -> None:
    content = {"simulated": True, "benchmark": benchmark, "about": "SIMULATED", "seed": 5, "hash": "abc", "sequences": 3}
    (folder / "manifest.json").write_text(json.dumps(content | {"config": {}} | more))


def test_eval_ids_are_listed_with_positions_and_the_missing_map(tmp_path):
    path = write_eval(tmp_path)
    write_eval(tmp_path, "seq_b_0", frames=6)
    for given in (tmp_path, path):
        text = describe(given)
        assert text.startswith("EVAL, as published\n2 sequences, 10 frames at 30 per second, 4 to 6 each\n")
        assert "camera fitted to seq_a_0.bin: 320x240, fx 285.70, fy 285.70, cx 159.50, cy 119.50 pixels" in text
        assert "  3: in 50 % of the frames, first at (-0.50, 0.25, 1.50) m\n  7: in 100 % of the frames" in text
        assert "markers LSHO" in text
        assert (
            "needs the map from joints to ids, which is not published" in text
            and f"benchmark.path={tmp_path} 'benchmark.joints=" in text
        )


@pytest.mark.parametrize(("layout", "phrase"), [(PACKED, "458,004 bytes (packed)"), (PADDED, "458,008 bytes (padded)")])
def test_smmc10_markers_are_listed_with_the_known_ones_that_are_absent(tmp_path, layout, phrase):
    write_smmc10(tmp_path, layout=layout)
    text = describe(tmp_path)
    assert text.startswith("SMMC-10, as published\n1 sequence, 4 frames at 25 per second") and phrase in text
    assert "camera fitted to real01_1.cal.bin: 144x176, fx 204." in text and "cx 71.50, cy 87.50 pixels" in text
    assert "  1: in 100 % of the frames, first at (0.25, -0.50, 1.75) m" in text
    assert "  24: in 0 % of the frames\n  40: in 50 % of the frames" in text
    assert "head: [1, 3], right_hand: [16], left_hand: [24], by one public reader; of these 3, 24 are never visible" in text
    assert f"python evaluate.py benchmark=smmc10 benchmark.path={tmp_path}" in text


def test_stand_ins_are_called_simulated_and_need_nothing_else(tmp_path):
    for benchmark, write, more in (
        ("eval_sim", write_eval, {"joint_ids": {"head": 7}}),
        ("smmc10_sim", write_smmc10, {"joint_markers": {"head": [1, 40]}, "markers": {"LFHD": 1, "RFHD": 40}}),
    ):
        folder = tmp_path / benchmark
        folder.mkdir()
        write(folder)
        manifest(folder, benchmark, **more)
        text = describe(folder)
        assert text.startswith(f"{benchmark}: SIMULATED\nseed 5, configuration abc; 1 of 3 sequences\n")
        assert "as published" not in text and "head: [" in text
        assert f"needs nothing else:\n  python evaluate.py benchmark={benchmark} benchmark.path={folder}" in text
    assert "marker names: 1 LFHD, 40 RFHD" in text


def test_truncated_sequences_are_named_and_the_others_described(tmp_path):
    truncated = write_smmc10(tmp_path, "real01_1")
    truncated.write_bytes(truncated.read_bytes()[:-7])
    text = describe(tmp_path)
    assert "cannot be read: " in text and "real01_1.cal.bin: ends" in text and "markers" not in text
    write_smmc10(tmp_path, "real01_2")
    text = describe(tmp_path)
    assert "1 sequence, 4 frames" in text and "real01_1.cal.bin: ends" in text and "real01_2.cal.bin holds markers" in text


def test_a_camera_that_cannot_be_fitted_is_reported(tmp_path):
    empty = write_eval(tmp_path)
    stored = np.fromfile(empty, FRAME)
    stored["xyz"] = 0
    stored.tofile(empty)
    assert "no camera can be fitted" in describe(tmp_path)
    stored["xyz"] = points(CAMERAS["eval"])[..., [1, 0, 2]]
    stored.tofile(empty)
    assert "no camera: " in describe(tmp_path) and "the best-fitting camera" in describe(tmp_path)


def test_itop_parts_are_listed(tmp_path):
    frames = np.full((3, 240, 320), 2.0), np.ones((3, 15, 3))
    write_itop(tmp_path, ["00_00000", "00_00001", "03_00000"], *frames, valid=np.array([1, 0, 1]))
    write_itop(tmp_path, ["00_00000", "00_00001", "03_00000"], *frames, part="top_train")
    (tmp_path / "ITOP_top_train_labels.h5").rename(tmp_path / "ITOP_top_train_labels.h5.gz")
    text = describe(tmp_path)
    assert "side test: 3 frames of 2 people (00, 03), 2 with checked labels; split into 2 sequences" in text
    assert "side train: not in this folder" in text and "top test: not in this folder" in text
    assert "top train: cannot be read: " in text and "gunzip" in text
    assert "benchmark.view=side benchmark.split=test" in text and "benchmark.view=top" not in text
    (tmp_path / "ITOP_side_test_labels.h5").unlink()
    assert "An evaluation still needs complete and decompressed depth_map.h5 and labels.h5" in describe(tmp_path)


def test_utd_mhad_sequences_with_one_file_are_listed(tmp_path):
    for kind in ("Depth", "Skeleton"):
        (tmp_path / kind).mkdir()
    depth, skeleton = np.full((240, 320, 5), 2000, np.uint16), np.ones((20, 3, 5))
    for name in ("a1_s1_t1", "a1_s2_t1", "a2_s1_t1"):
        savemat(tmp_path / "Depth" / f"{name}_depth.mat", {"d_depth": depth})
    for name in ("a1_s1_t1", "a1_s2_t1", "a9_s1_t1"):
        savemat(tmp_path / "Skeleton" / f"{name}_skeleton.mat", {"d_skel": skeleton})
    (tmp_path / "Depth" / "a1_s1_t1_depth.mat").write_bytes(b"truncated")
    for given in (tmp_path, tmp_path / "Depth", tmp_path / "Depth" / "a1_s1_t1_depth.mat"):
        text = describe(given)
        assert "2 sequences with depth and skeleton (the complete set has 861)" in text
        assert "of 1 action, 2 subjects and 1 trial" in text
        assert "without a file in Skeleton/: a2_s1_t1" in text and "without a file in Depth/: a9_s1_t1" in text
        assert "cannot be read: " in text and "a1_s2_t1: 5 frames" in text
        assert "python evaluate.py benchmark=utd_mhad" in text
    (tmp_path / "Depth" / "a1_s2_t1_depth.mat").unlink()
    assert "An evaluation still needs one sequence with two readable files" in describe(tmp_path)


def test_unknown_folders_are_rejected_with_the_expected_files(tmp_path):
    with pytest.raises(InputError, match="no such file or folder"):
        describe(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"Expected for EVAL seq_a_0\.bin.*UTD-MHAD Depth/.*Found nothing"):
        describe(tmp_path)
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError, match=r"Found notes\.txt"):
        describe(tmp_path)


def test_the_figure_shows_every_id_at_its_position(tmp_path):
    for write, camera in ((write_eval, CAMERAS["eval"]), (write_smmc10, CAMERAS["smmc10"])):
        folder = tmp_path / write.__name__
        folder.mkdir()
        path = write(folder)
        figure = id_figure(path)
        np.testing.assert_array_equal(figure, id_figure(folder))
        scale = 960 / camera.width
        assert figure.shape == (round(camera.height * scale), 960, 3)
        u, v, _ = camera.project(np.array([0.25, -0.5, 1.75]))
        pixel = figure[round((v + 0.5) * scale), round((u + 0.5) * scale)].astype(int)
        assert pixel[0] > 180 and pixel[1] < 80, "a red mark"
    # The first EVAL frame has no measured point. The second has, and in it joint 3 is absent.
    assert (figure[..., 0] > figure[..., 1].astype(int) + 100).sum() > 20


def test_the_command_line(tmp_path):
    def run(*given: str) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "kpopnet.datasets.describe", *given]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)

    write_smmc10(tmp_path)
    done = run(str(tmp_path), "--figure", str(tmp_path / "ids.png"))
    assert done.returncode == 0 and "SMMC-10, as published" in done.stdout and cv2.imread(str(tmp_path / "ids.png")).std() > 1
    failed = run(str(tmp_path / "nowhere"))
    assert failed.returncode == 1 and failed.stderr.startswith("error: ") and "Traceback" not in failed.stderr
    helped = run("--help")
    assert helped.returncode == 0 and "what an evaluation still needs" in " ".join(helped.stdout.split())
