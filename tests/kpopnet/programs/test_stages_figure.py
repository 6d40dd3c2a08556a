"""The figure of every stage, drawn by its program."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, draw_cones
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS
from kpopnet.programs.stages import main

CAMERA = CAMERAS["kinect_v1"]


@pytest.fixture
def draw(monkeypatch, capsys, tmp_path: Path):
    """Runs the program on a recording; returns its exit code, its output, and the figure's path."""

    def run(recorded: np.ndarray | bytes, *options: str, frame: int = 2) -> tuple[int, str, Path]:
        path, figure = tmp_path / "depth.npy", tmp_path / "stages.png"
        if isinstance(recorded, bytes):
            path.write_bytes(recorded)
        else:
            np.save(path, recorded)
        monkeypatch.setattr(sys, "argv", ["program", str(path), str(frame), str(figure), *options])
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        return code, printed.out + printed.err, figure

    return run


def test_every_stage_is_drawn(draw) -> None:
    depth_m = np.repeat(draw_y(y_joints(place_m=PLACE_M), CAMERA)[None], 3, axis=0)
    code, printed, path = draw(np.rint(1000 * depth_m).astype(np.uint16))
    assert code == 0 and str(path) in printed
    figure = cv2.imread(str(path))
    assert figure.shape[0] > 700 and figure.shape[1] > 1000
    # Two rows of three panels, none of them uniform.
    for row in np.array_split(figure, 2):
        for tile in np.array_split(row, 3, axis=1):
            assert tile.std() > 10


def test_recordings_need_no_start_pose(draw) -> None:
    joints = cone_joints(-75, 4)
    depth_m = np.repeat(draw_cones(joints, cone_body(joints), CAMERA)[None], 3, axis=0)
    code, printed, _ = draw(depth_m, "--start", "y_pose")
    assert code == 1 and "with start=auto" in printed
    assert draw(depth_m)[0] == 0


@pytest.mark.parametrize(
    ("recorded", "frame", "message"),
    [
        (np.zeros((3, 240, 320), np.uint16), 2, "no person"),
        (np.zeros((240, 320), np.uint16), 2, r"(T, H, W)"),
        (b"no array", 2, "numpy.save"),
    ],
)
def test_errors_are_one_line(draw, recorded, frame: int, message: str) -> None:
    code, printed, path = draw(recorded, frame=frame)
    assert code == 1 and printed.startswith("error: ") and printed.count("\n") == 1 and message in printed
    assert not path.exists()
