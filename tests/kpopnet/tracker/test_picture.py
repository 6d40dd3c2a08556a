"""The drawing of every stage, by its own program."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, draw_cones
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS
from kpopnet.tracker.__main__ import main

CAMERA = CAMERAS["kinect_v1"]


@pytest.fixture
def draw(monkeypatch, capsys, tmp_path: Path):
    """Runs the program on a recording; returns its exit code, what it printed, and the picture's path."""

    def run(recorded: np.ndarray | bytes, *options: str, frame: int = 2) -> tuple[int, str, Path]:
        path, picture = tmp_path / "depth.npy", tmp_path / "stages.png"
        if isinstance(recorded, bytes):
            path.write_bytes(recorded)
        else:
            np.save(path, recorded)
        monkeypatch.setattr(sys, "argv", ["program", str(path), str(frame), str(picture), *options])
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        return code, printed.out + printed.err, picture

    return run


def test_every_stage_is_drawn(draw) -> None:
    depth_m = np.repeat(draw_y(y_joints(place_m=PLACE_M), CAMERA)[None], 3, axis=0)
    code, printed, path = draw(np.rint(1000 * depth_m).astype(np.uint16))
    assert code == 0 and str(path) in printed
    picture = cv2.imread(str(path))
    assert picture.shape[0] > 700 and picture.shape[1] > 1000
    # Two rows of three pictures, each with something in it.
    for row in np.array_split(picture, 2):
        for tile in np.array_split(row, 3, axis=1):
            assert tile.std() > 10


def test_a_bar_counts_the_frames_where_somebody_watches(draw, monkeypatch) -> None:
    nobody = np.zeros((3, 240, 320), np.uint16)
    assert "2/2" not in draw(nobody)[1]
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert "2/2" in draw(nobody)[1]


def test_who_stands_can_be_followed_too(draw) -> None:
    joints = cone_joints(-75, 4)
    depth_m = np.repeat(draw_cones(joints, cone_body(joints), CAMERA)[None], 3, axis=0)
    code, printed, _ = draw(depth_m)
    assert code == 1 and "--start standing" in printed
    assert draw(depth_m, "--start", "standing")[0] == 0


@pytest.mark.parametrize(
    "recorded, frame, said",
    [
        (np.zeros((3, 240, 320), np.uint16), 2, "nobody"),
        (np.zeros((3, 240, 320), np.uint16), 3, "frame 3 of 3"),
        (np.zeros((3, 240, 320), np.uint16), 0, "one before it"),
        (np.zeros((240, 320), np.uint16), 2, r"(T, H, W)"),
        (np.zeros((3, 100, 100), np.uint16), 2, "100"),
        (b"no array", 2, "numpy.save"),
        (np.array([{"a": 1}] * 3, object), 2, "numpy.save"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(draw, recorded, frame: int, said: str) -> None:
    code, printed, path = draw(recorded, frame=frame)
    assert code == 1 and printed.startswith("error: ") and printed.count("\n") == 1 and said in printed
    assert not path.exists()
