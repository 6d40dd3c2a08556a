"""The examples as a user runs them."""

import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import time
from dataclasses import astuple

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from depth_files import CAMERA as DEPTH_CAMERA
from depth_files import depth_mm, next_image
from programs import ROOT, run_program

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from kpopnet.sources import open_depth
from kpopnet.sources.live.pipe import PipeCamera


def run_example(name: str, *words: object) -> str:
    done = run_program(f"examples/{name}", ROOT, *words)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_missing_recording_is_one_line(tmp_path):
    np.savez(tmp_path / "bare.npz", depth_mm=np.zeros((1, 2, 2), np.uint16))
    for name, words, told in (
        ("recordings_to_score.py", ("a.npz", "b.npz"), "error: a.npz: "),
        ("camera_to_joints.py", ("a.npz",), "error: a.npz: no such file"),
        ("feed_pipe.py", ("bare.npz",), "error: bare.npz: lacks camera, fps"),
    ):
        done = subprocess.run([sys.executable, ROOT / "examples" / name, *words], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 1 and done.stderr.startswith(told) and done.stderr.count("\n") == 1, done.stderr


def test_a_new_move_becomes_a_dance_and_scores_as_a_copy_of_itself(tmp_path):
    printed = run_example("new_move.py", tmp_path / "dance.png", "--joints", tmp_path / "dance.npz")
    assert (tmp_path / "dance.png").stat().st_size > 10_000 and "look at" in printed
    with np.load(tmp_path / "dance.npz") as file:
        assert np.isfinite(file["joints_m"]).all() and len(file["joints_m"]) == len(file["times_s"])
    scored = run_example("recordings_to_score.py", tmp_path / "dance.npz", tmp_path / "dance.npz")
    similarity = int(scored.split("similarity ")[1].split(",")[0])
    assert similarity == 100 and len(scored.splitlines()) == 2  # nothing to tell


def test_a_camera_becomes_joints(tmp_path):
    camera = CAMERAS["kinect_v1"]
    joints_m = cone_joints(-75, 4)  # upright, with hanging arms
    depth_m = draw_cones(joints_m, cone_body(joints_m), camera)
    np.save(tmp_path / "recording.npy", np.repeat((1000 * depth_m).astype(np.uint16)[None], 4, axis=0))
    fov_deg = np.degrees(2 * np.arctan(camera.width / 2 / camera.fx))
    printed = run_example("camera_to_joints.py", tmp_path / "recording.npy", "--fov", fov_deg)
    hands = {"right": joints_m[Joint.RIGHT_HAND], "left": joints_m[Joint.LEFT_HAND]}
    found = re.findall(r"image \d: person \d, (\w+) hand at (\S+), (\S+), (\S+) m", printed)
    assert {side for side, *_ in found} == {"right", "left"}
    for side, *place_m in found:
        assert np.linalg.norm(np.array(place_m, float) - hands[side]) < 0.2  # a body of cones, not one the network knows


@pytest.fixture
def recording(tmp_path):
    """What stands for a camera in examples/feed_pipe.py, and its images."""
    images = depth_mm(4)
    np.savez(tmp_path / "camera.npz", depth_mm=images, camera=astuple(DEPTH_CAMERA), fps=50.0)
    return tmp_path / "camera.npz", images


def test_a_camera_is_fed_to_kpopnet_by_python(recording, tmp_path):
    path, images = recording
    sent = subprocess.run([sys.executable, ROOT / "examples" / "feed_pipe.py", path], capture_output=True, check=True)
    (tmp_path / "sent.depth").write_bytes(sent.stdout)
    source = open_depth(tmp_path / "sent.depth")
    assert source.camera == DEPTH_CAMERA and [image.tolist() for image in source] == (images.astype("f4") / 1000).tolist()
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    feeding = subprocess.Popen([sys.executable, ROOT / "examples" / "feed_pipe.py", path, "--port", str(port)])
    try:
        camera = connected(f"tcp:127.0.0.1:{port}")
        seen = [next_image(camera)[0] for _ in range(20)]  # it ends after each four images, and is found again
        camera.close()
        assert all(any((one == image.astype("f4") / 1000).all() for image in images) for one in seen)
    finally:
        feeding.kill()
        feeding.wait()


def connected(address: str) -> PipeCamera:
    for _ in range(100):
        try:
            return PipeCamera(address)
        except InputError:
            time.sleep(0.1)
    raise AssertionError(f"nothing at {address}")


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_a_camera_is_fed_to_kpopnet_by_c(tmp_path):
    strict = ["cc", "-std=c11", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run([*strict, ROOT / "examples" / "feed_pipe.c", "-o", tmp_path / "feed"], check=True)
    before = time.monotonic()
    sent = subprocess.run([tmp_path / "feed", "3"], capture_output=True, check=True)
    (tmp_path / "sent.depth").write_bytes(sent.stdout)
    images = list(open_depth(tmp_path / "sent.depth").timed())
    for number, image in enumerate(images):
        assert image.depth_m.shape == (480, 640)
        np.testing.assert_array_equal(image.depth_m, np.tile((2000 + number + np.arange(640)).astype("f4") / 1000, (480, 1)))
    (first_s,) = struct.unpack_from("<d", sent.stdout, sent.stdout.index(b"\n") + 1)
    assert len(images) == 3 and images[0].time_s == 0 < images[2].time_s
    assert before < first_s < first_s + images[2].time_s < time.monotonic()


ORBBEC = """
from types import SimpleNamespace as Has
import numpy as np
print("the library greets")
OBSensorType = Has(DEPTH_SENSOR=3)
image = np.load("camera.npz")["depth_mm"][0]
camera = Has(**dict(zip(("fx", "fy", "cx", "cy", "width", "height"), (70.0, 71.0, 31.0, 23.5, 64, 48))))
lens = Has(model="OBCameraDistortionModel.BROWN_CONRADY_K6", **dict.fromkeys("k1 k2 k3 k4 k5 k6 p1 p2".split(), 0.0))
profile = Has(get_intrinsic=lambda: camera, get_distortion=lambda: lens)
frame = Has(get_depth_scale=lambda: 0.5, get_data=lambda: image.view(np.uint8).ravel())
Config = lambda: Has(enable_stream=print)
class Pipeline:
    left = [None, Has(get_depth_frame=lambda: frame), Has(get_depth_frame=lambda: None), Has(get_depth_frame=lambda: frame)]
    start = lambda self, config: None
    wait_for_frames = lambda self, wait_ms: self.left.pop(0)
    get_stream_profile_list = lambda self, kind: Has(get_default_video_stream_profile=lambda: profile)
"""
KINECT = """
from types import SimpleNamespace as Has
import numpy as np
print("the library greets")
CalibrationType, ColorResolution, DepthMode = Has(DEPTH=0), Has(OFF=0), Has(NFOV_UNBINNED=2)
depth = np.tile(np.load("camera.npz")["depth_mm"][0], (12, 10))
Config = dict
class PyK4A:
    left = [Has(depth=depth, depth_system_timestamp_nsec=k * 10**8) for k in (1, 2)]
    start = lambda self: None
    get_capture = lambda self: self.left.pop(0)
    calibration = Has(
        get_camera_matrix=lambda of: np.array([[500, 0, 320], [0, 501, 288], [0, 0, 1.0]]), get_distortion_coefficients=np.zeros
    )
    __init__ = lambda self, config: None
"""


@pytest.mark.parametrize(
    ("example", "module", "fake", "unit_m", "tiles"),
    [("orbbec", "pyorbbecsdk", ORBBEC, 0.0005, (1, 1)), ("azure_kinect", "pyk4a", KINECT, 0.001, (12, 10))],
)
def test_makers_libraries_are_fed_to_kpopnet(recording, tmp_path, example, module, fake, unit_m, tiles):
    """Fakes of the libraries, with what the examples use of them: what is sent is checked, not the libraries."""
    (tmp_path / f"{module}.py").write_text(fake)
    command = [sys.executable, ROOT / "examples" / f"feed_{example}.py"]
    sent = subprocess.run(command, cwd=tmp_path, capture_output=True, env=os.environ | {"PYTHONPATH": str(tmp_path)})
    assert b"IndexError: pop from empty list" in sent.stderr  # no more images
    (tmp_path / "sent.depth").write_bytes(sent.stdout)
    images = list(open_depth(tmp_path / "sent.depth"))
    assert len(images) == 2
    np.testing.assert_allclose(images[1], unit_m * np.tile(recording[1][0], tiles), rtol=1e-6)
