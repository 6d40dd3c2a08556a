"""`python -m kpopnet.datasets.describe`: the ids in the files of EVAL and SMMC-10."""

import sys

import cv2
import numpy as np
import pytest
from point_cloud_files import CAMERAS, FIRST, FRAMES

from kpopnet.datasets.describe import describe, id_figure, main, recognised
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


def test_the_program_and_what_it_does_not_know(tmp_path, monkeypatch, capsys):
    (tmp_path / FIRST["smmc10"]).write_bytes(FRAMES["smmc10"](0))
    monkeypatch.setattr(sys, "argv", ["describe", str(tmp_path), "--figure", str(tmp_path / "ids.png")])
    main()
    assert "SMMC-10: real01_7" in capsys.readouterr().out and cv2.imread(str(tmp_path / "ids.png")).std() > 1
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"expected sequences of SMMC-10 or EVAL, whose joints have ids, found notes\.txt"):
        recognised(tmp_path / "other")
