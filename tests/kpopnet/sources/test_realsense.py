"""RealSense's depth, recorded and live, of a camera simulated by the maker's library; it is unplugged and plugged in again."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("pyrealsense2", reason="the extra realsense, or libusb, is not installed", exc_type=ImportError)

from depth_files import CAMERA, FPS, SoftwareCamera, depth_mm, write_bag

from kpopnet.errors import InputError
from kpopnet.sources import open_depth, realsense
from kpopnet.sources.realsense import RealSenseCamera
from kpopnet.sources.source import CameraAwayError

IMAGES = depth_mm(6)


@pytest.fixture
def plugged(monkeypatch):
    """The software camera that is plugged in, to be changed; a silent camera is given up soon."""
    monkeypatch.setattr(realsense, "SILENCE_S", 0.1)
    monkeypatch.setattr(realsense, "START_S", 0.5)
    monkeypatch.setattr(realsense, "SEARCH_EVERY_S", 0.01)
    return [SoftwareCamera()]


def opened(plugged):
    return RealSenseCamera(lambda: plugged[0].device if plugged else None)


def test_a_recording_tells_camera_times_and_unit(tmp_path):
    stored = np.where(IMAGES == 0, np.uint16(65535), IMAGES)  # neither was measured
    source = open_depth(write_bag(tmp_path / "a.db3", stored, unit_m=0.0001))
    images = list(source.timed())
    np.testing.assert_allclose([image.depth_m for image in images], IMAGES.astype(np.float32) / 10_000, rtol=1e-6)
    np.testing.assert_allclose([image.time_s for image in images], np.arange(len(IMAGES)) / FPS, atol=1e-6)
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        assert getattr(source.camera, name) == pytest.approx(getattr(CAMERA, name))
    (tmp_path / "b.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(5000))
    with pytest.raises(InputError, match=r"b\.bag: not a (RealSense recording|readable bag)"):
        open_depth(tmp_path / "b.bag")


def test_a_recording_without_depth_is_refused(tmp_path, monkeypatch):
    path = write_bag(tmp_path / "a.db3", IMAGES[:2])
    monkeypatch.setattr(realsense, "_depth_profiles", lambda _: [])
    with pytest.raises(InputError, match=r"a\.db3: expected a stream of depth"):
        open_depth(path)


def test_a_camera_gives_what_its_recording_gives(plugged, tmp_path):
    camera, recorded = opened(plugged), open_depth(write_bag(tmp_path / "a.db3", IMAGES))
    for number, expected in enumerate(recorded):
        before = time.monotonic()
        plugged[0].take(IMAGES[number], number)
        depth_m, taken = camera.read()
        np.testing.assert_array_equal(depth_m, expected)
        assert depth_m.dtype == np.float32 and before <= taken <= time.monotonic()
    for number in range(6):
        plugged[0].take(IMAGES[number], number)
    time.sleep(0.1)
    np.testing.assert_allclose(camera.read()[0], IMAGES[5] / 1000, rtol=1e-6)  # the newest of those that wait
    assert camera.camera == recorded.camera
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
    for _ in range(2):
        with pytest.raises(CameraAwayError, match="cable"):  # it is there, but silent
            camera.read()
    camera._connect()
    plugged[0].take(IMAGES[3], 0)
    np.testing.assert_allclose(camera.read()[0], IMAGES[3] / 1000, rtol=1e-6)
    camera.close()


def test_the_first_image_may_take_longer_than_the_next_ones(plugged):
    camera = opened(plugged)
    later = threading.Timer(0.25, plugged[0].take, (IMAGES[0], 0))
    later.start()
    np.testing.assert_allclose(camera.read()[0], IMAGES[0] / 1000, rtol=1e-6)
    later.join()
    before = time.monotonic()
    with pytest.raises(CameraAwayError, match="cable"):
        camera.read()
    assert time.monotonic() - before < 0.4
    camera.close()


def test_another_camera_or_none_is_refused(plugged):
    camera = opened(plugged)
    plugged[0] = SoftwareCamera(camera=replace(CAMERA, fx=99.0))
    with pytest.raises(CameraAwayError):
        camera.read()
    with pytest.raises(InputError, match="another camera"):
        camera.read()
    plugged.clear()
    with pytest.raises(InputError, match="plug it in"):
        opened(plugged)
