"""Overlays: skeletons where the camera sees them, videos and GIFs that play, with PyAV and without."""

import subprocess
import sys

import cv2
import numpy as np
import pytest
from capsule_people import CAMERA, draw_depth, draw_joints
from PIL import Image
from programs import ROOT

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint
from kpopnet.viz.overlay import overlay_image, resized, save_gif, write_video


def pictures(count=6):
    joints_m = [draw_joints(np.random.default_rng(number)) for number in range(count)]
    return [overlay_image(draw_depth(one), CAMERA, [one], 640) for one in joints_m]


def test_several_people_are_numbered_and_one_who_is_missing_or_alone_is_not():
    depth_m, joints_m, missing = np.full((60, 80), 3, np.float32), np.zeros((15, 3)), np.full((15, 3), np.nan)
    joints_m[:] = 0, 0.5, 2.0
    joints_m[Joint.HEAD] = 0, 0, 2.0
    camera = Camera.centred(70.0, 80, 60)
    alone, beside_a_missing_one, second = (
        overlay_image(depth_m, camera, people, 640) for people in ([joints_m], [joints_m, missing], [missing, joints_m])
    )
    assert not np.array_equal(alone, beside_a_missing_one) and not np.array_equal(beside_a_missing_one, second)
    assert np.array_equal(overlay_image(depth_m, camera, [missing] * 2, 640), overlay_image(depth_m, camera, [], 640))


@pytest.mark.parametrize("library", ["av", "opencv"])
def test_a_video_plays_with_its_frames_in_order_and_one_that_is_interrupted_leaves_nothing(library, tmp_path, monkeypatch):
    if library == "opencv":
        monkeypatch.setitem(sys.modules, "av", None)
    else:
        pytest.importorskip("av", reason="the extra video is not installed")
    images = pictures()
    write_video(tmp_path / "a.mp4", images, 25.0)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    capture = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert capture.get(cv2.CAP_PROP_FPS) == 25.0
    for image in images:
        found = cv2.cvtColor(capture.read()[1], cv2.COLOR_BGR2RGB)
        assert np.abs(found.astype(float) - image).mean() < 4
    assert not capture.read()[0]

    def interrupted():
        yield images[0]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(tmp_path / "b.mp4", interrupted(), 25.0)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


def test_a_film_that_a_full_disk_cuts_short_is_none_also_by_opencv(tmp_path):
    script = f"""
import resource, sys
import numpy as np
sys.modules["av"] = None
from pathlib import Path
from kpopnet.viz.overlay import write_video
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
write_video(Path({str(tmp_path / "a.mp4")!r}), np.random.default_rng(0).integers(0, 255, (60, 480, 640, 3), np.uint8), 25.0)
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "OSError" in done.stderr and not list(tmp_path.iterdir())


def test_a_narrow_image_is_not_enlarged_beyond_what_videos_hold():
    camera = Camera.centred(500.0, 1, 480)
    assert overlay_image(np.full((480, 1), 2, np.float32), camera, [], 640).shape[0] <= 2048
    assert overlay_image(np.full((1, 480), 2, np.float32), camera.turned(), [], 640).shape == (2, 480, 3)


def test_a_gif_shows_every_frame_for_its_time(tmp_path):
    images = pictures()
    save_gif(tmp_path / "a.gif", [resized(image, 320) for image in images], 0.1)
    with Image.open(tmp_path / "a.gif") as gif:
        assert (gif.n_frames, gif.size, gif.info["duration"], gif.info["loop"]) == (6, (320, 240), 100, 0)
        gif.seek(4)
        assert np.abs(np.asarray(gif.convert("RGB"), float) - resized(images[4], 320)).mean() < 6
    save_gif(tmp_path / "fast.gif", images[:2], 1 / 90)  # which browsers would show at a tenth of a second each
    with Image.open(tmp_path / "fast.gif") as gif:
        assert gif.info["duration"] == 20
