"""The figure of every stage, drawn by its program."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from cone_people import PLACE_M, cone_body, cone_joints, draw_cones
from y_people import draw_y, y_joints

from kpopnet.camera import CAMERAS

CAMERA = CAMERAS["kinect_v1"]


@pytest.fixture
def draw(program, tmp_path: Path):
    """Runs the program on a recording; returns what it prints, and the figure's path."""

    def run(recorded: np.ndarray | bytes, *options: str, fails: bool = False) -> tuple[str, Path]:
        path, figure = tmp_path / "depth.npy", tmp_path / "stages.png"
        if isinstance(recorded, bytes):
            path.write_bytes(recorded)
        else:
            np.save(path, recorded)
        return program("stages", path, 2, figure, *options, fails=fails), figure

    return run


def test_every_stage_is_drawn(draw) -> None:
    depth_m = np.repeat(draw_y(y_joints(place_m=PLACE_M), CAMERA)[None], 3, axis=0)
    printed, path = draw(np.rint(1000 * depth_m).astype(np.uint16))
    assert str(path) in printed
    figure = cv2.imread(str(path))
    assert figure.shape[0] > 700 and figure.shape[1] > 1000
    # Two rows of three panels, none of them uniform.
    for row in np.array_split(figure, 2):
        for tile in np.array_split(row, 3, axis=1):
            assert tile.std() > 10


def test_recordings_need_no_start_pose(draw) -> None:
    joints = cone_joints(-75, 4)
    depth_m = np.repeat(draw_cones(joints, cone_body(joints), CAMERA)[None], 3, axis=0)
    assert "with start=auto" in draw(depth_m, "--start", "y_pose", fails=True)[0]
    draw(depth_m)


@pytest.mark.parametrize(
    ("recorded", "message"),
    [
        (np.zeros((3, 240, 320), np.uint16), "no person"),
        (np.zeros((240, 320), np.uint16), r"(T, H, W)"),
        (b"no array", "numpy.save"),
    ],
)
def test_errors_are_one_line(draw, recorded, message: str) -> None:
    printed, path = draw(recorded, fails=True)
    assert message in printed and not path.exists()
