"""The process of a lesson: the newest image, who the learner is, and a camera that vanishes and comes back."""

import contextlib
import gc
import multiprocessing
import queue
import threading
import time
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kpopnet.camera import CAMERAS
from kpopnet.dance.joint_files.mediapipe import WEBCAM
from kpopnet.errors import InputError
from kpopnet.pose import PersonPose, PoseEstimator
from kpopnet.programs.teach import RecordedCamera
from kpopnet.sources.live import NewestImage
from kpopnet.sources.source import CameraAwayError, LiveCamera, TimedDepth
from kpopnet.teacher.live import loop
from kpopnet.teacher.live.lesson import DanceClock, Lesson
from kpopnet.teacher.live.loop import Learners
from kpopnet.teacher.live.webcam import read_seen

FPS, LATE_S = 30, 0.2


def test_the_newest_image_wins_and_the_others_are_dropped_and_a_camera_that_fails_is_told():
    coming = queue.SimpleQueue()

    def read():
        if (number := coming.get()) is None:
            raise OSError("unplugged")
        return np.full((2, 2), number, np.float32), time.monotonic()

    images = NewestImage(SimpleNamespace(read=read, close=lambda: None))
    assert gc.get_freeze_count() > 10_000  # what was imported stops no thread: no collection looks at it
    for number in range(4):
        coming.put(number)
    while images.dropped < 3:
        time.sleep(0.01)
    assert images.fetch(1.0).depth_m[0, 0] == 3
    assert images.fetch(0.01) is None and not images.ended
    coming.put(4)
    assert images.fetch(5.0).depth_m[0, 0] == 4
    coming.put(None)
    while not images.ended:
        time.sleep(0.01)
    assert "unplugged" in images.error
    images.close()


def test_what_a_lesson_leaves_in_a_circle_is_collected_before_the_next_one():
    class Circle:
        """A camera that ends at once and holds itself."""

        def __init__(self) -> None:
            self.read, self.close, self.itself = lambda: None, lambda: None, self

    left = []
    for _ in range(3):
        camera = Circle()
        left.append(weakref.ref(camera))
        NewestImage(camera).close()
        del camera
    assert [one() is None for one in left[:-1]] == [True, True]


def test_who_stands_in_the_middle_is_the_learner_and_passers_by_do_not_take_over():
    def person(identity: int, x_m: float) -> PersonPose:
        return PersonPose(identity, np.full((15, 3), x_m, np.float32), np.ones(15, np.float32))

    one, two = Learners(1), Learners(2)
    for learners, now, people, identities in (
        (one, 0.0, [], [None]),
        (one, 0.0, [person(4, -0.9), person(7, 0.1)], [7]),
        (one, 1.0, [person(4, 0.0), person(7, 1.0)], [7]),
        (one, 2.0, [person(4, 0.0)], [None]),
        (one, 4.5, [person(4, 0.0)], [4]),
        (one, 5.0, [person(7, 0.0), person(4, 0.5)], [4]),
        (two, 0.0, [person(4, -0.9), person(7, 0.1)], [7, 4]),
        (two, 1.0, [person(7, 1.0), person(4, 0.0)], [7, 4]),  # they change places
        (two, 2.0, [person(4, 0.0), person(9, 0.2)], [None, 4]),
        (two, 4.5, [person(4, 0.0), person(9, 0.2)], [9, 4]),
    ):
        assert [pose and pose.identity for pose in learners.choose(people, now, begun=True)] == identities


def test_before_the_dance_begins_who_stands_in_the_middle_is_the_learner_whoever_was_seen_first():
    def person(identity, x_m):
        return PersonPose(identity, np.full((15, 3), x_m, np.float32), np.ones(15, np.float32))

    learners, couch = Learners(2), [person(4, 1.8)]
    for now, people, begun, identities in (
        (0.0, couch, False, [4, None]),
        (1.0, [*couch, person(7, 0.4)], False, [7, 4]),
        (2.0, [*couch, person(7, 0.4), person(9, -0.4)], False, [7, 9]),
        (3.0, [*couch, person(7, -0.3), person(9, 0.3)], False, [7, 9]),  # not by a step
        (4.0, [person(4, 0.0), person(7, 1.0), person(9, -1.0)], True, [7, 9]),  # who walks by
    ):
        assert [pose and pose.identity for pose in learners.choose(people, now, begun)] == identities


def test_the_picture_tells_near_from_far_and_from_nothing():
    shown = np.frombuffer(loop.picture(np.tile(np.array([0.0, 0.6, 5.0], np.float32), (4, 8))), np.uint8)
    assert shown[:4].view("<u2").tolist() == [24, 4]
    nothing, near, far = shown[4:7]
    assert nothing == 0 and 0 < near < 20 and far > 200
    assert len(loop.picture(np.ones((80_000, 4), np.float32))) < 1000  # of a strip, too


class Unsteady(LiveCamera):
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


class Knowing:
    """An estimator that knows the dance; a second learner is to the right, and late."""

    name = "none"

    def __init__(self, dance) -> None:
        self.dance, self.people = dance, 1

    def reset(self) -> None:
        pass

    def update(self, depth_m, camera, time_s=None):
        frame = min(round(float(depth_m[0, 0]) * self.dance.fps), len(self.dance.joints_m) - 1)
        late_m = self.dance.joints_m[max(frame - round(LATE_S * self.dance.fps), 0)] + np.float32([1.2, 0, 0])
        people = [
            PersonPose(1, self.dance.joints_m[frame], np.ones(15, np.float32)),
            PersonPose(2, late_m, np.ones(15, np.float32)),
        ]
        return people[: self.people]


@contextlib.contextmanager
def serving(opener, checkpoint=None):
    """A lesson's process as a thread: the connection for its messages."""
    server, other = multiprocessing.Pipe()
    thread = threading.Thread(target=loop.serve_lessons, args=(other, opener, checkpoint), daemon=True)
    thread.start()
    yield server
    server.send(("stop",))
    server.send(("quit",))
    thread.join(20)
    assert not thread.is_alive()


@pytest.fixture
def held(library, monkeypatch, request):
    """A lesson for a number of learners, that is ready: a connection for its messages, and the camera."""
    dance, cameras = library.dance("dance_001"), []

    def opener(lesson, dance, clock):
        cameras.append(Unsteady(clock))
        return cameras[0]

    monkeypatch.setattr(loop, "load_estimator", lambda checkpoint, mode: {"best": Knowing(dance)}[mode])
    people = getattr(request, "param", 1)  # whose scores are looked at: slowly, for slow machines
    lesson = Lesson("dance_001", to_s=4.0 if people == 1 else 2.5, people=people, speed=1.0 if people == 1 else 0.25)
    with serving(opener) as server:
        server.send(("prepare", 1, lesson, dance))
        told(server, "ready")
        yield server, cameras[0]


def test_a_lesson_with_a_recording_that_is_stopped_before_the_dance_begins_ends_at_once(library, monkeypatch):
    dance = library.dance("dance_001")
    monkeypatch.setattr(loop, "load_estimator", lambda checkpoint, mode: {"best": Knowing(dance)}[mode])
    images = [TimedDepth(number / FPS, np.full((240, 320), number / FPS, np.float32)) for number in range(30)]
    source = SimpleNamespace(camera=CAMERAS["kinect_v1"], name="a.h5", timed=lambda: iter(images))
    with serving(lambda lesson, dance, clock: RecordedCamera(source, clock)) as server:
        server.send(("prepare", 1, Lesson("dance_001", to_s=4.0), dance))
        told(server, "ready")
        server.send(("go", 20.0))
        time.sleep(0.5)
        began = time.monotonic()
        server.send(("stop",))
        server.send(("prepare", 2, Lesson("dance_001", to_s=4.0), dance))
        while server.recv()[0] != 2:
            pass
        assert time.monotonic() - began < 3


def test_who_is_recorded_has_the_joints_of_every_image_told_and_others_do_not(library, monkeypatch):
    dance = library.dance("dance_001")
    monkeypatch.setattr(loop, "load_estimator", lambda checkpoint, mode: {"best": Knowing(dance)}[mode])
    first = [[*map(float, point), 1.0] for point in dance.joints_m[0].astype(np.float64).round(4)]
    for record in (True, False):
        with serving(lambda lesson, dance, clock: Unsteady(clock)) as server:
            server.send(("prepare", 1, Lesson("dance_001", to_s=4.0, calibrate=True, record=record), dance))
            told(server, "ready")
            kinds, taken_ms = [], []
            while kinds.count("frame") < 10:
                assert server.poll(60)
                _, kind, content, _ = server.recv()
                kinds.append(kind)
                taken_ms.append(content["taken_ms"])
                assert kind == "frame" or content["joints"] == first
        assert kinds == (["joints", "frame"] if record else ["frame"]) * 10
        assert not record or taken_ms[::2] == taken_ms[1::2] == sorted(set(taken_ms))


def told(server, kind: str, frames: list | None = None) -> dict:
    """The next message of a kind; frames before it are kept."""
    while server.poll(60):
        number, said, content, _ = server.recv()
        assert number == 1 and said != "error", content
        if frames is not None and said == "frame":
            frames.append(content)
        if said == kind:
            return content
    raise AssertionError(f"no message {kind}")


def test_a_try_whose_camera_ends_in_a_pause_is_not_lost(held):
    server, camera = held
    server.send(("go", 0.1))
    frames: list[dict] = []
    while not frames or (frames[-1]["time_s"] or 0) < 2.6:
        told(server, "frame", frames)
    server.send(("pause",))
    told(server, "paused")
    camera.read = lambda: None
    assert told(server, "done")["total"] is not None


def test_the_dance_stands_still_while_the_camera_is_away_or_a_pause_is_asked_for_and_goes_on(held):
    server, camera = held
    camera.plugged.clear()  # between two dances it interrupts nothing
    told(server, "away")
    camera.plugged.set()
    assert told(server, "back")["from_s"] is None
    server.send(("resume", 0.0))  # there is nothing to go on with
    assert told(server, "frame")["time_s"] is None
    camera.plugged.clear()
    told(server, "away")
    server.send(("go", 0.1))  # as a lesson does that is repeated
    told(server, "away")
    camera.plugged.set()
    assert told(server, "back")["from_s"] == 0
    server.send(("go", 0.1))
    before: list[dict] = []
    while not before or (before[-1]["time_s"] or 0) < 1.5:
        told(server, "frame", before)
    camera.plugged.clear()
    assert told(server, "away", before)["text"] == "plug it in"
    time.sleep(3.0)  # longer than what is left of the dance
    assert [server.recv()[1] for _ in iter(server.poll, False)] in ([], ["frame"])  # of an image from just before
    camera.plugged.set()
    resumed_s = told(server, "back", before)["from_s"]
    assert 1.4 < resumed_s <= before[-1]["time_s"] + 1e-3
    server.send(("resume", 0.3))
    server.send(("pause",))
    assert told(server, "paused")["from_s"] >= resumed_s - 1e-6
    server.send(("resume", 0.3))
    after: list[dict] = []
    told(server, "done", after)
    times_s = [frame["time_s"] for frame in after if frame["time_s"] is not None]
    assert min(times_s) < resumed_s < max(times_s) - 1


@pytest.mark.parametrize("checkpoint", [None, "mine"])
def test_what_the_packages_network_saw_of_a_dance_is_not_for_another_network(library, monkeypatch, checkpoint):
    taught = library.dance("dance_001")
    taught = replace(taught, seen=taught.performance)
    given = queue.SimpleQueue()

    def refuse(lesson, dance, *_):
        given.put(dance)
        raise InputError("no camera")

    monkeypatch.setattr(loop, "load_estimator", lambda checkpoint, mode: None)
    monkeypatch.setattr(loop, "RunningLesson", refuse)
    with serving(None, checkpoint) as server:
        server.send(("prepare", 1, Lesson("dance_001"), replace(taught, others=(taught,))))
        dance = given.get(timeout=20)
    assert [one.seen is None for one in dance.dancers] == [checkpoint is not None] * 2


def test_each_picture_of_a_webcam_is_used_when_it_comes(library, monkeypatch):
    """They come as messages, which a lesson that waits for an image of a camera does not read."""
    monkeypatch.setattr(loop, "load_estimator", lambda checkpoint, mode: None)
    monkeypatch.setattr(loop, "FRAME_PATIENCE_S", 1000.0)
    monkeypatch.setattr(loop, "NOBODY_PATIENCE_S", 0.0)
    seen, kinds = read_seen({"points": [], "age_ms": 0.0}), []
    with serving(None) as server:
        server.send(("prepare", 1, Lesson("dance_001", source=WEBCAM, to_s=4.0), library.dance("dance_001")))
        while "ready" not in kinds:
            server.send(("see", seen))
            kinds += [server.recv()[1]] if server.poll(0.2) else []
            assert "error" not in kinds
        for _ in range(5):
            while server.poll(0.5):  # of pictures before
                server.recv()
            server.send(("see", seen))
            assert server.poll(20) and server.recv()[1] == "frame"


def test_a_webcam_that_is_let_go_of_is_not_waited_for(library, monkeypatch):
    monkeypatch.setattr("kpopnet.teacher.live.webcam.SILENCE_S", 1000.0)
    lesson = Lesson("dance_001", source=WEBCAM, to_s=4.0)
    running = loop.RunningLesson(lesson, library.dance("dance_001"), None, SimpleNamespace(), lambda *_: None)
    running.close()
    assert not running.images._thread.is_alive()


@pytest.mark.parametrize("held", [2], indirect=True)
def test_two_learners_are_scored_each_by_the_teacher_and_both_by_each_other(held):
    server, _ = held
    server.send(("go", 0.1))
    frames, verdicts, late = [], set(), {}
    while True:
        assert server.poll(60)
        _, kind, content, arrays = server.recv()
        assert kind != "error", content
        frames += [content] if kind == "frame" else []
        verdicts |= {content["member"]} if kind == "verdict" else set()
        late = content if kind == "member" else late
        if kind == "done":
            break
    assert verdicts == {0, 1} and all(len(one["others"]) == 1 for one in frames)
    assert frames[-1]["joints"][0][0] < frames[-1]["others"][0]["joints"][0][0]  # each has their own joints
    assert content["total"] > late["total"] + 5 and late["who"] == "" and len(arrays["joints_m"]) > 30
    common = content["together"]
    assert common["after_s"] == [0.0, pytest.approx(LATE_S / 0.25, abs=0.24)] and common["posture"] > common["timing"]


def test_lessons_make_two_passes_and_know_the_errors_of_what_sees_no_later_image():
    estimator = loop.load_estimator(None, mode="best")
    assert estimator.mode == "best" and loop.noise_of(estimator) == "realtime"
    assert loop.noise_of(PoseEstimator(None, "tracker")) == "tracker"


def test_a_network_that_does_not_load_is_told_where_the_tracker_stands_in(monkeypatch, caplog):
    def damaged(*given: object) -> PoseEstimator:
        raise InputError("model.safetensors: damaged")

    monkeypatch.setattr(loop.PoseEstimator, "load", damaged)
    assert loop.load_estimator(None).mode == "tracker"
    assert "model.safetensors: damaged; the tracker without a network estimates the joints" in caplog.text
    with pytest.raises(InputError, match="damaged"):
        loop.load_estimator("outputs/best")
    assert loop.load_estimator("tracker").mode == "tracker"
