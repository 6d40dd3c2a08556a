"""Recordings of phones: the depth's camera from the colour image's, times, and no pixel of the lowest confidence."""

import json
import zipfile

import numpy as np
import pytest
from depth_files import FPS, depth_mm
from phone_files import RECORD3D_COLOUR, STRAY_COLOUR, UNSURE_ROWS, write_record3d, write_stray
from PIL import Image

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.sources import open_depth

IMAGES = depth_mm(12)
SURE_M = np.where(np.arange(48)[:, None] < UNSURE_ROWS, 0, IMAGES / 1000).astype(np.float32)


def written(kind, place, **how):
    if kind == "stray":
        return write_stray(place / "a", IMAGES, **how)
    pytest.importorskip("lzfse", reason="the extra record3d is not installed")
    return write_record3d(place / "a.r3d", IMAGES, **how)


@pytest.mark.parametrize(("kind", "colour"), [("stray", STRAY_COLOUR), ("record3d", RECORD3D_COLOUR)])
def test_depth_comes_with_its_camera_and_times(kind, colour, tmp_path):
    source = open_depth(written(kind, tmp_path), in_child=kind == "record3d")
    images = list(source.timed())
    np.testing.assert_allclose([image.depth_m for image in images], SURE_M, rtol=1e-6)
    np.testing.assert_allclose([image.time_s for image in images], np.arange(len(IMAGES)) / FPS, atol=1e-5)
    assert source.fps == pytest.approx(FPS, rel=1e-3) and source.frames == len(IMAGES)
    corners = np.array([[-0.5, -0.5, 2.0], [63.5, 47.5, 2.0]])
    of_colour = np.array([[-0.5, -0.5, 2.0], [colour.width - 0.5, colour.height - 0.5, 2.0]])
    np.testing.assert_allclose(source.camera.back_project(corners), colour.back_project(of_colour))


def test_stray_scanner_without_times_or_confidence_and_with_a_camera_of_its_own(tmp_path):
    folder = write_stray(tmp_path / "a", IMAGES)
    (folder / "odometry.csv").write_text("timestamp, frame\n1.0, 000000\n")
    for path in (folder / "confidence").iterdir():
        path.unlink()
    with pytest.raises(InputError, match=r"confidence.000000\.png: .*No such file"):
        list(open_depth(folder))
    (folder / "confidence").rmdir()
    source = open_depth(folder)
    assert not source.fps_is_known and next(iter(source))[0].all()
    (folder / "camera_matrix.csv").write_text("500, 0, 320\n0, 500, 240\n0, 0, 1\n")
    with pytest.raises(InputError, match=r"camera_matrix\.csv: expected the matrix of colour images of 1920x1440"):
        open_depth(folder)
    camera = Camera(60.0, 60.0, 32.0, 24.0, 64, 48)
    (folder / "camera.json").write_text(json.dumps(vars(camera)))
    assert open_depth(folder).camera == camera


def test_what_is_wrong_in_a_stray_folder_is_told_in_one_line(tmp_path):
    folder = write_stray(tmp_path / "a", IMAGES[:3])
    for name, content, told in (
        ("camera_matrix.csv", "", "expected 9 finite numbers"),
        ("odometry.csv", "a, b\n1, 2\n", "expected columns timestamp"),
        ("odometry.csv", "timestamp, frame\nnan, 0\n", "finite times"),
    ):
        whole = (folder / name).read_bytes()
        (folder / name).write_text(content)
        with pytest.raises(InputError, match=f"{name}: .*{told}"):
            open_depth(folder)
        (folder / name).write_bytes(whole)
    Image.fromarray(np.ones((4, 4), np.uint8)).save(folder / "confidence" / "000001.png")
    with pytest.raises(InputError, match=r"000001\.png: expected a confidence for each of 64x48 pixels"):
        list(open_depth(folder))
    for path in (folder / "depth").iterdir():
        path.unlink()
    with pytest.raises(InputError, match="depth: expected images of depth"):
        open_depth(folder)


def test_what_is_wrong_in_an_r3d_is_told_in_one_line(tmp_path):
    np.testing.assert_allclose(next(iter(open_depth(written("record3d", tmp_path, with_confidence=False)))), IMAGES[0] / 1000)
    one_size = written("record3d", tmp_path, w=64, h=48, dw=None, dh=None, frameTimestamps=None)
    assert open_depth(one_size).camera.fx == RECORD3D_COLOUR.fx and open_depth(one_size).fps == FPS
    for changed, told in (
        ({"K": [1.0] * 8}, "K: expected 9 numbers"),
        ({"K": None}, "lacks K"),
        ({"K": [0.0] * 9}, "fx"),
        ({"dw": 65}, "expected .* bytes for 65x48 pixels"),
        ({"dw": 10**9}, "expected 1 to 16,000,000 pixels"),
    ):
        with pytest.raises(InputError, match=told):
            list(open_depth(written("record3d", tmp_path, **changed)))
    with zipfile.ZipFile(tmp_path / "a.r3d", "w") as archive:
        archive.writestr("rgbd/0.jpg", b"")
    with pytest.raises(InputError, match=r"expected metadata and rgbd/N\.depth"):
        open_depth(tmp_path / "a.r3d")
