"""The program `kpopnet check`: a simulated film, recordings that are damaged or too short, and a live camera."""

import contextlib
import json
import time
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from cone_people import cone_joints
from depth_files import depth_mm, write_npz
from numba.core import event
from simulated_files import write_simulated

import kpopnet.programs.check
from kpopnet.camera import CAMERAS, Camera
from kpopnet.datasets import check_script
from kpopnet.datasets.check_script import Step
from kpopnet.datasets.simulated import StoredSequence
from kpopnet.errors import InputError
from kpopnet.pose import PersonPose
from kpopnet.programs.check import Answer, Collected
from kpopnet.sources.arrays import DepthWriter
from kpopnet.teacher.live.loop import KERNELS, STEADY_S
from synth.simulated.check_sim import CheckSim, CheckSimConfig

FPS, EVERY = 2.0, 15
SHORTER = 20
"""The script is shorter by this factor where images come at their own times."""


@pytest.fixture
def check(program):
    return partial(program, "check")


@pytest.fixture(scope="module")
def film() -> StoredSequence:
    """Every fifteenth image of a film of `check_sim`."""
    maker = CheckSim(CheckSimConfig(seed=5, cameras=["kinect_v1"], sequences=5))
    take = maker.take(0)
    shots = list(maker.shots(0, take, range(0, len(take), EVERY)))
    arrays = {name: np.stack([shot[name] for shot in shots]) for name in shots[0]}
    return StoredSequence("any", "kinect_v1", FPS, take.camera, ("person 0",), **arrays)


def rows(text: str) -> dict[str, str]:
    """The measured column by the title of its line."""
    return {line[:54].strip(): line.rsplit("  ", 1)[-1].strip() for line in text.splitlines() if "  " in line}


def test_the_estimator_of_the_package_on_simulated_films(check, film, tmp_path):
    write_simulated(tmp_path / "set", "check_sim", {"check_00": film})
    printed = check(tmp_path / "set", "--as-fast", "--out", tmp_path / "out")
    assert "film 1 of 1" in printed and "SIMULATED" in printed and "no delays" in printed
    stored = json.loads((tmp_path / "out" / "check.json").read_text())
    found = {name: line["value"] for name, line in stored["sheet"]["kinect_v1"].items()}
    assert stored["simulated"] and found["delay_p95_ms"] is None
    # At 7 m stands a thing whose likeness to a person changes with the noise.
    assert found["availability"] > 0.9 and found["false_people"] <= 3 and 15 < found["empty_s"] < 18
    assert 5 < found["mean_error_mm"] < 80 and found["jitter_core_mm"] < 30 and found["found_again_ms"] <= 1000
    assert (tmp_path / "out" / "check.png").stat().st_size > 5000


class Estimator:
    """Finds the person of `cone_people` wherever something is nearer than the wall."""

    def reset(self) -> None:
        pass

    def update(self, depth_m: np.ndarray, camera: Camera, time_s: float | None = None) -> list[PersonPose]:
        near = (depth_m > 0) & (depth_m < 3)
        return [PersonPose(0, cone_joints().astype(np.float32), np.ones(15, np.float32))] if near.any() else []


@pytest.fixture
def cheap(monkeypatch):
    """An estimator that costs nothing."""
    monkeypatch.setattr("kpopnet.programs.check.load_estimator", lambda checkpoint: Estimator())


def test_without_truth_whoever_stands_before_the_empty_room_is_in_view(check, cheap, film, tmp_path):
    numbers = [getattr(film.camera, name) for name in ("fx", "fy", "cx", "cy", "width", "height")]
    np.savez_compressed(tmp_path / "minute.npz", depth_mm=film.depth, camera=numbers, fps=FPS)
    unknown = rows(check(tmp_path / "minute.npz", "--as-fast"))
    assert unknown["mean error of all joints"] == "-, not shown"
    assert 15 < float(unknown["time for which the room was empty"].split()[0]) < 18


def test_who_stands_still_warms_up_whatever_the_clock_of_the_recording():
    watched_s, begins_s = [], 5000.0

    class Watching(Estimator):
        def update(self, depth_m: np.ndarray, camera: Camera, time_s: float | None = None) -> list[PersonPose]:
            watched_s.append(time_s - begins_s)
            return super().update(depth_m, camera, time_s)

    images = [SimpleNamespace(time_s=begins_s + k / FPS, depth_m=np.full((4, 4), 2.0)) for k in range(60)]
    source = SimpleNamespace(camera=None, timed=lambda: ((one.time_s, one.depth_m) for one in images))
    kpopnet.programs.check.warm_up(source, Watching())
    begin_s, end_s = kpopnet.programs.check.step_s("stand still")
    assert watched_s and begin_s <= watched_s[0] and watched_s[-1] < end_s


def test_recordings_that_cannot_be_checked_are_one_line(check, cheap, film, tmp_path):
    short = write_npz(tmp_path / "short.npz", depth_mm(90), fps=30)
    assert "short.npz: 90 images of 3.0 s; the script takes 60 s" in check(short, "--as-fast", fails=True)
    write_simulated(tmp_path / "set", "check_sim", {"check_00": film})
    damaged = tmp_path / "set" / "check_00.h5"
    for words in (("--rotate", 180), ("--fov", 80), ("--camera", "kinect_v1")):
        assert f"error: {words[0]}: a simulated film states its own" in check(damaged, "--as-fast", *words, fails=True)
    content = damaged.read_bytes()
    damaged.write_bytes(content[: len(content) // 2])
    assert "check_00.h5: not a readable HDF5 file" in check(tmp_path / "set", fails=True)
    write_simulated(tmp_path / "other", "rooms", {"room_000": film})
    assert "holds rooms, not check_sim" in check(tmp_path / "other", fails=True)
    assert "--empty for live cameras" in check(short, "--empty", 10, fails=True)
    assert "--as-fast is for recordings" in check("realsense", "--as-fast", fails=True)
    assert "--depth-scale: a live camera states its own" in check("realsense", "--depth-scale", 5000, fails=True)
    (tmp_path / "out").write_text("no folder")  # which is told before the minute
    assert f"error: {tmp_path / 'out'}: is there already" in check(short, "--as-fast", "--out", tmp_path / "out", fails=True)


def test_a_covered_lens_meets_no_gate_and_is_named(check, cheap, tmp_path):
    dark = write_npz(tmp_path / "dark.npz", np.zeros((121, 48, 64), np.uint16), fps=FPS)
    printed = check(dark, "--as-fast")
    assert "dark.npz: no image has a measured pixel; is the lens covered?" in printed
    found = rows(printed)
    assert found["exchanges of left and right"] == "-, not shown" and found["longest gap"] == "-"
    assert float(found["time for which the room was empty"].split()[0]) == 0


@pytest.fixture
def shorter(monkeypatch, cheap):
    """The script in three seconds."""
    steps = tuple(Step(one.name, one.start_s / SHORTER, one.told) for one in check_script.SCRIPT)
    for module in (check_script, kpopnet.programs.check):
        monkeypatch.setattr(module, "SCRIPT", steps)
        monkeypatch.setattr(module, "END_S", 60 / SHORTER)
    monkeypatch.setattr("kpopnet.evaluation.acceptance.figures.AWAY_S", 1 / SHORTER)
    monkeypatch.setattr("kpopnet.programs.check.TOLERANCE_S", 0.1)


def seen(time_s: float) -> np.ndarray:
    """(240, 320) metres: a wall, and from 0.5 s to 2.2 s and from 2.6 s on a person before it."""
    image_m = np.full((240, 320), 4, np.float32)
    if 0.5 <= time_s < 2.2 or time_s >= 2.6:
        image_m[40:220, 130:190] = 2
    return image_m


def test_a_recording_is_fed_at_its_own_times_also_where_the_camera_skipped_images(check, shorter, tmp_path):
    path = tmp_path / "minute.h5"
    with contextlib.closing(DepthWriter(path, CAMERAS["kinect_v1"])) as writer:
        for number in range(90):
            if number % 4 < 3:
                writer.add(seen(number / 30), 7 + number / 30)  # of any clock
    began = time.monotonic()
    found = rows(check(path))
    assert time.monotonic() - began > 2.9
    assert 5 < float(found["images a second from the camera"]) < 24
    assert float(found["time in view with joints"].split()[0]) == 100 and found["exchanges of left and right"].startswith("0")
    assert 0 <= float(found["delay from image to joints, median"].split()[0]) < 1000


class Live:
    """A camera before which a person does what the program tells, 30 images a second."""

    camera, READY_S = CAMERAS["kinect_v1"], 0.4
    told_to_leave = float("inf")

    def __init__(self, name: str, rotate_deg: int) -> None:
        self._due = time.monotonic()
        self.closed = False

    def read(self) -> tuple[np.ndarray, float]:
        self._due += 1 / 30
        time.sleep(max(self._due - time.monotonic(), 0))
        now = time.monotonic()
        # In view until found, then away for the time to leave and the first step of the script.
        script_s = now - Live.told_to_leave - Live.READY_S
        return seen(1.0 if script_s < -Live.READY_S else script_s), now

    def close(self) -> None:
        self.closed = True

    @classmethod
    def hear(cls, text: str, **how: bool) -> None:
        print(text, **how)
        if "leave the camera's view" in text:
            cls.told_to_leave = time.monotonic()


class Compiling(Estimator):
    """One whose first answer compiles, as in a fresh installation."""

    is_compiled = False

    def update(self, *given: object) -> list[PersonPose]:
        for _ in range(0 if self.is_compiled else KERNELS):
            with event.trigger_event("numba:compile", {"dispatcher": SimpleNamespace(py_func=self.update)}):
                self.is_compiled = True
                time.sleep(2 * STEADY_S / KERNELS)
        return super().update(*given)


def test_a_person_before_a_live_camera_is_told_what_to_do(check, shorter, monkeypatch):
    """The address of what standard input brings has a secret in it, which the sheet does not show."""
    monkeypatch.setattr("kpopnet.programs.check.shared_live", lambda _: contextlib.nullcontext("stdin:1/5ec4e7"))
    monkeypatch.setattr("kpopnet.programs.check.load_estimator", lambda checkpoint: Compiling())
    monkeypatch.setattr("kpopnet.programs.check.NOBODY_PATIENCE_S", 0)  # but for what is compiled
    monkeypatch.setattr("kpopnet.programs.check.open_live", Live)
    monkeypatch.setattr("kpopnet.programs.check.READY_S", Live.READY_S)
    monkeypatch.setattr(Live, "told_to_leave", Live.told_to_leave)
    monkeypatch.setattr("kpopnet.programs.check.print", Live.hear, raising=False)
    printed = check("-")
    assert "Acceptance sheet: -" in printed and "5ec4e7" not in printed
    told = [printed.index(step.told) for step in check_script.SCRIPT]
    assert told == sorted(told) and printed.index("you are found; leave") < told[0]
    found = rows(printed)
    assert float(found["time for which the room was empty"].split()[0]) > 0.3
    assert float(found["time in view with joints"].split()[0]) == 100
    assert float(found["images a second from the camera"]) < 31.5  # not those that were dropped while kernels were compiled
    assert "SIMULATED" not in printed


def test_who_is_found_slowly_is_found(monkeypatch, capsys):
    class Short(Live):
        images = 3

        def read(self):
            self.images -= 1
            return (seen(1.0), time.monotonic()) if self.images >= 0 else None

    for name, value in (("open_live", Short), ("STEADY_S", 0), ("NOBODY_PATIENCE_S", 0)):
        monkeypatch.setattr(f"kpopnet.programs.check.{name}", value)
    with pytest.raises(InputError, match="the script takes 60 s"):
        kpopnet.programs.check.check_live(SimpleNamespace(source="oak", rotate=0, empty=0.0), "oak", Estimator())
    assert "you are found; leave" in capsys.readouterr().out


def test_a_camera_that_fails_is_one_line(check, shorter, monkeypatch):
    class Failing(Live):
        def read(self):
            raise OSError("the cable is broken")

    monkeypatch.setattr("kpopnet.programs.check.open_live", Failing)
    assert "the camera stopped: the cable is broken" in check("realsense", fails=True)


def test_a_camera_that_was_away_while_the_room_was_empty_is_one_line():
    collected = Collected(CAMERAS["kinect_v1"])
    for script_s in (-1.0, 8.1, 59.9):
        collected.add(Answer(script_s, 0.02, 0.01, seen(0), [], None), script_s)
    with pytest.raises(InputError, match="realsense: no image came in the first 8 s"):
        collected.watched("realsense", 0)
