"""Live cameras by name, recordings that are played as cameras, and recordings of cameras, also after a kill."""

import contextlib
import errno
import os
import signal
import subprocess
import sys
import time
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from depth_files import CAMERA, depth_mm, write_npz
from programs import ROOT

from kpopnet.errors import InputError
from kpopnet.languages import Said, in_language
from kpopnet.sources import arrays, open_depth
from kpopnet.sources.arrays import DepthWriter
from kpopnet.sources.live import NewestImage, PlayedRecording
from kpopnet.sources.source import CameraAwayError

MILLIMETRES = depth_mm(6)
METRES = MILLIMETRES.astype(np.float32) / 1000
FPS = 50.0


def played(folder, **how):
    write_npz(folder / "a.npz", MILLIMETRES, fps=FPS)
    return PlayedRecording(partial(open_depth, folder / "a.npz"), **how)


def test_a_recording_is_played_in_its_own_time_to_its_end(tmp_path):
    camera, began = played(tmp_path), time.monotonic()
    read = [camera.read() for _ in range(len(METRES))]
    assert time.monotonic() - began >= (len(METRES) - 1) / FPS - 0.01 and camera.camera == CAMERA
    np.testing.assert_array_equal([depth_m for depth_m, _ in read], METRES)
    assert (np.diff([taken for _, taken in read]) > 0).all()
    assert camera.read() is None


def test_a_recording_in_a_loop_stands_still_while_it_is_not_read(tmp_path):
    camera = played(tmp_path, loop=True)
    camera.read()
    time.sleep(0.5)  # longer than the recording
    began = time.monotonic()
    shown = [camera.read()[0] for _ in range(len(METRES))]
    np.testing.assert_array_equal(shown, METRES[[1, 2, 3, 4, 5, 0]])
    assert time.monotonic() - began >= 4 / FPS - 0.01  # in its own time again
    camera.close()
    assert camera.read() is None


def test_a_recording_of_a_camera_opens_with_equal_depth(tmp_path):
    times_s = np.array([0, 0.03, 0.07, 0.1, 0.13, 0.17])
    writer = DepthWriter(tmp_path / "depth.h5", CAMERA)
    for image_m, time_s in zip(METRES, times_s, strict=True):
        writer.add(np.where(image_m > 2, np.float32(70), image_m) if time_s == 0.1 else image_m, time_s)
        if writer.images == 3:  # while it is written, too
            np.testing.assert_array_equal(list(open_depth(tmp_path / "depth.h5", in_child=True)), METRES[:3])
    writer.close()
    source = open_depth(tmp_path / "depth.h5")
    images = list(source.timed())
    np.testing.assert_array_equal([image.time_s for image in images], times_s)
    np.testing.assert_array_equal(images[3].depth_m, np.where(METRES[3] > 2, 0, METRES[3]))  # what is too far for a file
    assert source.camera == CAMERA and source.fps == pytest.approx(1 / 0.03)


def test_a_recording_ends_before_the_disk_is_full(tmp_path, monkeypatch):
    writer = DepthWriter(tmp_path / "depth.h5", CAMERA)
    writer.add(METRES[0], 0.0)
    monkeypatch.setattr(arrays.shutil, "disk_usage", lambda _: SimpleNamespace(free=1000))
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        writer.add(METRES[1], 0.1)
    writer.close()
    assert len(list(open_depth(tmp_path / "depth.h5"))) == 1
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        DepthWriter(tmp_path / "other.h5", CAMERA)
    assert not (tmp_path / "other.h5").exists()


WRITER = """
import sys
from pathlib import Path
import numpy as np
from kpopnet.camera import Camera
from kpopnet.sources.arrays import DepthWriter
writer = DepthWriter(Path(sys.argv[1]), Camera.from_fov(60, 320, 240))
rng = np.random.default_rng(0)
for number in range(10**6):
    writer.add(np.full((240, 320), number % 4096 + 1, np.float32) / 1000 + (rng.random((240, 320)) < 0.1), number / 30)
    print(number, flush=True)
"""


def test_a_kill_leaves_a_recording_that_opens(tmp_path):
    path, images = tmp_path / "depth.h5", 7
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], cwd=ROOT, stdout=subprocess.PIPE, text=True) as program:
        for _ in range(images):
            program.stdout.readline()
        os.kill(program.pid, signal.SIGKILL)
    read = list(open_depth(path, in_child=True).timed())
    assert len(read) >= images
    for number, image in enumerate(read):
        assert image.time_s == number / 30 and image.depth_m.min() == np.float32((number + 1) / 1000)


def test_a_camera_that_is_back_is_not_away(tmp_path):
    reads = [CameraAwayError("gone"), (METRES[0], 1.0), None]

    def read():
        if isinstance(one := reads.pop(0), CameraAwayError):
            raise one
        return one

    with contextlib.closing(NewestImage(SimpleNamespace(read=read, close=lambda: None))) as images:
        assert images.fetch(10.0).taken == 1.0 and images.away == ""


def test_what_a_camera_says_can_be_said_in_the_language_of_the_page():
    errors = [
        CameraAwayError(Said("no OAK camera starts ({reason}); plug it in", reason="busy")),
        InputError(Said("the recording of depth has ended")),
    ]

    waited = []

    def read():
        time.sleep(0.1)
        waited.append(images.away)
        raise errors.pop(0)

    images = NewestImage(SimpleNamespace(read=read, close=lambda: None))
    images.fetch(10.0)
    assert in_language(waited[1], "de") == "keine OAK-Kamera startet (busy); schließe sie an"
    assert in_language(images.error, "de") == "die Kamera ist stehen geblieben: die Tiefenaufnahme ist zu Ende"
    images.close()
