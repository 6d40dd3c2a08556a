"""A live RealSense camera, simulated by the maker's library; it is unplugged and plugged in again."""

import time
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyrealsense2", reason="the extra realsense, or libusb, is not installed", exc_type=ImportError)

from depth_files import CAMERA, SoftwareCamera, depth_mm, write_bag

from kpopnet.errors import InputError
from kpopnet.sources import open_depth, realsense_camera
from kpopnet.sources.live import CameraAwayError
from kpopnet.sources.realsense_camera import RealSenseCamera

IMAGES = depth_mm(6)


@pytest.fixture
def plugged(monkeypatch):
    """The software camera that is plugged in, to be changed; a silent camera is given up soon."""
    monkeypatch.setattr(realsense_camera, "SILENCE_MS", 100)
    monkeypatch.setattr(realsense_camera, "SEARCH_EVERY_S", 0.01)
    return [SoftwareCamera()]


def opened(plugged):
    return RealSenseCamera(lambda: plugged[0].device if plugged else None)


def test_a_camera_gives_what_its_recording_gives(plugged, tmp_path):
    camera, recorded = opened(plugged), open_depth(write_bag(tmp_path / "a.db3", IMAGES))
    for number, expected in enumerate(recorded):
        before = time.monotonic()
        plugged[0].take(IMAGES[number], number)
        depth_m, taken = camera.read()
        np.testing.assert_array_equal(depth_m, expected)
        assert depth_m.dtype == np.float32 and before <= taken <= time.monotonic()
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        assert getattr(camera.camera, name) == pytest.approx(getattr(CAMERA, name)) == getattr(recorded.camera, name)
    camera.close()


def test_images_that_wait_are_dropped_but_for_the_newest(plugged):
    camera = opened(plugged)
    for number in range(6):
        plugged[0].take(IMAGES[number], number)
    time.sleep(0.1)
    np.testing.assert_allclose(camera.read()[0], IMAGES[5] / 1000, rtol=1e-6)
    camera.close()


def test_a_camera_vanishes_and_comes_back(plugged):
    camera = opened(plugged)
    plugged[0].take(IMAGES[0], 0)
    camera.read()
    with pytest.raises(CameraAwayError, match="look at its cable"):
        camera.read()
    plugged.clear()
    for _ in range(3):
        with pytest.raises(CameraAwayError, match=r"no RealSense camera .* plug it in"):
            camera.read()
    plugged.append(SoftwareCamera())
    with pytest.raises(CameraAwayError, match="cable"):  # it is there, but silent
        camera.read()
    with pytest.raises(CameraAwayError, match="cable"):
        camera.read()
    camera._connect()
    plugged[0].take(IMAGES[3], 0)
    np.testing.assert_allclose(camera.read()[0], IMAGES[3] / 1000, rtol=1e-6)
    camera.close()


def test_another_camera_is_not_taken_for_the_first(plugged):
    camera = opened(plugged)
    plugged[0] = SoftwareCamera(camera=replace(CAMERA, fx=99.0))
    with pytest.raises(CameraAwayError):
        camera.read()
    with pytest.raises(InputError, match="another camera"):
        camera.read()


def test_without_a_camera_it_says_so(plugged):
    plugged.clear()
    with pytest.raises(InputError, match="plug it in"):
        opened(plugged)
