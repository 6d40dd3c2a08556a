"""What `python -m kpopnet.benchmarks describe` says of each format, whole, partial and broken."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from itop_files import write_itop
from scipy.io import savemat

from kpopnet.benchmarks.__main__ import first_picture
from kpopnet.benchmarks.describe import describe
from kpopnet.benchmarks.eval_format import FRAME
from kpopnet.benchmarks.organised_points import FROM_OPENGL
from kpopnet.benchmarks.smmc10_format import MAGIC, PACKED, PADDED, stored_points
from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError

ROOT = Path(__file__).parents[2]


def points(camera: Camera) -> np.ndarray:
    """A wall at 2 m, as stored."""
    return camera.points(np.full((camera.height, camera.width), 2, np.float32)) * FROM_OPENGL


def write_eval(folder: Path, name: str = "seq_a_0", frames: int = 4) -> Path:
    """Joint 7 in all frames, joint 3 in every second; a marker."""
    stored = np.zeros(frames, FRAME)
    stored["magic"], stored["xyz"] = 5, points(CAMERAS["eval"])
    stored["xyz"][0] = 0  # the first frame shows nothing
    stored["njoints"], stored["nmarkers"] = 2, 1
    stored["joints"]["id"][:, :2] = 7, 3
    stored["joints"]["pos"][:, 0] = 0.25, 0.5, -1.75
    stored["joints"]["pos"][::2, 1] = -0.5, -0.25, -1.5
    stored["markers"]["name"][:, 0] = b"LSHO"
    stored.tofile(folder / f"{name}.bin")
    return folder / f"{name}.bin"


def write_smmc10(folder: Path, name: str = "real01_1", layout: np.dtype = PACKED, frames: int = 4) -> Path:
    """Markers 1 and 16 in all frames, 24 in none, 40 in every second."""
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
    described = {"simulated": True, "benchmark": benchmark, "about": "SIMULATED", "seed": 5, "hash": "abc", "sequences": 3}
    (folder / "manifest.json").write_text(json.dumps(described | {"config": {}} | more))


def test_eval_says_its_ids_where_they_are_and_that_the_map_is_missing(tmp_path):
    path = write_eval(tmp_path)
    write_eval(tmp_path, "seq_b_0", frames=6)
    for given in (tmp_path, path):
        text = describe(given)
        assert text.startswith("EVAL, as published\n2 sequences, 10 frames at 30 a second, 4 to 6 each\n")
        assert "camera fitted to seq_a_0.bin: 320x240, fx 285.70, fy 285.70, cx 159.50, cy 119.50 pixels" in text
        assert "  3: in 50 % of the frames, first at (-0.50, 0.25, 1.50) m\n  7: in 100 % of the frames" in text
        assert "markers LSHO" in text
        assert "missing: which id is which joint" in text and f"benchmark.path={tmp_path} 'benchmark.joints=" in text


@pytest.mark.parametrize(("layout", "word"), [(PACKED, "458,004 bytes (packed)"), (PADDED, "458,008 bytes (padded)")])
def test_smmc10_says_its_markers_and_which_of_the_known_are_absent(tmp_path, layout, word):
    write_smmc10(tmp_path, layout=layout)
    text = describe(tmp_path)
    assert text.startswith("SMMC-10, as published\n1 sequence, 4 frames at 25 a second") and word in text
    assert "camera fitted to real01_1.cal.bin: 144x176, fx 204." in text and "cx 71.50, cy 87.50 pixels" in text
    assert "  1: in 100 % of the frames, first at (0.25, -0.50, 1.75) m" in text
    assert "  24: in 0 % of the frames\n  40: in 50 % of the frames" in text
    assert "head: [1, 3], right_hand: [16], left_hand: [24], by one public reader; of these 3, 24 are never visible" in text
    assert f"python evaluate.py benchmark=smmc10 benchmark.path={tmp_path}" in text


def test_stand_ins_are_called_simulated_and_lack_nothing(tmp_path):
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
        assert f"nothing is missing:\n  python evaluate.py benchmark={benchmark} benchmark.path={folder}" in text
    assert "called 1 LFHD, 40 RFHD" in text


def test_torn_sequences_are_named_and_the_others_described(tmp_path):
    torn = write_smmc10(tmp_path, "real01_1")
    torn.write_bytes(torn.read_bytes()[:-7])
    text = describe(tmp_path)
    assert "cannot be read: " in text and "real01_1.cal.bin: ends" in text and "markers" not in text
    write_smmc10(tmp_path, "real01_2")
    text = describe(tmp_path)
    assert "1 sequence, 4 frames" in text and "real01_1.cal.bin: ends" in text and "real01_2.cal.bin holds markers" in text


def test_where_no_camera_fits_it_is_said(tmp_path):
    empty = write_eval(tmp_path)
    stored = np.fromfile(empty, FRAME)
    stored["xyz"] = 0
    stored.tofile(empty)
    assert "no camera can be fitted" in describe(tmp_path)
    stored["xyz"] = points(CAMERAS["eval"])[..., [1, 0, 2]]
    stored.tofile(empty)
    assert "no camera: " in describe(tmp_path) and "pixels from those of the camera that fits best" in describe(tmp_path)


def test_itop_says_which_parts_are_there(tmp_path):
    frames = np.full((3, 240, 320), 2.0), np.ones((3, 15, 3))
    write_itop(tmp_path, ["00_00000", "00_00001", "03_00000"], *frames, valid=np.array([1, 0, 1]))
    write_itop(tmp_path, ["00_00000", "00_00001", "03_00000"], *frames, part="top_train")
    (tmp_path / "ITOP_top_train_labels.h5").rename(tmp_path / "ITOP_top_train_labels.h5.gz")
    text = describe(tmp_path)
    assert "side test: 3 frames of 2 people (00, 03), 2 with checked labels; read as 2 sequences" in text
    assert "side train: not here" in text and "top test: not here" in text
    assert "top train: cannot be read: " in text and "gunzip" in text
    assert "benchmark.view=side benchmark.split=test" in text and "benchmark.view=top" not in text
    (tmp_path / "ITOP_side_test_labels.h5").unlink()
    assert "For a score is missing: of one view and split both" in describe(tmp_path)


def test_utd_mhad_says_which_halves_are_missing(tmp_path):
    for kind in ("Depth", "Skeleton"):
        (tmp_path / kind).mkdir()
    depth, skeleton = np.full((240, 320, 5), 2000, np.uint16), np.ones((20, 3, 5))
    for name in ("a1_s1_t1", "a1_s2_t1", "a2_s1_t1"):
        savemat(tmp_path / "Depth" / f"{name}_depth.mat", {"d_depth": depth})
    for name in ("a1_s1_t1", "a1_s2_t1", "a9_s1_t1"):
        savemat(tmp_path / "Skeleton" / f"{name}_skeleton.mat", {"d_skel": skeleton})
    (tmp_path / "Depth" / "a1_s1_t1_depth.mat").write_bytes(b"torn")
    for given in (tmp_path, tmp_path / "Depth", tmp_path / "Depth" / "a1_s1_t1_depth.mat"):
        text = describe(given)
        assert "2 sequences with depth and skeleton (the whole set has 861)" in text
        assert "of 1 action, 2 subjects and 1 trial" in text
        assert "without their file in Skeleton/: a2_s1_t1" in text and "without their file in Depth/: a9_s1_t1" in text
        assert "cannot be read: " in text and "a1_s2_t1: 5 frames" in text
        assert "python evaluate.py benchmark=utd_mhad" in text
    (tmp_path / "Depth" / "a1_s2_t1_depth.mat").unlink()
    assert "For a score is missing: one sequence of which both files can be read" in describe(tmp_path)


def test_what_is_none_of_them_is_told_what_is_expected(tmp_path):
    with pytest.raises(InputError, match="no such file or folder"):
        describe(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"Expected for EVAL seq_a_0\.bin.*UTD-MHAD Depth/.*Found nothing"):
        describe(tmp_path)
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError, match=r"Found notes\.txt"):
        describe(tmp_path)


def test_the_picture_shows_every_id_at_its_place(tmp_path):
    for write, camera in ((write_eval, CAMERAS["eval"]), (write_smmc10, CAMERAS["smmc10"])):
        folder = tmp_path / write.__name__
        folder.mkdir()
        path = write(folder)
        picture = first_picture(path)
        np.testing.assert_array_equal(picture, first_picture(folder))
        scale = 960 / camera.width
        assert picture.shape == (round(camera.height * scale), 960, 3)
        u, v, _ = camera.project(np.array([0.25, -0.5, 1.75]))
        at = picture[round((v + 0.5) * scale), round((u + 0.5) * scale)].astype(int)
        assert at[0] > 180 and at[1] < 80, "a red mark"
    # The first frame of EVAL's shows nothing; the second does, and in it joint 3 is absent.
    assert (picture[..., 0] > picture[..., 1].astype(int) + 100).sum() > 20


def test_the_command_line(tmp_path):
    def run(*given: str) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "kpopnet.benchmarks", *given]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)

    write_smmc10(tmp_path)
    done = run("describe", str(tmp_path), "--picture", str(tmp_path / "ids.png"))
    assert done.returncode == 0 and "SMMC-10, as published" in done.stdout and cv2.imread(str(tmp_path / "ids.png")).std() > 1
    failed = run("describe", str(tmp_path / "nowhere"))
    assert failed.returncode == 1 and failed.stderr.startswith("error: ") and "Traceback" not in failed.stderr
    helped = run("--help")
    assert helped.returncode == 0 and "what is missing for a score" in " ".join(helped.stdout.split())
