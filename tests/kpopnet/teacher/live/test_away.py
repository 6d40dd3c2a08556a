"""A camera that vanishes in the middle of a dance and comes back: the stage says so, waits and goes on."""

import multiprocessing
import threading
import time

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from kpopnet.pose import PersonPose
from kpopnet.sources.live import CameraAwayError
from kpopnet.teacher.live import stage
from kpopnet.teacher.live.lesson import DanceClock, Lesson

FPS = 60


class Unsteady:
    """A camera that can be unplugged; its learner dances perfectly, and each image is the time of the dance."""

    camera = CAMERAS["kinect_v1"]

    def __init__(self, clock: DanceClock) -> None:
        self.clock, self.plugged = clock, threading.Event()
        self.plugged.set()

    def read(self):
        time.sleep(1 / FPS)
        if not self.plugged.is_set():
            raise CameraAwayError("plug it in")
        now = time.monotonic()
        return np.full((240, 320), max(self.clock.dance_s(now), 0.0), np.float32), now

    def close(self) -> None:
        pass


class Knowing:
    """An estimator that knows the dance."""

    name = "none"

    def __init__(self, dance) -> None:
        self.dance = dance

    def reset(self) -> None:
        pass

    def update(self, depth_m, camera):
        frame = min(round(float(depth_m[0, 0]) * self.dance.fps), len(self.dance.joints_m) - 1)
        return [PersonPose(1, self.dance.joints_m[frame], np.ones(15, np.float32))]


@pytest.fixture
def held(library, monkeypatch):
    """A lesson of 4 s that is ready: what the server says goes in, what the stage tells comes out; and the camera."""
    dance, cameras = library.dance("dance_001"), []

    def opener(lesson, dance, clock):
        cameras.append(Unsteady(clock))
        return cameras[0]

    monkeypatch.setattr(stage, "load_estimator", lambda checkpoint: Knowing(dance))
    server, other = multiprocessing.Pipe()
    thread = threading.Thread(target=stage.run_stage, args=(other, stage.Settings(opener, None)))
    thread.start()
    server.send(("prepare", 1, Lesson("dance_001", to_s=4.0), dance))
    told(server, "ready")
    yield server, cameras[0]
    server.send(("stop",))
    server.send(("quit",))
    thread.join(20)
    assert not thread.is_alive()


def told(server, kind: str, frames: list | None = None) -> dict:
    """The next message of a kind; frames before it are kept."""
    while server.poll(60):
        number, said, content, _ = server.recv()
        assert number == 1 and said != "error", content
        if frames is not None and said == "frame":
            frames.append(content)
        if said == kind:
            return content
    raise AssertionError(f"nobody told {kind}")


def test_the_dance_stands_still_while_the_camera_is_away_and_goes_on(held):
    server, camera = held
    server.send(("go", 0.1))
    before: list[dict] = []
    while not before or (before[-1]["time_s"] or 0) < 1.5:
        told(server, "frame", before)
    camera.plugged.clear()
    assert told(server, "away", before)["text"] == "plug it in"
    time.sleep(3.0)  # longer than what is left of the dance
    assert not server.poll()
    camera.plugged.set()
    resumed_s = told(server, "back", before)["from_s"]
    assert 1.4 < resumed_s <= before[-1]["time_s"] + 1e-3
    server.send(("resume", 0.3))
    after: list[dict] = []
    result = told(server, "done", after)
    times_s = [frame["time_s"] for frame in after if frame["time_s"] is not None]
    assert min(times_s) < resumed_s and max(times_s) > 3.8
    assert result["total"] > 95 and result["notes"]["frames"] > 100


def test_a_camera_that_is_away_between_two_dances_interrupts_nothing(held):
    server, camera = held
    camera.plugged.clear()
    told(server, "away")
    camera.plugged.set()
    assert told(server, "back")["from_s"] is None
    server.send(("resume", 0.0))  # there is nothing to go on with
    assert told(server, "frame")["time_s"] is None
    server.send(("go", 0.1))
    assert told(server, "done")["total"] > 95
