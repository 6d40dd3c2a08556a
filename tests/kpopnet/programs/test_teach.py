"""The program of the dance teacher, without its page."""

import asyncio
import json
import re
import subprocess
import sys
import threading
import time
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from cone_people import cone_body, cone_joints, draw_cones
from depth_files import sent_image, sent_line
from programs import ROOT

from kpopnet.camera import CAMERAS
from kpopnet.errors import InputError
from kpopnet.programs import teach
from kpopnet.programs.convert import write_dance
from kpopnet.skeleton import Joint
from kpopnet.sources.source import TimedDepth
from kpopnet.teacher.live import lesson
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.score import DanceTry
from synth.dances import seen, taught
from synth.dances.live import LiveLearner


@pytest.fixture
def run(program, monkeypatch, tmp_path):
    """Runs the program with a library of one dance."""
    monkeypatch.setattr(taught, "DANCES", 1)
    return lambda *words, **given: program("teach", *words, "--data", tmp_path / "teach", **given)


@pytest.fixture
def danced(run, tmp_path):
    """A dance of the library."""
    return teach.made_library(tmp_path / "teach").dance("dance_000")


def test_a_dance_of_ones_own_is_added(run, tmp_path):
    library = teach.made_library(tmp_path / "teach")
    assert library.identities() == ["dance_000"]
    made = library.path("dance_000").stat().st_mtime_ns
    performance = library.dance("dance_000").performance
    np.savez(tmp_path / "mama.npz", joints_m=performance.joints_m.astype(np.float32), times_s=performance.times_s)
    words = ("--bpm", 128, "--free", 2, 4.5, "--weights", "similarity=3", "place=1")
    assert "added mama as own_001" in run("add", tmp_path / "mama.npz", *words)
    np.save(tmp_path / "array.npy", performance.joints_m)
    (tmp_path / "map.json").write_text(json.dumps({joint.name.lower(): int(joint) for joint in Joint if joint != Joint.TORSO}))
    run("add", tmp_path / "array.npy", "--fps", 30, "--joint-map", tmp_path / "map.json")
    assert library.about("own_002").name == "array"
    assert library.about("own_001").name == "mama" and library.about("own_001").bpm == 128
    assert library.about("own_001").free_s == [[2, 4.5]] and library.about("own_001").weights == {"similarity": 3, "place": 1}
    assert library.path("dance_000").stat().st_mtime_ns == made  # what is there is not made again


@pytest.mark.parametrize("begin_s", [0.0, 1.7e9])  # since 1970, too
def test_a_group_is_added_from_a_file_for_each_dancer(run, tmp_path, danced, begin_s):
    joints_m, times_s = danced.performance.joints_m, danced.performance.times_s
    for name, left_m, late in (("ann", 0.0, 0), ("bea", 1.5, 60)):  # bea is seen two seconds later
        moved_m = (joints_m + np.array([left_m, 0, 0])).astype(np.float32)
        np.savez(tmp_path / f"{name}.npz", joints_m=moved_m[late:], times_s=begin_s + times_s[late:])
    told = run("add", tmp_path / "ann.npz", tmp_path / "bea.npz", "--title", "Duet", "--from", 2)
    assert "added Duet as own_001" in told
    first, second = teach.made_library(tmp_path / "teach").dance("own_001").dancers
    np.testing.assert_allclose(first.joints_m - second.joints_m, np.full_like(first.joints_m, [1.5, 0, 0]), atol=1e-4)
    np.testing.assert_allclose(second.joints_m[0], joints_m[120], atol=1e-4)


def test_a_folder_of_dances_is_added(run, tmp_path, danced):
    performance = danced.performance
    for name in ("alpha", "beta"):
        write_dance(tmp_path / "set", name, performance, {"best": performance, "worst": performance})
    assert "--title: " in run("add", tmp_path / "set", "--title", "not for two", fails=True)
    told = run("add", tmp_path / "set", "--from", 1, "--to", 8.5)
    library = teach.made_library(tmp_path / "teach")
    assert "added alpha as own_001" in told and "added beta as own_002" in told
    assert library.about("own_002").seconds == pytest.approx(7.5, abs=0.05)
    assert "--fps: for recordings" in run("add", tmp_path / "set", "--fps", 25, fails=True)
    told = run("add", tmp_path / "set" / "beta", "--title", "Beta")
    assert library.about("own_003").name == "Beta" and "own_003" in told
    np.testing.assert_allclose(library.dance("own_003").joints_m, danced.joints_m[:-1], atol=1e-4)


def test_a_dance_that_is_given_as_this_folder_has_the_name_of_the_folder(run, tmp_path, danced, monkeypatch):
    write_dance(tmp_path / "set", "alpha", danced.performance, {"best": danced.performance, "worst": danced.performance})
    monkeypatch.chdir(tmp_path / "set" / "alpha")
    assert "added alpha as own_001" in run("add", ".") and "added alpha as own_002" in run("add", "teacher.h5")


def test_a_dance_before_a_depth_camera_is_added(run, tmp_path, danced):
    """A simulated learner dances perfectly; the network of the package finds the joints."""
    camera = teach.open_source(None, Lesson("dance_000"), danced, DanceClock(0.0, 1.0))
    assert camera.read()[0].shape == (240, 320) and camera.camera == CAMERAS["kinect_v1"]
    fps, seconds = 6, 5.5
    learner = LiveLearner(danced.quats, danced.hips_m, danced.fps, "perfect")
    depth_m = np.stack([learner.frame(number / fps) for number in range(round(fps * seconds))])
    np.savez(tmp_path / "depth.npz", depth_mm=np.round(1000 * depth_m).astype(np.uint16), fps=fps)
    run("add", tmp_path / "depth.npz", "--camera", "kinect_v1", "--title", "Seen")
    seen = teach.made_library(tmp_path / "teach").dance("own_001")
    assert seen.about.name == "Seen" and seen.about.own
    true_m = danced.joints_m[: len(seen.joints_m)]
    errors_m = np.linalg.norm((seen.joints_m - true_m) - (seen.joints_m - true_m)[:, [Joint.TORSO]], axis=2)
    assert np.isfinite(errors_m).mean() > 0.9  # those of limbs that were only guessed are not taught
    assert np.nanmedian(errors_m) < 0.1  # of another person than the teacher


MISTAKES = {
    ("mama.bvh", "--no-browser"): "mama.bvh: kpopnet teach takes no file; kpopnet teach add FILE adds a dance",
    ("add", "missing.bag"): "missing.bag: no such file or folder",
    ("--title", "Mama", "add", "missing.pkl"): "pickle",
    ("add", "notes.txt"): "notes.txt: expected joints in a file .npz, .bvh, ",
    ("add", "missing.bvh", "--from", "10", "--to", "4"): "--to: expected more than the 10 s of --from",
    ("add", "missing.bvh", "--bpm", "1e9"): "20 to 400",
    ("add", "missing.bvh", "--free", "9", "4"): "free from 9 to 4 s",
    ("add", "missing.bvh", "--weights", "hands=1"): "hands",
    ("add", "missing.bvh", "--camera", "kinect_v1"): "--camera: for recordings of depth; missing.bvh holds joints",
    ("add", "missing.bvh", "--depth-scale", "0"): "--depth-scale: for recordings of depth; missing.bvh holds joints",
    ("add", "missing.bvh", "--people", "2"): "--people: expected a recording of depth; of joints, a file for each dancer",
    ("--rotate", "90", "--no-browser"): "--rotate: for the recording of --depth",
    ("--fps", "25", "--no-browser"): "--fps: for the recording of --depth",
    ("--depth", "missing.npz", "--no-browser"): "missing.npz: no such file",
    ("--checkpoint", "missing", "--no-browser"): "missing",
    ("--port", "70000", "--no-browser"): "--port 70000: expected 1 to 65535, or 0 for one that is free",
    ("--live", "kinect", "--no-browser"): "--live: no live camera kinect; there are realsense, oak, -, tcp:127.0.0.1:PORT",
    ("--live", "tcp:10.0.0.1:5005", "--no-browser"): "a port of this machine",
}


def test_what_would_be_refused_is_refused_before_a_recording_is_looked_at(run, tmp_path, monkeypatch):
    monkeypatch.setattr(teach.PoseEstimator, "load", None)
    for seconds, words, told in (
        (1000, (), "depth.npz: lasts 1000.0 s; a dance lasts 5 to 900 s"),
        (1000, ("--from", 10), "depth.npz: lasts 990.0 s; a dance lasts 5 to 900 s"),
        (10, ("--from", 4, "--to", 8), "depth.npz: lasts 4.0 s; a dance lasts 5 to 900 s"),
        (10, ("--title", "a\tb"), "letters that can be printed"),
    ):
        np.savez(tmp_path / "depth.npz", depth_mm=np.full((seconds, 8, 8), 2000, np.uint16), fps=1)
        assert told in run("add", tmp_path / "depth.npz", "--focal", 2, *words, fails=True)


def test_a_mistake_is_one_line_before_dances_are_made(run, tmp_path):
    for words, told in MISTAKES.items():
        assert told in run(*words, fails=True), words
    assert not (tmp_path / "teach").exists()


def test_without_its_server_library_it_says_what_to_install(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert '[app]"' in run(fails=True)


class Moments:
    """A clock that tests move on, in place of the module `time`."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += max(seconds, 1e-6)


@pytest.fixture
def moments(monkeypatch):
    moments = Moments()
    for module in (teach, lesson):
        monkeypatch.setattr(module, "time", moments)
    return moments


def recorded(moments, clock, read_s, begin_s=0.0, frames=900):
    """A recording of which each image is its own time, and takes read_s(number) seconds to be read."""

    def timed():
        for number in range(frames):
            moments.sleep(read_s(number))
            yield TimedDepth(begin_s + number / 30, np.full((1, 1), number / 30))

    return teach.RecordedCamera(SimpleNamespace(camera=None, name="slow.h5", timed=timed), clock)


def late_s(camera, clock, images):
    """How far the images are from the moments of the dance at which they are seen."""
    return [abs(clock.dance_s(taken) - depth_m[0, 0]) for depth_m, taken in (camera.read() for _ in range(images))]


def test_a_recording_waits_for_the_dance_and_runs_with_it(moments):
    clock = DanceClock(0.0, 1.0)
    camera = recorded(moments, clock, lambda number: 0.0, frames=6)
    assert [camera.read()[0][0, 0] for _ in range(3)] == [0, 0, 0]
    for _ in range(2):  # and once more, from its beginning, for another try
        clock.start(0.05)
        began = moments.monotonic()
        shown = [camera.read()[0][0, 0] for _ in range(7)]
        assert shown == pytest.approx(np.array([0, 1, 2, 3, 4, 5, 5]) / 30)  # in the end a person who stands there
        assert moments.monotonic() - began > 0.05 + 4 / 30
        clock.stop()
        assert camera.read()[0][0, 0] == 0


def test_of_a_recording_is_seen_what_belongs_to_the_moment_of_the_dance(moments):
    """A phrase from second 60 on, with a pause, and images that are read slowly."""

    def check_up_to(until_s: float, least: int) -> None:
        errors_s = []
        while clock.dance_s(moments.monotonic()) < until_s:
            errors_s += late_s(camera, clock, 1)
        assert len(errors_s) >= least and max(errors_s) < 0.04

    clock = DanceClock(60.0, 1.0)
    camera = recorded(moments, clock, lambda number: 0.3 if 2000 <= number < 2005 else 0.006, 5.0, 3000)
    clock.start(2.2)  # before the recording has run up to it
    check_up_to(75.0, least=60)
    clock.stop()
    while camera.read()[0][0, 0] < 59.9:
        pass
    clock.start(2.2)
    check_up_to(63.0, least=90)
    clock.pause(62.95)
    moments.sleep(9)
    assert all(abs(camera.read()[0][0, 0] - 63) < 0.1 for _ in range(3))
    clock.resume(2.2)
    check_up_to(66.0, least=89)
    check_up_to(69.0, least=30)


def test_a_recording_that_is_read_more_slowly_than_the_dance_goes_on_says_so(moments):
    """All images would be too late, and no person would be seen until the dance is over."""
    clock = DanceClock(0.0, 1.0)
    camera = recorded(moments, clock, lambda number: 0.05)
    clock.start(0.1)
    with pytest.raises(InputError, match=r"slow\.h5: this machine reads it more slowly"):
        late_s(camera, clock, 900)
    assert 5 < clock.dance_s(moments.monotonic()) < 6


@pytest.mark.parametrize(
    ("speed", "read_s", "until"),
    [(0.5, lambda number: 0.05, 5), (1.0, lambda number: 6.0 if number == 200 else 0.01, 400)],
    ids=["slow dance", "not read for longer than a slow recording is endured"],
)
def test_a_recording_catches_up(moments, speed, read_s, until):
    clock = DanceClock(0.0, speed)
    camera = recorded(moments, clock, read_s)
    clock.start(0.1)
    assert max(late_s(camera, clock, 500)[until:]) < 0.04


def test_a_person_before_another_programs_camera_is_seen_until_it_ends(tmp_path):
    """Standard input of the program, through the lesson's process, to a page."""
    aiohttp = pytest.importorskip("aiohttp", reason="the extra app is not installed")
    camera, joints_m = CAMERAS["kinect_v1"], cone_joints(-75, 4)
    depth_mm = (1000 * draw_cones(joints_m, cone_body(joints_m), camera)).astype(np.uint16)
    begin = "from synth.dances import taught; taught.DANCES = 1; from kpopnet.programs.teach import main; main()"
    words = ["--live", "-", "--rotate", "180", "--no-browser", "--port", "0", "--checkpoint", "tracker", "--data", tmp_path]
    with subprocess.Popen(
        [sys.executable, "-c", begin, *map(str, words)], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as program:
        ended = threading.Event()

        def send():
            program.stdin.write(sent_line(**asdict(camera)))
            while not ended.wait(0.03):
                program.stdin.write(sent_image(depth_mm[::-1, ::-1], time.monotonic()))
                program.stdin.flush()
            program.stdin.close()

        async def learn(address):
            async with aiohttp.ClientSession(address) as client, client.ws_connect("/live", max_msg_size=0) as page:
                (source, told), *_ = (await (await client.get("/api/offer")).json())["sources"].items()
                assert told == "depth that another program sends to standard input"
                await page.send_json({"do": "prepare", "lesson": {"dance": "dance_000", "source": source}})
                pictures = 0
                while True:
                    message = await page.receive()
                    if message.type is aiohttp.WSMsgType.BINARY:
                        pictures += 1
                        seen = json.loads(message.data[4 : 4 + int.from_bytes(message.data[:4], "little")])
                        await page.send_json({"do": "drawn", "page_ms": 0.0})
                        if pictures > 10:
                            ended.set()
                    else:
                        content = json.loads(message.data)
                        if content["kind"] == "ready":
                            assert (content["width"], content["height"]) == (320, 240)
                        if content["kind"] == "error":
                            return seen, content["text"]

        sending = threading.Thread(target=send)
        sending.start()
        try:
            address = re.search(rb"http://\S+", program.stdout.readline())[0].decode()
            seen, told = asyncio.run(asyncio.wait_for(learn(address), 240))
        finally:
            ended.set()
            sending.join()
            program.terminate()
    _, head_v, _, confidence = seen["joints"][Joint.HEAD]
    assert 0.2 < head_v < 0.4 and confidence > 0.5  # from the top, of an image that was turned
    assert told == "the recording of depth has ended"


def test_dances_are_shown_to_the_network_once_and_lessons_by_depth_go_by_what_it_saw(run, monkeypatch, tmp_path, danced):
    monkeypatch.setattr(seen, "PEOPLE", 1)
    library = teach.made_library(tmp_path / "teach")
    short = {name: getattr(danced, name)[:150] for name in ("joints_m", "quats", "hips_m")}
    short["joints_m"][:, Joint.LEFT_FOOT] = np.nan
    library.write("dance_000", replace(danced, **short))
    assert "1 dances were shown to the network" in run("see") and "0 dances were shown" in run("see")
    dance = library.dance("dance_000")
    off_m = np.linalg.norm(dance.seen.joints_m - dance.joints_m, axis=2)
    known = [joint for joint in Joint if joint not in (Joint.LEFT_FOOT, Joint.TORSO)]
    assert np.isnan(off_m[:, Joint.LEFT_FOOT]).all() and off_m[:, Joint.TORSO].max() < 1e-3
    assert 0.005 < off_m[:, known].mean() < 0.08 and off_m[:, known].max() < 0.6
    for noise, is_seen in (("realtime", True), ("webcam", False), ("none", False)):
        tried = DanceTry(Lesson("dance_000", from_s=1.0), dance, noise, DanceClock(1.0, 1.0))
        assert tried._scorer.scorer.noise == ("network_seen_teacher" if is_seen else noise)
        expected_m = (dance.seen if is_seen else dance.performance).joints_m[30:]
        np.testing.assert_array_equal(tried._teacher.joints_m, expected_m)
        tried.compile()
    library.write("dance_000", danced)  # another dance of the same name
    assert library.dance("dance_000").seen is None
    (tmp_path / "teach" / "seen" / "dance_000.npz").write_bytes(b"no file")
    with pytest.raises(InputError, match=r"seen/dance_000\.npz"):
        library.dance("dance_000")
