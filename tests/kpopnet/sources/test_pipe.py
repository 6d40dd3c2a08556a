"""Depth that another program sends: in a file, through sockets and through standard input; it ends, comes back, and lies."""

import contextlib
import math
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from depth_files import CAMERA, FPS, depth_mm, next_image, sent_image, sent_line, write_sent
from programs import ROOT

from kpopnet.errors import InputError
from kpopnet.languages import in_language
from kpopnet.sources import open_depth
from kpopnet.sources.lenses import Lens, Optics
from kpopnet.sources.live import pipe
from kpopnet.sources.live.pipe import PipeCamera, Relay
from kpopnet.sources.source import CameraAwayError, CameraClock

IMAGES = depth_mm(6)


class Sender:
    """A program that sends depth where `PipeCamera` looks for it: once, or after it has ended again."""

    def __init__(self, place):
        self._place = place

    def begin(self):
        is_path = isinstance(self._place, str)
        self._listener = socket.create_server(self._place, family=socket.AF_UNIX if is_path else socket.AF_INET)
        self._place = self._listener.getsockname()
        self.address = f"unix:{self._place}" if is_path else f"tcp:127.0.0.1:{self._place[1]}"

    def accept(self, line):
        self._connection, _ = self._listener.accept()
        self._connection.sendall(line)

    def camera(self, line):
        """A camera that has just been connected."""
        self.begin()
        accepting = threading.Thread(target=self.accept, args=(line,))
        accepting.start()
        try:
            self._camera = PipeCamera(self.address)
        finally:
            accepting.join()
        return self._camera

    def send(self, *images):
        self._connection.sendall(b"".join(images))

    def end(self):
        self._connection.close()
        self._listener.close()
        if isinstance(self._place, str):
            Path(self._place).unlink()

    def close(self):
        self._camera.close()
        self.end()


@pytest.fixture(autouse=True)
def _soon(monkeypatch):
    monkeypatch.setattr(pipe, "SILENCE_S", 0.3)
    monkeypatch.setattr(pipe, "SEARCH_EVERY_S", 0.01)


@pytest.fixture(params=["tcp", "unix"])
def sender(request, tmp_path):
    with contextlib.closing(Sender(("127.0.0.1", 0) if request.param == "tcp" else str(tmp_path / "depth"))) as sender:
        yield sender


def test_a_file_gives_what_was_sent(tmp_path):
    path = write_sent(tmp_path / "a.depth", IMAGES)
    path.write_bytes(path.read_bytes()[:-10])  # the sender was killed
    source = open_depth(path, in_child=True)
    images = list(source.timed())
    np.testing.assert_array_equal([one.depth_m for one in images], IMAGES[:5].astype(np.float32) / 1000)
    assert [one.time_s for one in images] == [k / FPS for k in range(5)]
    assert source.camera == CAMERA and source.fps == pytest.approx(FPS) and source.frames == 5
    write_sent(tmp_path / "b.depth", IMAGES.astype(np.float32) / 4, dtype="float32", unit_m=0.004)
    for one, expected in zip(open_depth(tmp_path / "b.depth"), IMAGES, strict=True):
        np.testing.assert_allclose(one, expected / 1000, rtol=1e-6)
    with pytest.raises(InputError, match="states the unit of its depth; leave --depth-scale out"):
        open_depth(tmp_path / "b.depth", depth_scale=250)
    at_s = 1.7e9 + np.arange(len(IMAGES)) / FPS  # of the day's clock
    for unknown in ([], [0, 3], [1, 5]):  # the rate of the others tells them all
        at_s[unknown] = math.nan
        (tmp_path / "c.depth").write_bytes(sent_line() + b"".join(map(sent_image, IMAGES, at_s)))
        times_s = [one.time_s for one in open_depth(tmp_path / "c.depth").timed()]
        np.testing.assert_allclose(times_s, np.arange(len(IMAGES)) / FPS, atol=1e-6)


def test_a_pause_of_the_sender_is_no_slower_rate(tmp_path):
    at_s = 5 + np.arange(len(IMAGES)) / FPS + np.where(np.arange(len(IMAGES)) > 2, 60, 0)
    (tmp_path / "a.depth").write_bytes(sent_line() + b"".join(map(sent_image, IMAGES, at_s)))
    source = open_depth(tmp_path / "a.depth")
    assert source.fps == pytest.approx(FPS)
    np.testing.assert_allclose([one.time_s for one in source.timed()], at_s - 5, atol=1e-6)


def test_images_arrive_bit_for_bit_with_their_times(sender):
    camera = sender.camera(sent_line())
    assert camera.camera == CAMERA
    for image in IMAGES:
        measured = time.monotonic()
        sender.send(sent_image(image, measured))
        depth_m, taken = next_image(camera)
        np.testing.assert_array_equal(depth_m, image.astype(np.float32) / 1000)
        assert depth_m.dtype == np.float32 and taken == measured
    for unknown in (float("nan"), float("-inf"), 0.0, time.monotonic() + 100, 1.7e9):
        before = time.monotonic()
        sender.send(sent_image(IMAGES[0], unknown))
        assert before <= next_image(camera)[1] <= time.monotonic()


def test_after_a_stall_times_do_not_run_back():
    """Images of 1.2 s that come at once: the old ones are taken for taken now, and so are those that follow until they are."""
    clock, stated_s = CameraClock(), 100 + np.arange(60) / 30
    arrived_s = np.maximum(101.2 + np.arange(60) / 1000, stated_s + 0.01)
    taken_s = np.array([clock.moment(*one) for one in zip(stated_s, arrived_s, strict=True)])
    assert (np.diff(taken_s) > 0).all() and (taken_s <= arrived_s).all()
    np.testing.assert_array_equal(taken_s[45:], stated_s[45:])
    assert clock.moment(stated_s[-1], arrived_s[-1] + 0.01) == arrived_s[-1] + 0.01  # the same time is stated twice


def test_a_sender_of_metres_as_integers_is_refused_and_a_hand_before_the_camera_ends_nothing(sender):
    camera = sender.camera(sent_line())
    for image in (IMAGES[0], np.full_like(IMAGES[0], 40)):
        sender.send(sent_image(image))
        np.testing.assert_array_equal(next_image(camera)[0], image.astype(np.float32) / 1000)
    sender.close()
    camera = sender.camera(sent_line())
    sender.send(sent_image(np.zeros_like(IMAGES[0])))  # nothing was measured: it tells no unit
    assert not next_image(camera)[0].any()
    sender.send(sent_image(np.full_like(IMAGES[0], 3)))
    with pytest.raises(InputError, match="these look like metres"):
        next_image(camera)


def test_of_images_that_wait_the_newest_is_given(sender):
    camera = sender.camera(sent_line())
    sender.send(*map(sent_image, IMAGES))
    time.sleep(0.2)
    np.testing.assert_array_equal(camera.read()[0], IMAGES[-1].astype(np.float32) / 1000)
    with pytest.raises(CameraAwayError, match="sends nothing; look at the program") as caught:
        camera.read()
    assert "sendet nichts" in in_language(caught.value.said, "de")


def test_a_sender_ends_and_comes_back(sender):
    camera = sender.camera(sent_line())
    sender.send(sent_image(IMAGES[0]))
    next_image(camera)
    sender.send(sent_image(IMAGES[1])[:1000])  # it is killed within an image
    sender.end()
    for _ in range(3):
        with pytest.raises(CameraAwayError, match=r"has ended; start|no program sends depth .*; start it"):
            camera.read()
    sender.begin()
    sender.accept(sent_line())
    sender.send(sent_image(IMAGES[2]))
    np.testing.assert_array_equal(next_image(camera)[0], IMAGES[2].astype(np.float32) / 1000)
    sender.end()
    sender.begin()
    sender.accept(sent_line(fx=99.0))
    with pytest.raises(InputError, match="another camera") as caught:
        next_image(camera)
    assert "jetzt sendet eine andere Kamera" in in_language(caught.value.said, "de")
    sender.end()
    with pytest.raises(InputError, match="expected dtype to be one of uint16, float32"):
        sender.camera(sent_line(dtype="uint8"))


def test_the_lens_is_undone(sender):
    coefficients = [-0.3, 0.1, 0.0, 0.0, 0.0]
    camera = sender.camera(sent_line(coeffs=coefficients))
    view = Optics(CAMERA, Lens(tuple(coefficients))).view()
    sender.send(sent_image(IMAGES[0]))
    np.testing.assert_array_equal(next_image(camera)[0], view.image(IMAGES[0].astype(np.float32) / 1000))
    assert camera.camera == view.camera != CAMERA


def test_standard_input_reaches_several_cameras_and_ends_without_sockets_of_files_too(monkeypatch):
    monkeypatch.delattr(socket, "AF_UNIX", raising=False)  # as on Windows
    with pytest.raises(InputError, match=r"unix:/tmp/a: expected .* \(not on Windows\)"):
        PipeCamera("unix:/tmp/a")
    receiving, sending = os.pipe()
    with os.fdopen(receiving, "rb") as file, os.fdopen(sending, "wb", buffering=0) as pipe_in:
        pipe_in.write(sent_line())
        with contextlib.closing(Relay(file)) as relay:
            cameras = [PipeCamera(relay.address) for _ in range(2)]
            for image in IMAGES:
                measured = time.monotonic()
                pipe_in.write(sent_image(image, measured))
                for camera in cameras:
                    depth_m, taken = next_image(camera)
                    np.testing.assert_array_equal(depth_m, image.astype(np.float32) / 1000)
                    assert taken == measured
            pipe_in.close()
            for camera in cameras:
                assert next_image(camera) is None
                camera.close()


def test_standard_input_is_no_stranger_s_to_see(tmp_path):
    with write_sent(tmp_path / "a.depth", IMAGES).open("rb") as file, contextlib.closing(Relay(file)) as relay:
        port, _, secret = relay.address.removeprefix("stdin:").partition("/")
        for guess in (b"", bytes(32), bytes.fromhex(secret)[:31]):
            with socket.create_connection(("127.0.0.1", int(port)), timeout=10) as stranger:
                stranger.sendall(guess)
                stranger.shutdown(socket.SHUT_WR)
                assert not stranger.recv(1)


def test_an_input_that_is_closed_is_told():
    told = subprocess.run(
        ["sh", "-c", 'exec "$@" <&-', "sh", sys.executable, "-m", "kpopnet.cli", "live", "-", "--no-page", "--stream", "csv"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert told.stderr == "error: standard input is closed: send depth to it, as of `python send.py |`\n"


def test_of_images_that_all_came_before_a_camera_it_gets_the_last_one(tmp_path):
    with write_sent(tmp_path / "a.depth", IMAGES).open("rb") as file, contextlib.closing(Relay(file)) as relay:
        while not relay._ended:
            time.sleep(0.01)
        for _ in range(2):
            with contextlib.closing(PipeCamera(relay.address)) as camera:
                np.testing.assert_array_equal(next_image(camera)[0], IMAGES[-1].astype(np.float32) / 1000)
                assert next_image(camera) is None


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (b"\n", "not valid JSON"),
        (b"[]\n", "no camera in it"),
        (b" " * 5000, "first line of at most 4,096 bytes"),
        (sent_line()[:-1], "ends with a newline"),
        (sent_line(width=10**6, height=10**6), "at most 16,000,000 pixels"),
        (sent_line(fx=-1.0), "fx"),
        (sent_line(cx=float("nan")), "NaN"),
        (sent_line(dtype="uint8"), "uint16, float32"),
        (sent_line(unit_m=0), "unit_m"),
        (sent_line(coeffs="round"), "coeffs: expected a list of numbers"),
    ],
)
def test_a_wrong_first_line_is_one_line(tmp_path, line, told):
    (tmp_path / "a.depth").write_bytes(line)
    with pytest.raises(InputError, match=told) as error:
        open_depth(tmp_path / "a.depth")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("address", ["tcp:192.168.1.2:5005", "tcp:127.0.0.1", "unix:", "x"])
def test_only_places_of_this_machine_are_addresses(address):
    with pytest.raises(InputError, match="port of this machine, or unix:PATH"):
        PipeCamera(address)


def test_without_a_sender_it_says_to_start_one(tmp_path):
    with pytest.raises(InputError, match=r"no program sends depth through unix:.* \(No such file or directory\); start it"):
        PipeCamera(f"unix:{tmp_path / 'depth'}")
