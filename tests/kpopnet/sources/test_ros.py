"""Bags of ROS 1 and 2, written by rosbags, give the depth, the camera and the times that were written."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import ros_files

from kpopnet.sources import ros

pytest.importorskip("rosbags", reason="the extra ros is not installed")

from depth_files import CAMERA, FPS, depth_mm
from ros_files import REALSENSE_TOPIC, TOPIC, write_ros

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.sources import open_depth
from kpopnet.sources.lenses import Lens, Optics

IMAGES = depth_mm(6)
ALIGNED = "/camera/aligned_depth_to_color/image_raw"
KINDS = {"16UC1": 0, "32FC1": 0, "16UC1; compressedDepth": 0, "32FC1; compressedDepth png": 0.002}
"""Encodings, and what each may lose, in metres."""


@pytest.mark.parametrize("name", ["a.bag", "a.db3", "a.mcap", "bag"])
def test_depth_of_every_encoding_comes_with_camera_and_times(name, tmp_path):
    for number, (kind, lost_m) in enumerate(KINDS.items()):
        topic = f"{TOPIC}/compressedDepth" if "compressed" in kind else TOPIC
        path = tmp_path / str(number) / name
        path.parent.mkdir()
        source = open_depth(write_ros(path, IMAGES, {topic: kind}), in_child=name == "bag" and number == 0)
        images = list(source.timed())
        np.testing.assert_allclose([image.depth_m for image in images], IMAGES / 1000, rtol=1e-6, atol=lost_m)
        np.testing.assert_allclose([image.time_s for image in images], np.arange(len(IMAGES)) / FPS, atol=1e-6)
        assert source.camera == CAMERA and source.frames == len(IMAGES) and source.fps == pytest.approx(FPS)


def test_the_topic_is_the_only_one_called_depth_or_the_key(tmp_path):
    topics = {"/camera/infra/image_raw": "16UC1", "/camera/ir/image": "mono16", TOPIC: "16UC1"}
    write_ros(tmp_path / "a.bag", IMAGES, topics | {f"{TOPIC}/compressedDepth": "16UC1; compressedDepth png"})
    assert len(list(open_depth(tmp_path / "a.bag"))) == len(IMAGES)
    assert list(open_depth(tmp_path / "a.bag", key="/camera/infra/image_raw"))
    write_ros(tmp_path / "b.mcap", IMAGES, {ALIGNED: "16UC1", TOPIC: "16UC1"})
    with pytest.raises(InputError, match=rf"2 topics are called depth .*--key\): it holds {ALIGNED}, {TOPIC}"):
        open_depth(tmp_path / "b.mcap")
    assert list(open_depth(tmp_path / "b.mcap", key=ALIGNED))
    with pytest.raises(InputError, match=rf"/camera/ir/image: expected a topic of depth .* it holds .*{TOPIC}"):
        open_depth(tmp_path / "a.bag", key="/camera/ir/image")
    write_ros(tmp_path / "c.db3", IMAGES, {"/camera/image": "mono16"})
    with pytest.raises(InputError, match=r"no topics are called depth .* none among /camera/camera_info, /camera/image"):
        open_depth(tmp_path / "c.db3")


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("plumb_bob", (-0.3, 0.1, 0, 0, 0)),
        ("rational_polynomial", (0.5, 0.2, 0, 0, 0, 0.8, 0.3, 0)),
        ("equidistant", (0.1, 0, 0, 0)),
    ],
)
def test_the_lens_of_a_camera_info_is_undone_unless_the_driver_did(model, coefficients, tmp_path):
    expected = Optics(CAMERA, Lens(coefficients, model == "equidistant")).view()
    projection = (50.0, 0, 30, 0, 0, 51.0, 22, 0, 0, 0, 1, 0)
    source = open_depth(write_ros(tmp_path / "a.bag", IMAGES, camera=(model, coefficients), projection=projection))
    assert source.camera == expected.camera and expected.camera != CAMERA
    np.testing.assert_allclose(next(iter(source)), expected.image(IMAGES[0]) / 1000, rtol=1e-6)
    write_ros(tmp_path / "b.bag", IMAGES, {"/depth/image_rect": "16UC1"}, (model, coefficients), projection)
    assert open_depth(tmp_path / "b.bag").camera == Camera(50.0, 51.0, 30.0, 22.0, CAMERA.width, CAMERA.height)


def test_a_recording_of_realsense_is_read_without_its_library(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    source = open_depth(write_ros(tmp_path / "a.bag", IMAGES, {REALSENSE_TOPIC: "mono16"}, unit_m=0.0005))
    np.testing.assert_allclose(list(source), IMAGES / 2000, rtol=1e-6)
    assert source.camera == CAMERA
    write_ros(tmp_path / "b.bag", IMAGES, {REALSENSE_TOPIC: "16UC1"})
    with pytest.raises(InputError, match=r"expected the unit of depth.*extra realsense"):
        open_depth(tmp_path / "b.bag")


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
def test_what_cannot_be_read_is_refused_in_one_line(suffix, tmp_path):
    for name, images, content, told in (
        ("a", IMAGES, {"camera": None}, "does not state its camera"),
        ("b", IMAGES, {"topics": {TOPIC: "16UC1; compressedDepth rvl"}}, "found 16UC1; compressedDepth rvl"),
        ("c", IMAGES, {"topics": {TOPIC: "8UC1"}}, "no topics are called depth"),
        ("d", IMAGES[:0], {"camera": None}, "no topics are called depth .* none among no topics"),
    ):
        with pytest.raises(InputError, match=told):
            open_depth(write_ros(tmp_path / f"{name}{suffix}", images, **content))


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_times_go_on_over_whole_seconds(name, tmp_path, monkeypatch):
    def header(self, number):
        sec, nanosec = divmod(round(number * 1e9 / FPS) + 900_000_000, 10**9)
        stamp = self.types.Time(sec=ros_files.START_S + sec, nanosec=nanosec)
        return self.types.Header(stamp=stamp, frame_id="depth", **({"seq": number} if self.is_ros1 else {}))

    monkeypatch.setattr(ros_files.Messages, "header", header)
    source = open_depth(write_ros(tmp_path / name, depth_mm(6)))
    np.testing.assert_allclose([one.time_s for one in source.timed()], np.arange(6) / FPS, atol=1e-6)


@pytest.mark.parametrize(("encoding", "dtype"), [("16UC1", ">u2"), ("32FC1", ">f4")])
def test_bytes_of_the_other_order_are_read(encoding, dtype):
    stored = (IMAGES[0] / (1 if encoding == "16UC1" else 1000)).astype(dtype)
    height, width = stored.shape
    data = np.frombuffer(stored.tobytes(), np.uint8)
    message = SimpleNamespace(encoding=encoding, is_bigendian=1, width=width, height=height, step=stored.strides[0], data=data)
    np.testing.assert_array_equal(ros._raw(message, "here"), stored)
