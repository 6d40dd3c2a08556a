"""The program of live cameras, without its page, and a user's mistakes."""

import json
import subprocess
import sys

import numpy as np
import pytest
from live_people import FRAMES, write_recording
from programs import ROOT

from kpopnet.programs import arguments


def test_a_recording_is_streamed_to_its_end_without_a_page(program, tmp_path):
    write_recording(tmp_path)
    printed = program("live", tmp_path / "two.npz", "--no-page", "--stream", "json")
    images = [json.loads(line) for line in printed.splitlines()]
    assert 2 <= len(images) <= FRAMES and [one["image"] for one in images] == list(range(len(images)))
    assert (np.diff([one["time_s"] for one in images]) > 0).all() and images[0]["time_s"] == 0
    both = [one for one in images if len(one["people"]) == 2]
    assert len(both) > len(images) / 2
    assert all(len(person["joints"]) == 15 for one in both for person in one["people"])


def test_a_stream_by_udp_says_its_port(program, tmp_path):
    wall = np.full((3, 60, 80), 3000, np.uint16)
    np.savez(tmp_path / "wall.npz", depth_mm=wall, camera=(70.0, 70.0, 39.5, 29.5, 80, 60), fps=30)
    words = ("--no-page", "--stream", "osc", "--port-out", 9009)
    assert program("live", tmp_path / "wall.npz", *words).startswith("osc goes to UDP port 9009 of this machine")


def test_a_reader_that_ends_ends_the_stream_in_silence(tmp_path):
    write_recording(tmp_path)
    words = ["live", tmp_path / "two.npz", "--loop", "--no-page", "--stream", "csv"]
    command = [sys.executable, "-m", "kpopnet.cli", *map(str, words)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline().startswith("image,identity")
        program.stdout.close()
        told = program.stderr.read()
        assert program.wait(120) == 0 and "Traceback" not in told and "Broken" not in told, told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "no source; give a recording of depth, or a camera: realsense"),
        (("nothing.npz",), "nothing.npz: no such recording, and no camera; there are realsense"),
        (("nothing.npz", "--no-page"), "add --stream json, csv, osc or vmc"),
        (("nothing.npz", "--stream", "json", "--port-out", "9000"), "--port-out 9000: expected 1 to 65535, with --stream osc"),
        (("nothing.npz", "--stream", "vmc", "--port-out", "65534", "--people", "3"), "--port-out 65534: expected 1 to 65533"),
        (("nothing.npz", "--people", "99"), "--people=99: expected a number in 1..16"),
        (("tcp:127.0.0.1:9", "--fov", "60"), "--fov: a live camera states its own; it is for recordings"),
        (("tcp:127.0.0.1:9", "--fps", "0"), "--fps: a live camera"),
        (("tcp:127.0.0.1:9", "--loop"), "--loop: a live camera"),
        (("nothing.npz", "--port", "-1"), "--port -1"),
        (("nothing.npz", "--no-page", "--stream", "json", "--host", "0.0.0.0"), "--host: is of the page"),
        (("nothing.npz", "--no-page", "--stream", "json", "--no-browser"), "--no-browser: is of the page"),
        (("nothing.npz", "--no-page", "--stream", "json", "--data", "kept"), "--data: is of the page"),
    ],
)
def test_a_mistake_is_one_line(program, words, told):
    assert told in program("live", *words, fails=True)


def test_a_page_needs_its_server_library_and_a_stream_alone_does_not(program, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert '[app]"' in program("live", tmp_path, fails=True)
    assert "no such recording" in program("live", tmp_path / "nothing.npz", "--no-page", "--stream", "osc", fails=True)


def test_the_words_of_the_command_line_reach_what_watches(program, monkeypatch, tmp_path):
    hosting, asked, known = pytest.importorskip("kpopnet.teacher.hosting"), [], []
    monkeypatch.setattr(hosting, "host", lambda make, *given, out, **others: asked.append((*make.args, out)))
    monkeypatch.setattr("kpopnet.sources.opening.read_in_child", lambda reader, *given: reader(*given))
    monkeypatch.setattr(arguments, "tell_assumed_rate", lambda source: known.append(source.fps_is_known))
    np.savez(tmp_path / "a.npz", depth_mm=np.full((2, 24, 32), 2000, np.uint16))
    of_recording = ("--fov", 60, "--loop", "--rotate", 90)
    program("live", tmp_path / "a.npz", *of_recording, "--people", 3, "--stream", "json", "--data", tmp_path)
    program("live", "tcp:127.0.0.1:9", "--rotate", 180, "--checkpoint", "tracker", "--stream", "osc", "--port-out", 9001)
    (recording, out), (live, other) = asked
    open_source, is_in_a_loop = recording.open_camera.args
    assert is_in_a_loop and 90 in open_source.args
    assert (recording.people, recording.stream, recording.folder) == (3, "json", tmp_path) and known == [False]
    assert live.open_camera.args == ("tcp:127.0.0.1:9", 180) and (live.checkpoint, live.port) == ("tracker", 9001)
    assert (out, other) == (sys.stderr, sys.stdout)  # lines of JSON are alone on the standard output


def test_the_server_ends_later_than_what_it_saves(program, monkeypatch):
    hosting, server = (pytest.importorskip(f"kpopnet.{name}") for name in ("teacher.hosting", "live.server"))
    named = {}
    monkeypatch.setattr(hosting, "host", lambda *given, **others: named.update(others))
    program("live", "tcp:127.0.0.1:9000")
    assert named["end_s"] > server.SAVE_S
