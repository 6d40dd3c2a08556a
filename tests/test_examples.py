"""The examples as a user runs them."""

import re
import subprocess
import sys

import numpy as np
from cone_people import cone_body, cone_joints, draw_cones
from programs import ROOT

from kpopnet.camera import CAMERAS
from kpopnet.skeleton import Joint


def run_example(name: str, *words: object) -> str:
    command = [sys.executable, str(ROOT / "examples" / name), *map(str, words)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_new_move_becomes_a_dance_and_scores_as_a_copy_of_itself(tmp_path):
    printed = run_example("new_move.py", tmp_path / "dance.png", "--joints", tmp_path / "dance.npz")
    assert (tmp_path / "dance.png").stat().st_size > 10_000 and "look at" in printed
    with np.load(tmp_path / "dance.npz") as file:
        assert np.isfinite(file["joints_m"]).all() and len(file["joints_m"]) == len(file["times_s"])
    scored = run_example("recordings_to_score.py", tmp_path / "dance.npz", tmp_path / "dance.npz")
    similarity = int(scored.split("similarity ")[1].split(",")[0])
    assert similarity == 100 and len(scored.splitlines()) == 2  # nothing to tell


def test_a_camera_becomes_joints(tmp_path):
    camera = CAMERAS["kinect_v1"]
    joints_m = cone_joints(-75, 4)  # upright, with hanging arms
    depth_m = draw_cones(joints_m, cone_body(joints_m), camera)
    np.save(tmp_path / "recording.npy", np.repeat((1000 * depth_m).astype(np.uint16)[None], 4, axis=0))
    fov_deg = np.degrees(2 * np.arctan(camera.width / 2 / camera.fx))
    printed = run_example("camera_to_joints.py", tmp_path / "recording.npy", "--fov", fov_deg)
    hands = {"right": joints_m[Joint.RIGHT_HAND], "left": joints_m[Joint.LEFT_HAND]}
    found = re.findall(r"image \d: person \d, (\w+) hand at (\S+), (\S+), (\S+) m", printed)
    assert {side for side, *_ in found} == {"right", "left"}
    for side, *place_m in found:
        assert np.linalg.norm(np.array(place_m, float) - hands[side]) < 0.2  # a body of cones, not one the network knows
