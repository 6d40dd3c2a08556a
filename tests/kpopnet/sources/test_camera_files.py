"""Cameras are read from our own JSON, RealSense's and Azure Kinect's."""

import json

import cv2
import numpy as np
import pytest

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.sources import open_depth
from kpopnet.sources.camera_files import read_optics
from kpopnet.sources.lenses import Lens

OURS = {"fx": 365.0, "fy": 366.0, "cx": 255.5, "cy": 211.5, "width": 512, "height": 424}
REALSENSE = {
    "width": 640, "height": 480, "ppx": 321.2, "ppy": 238.9, "fx": 387.1, "fy": 387.5, "model": "distortion.brown_conrady",
    "coeffs": [0.0, 0.0, 0.0, 0.0, 0.0],
}  # fmt: skip
AZURE = [0.51, 0.52, 0.49, 0.48, 5.25, 3.5, 0.18, 5.58, 5.13, 0.95, 0, 0, 0.0001, -0.0001]


def azure(parameters):
    depth = {"Purpose": "CALIBRATION_CameraPurposeDepth", "Intrinsics": {"ModelParameters": parameters}}
    colour = {"Purpose": "CALIBRATION_CameraPurposePhotoVideo", "Intrinsics": {"ModelParameters": [9.0] * 14}}
    return {"CalibrationInformation": {"Cameras": [colour, depth]}}


def written(tmp_path, content):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(content))
    return path


def test_our_own_realsense_and_presets(tmp_path):
    for content in (REALSENSE, {"depth": REALSENSE, "color": {"fx": 1}}, {"depth_intrinsics": REALSENSE}):
        assert read_optics(written(tmp_path, content)) == (Camera(387.1, 387.5, 321.2, 238.9, 640, 480), None)
    assert read_optics(written(tmp_path, OURS)) == (Camera(365.0, 366.0, 255.5, 211.5, 512, 424), None)
    assert read_optics("kinect_2").camera == CAMERAS["kinect_2"]
    with pytest.raises(InputError, match=r"no such file, and no preset; there are .*kinect_2"):
        read_optics("kinect_3")


def test_the_modes_of_an_azure_kinect_see_the_same_rays(tmp_path):
    """A ray hits the narrow image, its binned half and the wide image at the same place of the sensor."""
    path = written(tmp_path, azure(AZURE))
    full, binned, narrow, half = (
        read_optics(path, *size).camera for size in ((1024, 1024), (512, 512), (640, 576), (320, 288))
    )
    ray = np.array([0.1, -0.2, 1.0])
    u, v, _ = full.project(ray)
    np.testing.assert_allclose(narrow.project(ray)[:2], (u - 192, v - 180))
    for whole, smaller in ((full, binned), (narrow, half)):  # edges of pixels, not centres, are halved
        np.testing.assert_allclose(smaller.project(ray)[:2] + 0.5, (whole.project(ray)[:2] + 0.5) / 2)
    assert full.fx == pytest.approx(0.49 * 1024)
    assert (narrow.width, narrow.height) == (640, 576)


def test_the_lens_is_what_the_file_states_and_an_unknown_model_is_told(tmp_path, caplog):
    for content, expected in (
        (REALSENSE | {"coeffs": [0.2, 0.1, 0.01, 0.02, 0.3]}, Lens((0.2, 0.1, 0.01, 0.02, 0.3))),
        (OURS | {"coeffs": [0.2, 0.1, 0, 0], "model": "distortion.kannala_brandt4"}, Lens((0.2, 0.1, 0.0, 0.0), True)),
        (azure(AZURE), Lens((5.25, 3.5, -0.0001, 0.0001, 0.18, 5.58, 5.13, 0.95))),
    ):
        assert read_optics(written(tmp_path, content), 640, 576).lens == expected
    harmless = OURS | {"distortion_model": "brown", "distortion": [0, 0.0], "D": []}
    assert read_optics(written(tmp_path, harmless)).lens is None
    assert not caplog.text
    unknown = REALSENSE | {"coeffs": [0.2, 0.1, 0, 0, 0], "model": "distortion.inverse_brown_conrady"}
    assert read_optics(written(tmp_path, unknown)).lens is None and "inverse_brown_conrady is not known" in caplog.text
    caplog.clear()
    cv2.imwrite(str(tmp_path / "0.png"), np.full((unknown["height"], unknown["width"]), 2000, np.uint16))
    list(open_depth(tmp_path, in_child=True))
    assert "inverse_brown_conrady is not known" in caplog.text and len(caplog.messages) == 1


@pytest.mark.parametrize(
    ("content", "size", "message"),
    [
        ([], (), "no camera in it"),
        (OURS | {"coeffs": [0.1] * 14}, (), "at most 8 lens coefficients"),
        (OURS | {"coeffs": [0.1] * 5, "model": "kannala_brandt4"}, (), "at most 4 lens coefficients"),
        (OURS | {"fx": -1}, (), "fx=-1"),
        (OURS | {"coeffs": None}, (), "coeffs: expected a list of numbers; leave it out"),
        (OURS | {"distortion": [0.1, 0.2, 0, 0]}, (), "distortion: expected a lens under coeffs"),
        (
            {name: REALSENSE[name] for name in REALSENSE if name != "coeffs"} | {"dist_coeffs": [[0.1, 0.2]]},
            (),
            "dist_coeffs: expected a lens under coeffs",
        ),
        (OURS | {"k1": 0.1}, (), "k1: expected a lens under coeffs"),
        (azure(AZURE), (), "give the depth image's size"),
        (azure(["a"] * 14), (640, 576), "ModelParameters"),
    ],
)
def test_what_is_no_camera_is_refused(tmp_path, content, size, message):
    with pytest.raises(InputError, match=message):
        read_optics(written(tmp_path, content), *size)
