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
    """Draws the figure of a recording; what the program prints."""

    def run(recorded: np.ndarray, *options: str, fails: bool = False) -> str:
        np.save(tmp_path / "depth.npy", recorded)
        return program("stages", tmp_path / "depth.npy", 2, tmp_path / "stages.png", *options, fails=fails)

    return run


def test_every_stage_is_drawn(draw, tmp_path: Path) -> None:
    depth_m = np.repeat(draw_y(y_joints(place_m=PLACE_M), CAMERA)[None], 3, axis=0)
    assert "stages.png" in draw(np.rint(1000 * depth_m).astype(np.uint16))
    figure = cv2.imread(str(tmp_path / "stages.png"))
    assert figure.shape[0] > 700 and figure.shape[1] > 1000
    # Two rows of three panels, none of them uniform.
    assert all(tile.std() > 10 for row in np.array_split(figure, 2) for tile in np.array_split(row, 3, axis=1))


def test_a_figure_of_another_kind_is_refused(program, tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        program("stages", tmp_path / "depth.npy", 2, tmp_path / "stages.txt")


def test_recordings_need_no_start_pose(draw) -> None:
    joints = cone_joints(-75, 4)
    depth_m = np.repeat(draw_cones(joints, cone_body(joints), CAMERA)[None], 3, axis=0)
    assert "with start=auto" in draw(depth_m, "--start", "y_pose", fails=True)
    draw(depth_m)


@pytest.mark.parametrize(("size", "message"), [((3, 240, 320), "no person"), ((240, 320), "depth that numpy.save wrote")])
def test_errors_are_one_line(draw, tmp_path, size, message: str) -> None:
    assert message in draw(np.zeros(size, np.uint16), fails=True) and not (tmp_path / "stages.png").exists()


def test_images_of_another_camera_are_refused_with_the_file_and_the_word(draw) -> None:
    told = draw(np.full((3, 240, 320), 2000, np.uint16), "--camera", "kinect_2", fails=True)
    assert "depth.npy, read with --camera kinect_2: depth sequence: expected the camera's 512x424 pixels" in told
