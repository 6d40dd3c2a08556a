"""The tool that trains a webcam's network, on points of people whose depth is guessed too small: through the program."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from dance_people import dance_joints_m
from programs import run_program, tool

from kpopnet.dance.joint_files.mediapipe import CAMERA
from kpopnet.dance.joint_files.points import MEDIAPIPE_NAMES
from kpopnet.runtime.input_files import read_json
from kpopnet.skeleton import Joint

SHARE = 0.4


def points_of(joints_m):
    """(33, 6) points as a page sends them of (15, 3) joints: each the nearest joint that it is named after."""
    points = []
    for name in MEDIAPIPE_NAMES:
        side, _, part = name.partition("_")
        part = {"wrist": "hand", "pinky": "hand", "index": "hand", "thumb": "hand"}.get(part, part)
        part = {"ankle": "foot", "heel": "foot", "foot_index": "foot"}.get(part, part)
        points.append(joints_m[Joint.__members__.get(f"{side}_{part}".upper(), Joint.HEAD)])
    points = np.array(points)
    shares = (CAMERA.project(points)[:, :2] + 0.5) / [CAMERA.width, CAMERA.height]
    world_m = (points - (joints_m[Joint.RIGHT_HIP] + joints_m[Joint.LEFT_HIP]) / 2) * (1, 1, SHARE)
    return np.column_stack([world_m, shares, np.full(33, 0.9)])


def write_film(folder, number):
    true_m = dance_joints_m(number)[:300:5]
    points = np.stack([points_of(joints_m) for joints_m in true_m])
    points[7] = np.nan  # no person was found
    folder.mkdir(exist_ok=True)
    np.savez(folder / f"film_{number:05d}.npz", points=points.astype(np.float32), true_m=true_m.astype(np.float32))


def test_a_short_training_finds_depth_in_films_that_were_held_out_and_repeats(tmp_path):
    for number in range(8):
        write_film(tmp_path / "films", number)
    (tmp_path / "films/manifest.json").write_text('{"clips": "pack"}')
    given = ("fit", "films", "--steps", 60, "--held-out", 4, "--figures", "figures.json", "--out")
    first = run_program("tools/fit_lifting.py", tmp_path, *given, "net.safetensors")
    assert first.returncode == 0, first.stderr
    guessed_cm, lifted_cm = (float(re.search(rf"{name}: ([\d.]+) cm", first.stdout)[1]) for name in ("points", "lifted"))
    assert lifted_cm < 0.8 * guessed_cm
    figures = read_json(tmp_path / "figures.json")  # of films 0 and 4
    assert figures["films"] == 2 and figures["lifted"]["cm"] == pytest.approx(lifted_cm, abs=0.06)
    assert figures["lifted"]["cm"] == pytest.approx((figures["composed"]["cm"] + figures["recorded"]["cm"]) / 2)
    assert "other" not in figures and "--held-out 4" in figures["command"]
    again = run_program("tools/fit_lifting.py", tmp_path, *given, "again.safetensors")
    assert again.stdout == first.stdout
    assert (tmp_path / "net.safetensors").read_bytes() == (tmp_path / "again.safetensors").read_bytes()


def test_folders_and_films_that_cannot_be_learnt_from_are_named(tmp_path):
    def ended(*options):
        done = run_program("tools/fit_lifting.py", tmp_path, "fit", ".", "--out", "net.safetensors", "--steps", 1, *options)
        assert done.returncode == 1 and done.stderr.count("\n") == 1
        return done.stderr

    assert "no film_*.npz in which a person was found" in ended()
    write_film(tmp_path, 1)
    assert "no film is left to learn from with --held-out 1" in ended("--held-out", 1)
    (tmp_path / "film_00002.npz").write_bytes((tmp_path / "film_00001.npz").read_bytes()[:900])
    assert "film_00002.npz: not a readable film" in ended()


def test_without_recordings_no_film_is_called_a_recording(capsys):
    fit_lifting = tool("fit_lifting")
    film = fit_lifting.Pictures(SimpleNamespace(points_m=np.zeros((3, 15, 3))), np.zeros((3, 15, 3)))
    figures = [
        fit_lifting.report(lambda seen: (np.zeros((3, 15, 3)), np.full((3, 15), 0.9)), {1: film}, known)
        for known in (True, False)
    ]
    assert "recorded" in figures[0] and "other" not in figures[0] and "other" in figures[1] and "recorded" not in figures[1]
