"""What is kept of what is seen, with a camera and an estimator that cost nothing; the process and its page: test_server.py."""

import contextlib
import errno
import os
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cone_people import CAMERA, cone_joints

from kpopnet.camera import CAMERAS
from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.errors import InputError
from kpopnet.estimator import Estimate
from kpopnet.live import keeping, loop
from kpopnet.live.loop import Watcher, Watching
from kpopnet.live.streams import Seen
from kpopnet.pose import PersonPose
from kpopnet.sources import open_depth
from kpopnet.sources.live import Image, PlayedRecording
from kpopnet.sources.source import CameraAwayError, LiveCamera, TimedDepth


class Estimator:
    """Finds the same two people in every image."""

    def reset(self) -> None:
        pass

    def update(self, *image: object) -> list[PersonPose]:
        joints_m = cone_joints().astype(np.float32)
        return [PersonPose(identity, joints_m, np.ones(15, np.float32)) for identity in range(2)]


class Images(LiveCamera):
    """A camera whose images are taken at these times."""

    camera = CAMERA

    def __init__(self, times_s: Sequence[float], wait: Callable[[], object] = lambda: None) -> None:
        self._times_s, self._wait = iter(times_s), wait

    def read(self) -> tuple[np.ndarray, float] | None:
        """See `LiveCamera.read`."""
        self._wait()
        time_s = next(self._times_s, None)
        return None if time_s is None else (np.full((240, 320), 4, np.float32), time_s)


@pytest.fixture
def watch(monkeypatch, tmp_path):
    monkeypatch.setattr(loop, "load_estimator", lambda *given: Estimator())

    def run(camera: LiveCamera, orders: dict[int, tuple]) -> list[tuple[str, dict]]:
        """Watches with these orders by number of the question for them; what the page is told."""
        told, asked = [], iter(range(10**9))

        def next_orders():
            if order := orders.get(next(asked)):
                yield order

        watching = Watching("test", lambda: camera, tmp_path / "kept")
        Watcher(watching, lambda kind, content, picture=None: told.append((kind, content)), next_orders).run()
        return told

    return run


@pytest.fixture
def in_turn(monkeypatch):
    """No image is left out."""
    monkeypatch.setattr(loop, "STEADY_FRAMES", 10**9)
    monkeypatch.setattr(loop, "NOBODY_S", 1e9)


def said(told: list[tuple[str, dict]]) -> list[str]:
    return [content["text"] for kind, content in told if kind == "said"]


def test_joints_outlive_equal_times_a_full_disk_and_an_hour(watch, in_turn, monkeypatch, tmp_path):
    free_writes, write = [True, False, False, True], keeping.write_performance

    def write_while_free(path: Path, *given: object) -> None:
        if free_writes and not free_writes.pop(0):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        write(path, *given)

    monkeypatch.setattr(keeping, "write_performance", write_while_free)
    monkeypatch.setattr(keeping, "MOST_JOINTS_S", 0.95)
    monkeypatch.setattr(keeping, "RETRY_S", 0.45)
    times_s = np.arange(25) / 10
    times_s[6], times_s[9] = times_s[5], times_s[7]
    # The first image compiles; the second person's file does not fit at 0.5 s, the first one's not after the "hour".
    told = watch(Images([0.0, *times_s]), {1: ("joints", True), 6: ("joints", False)})
    failed, again, *saved = said(told)
    assert failed.startswith("not saved: ") and again.startswith("not saved: ") and "disk is full" in failed
    paths = sorted((tmp_path / "kept").iterdir(), key=lambda path: path.stat().st_mtime_ns)
    assert len(saved) == 2 and len(paths) == 4
    whole = [read_performance(path).times_s for path in paths]
    np.testing.assert_allclose(whole[0], np.delete(times_s, [6, 9])[: len(whole[0])], atol=1e-6)
    assert [len(one) for one in whole] == [14, 14, 9, 9]  # until the second try after the "hour", and from then on


def test_joints_are_saved_before_a_camera_is_waited_for(watch, tmp_path):
    closed_with = []

    class Slow(Images):
        """One that is about to send an image until the joints are there."""

        def close(self) -> None:
            closed_with.append(len(saved()))

    def saved() -> list[Path]:
        return list((tmp_path / "kept").glob("joints-*"))

    def wait() -> None:
        by = time.monotonic() + 20
        while next(read) > 12 and not saved() and time.monotonic() < by:
            time.sleep(0.01)

    read = iter(range(10**9))
    watch(Slow(np.arange(100) / 10, wait), {1: ("joints", True), 20: ("quit",)})
    assert closed_with == [2]


def test_somebody_quits_while_the_camera_is_away_before_joints_come_in_real_time(watch, in_turn, tmp_path):
    class Away(Images):
        """One whose cable is pulled after a second."""

        def read(self) -> tuple[np.ndarray, float] | None:
            if read := super().read():
                return read
            raise CameraAwayError("camera: gone")

    watch(Away(np.arange(10) / 10), {1: ("joints", True), 20: ("quit",)})
    assert len(list((tmp_path / "kept").glob("joints-*"))) == 2


def test_a_pause_from_the_start_holds_everything(watch, monkeypatch, tmp_path):
    streamed = []
    monkeypatch.setattr(loop, "open_stream", lambda *given: contextlib.nullcontext(streamed.append))
    watch(Images(np.arange(20) / 10), {0: ("pause", True), 1: ("record", True)})
    assert not streamed and not list((tmp_path / "kept").iterdir())


def test_a_recording_that_ends_while_kernels_are_compiled_gives_its_last_image(watch, monkeypatch):
    streamed = []
    monkeypatch.setattr(loop, "open_stream", lambda *given: contextlib.nullcontext(streamed.append))
    watch(Images([0.0]), {})
    assert [(one.number, [person.identity for person in one.people]) for one in streamed] == [(0, [1, 2])]
    watch(Images(np.arange(5) / 10), {})
    assert [one.number for one in streamed[1:]] == [0, 1, 2, 3]


def test_a_stream_to_a_full_disk_ends_in_one_line_after_the_joints_are_saved(watch, monkeypatch, tmp_path):
    def full(seen: Seen) -> None:
        if seen.number == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(loop, "open_stream", lambda *given: contextlib.nullcontext(full))
    with pytest.raises(InputError, match="the disk is full"):
        watch(Images(np.arange(9) / 10), {1: ("joints", True)})
    assert len(list((tmp_path / "kept").glob("joints-*"))) == 2


def test_what_is_never_saved_is_not_kept(watch, monkeypatch):
    class Networked(Estimator):
        def update(self, *image: object) -> list[PersonPose]:
            return [one._replace(network=Estimate(one.joints_camera_m, one.confidence)) for one in super().update(*image)]

    seen: list[Seen] = []
    monkeypatch.setattr(loop, "load_estimator", lambda *given: Networked())
    monkeypatch.setattr(keeping.JointKeeper, "add", lambda _, one: seen.append(one))
    watch(Images([0.0, 0.1, 0.2]), {})
    assert seen and all(person.network is None for one in seen for person in one.people)


def test_the_page_is_told_when_images_were_taken_and_how_many_come_a_second(watch, in_turn, monkeypatch):
    now_s, wall_s = [0.0], 5000.0
    clock = SimpleNamespace(monotonic=lambda: now_s[0], time=lambda: now_s[0] + wall_s)
    monkeypatch.setattr(loop, "time", clock)
    camera = Images(np.arange(9) / 4 + 0.125, lambda: now_s.append(now_s.pop() + 0.25))
    frames = [content for kind, content in watch(camera, {0: ("watched", True)}) if kind == "frame"]
    assert [one["fps"] for one in frames] == [None, *[4.0] * 7]
    assert [one["delay_ms"] for one in frames] == [125] * 8
    assert frames[0]["taken_ms"] == 1000 * (wall_s + 0.375)


def test_images_that_are_left_out_are_counted(watch):
    times_s = np.arange(300) / 10
    frames = [content for kind, content in watch(Images(times_s), {0: ("watched", True)}) if kind == "frame"]
    assert frames[-1]["dropped"] > 0 and 1 + len(frames) + frames[-1]["dropped"] == len(times_s)  # the first one compiles


def test_a_recording_that_is_paused_before_joints_come_is_heard_and_can_be_left(watch):
    images = [TimedDepth(number / 10, np.full((240, 320), 4, np.float32)) for number in range(9)]
    played = PlayedRecording(lambda: SimpleNamespace(camera=CAMERA, timed=lambda: iter(images)))
    told: list[tuple[str, dict]] = []
    orders = {0: ("pause", True), 5: ("quit",)}
    watching = threading.Thread(target=lambda: told.extend(watch(played, orders)), daemon=True)
    watching.start()
    watching.join(4)  # a camera that stands still is waited for 5 s
    assert [content["paused"] for kind, content in told if kind == "state"] == [True, False]


def test_joints_that_could_not_be_saved_are_not_begun(watch, in_turn, tmp_path):
    (tmp_path / "kept").write_text("a file where the folder should be")
    told = watch(Images(np.arange(5) / 10), {1: ("joints", True)})
    (failed,) = said(told)
    assert failed.startswith("not saved: ") and not any(content["keeping"] for kind, content in told if kind == "state")


def test_a_disk_that_fills_while_a_recording_begins_leaves_the_joints(watch, in_turn, monkeypatch, tmp_path):
    def full(*given: object) -> None:
        raise RuntimeError("Unable to start swmr writing")

    monkeypatch.setattr(keeping, "DepthWriter", full)
    failed, saved = said(watch(Images(np.arange(9) / 10), {1: ("joints", True), 4: ("record", True)}))
    assert failed == "not saved: Unable to start swmr writing" and "the joints of 8 images" in saved


def test_joints_that_cannot_be_written_are_kept_for_as_long_as_a_dance_may_last(monkeypatch, tmp_path):
    monkeypatch.setattr(keeping, "MAX_DURATION_S", 0.5)
    keeper = keeping.JointKeeper(tmp_path)
    keeper.start()
    for number, time_s in enumerate((0.0, 0.5, 0.6)):
        keeper.add(Seen(number, time_s, 10.0, []))
    assert keeper.state == {"images": 2, "seconds": 0.5}


def test_passers_by_are_saved_from_their_first_to_their_last_image_on_the_common_clock(tmp_path):
    keeper, joints_m = keeping.JointKeeper(tmp_path), cone_joints().astype(np.float32)
    keeper.start()
    for number, identities in enumerate(([1], [1], [1, 2], [1], [1, 2], [1])):
        people = [PersonPose(one, joints_m, np.ones(15, np.float32)) for one in identities]
        keeper.add(Seen(number, 5.0 + number / 10, 10.0, people))
    assert "the joints of 6 images" in keeper.write()
    one, other = (read_performance(path) for path in sorted(tmp_path.iterdir()))
    np.testing.assert_allclose(one.times_s, np.arange(6) / 10, atol=1e-6)
    np.testing.assert_allclose(other.times_s, [0.2, 0.3, 0.4], atol=1e-6)
    assert other.confidence.any(axis=1).tolist() == [True, False, True]


def test_a_recording_goes_on_in_another_file_before_it_is_too_long_to_be_read(monkeypatch, tmp_path):
    camera, depth_m = CAMERAS["eval"], np.ones((240, 320), np.float32)
    recorder = keeping.DepthRecorder(tmp_path, camera)
    monkeypatch.setattr(keeping, "MAX_DURATION_S", 1.0)
    recorder.start()
    for taken in (5.0, 5.5, 6.0, 6.5, 7.0):
        recorder.add(Image(depth_m, taken))
    assert "3 depth images of 1.0 s" in (told := recorder.news()) and "the next one goes on" in told
    assert recorder.state == {"images": 2, "seconds": 0.5}
    recorder.stop()
    times_s = [[image.time_s for image in open_depth(path).timed()] for path in sorted(tmp_path.iterdir())]
    assert sorted(times_s) == [[0, 0.5], [0, 0.5, 1.0]]


def test_a_disk_that_is_full_when_the_next_file_begins_ends_the_recording_alone(monkeypatch, tmp_path):
    class Full(keeping.DepthWriter):
        def __init__(self, path: Path, camera: object) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    depth_m = np.ones((240, 320), np.float32)
    recorder = keeping.DepthRecorder(tmp_path, CAMERAS["eval"])
    monkeypatch.setattr(keeping, "MAX_DURATION_S", 1.0)
    recorder.start()
    recorder.add(Image(depth_m, 5.0))
    monkeypatch.setattr(keeping, "DepthWriter", Full)
    recorder.add(Image(depth_m, 6.5))
    assert "1 depth images of 0.0 s" in (told := recorder.news()) and "ended early" in told and "disk is full" in told
    assert recorder.state is None and len(list(tmp_path.iterdir())) == 1  # no empty file
    with pytest.raises(OSError, match="No space"):
        recorder.start()
    assert recorder.state is None and len(list(tmp_path.iterdir())) == 1


def test_a_file_that_was_finished_is_told_where_the_next_ones_first_image_cannot_be_written(monkeypatch, tmp_path):
    def full(writer: keeping.DepthWriter, *image: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    recorder = keeping.DepthRecorder(tmp_path, CAMERAS["eval"])
    monkeypatch.setattr(keeping, "MAX_DURATION_S", 1.0)
    recorder.start()
    recorder.add(Image(np.ones((240, 320), np.float32), 5.0))
    monkeypatch.setattr(keeping.DepthWriter, "add", full)
    recorder.add(Image(np.ones((240, 320), np.float32), 6.5))
    [kept] = tmp_path.iterdir()
    assert f"1 depth images of 0.0 s are in {kept}" in (told := recorder.news()) and "disk is full" in told


def test_a_disk_that_is_gone_when_a_recording_ends_is_told_and_the_next_one_begins_anew(monkeypatch, tmp_path):
    camera, depth_m = CAMERAS["eval"], np.ones((240, 320), np.float32)
    recorder, close = keeping.DepthRecorder(tmp_path, camera), keeping.DepthWriter.close

    def gone(writer: keeping.DepthWriter) -> None:
        close(writer)
        raise RuntimeError("Can't decrement id ref count")

    recorder.start()
    for taken in (5.0, 63.0, 63.0):  # no file may hold a time twice
        recorder.add(Image(depth_m, taken))
    monkeypatch.setattr(keeping.DepthWriter, "close", gone)
    recorder.stop()
    assert "2 depth images of 58.0 s" in (told := recorder.news()) and "it is not complete: Can't decrement" in told
    monkeypatch.undo()
    recorder.start()
    assert recorder.state == {"images": 0, "seconds": 0.0}
    recorder.stop()
