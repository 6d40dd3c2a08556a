"""`python -m kpopnet.datasets.describe`: the ids in the files of EVAL and SMMC-10."""

import subprocess
import sys

import cv2
import numpy as np
import pytest
from point_cloud_files import CAMERAS, FIRST, FRAMES
from programs import ROOT

from kpopnet.datasets.describe import describe, id_figure, recognised
from kpopnet.errors import InputError


@pytest.mark.parametrize("name", ["eval", "smmc10"])
def test_ids_are_listed_with_their_positions_and_drawn_there(tmp_path, name):
    """Two frames: id 7 in both, id 3 in the first."""
    joints = [(7, (0.25, -0.5, 1.75)), (3, (-0.5, 0.25, 1.5))]
    path = tmp_path / FIRST[name]
    path.write_bytes(FRAMES[name](0, joints=joints) + FRAMES[name](1, joints=joints[:1]))
    assert recognised(tmp_path) == recognised(path)
    kind, first = recognised(tmp_path)
    found = kind.recording(first)
    text = "\n".join(describe(kind, first, found))
    assert "2 frames" in text and f"benchmark={name} benchmark.path={tmp_path} " in text
    assert "  3: in 50 % of the frames, first at (-0.50, 0.25, 1.50) m" in text
    assert "  7: in 100 % of the frames, first at (0.25, -0.50, 1.75) m" in text
    figure, camera = id_figure(found), CAMERAS[name]
    scale = 960 / camera.width
    u, v, _ = camera.project(np.array([0.25, -0.5, 1.75]))
    pixel = figure[round((v + 0.5) * scale), round((u + 0.5) * scale)].astype(int)
    assert figure.shape[1] == 960 and pixel[0] > 180 and pixel[1] < 80, "a red mark"


def test_the_command_line(tmp_path):
    (tmp_path / FIRST["smmc10"]).write_bytes(FRAMES["smmc10"](0))
    command = [sys.executable, "-m", "kpopnet.datasets.describe", tmp_path, "--figure", tmp_path / "ids.png"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and "SMMC-10: real01_7" in done.stdout and cv2.imread(str(tmp_path / "ids.png")).std() > 1
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"expected sequences of SMMC-10 or EVAL, whose joints have ids, found notes\.txt"):
        recognised(tmp_path / "other")
    with pytest.raises(InputError, match="no such file or folder"):
        recognised(tmp_path / "nowhere")
