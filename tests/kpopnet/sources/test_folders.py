"""Folders in the layouts of data sets state their scale and, where the data set does, their camera."""

import numpy as np
import pytest
from depth_files import CAMERA, FPS, SCANNET_MATRIX, depth_mm, save_images, write_scannet, write_tum

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.sources import open_depth
from kpopnet.sources.folders import TUM_CAMERA

IMAGES = depth_mm(4)


def test_tum(tmp_path):
    index = write_tum(tmp_path / "mine", IMAGES) / "depth.txt"
    index.write_text(index.read_text() + "\n")  # an empty line
    source = open_depth(tmp_path / "mine", CAMERA)
    images = list(source.timed())
    np.testing.assert_allclose([image.depth_m for image in images], IMAGES / 5000, rtol=1e-6)
    np.testing.assert_allclose([image.time_s for image in images], np.arange(4) / FPS, atol=1e-5)
    np.testing.assert_allclose(list(open_depth(tmp_path / "mine", CAMERA, depth_scale=1000)), IMAGES / 1000, rtol=1e-6)
    for scale in (0, float("nan")):
        with pytest.raises(InputError, match="units a metre; expected a positive number"):
            open_depth(tmp_path / "mine", CAMERA, depth_scale=scale)
    with pytest.raises(InputError, match="does not state its camera"):
        open_depth(tmp_path / "mine")
    for place in ("../mine/depth/0.png", tmp_path / "mine" / "depth" / "0.png", ""):
        index.write_text(f"1.5 {place}\n")
        with pytest.raises(InputError, match=r"depth\.txt: line 1: expected the path of an image in this folder"):
            open_depth(tmp_path / "mine", CAMERA)
    vga = np.tile(IMAGES, (1, 10, 10))
    assert open_depth(write_tum(tmp_path / "rgbd_dataset_freiburg3_sitting_static", vga)).camera == TUM_CAMERA


def test_scannet(tmp_path):
    exported = save_images(tmp_path / "a" / "depth", "{}.png", IMAGES).parent
    (exported / "intrinsic").mkdir()
    (exported / "intrinsic" / "intrinsic_depth.txt").write_text(SCANNET_MATRIX)
    sensor = write_scannet(tmp_path / "b", IMAGES, units_per_m=2000)
    save_images(sensor, "frame-{:06d}.color.png", np.zeros((4, 48, 64, 3), np.uint8))
    info = (sensor / "_info.txt").read_text()
    for folder, units in ((exported, 1000), (sensor, 2000)):
        source = open_depth(folder)
        np.testing.assert_allclose(list(source), IMAGES / units, rtol=1e-6)
        assert source.camera == CAMERA
    for damaged, told in (
        (info.replace(SCANNET_MATRIX, "1 2 3"), "expected 16 finite numbers, found 3"),
        (info.replace("2000", "0"), "a positive m_depthShift"),
        ("", "does not state its camera"),
    ):
        (sensor / "_info.txt").write_text(damaged)
        with pytest.raises(InputError, match=told):
            open_depth(sensor)


def test_ntu(tmp_path):
    images = np.tile(IMAGES, (1, 9, 8))[:, :424]
    source = open_depth(save_images(tmp_path / "S001C001P001R001A001", "MDepth-{:08d}.png", images))
    assert source.camera == CAMERAS["kinect_2"] and source.fps == 30
    np.testing.assert_allclose(next(iter(source)), images[0] / 1000, rtol=1e-6)
    save_images(tmp_path / "S001C001P001R001A001", "Depth-{:08d}.png", images)
    with pytest.raises(InputError, match=r"2 kinds of names \(Depth-#, MDepth-#"):
        open_depth(tmp_path / "S001C001P001R001A001")
    assert open_depth(tmp_path / "S001C001P001R001A001", key="Depth*").camera == CAMERAS["kinect_2"]
