"""`python -m kpopnet.datasets.describe`: what a folder of a data set holds."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from itop_files import write_itop
from point_cloud_files import CAMERAS, FIRST, FRAMES
from programs import ROOT
from scipy.io import savemat
from two_people_files import write_two_people

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.writer import write_labels, write_learner, write_teacher
from kpopnet.datasets.describe import describe, id_figure
from kpopnet.errors import InputError


def described(path: Path) -> str:
    return "\n".join(describe(path))


def write_points(folder: Path, name: str) -> Path:
    """Two frames: id 7 in both, id 3 in the first."""
    joints = [(7, (0.25, -0.5, 1.75)), (3, (-0.5, 0.25, 1.5))]
    (folder / FIRST[name]).write_bytes(FRAMES[name](0, joints=joints) + FRAMES[name](1, joints=joints[:1]))
    return folder / FIRST[name]


@pytest.mark.parametrize("name", ["eval", "smmc10"])
def test_ids_are_listed_with_their_positions_and_drawn_there(tmp_path, name):
    path = write_points(tmp_path, name)
    for given in (tmp_path, path):
        text = described(given)
        assert "as published: 1 sequences" in text and "2 frames" in text and f"benchmark={name}" in text
        assert "  3: in 50 % of the frames, first at (-0.50, 0.25, 1.50) m" in text
        assert "  7: in 100 % of the frames, first at (0.25, -0.50, 1.75) m" in text
    figure, camera = id_figure(tmp_path), CAMERAS[name]
    scale = 960 / camera.width
    u, v, _ = camera.project(np.array([0.25, -0.5, 1.75]))
    pixel = figure[round((v + 0.5) * scale), round((u + 0.5) * scale)].astype(int)
    assert figure.shape[1] == 960 and pixel[0] > 180 and pixel[1] < 80, "a red mark"


def test_itop_and_utd_mhad_are_described_by_their_first_sequence(tmp_path):
    for kind in ("itop", "Depth", "Skeleton"):
        (tmp_path / kind).mkdir()
    frames = np.full((3, 240, 320), 2.0), np.ones((3, 15, 3))
    write_itop(tmp_path / "itop", ["00_00000", "00_00001", "03_00000"], *frames, valid=np.array([1, 0, 1]))
    text = described(tmp_path / "itop")
    assert "2 of 3 frames have manually checked labels" in text and "benchmark.view=side benchmark.split=test" in text
    savemat(tmp_path / "Depth" / "a1_s1_t1_depth.mat", {"d_depth": np.full((240, 320, 5), 2000, np.uint16)})
    savemat(tmp_path / "Skeleton" / "a1_s1_t1_skeleton.mat", {"d_skel": np.ones((20, 3, 5))})
    for given in (tmp_path, tmp_path / "Depth", tmp_path / "Depth" / "a1_s1_t1_depth.mat"):
        assert "1 sequences; a1_s1_t1: 5 frames" in described(given)
    (tmp_path / "Skeleton" / "a1_s1_t1_skeleton.mat").unlink()
    with pytest.raises(InputError, match="no such file"):
        described(tmp_path)


def test_simulated_sets_and_dances_are_described(tmp_path):
    write_two_people(tmp_path / "pairs", 2)
    assert "SIMULATED" in described(tmp_path / "pairs") and "benchmark=two_people" in described(tmp_path / "pairs")
    dance = Performance(np.ones((4, 15, 3)), np.arange(4) / 30)
    write_teacher(tmp_path / "set" / "mama", dance)
    for name in ("ann", "jin"):
        write_learner(tmp_path / "set" / "mama", name, dance.times_s, dance.joints_m)
    write_labels(tmp_path / "set" / "mama", ["ann", "jin"])
    assert "1 dances; mama has 2 learners" in described(tmp_path / "set")


def test_an_unknown_layout_is_refused_with_the_expected_files(tmp_path):
    (tmp_path / "notes.txt").write_text("")
    with pytest.raises(InputError, match=r"an unknown layout; expected one of seq_\*_\*\.bin \(EVAL\).*found notes\.txt"):
        described(tmp_path)


def test_the_command_line(tmp_path):
    def run(*given: str) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "kpopnet.datasets.describe", *given]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)

    write_points(tmp_path, "smmc10")
    done = run(str(tmp_path), "--figure", str(tmp_path / "ids.png"))
    assert done.returncode == 0 and "SMMC-10, as published" in done.stdout and cv2.imread(str(tmp_path / "ids.png")).std() > 1
    failed = run(str(tmp_path / "nowhere"))
    assert failed.returncode == 1 and failed.stderr.startswith("error: ") and "Traceback" not in failed.stderr
