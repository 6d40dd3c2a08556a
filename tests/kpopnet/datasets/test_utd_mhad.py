import csv
import logging
from pathlib import Path

import numpy as np
import pytest
from real_data import UTD_MHAD
from scipy.io import savemat

from kpopnet.camera import Camera
from kpopnet.datasets.utd_mhad import KINECT_JOINTS, UtdMhadBenchmark, UtdMhadConfig, estimate_lag
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint

FRAMES = 24
MEASURED_CAMERA = Camera(285.63, 285.63, 158.3, 120.0, 320, 240)
"""Projects the labels onto the stored images, in which both people stand 1.7 columns left of the nominal centre."""


def kinect_person(frames: int) -> np.ndarray:
    """(T, 20, 3) metres of a standing person in the stored axes (y up, mirrored: right has x > 0); the right hand moves."""
    middle = [(0, 0.65, 2.8), (0, 0.4, 2.8), (0, 0.0, 2.8), (0, -0.05, 2.8)]
    arm = [(0.2, 0.35, 2.8), (0.3, 0.1, 2.8), (0.35, -0.1, 2.8), (0.35, -0.2, 2.8)]
    leg = [(0.1, -0.1, 2.8), (0.12, -0.5, 2.8), (0.12, -0.8, 2.8), (0.14, -0.85, 2.7)]
    left = np.array([-1, 1, 1])
    skeleton = np.repeat(np.concatenate([middle, left * arm, arm, left * leg, leg])[None], frames, axis=0)
    for name in ("right_wrist", "right_hand"):
        skeleton[:, KINECT_JOINTS.index(name), 1] += 0.5 * np.sin(np.arange(frames) * 0.5)
    return skeleton


def depth_of(skeleton: np.ndarray) -> np.ndarray:
    """(T, 240, 320) uint16 mm: a square of pixels around every joint."""
    depth = np.zeros((len(skeleton), 240, 320), np.uint16)
    for frame, joints in enumerate(skeleton * [1, -1, 1]):
        for u, v, z in MEASURED_CAMERA.project(joints):
            row, column = round(v), round(u)
            depth[frame, row - 2 : row + 3, column - 2 : column + 3] = round(1000 * z)
    return depth


def write(folder: Path, name: str, depth: np.ndarray, skeleton: np.ndarray) -> None:
    for kind in ("Depth", "Skeleton"):
        (folder / kind).mkdir(parents=True, exist_ok=True)
    savemat(folder / "Depth" / f"{name}_depth.mat", {"d_depth": depth.transpose(1, 2, 0)})
    savemat(folder / "Skeleton" / f"{name}_skeleton.mat", {"d_skel": skeleton.transpose(1, 2, 0)})


def benchmark(folder: Path, lag: int | None = None) -> UtdMhadBenchmark:
    return UtdMhadBenchmark(UtdMhadConfig(path=str(folder), lag=lag))


@pytest.mark.parametrize("lag", [-3, 0])
def test_labels_are_shifted_to_their_depth_frames(tmp_path, lag):
    person = kinect_person(FRAMES)
    # Row t + lag of the skeleton belongs to depth frame t.
    write(tmp_path, "a3_s1_t1", depth_of(person), np.roll(person, lag, axis=0))
    sequence = benchmark(tmp_path).read("a3_s1_t1")
    inner = slice(4, -4)
    hand = person[:, KINECT_JOINTS.index("right_hand")]
    np.testing.assert_allclose(sequence.joints_camera_m[inner, Joint.RIGHT_HAND], (hand * [-1, -1, 1])[inner], atol=1e-6)
    unlabelled = np.arange(FRAMES) < -lag
    assert (np.isnan(sequence.joints_camera_m).all(axis=(1, 2)) == unlabelled).all()
    assert (sequence.visible.any(axis=1) == ~unlabelled).all()


def test_the_person_is_mirrored_back_and_every_joint_lies_on_its_pixels(tmp_path):
    person = kinect_person(FRAMES)
    for name in ("a10_s1_t1", "a3_s12_t10", "a3_s12_t1", "a3_s12_t9"):
        write(tmp_path, name, depth_of(person), person)
    (tmp_path / "Depth" / "._a3_s12_t1_depth.mat").write_bytes(b"what macOS writes beside a file")
    found = benchmark(tmp_path, lag=0)
    assert found.sequence_names() == ["a3_s12_t1", "a3_s12_t9", "a3_s12_t10", "a10_s1_t1"]
    sequence = found.read("a3_s12_t1")
    joints = sequence.joints_camera_m
    assert sequence.identity == "s12" and sequence.fps == 30 and joints.shape == (FRAMES, 15, 3)
    # The right hand of a person who faces the camera is left in the image, and up is towards row 0.
    uvz = sequence.camera.project(joints)
    assert (uvz[:, Joint.RIGHT_HAND, 0] < uvz[:, Joint.LEFT_HAND, 0]).all()
    assert (uvz[:, Joint.HEAD, 1] < uvz[:, Joint.LEFT_FOOT, 1]).all()
    assert np.ptp(joints[:, Joint.RIGHT_HAND, 1]) > 0.9 and np.ptp(joints[:, Joint.LEFT_HAND, 1]) == 0
    for joint in set(Joint) - {Joint.TORSO}:
        for frame in range(FRAMES):
            u, v, z = uvz[frame, joint]
            assert sequence.depth_m[frame, round(v), round(u)] == pytest.approx(z, abs=1e-3)
    corners = joints[:, [Joint.RIGHT_SHOULDER, Joint.LEFT_SHOULDER, Joint.RIGHT_HIP, Joint.LEFT_HIP]]
    np.testing.assert_allclose(joints[:, Joint.TORSO], corners.mean(axis=1), atol=1e-6)


def test_absent_joints_are_nan_and_invisible_and_logged(tmp_path, caplog):
    person = kinect_person(FRAMES)
    person[3, KINECT_JOINTS.index("head")] = 0
    person[4, KINECT_JOINTS.index("left_hip")] = np.nan  # then the torso is absent too
    write(tmp_path, "a1_s1_t1", depth_of(kinect_person(FRAMES)), person)
    with caplog.at_level(logging.WARNING):
        sequence = benchmark(tmp_path, lag=0).read("a1_s1_t1")
    assert "a1_s1_t1: left out 2 joints that are absent" in caplog.text
    absent = np.zeros((FRAMES, 15), bool)
    absent[3, Joint.HEAD] = absent[4, Joint.LEFT_HIP] = absent[4, Joint.TORSO] = True
    assert (np.isnan(sequence.joints_camera_m).all(-1) == absent).all() and (sequence.visible == ~absent).all()


@pytest.mark.parametrize("name", ["my_own_take", "a1_s_t1", "take"])
def test_who_is_seen_in_a_recording_of_another_name_is_not_known(tmp_path, name):
    write(tmp_path, name, depth_of(kinect_person(4)), kinect_person(4))
    assert benchmark(tmp_path, lag=0).read(name).identity == ""


def test_invalid_files_are_named(tmp_path):
    person = kinect_person(4)
    name = "a1_s1_t1"
    depth_file, skeleton_file = tmp_path / "Depth" / f"{name}_depth.mat", tmp_path / "Skeleton" / f"{name}_skeleton.mat"

    def message() -> str:
        with pytest.raises(InputError) as caught:
            benchmark(tmp_path).read(name)
        return str(caught.value)

    write(tmp_path, name, depth_of(person), person[:, :15])
    assert str(skeleton_file) in message() and "expected (20, 3, any)" in message()
    far = person.copy()
    far[2, 5, 1] = 1e39  # damage of a few bits; float32 has no such number
    write(tmp_path, name, depth_of(person), far)
    assert message() == f"{skeleton_file}: expected joints in metres, at most 100 m"
    skeleton_file.unlink()
    assert f"{skeleton_file}: no such file" in message()
    write(tmp_path, name, depth_of(person), person)
    depth_file.write_bytes(depth_file.read_bytes()[:5000])
    assert str(depth_file) in message() and "not a complete MATLAB file" in message() and "\n" not in message()
    with pytest.raises(InputError, match="expected Depth/"):
        benchmark(tmp_path / "nowhere")


@pytest.mark.skipif(not UTD_MHAD.exists(), reason="needs part of UTD-MHAD")
def test_real_labels_lie_on_real_people_and_have_the_measured_lag():
    rows = csv.reader((UTD_MHAD / "lag.csv").read_text().splitlines()[1:])
    measured = {row[0]: int(row[2]) for row in rows}
    real = benchmark(UTD_MHAD)
    names = [name for name in real.sequence_names() if name.endswith("s1_t1")][::9]
    lags = []
    for name in names:
        depth_m, skeleton_m = real._read_depth(name), real._read_skeleton(name)
        lags.append((estimate_lag(depth_m, skeleton_m), measured[name]))
        sequence = real.read(name)
        uvz = sequence.camera.project(sequence.joints_camera_m[10:-10, [Joint.TORSO, Joint.NECK]])
        at = np.round(uvz[..., :2]).astype(int)
        frames = np.arange(10, len(sequence.depth_m) - 10)[:, None]
        surface = sequence.depth_m[frames, at[..., 1], at[..., 0]]
        assert (surface > 0).mean() > 0.95, name
        # The joints are behind the surface by less than the thickness of the body, unless an arm occludes them.
        assert np.median(np.abs(uvz[..., 2] - surface)) < 0.15, name
    assert lags and all(abs(found - known) <= 1 for found, known in lags)
