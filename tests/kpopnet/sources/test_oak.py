"""An OAK camera's depth, of a camera simulated by a node of the maker's library; it is unplugged and plugged in again."""

import queue
import time

import numpy as np
import pytest

pytest.importorskip("depthai", reason="the extra oak is not installed", exc_type=ImportError)

import depthai
from depth_files import CAMERA, depth_mm

from kpopnet.errors import InputError
from kpopnet.sources.lenses import Lens, Optics
from kpopnet.sources.live import oak
from kpopnet.sources.live.oak import OakCamera
from kpopnet.sources.source import CameraAwayError

IMAGES = depth_mm(6)


class Measuring(depthai.node.ThreadedHostNode):
    """Stands where the camera's own depth would be."""

    def __init__(self):
        super().__init__()
        kinds = [depthai.Node.DatatypeHierarchy(depthai.DatatypeEnum.ImgFrame, True)]
        self.depth = self.createOutput("depth", possibleDatatypes=kinds)

    def run(self):
        while self.isRunning():
            try:
                self.depth.send(self.waiting.get(timeout=0.01))
            except queue.Empty:
                continue


class Plugged:
    """The simulated camera that is plugged in, if any, to be changed."""

    def __init__(self):
        self.fx, self.coefficients, self.is_there, self._waiting = CAMERA.fx, [], True, queue.Queue()

    def build(self):
        if not self.is_there:
            raise RuntimeError("No available devices")
        pipeline = self.pipeline = depthai.Pipeline(False)
        node = pipeline.create(Measuring)
        node.waiting = self._waiting = queue.Queue()
        self.measure(IMAGES[0])
        return pipeline, node.depth

    def measure(self, image):
        """Sends (H, W) uint16 millimetres; when that was, in seconds."""
        frame = depthai.ImgFrame()
        frame.setType(depthai.ImgFrame.Type.RAW16)
        frame.setSize(CAMERA.width, CAMERA.height)
        frame.setStride(2 * CAMERA.width)
        frame.setData(np.frombuffer(image.tobytes(), np.uint8))
        matrix = [[self.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
        model = depthai.CameraModel.Perspective
        frame.setTransformation(depthai.ImgTransformation(CAMERA.width, CAMERA.height, matrix, model, self.coefficients))
        now = depthai.Clock.now()
        frame.setTimestamp(now)
        self._waiting.put(frame)
        return now.total_seconds()


@pytest.fixture
def plugged(monkeypatch):
    monkeypatch.setattr(oak, "SILENCE_S", 0.2)
    monkeypatch.setattr(oak, "SEARCH_EVERY_S", 0.01)
    return Plugged()


def test_images_come_with_camera_and_times(plugged):
    camera = OakCamera(plugged.build)
    assert camera.camera == CAMERA
    for image in IMAGES:
        measured = plugged.measure(image)
        depth_m, taken = camera.read()
        np.testing.assert_array_equal(depth_m, image.astype(np.float32) / 1000)
        assert depth_m.dtype == np.float32 and taken == measured == pytest.approx(time.monotonic(), abs=1)
    for image in IMAGES:
        plugged.measure(image)
    time.sleep(0.2)
    np.testing.assert_array_equal(camera.read()[0], IMAGES[-1].astype(np.float32) / 1000)  # the newest of those that wait
    camera.close()


def test_what_the_camera_leaves_of_the_distortion_is_undone(plugged):
    plugged.coefficients = [-0.25, 0.125, 0, 0, 0]
    camera = OakCamera(plugged.build)
    view = Optics(CAMERA, Lens((-0.25, 0.125))).view()
    plugged.measure(IMAGES[1])
    np.testing.assert_array_equal(camera.read()[0], view.image(IMAGES[1].astype(np.float32) / 1000))
    assert camera.camera == view.camera != CAMERA
    camera.close()


def test_a_camera_vanishes_and_comes_back(plugged):
    camera = OakCamera(plugged.build)
    with pytest.raises(CameraAwayError, match="look at its cable"):
        camera.read()
    plugged.is_there = False
    for _ in range(2):
        with pytest.raises(CameraAwayError, match=r"no OAK camera starts \(No available devices\); plug it in"):
            camera.read()
    plugged.is_there = True
    camera._connect()
    plugged.measure(IMAGES[3])
    np.testing.assert_array_equal(camera.read()[0], IMAGES[3].astype(np.float32) / 1000)
    camera._pipeline.stop()  # torn out while it is asked
    with pytest.raises(CameraAwayError, match="look at its cable"):
        camera.read()
    plugged.fx = 99.0
    with pytest.raises(InputError, match="another camera"):
        camera.read()
    camera.close()


def test_the_pipeline_ends_with_the_camera_and_where_opening_fails(plugged):
    camera = OakCamera(plugged.build)
    assert plugged.pipeline.isRunning()
    camera.close()
    assert not plugged.pipeline.isRunning()
    camera.close()  # twice is no error
    plugged.fx = -1.0
    with pytest.raises(InputError, match="intrinsics: a camera's fx=-1"):
        OakCamera(plugged.build)
    assert not plugged.pipeline.isRunning()
    plugged.fx = 99.0  # another camera: none of its images may be taken for the first one's
    with pytest.raises(InputError, match="another camera"):
        camera.read()
    assert not plugged.pipeline.isRunning()


def test_without_a_camera_it_says_so():
    with pytest.raises(InputError, match="no OAK camera is connected; plug it in"):
        OakCamera()
