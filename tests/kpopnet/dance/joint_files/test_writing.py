"""Joints that are written are read again: exactly by npz, to the rounding by text, in directions and mean lengths by BVH."""

import json

import numpy as np
import pytest
from dance_people import dance_joints_m, performed, turned

from kpopnet.dance.joint_files import reader, writing
from kpopnet.dance.joint_files.reader import (
    read_performance,
    read_performances,
    read_strangers_group,
    read_strangers_performance,
)
from kpopnet.dance.joint_files.writing import write_performance
from kpopnet.dance.performance import Performance, from_absolute_clocks
from kpopnet.errors import InputError
from kpopnet.skeleton import Joint


def distances_m(joints_m):
    """(T, 15, 15) distances of all pairs of joints, which no turn and shift changes."""
    return np.linalg.norm(joints_m[:, :, None] - joints_m[:, None], axis=-1)


def recording() -> Performance:
    """A dance, some joints missing, and a confidence of each."""
    joints_m = dance_joints_m(3).copy()
    joints_m[40:60, Joint.LEFT_HAND] = np.nan
    confidence = np.random.default_rng(0).uniform(0.2, 1, joints_m.shape[:2])
    confidence[70, Joint.RIGHT_HAND] = 0.00045  # hardly seen, but seen
    return Performance(joints_m, 5 + np.arange(len(joints_m)) / 30, confidence)


@pytest.mark.parametrize(("suffix", "tolerance_m"), [(".npz", 1e-6), (".json", 4e-4), (".csv", 4e-4)])
def test_joints_times_and_confidence_come_back(suffix, tolerance_m, tmp_path):
    dance, path = recording(), tmp_path / f"a{suffix}"
    write_performance(path, dance)
    again = read_performance(path)
    np.testing.assert_allclose(distances_m(again.joints_m), distances_m(dance.joints_m), atol=tolerance_m)
    np.testing.assert_allclose(again.times_s, dance.times_s, atol=1e-6)
    np.testing.assert_allclose(again.confidence, dance.confidence, atol=6e-4)
    if suffix == ".npz":
        np.testing.assert_allclose(again.joints_m, dance.joints_m, atol=1e-6)
    if suffix == ".json":  # keeps the camera frame and says so
        content = json.loads(path.read_text())
        assert content["unit"] == "metre" and "y down" in content["frame"]
        np.testing.assert_allclose(content["frames"][7]["joints"]["head"][:3], dance.joints_m[7, Joint.HEAD], atol=6e-5)


def written_and_read(folder, performance) -> Performance:
    write_performance(folder / "a.bvh", performance)
    return read_performance(folder / "a.bvh")


@pytest.mark.parametrize("turn", [0.0, 3.1])
def test_a_skeleton_of_constant_bones_comes_back_from_bvh(turn, tmp_path):
    """Wherever the dancer faces. The first writing makes bones constant: a trunk that bends is a line in fifteen joints."""
    joints_m = turned(dance_joints_m(5), [0, 1, 0], np.full(360, turn))
    constant = written_and_read(tmp_path, performed(joints_m))
    assert len(constant) == len(joints_m) and constant.torso_is_derived  # its trunk is one straight bone
    np.testing.assert_allclose(np.diff(constant.times_s), 1 / 30, atol=1e-6)
    assert np.median(np.abs(distances_m(constant.joints_m) - distances_m(joints_m))) < 5e-3
    again_m = written_and_read(tmp_path, constant).joints_m
    np.testing.assert_allclose(distances_m(again_m), distances_m(constant.joints_m), atol=1e-4)


def test_bvh_follows_the_clock_where_frames_are_missing_and_fills_gaps(tmp_path):
    dance = recording()
    kept = np.delete(np.arange(len(dance)), np.arange(100, 130))
    again = written_and_read(tmp_path, Performance(dance.joints_m[kept], dance.times_s[kept], dance.confidence[kept]))
    assert len(again) == len(dance) and again.times_s[1] == pytest.approx(1 / 30) and np.isfinite(again.joints_m).all()


@pytest.mark.parametrize("fps", [4, 1000])
def test_bvh_of_the_lowest_rate_that_can_be_scored_and_of_the_highest_is_read_again(fps, tmp_path):
    again = written_and_read(tmp_path, performed(dance_joints_m(3), 0.3, fps))
    assert len(again) == len(dance_joints_m(3)) and again.times_s[1] == pytest.approx(1 / fps)


def test_a_single_frame_and_straight_opposite_limbs_make_a_bvh(tmp_path):
    joints_m = dance_joints_m(0)[:1].copy()
    for side, sign in (("LEFT", -1), ("RIGHT", 1)):  # folded onto the trunk: opposite to the rest pose
        shoulder = joints_m[:, Joint[f"{side}_SHOULDER"]]
        inwards = joints_m[:, Joint.LEFT_SHOULDER] - joints_m[:, Joint.RIGHT_SHOULDER]
        joints_m[:, Joint[f"{side}_ELBOW"]] = shoulder + sign * 0.8 * inwards
        joints_m[:, Joint[f"{side}_HAND"]] = shoulder + sign * 1.5 * inwards
    hands = [Joint.LEFT_HAND, Joint.RIGHT_HAND]
    again_m, joints_m = written_and_read(tmp_path, performed(joints_m)).joints_m[:, hands], joints_m[:, hands]
    np.testing.assert_allclose(distances_m(again_m), distances_m(joints_m), atol=2e-3)


def test_mistaken_arguments_of_reading_and_writing_are_one_line(tmp_path):
    write_performance(path := tmp_path / "a.csv", performed(dance_joints_m(0)))
    for mistaken, message in (
        (lambda: write_performance(path, dance_joints_m(0)), "expected a Performance, as .* makes, got ndarray"),
        (lambda: write_performance(None, read_performance(path)), "expected the path of a file or folder, got None"),
        (lambda: read_performance(None), "expected the path of a file or folder, got None"),
        (lambda: read_strangers_performance(3), "expected the path of a file or folder, got 3"),
        (lambda: read_performances(path), r"expected a list of one file or more, got PosixPath"),
        (lambda: read_performances([]), r"expected a list of one file or more, got \[\]"),
        (lambda: read_strangers_group(str(path)), "expected a list of one file or more, got '"),
        (lambda: read_strangers_group([None]), "expected the path of a file or folder, got None"),
        (lambda: read_performance(path, "30"), "fps='30': expected a number"),
        (lambda: read_performance(path, joint_map={"head": "nose"}), "expected the path of a file or folder"),
        (lambda: from_absolute_clocks([dance_joints_m(0)]), "a dance: expected a Performance"),
    ):
        with pytest.raises(InputError, match=message):
            mistaken()


def test_what_cannot_be_written_is_told_in_one_line(tmp_path):
    joints_m = dance_joints_m(0).copy()
    with pytest.raises(InputError, match=r"a\.txt: expected a name that ends with \.npz"):
        write_performance(tmp_path / "a.txt", performed(joints_m))
    for interval_s in (2.0, 1e-9):  # the second would make a frame for each of its intervals in the last gap
        times_s = np.append(interval_s * np.arange(len(joints_m) - 1), 7000.0)
        with pytest.raises(InputError, match=rf"frames are {interval_s:g} s apart, in the median; BVH.* 0\.001 to 1 s"):
            write_performance(tmp_path / "a.bvh", Performance(joints_m, times_s))
    joints_m[:, Joint.LEFT_FOOT] = np.nan
    with pytest.raises(InputError, match="left_foot is missing in every frame"):
        write_performance(tmp_path / "a.bvh", performed(joints_m))
    joints_m[:, [Joint.LEFT_FOOT, Joint.LEFT_KNEE]] = 0.0
    with pytest.raises(InputError, match="lie in one point"):
        write_performance(tmp_path / "a.bvh", performed(joints_m))
    assert list(tmp_path.iterdir()) == []


def test_more_frames_than_a_process_should_hold_do_not_leave_the_one_that_read_them(tmp_path, monkeypatch):
    write_performance(tmp_path / "a.npz", performed(dance_joints_m(0, 3.0)))
    monkeypatch.setattr(reader, "MOST_FRAMES", 80)
    with pytest.raises(InputError, match=r"a\.npz: expected at most 80 frames, found 90"):
        reader._arrays(tmp_path / "a.npz", [], None, None)


def test_more_text_than_is_read_is_not_written(tmp_path, monkeypatch):
    dance = performed(dance_joints_m(0, 3.0))
    monkeypatch.setattr(writing, "MAX_JSON_BYTES", 5000)
    for name in ("a.json", "a.csv"):
        with pytest.raises(InputError, match=rf"{name}: \d+,\d+ bytes, more than `kpopnet score` reads; write .npz"):
            write_performance(tmp_path / name, dance)
    for name in ("a.npz", "a.bvh"):
        write_performance(tmp_path / name, dance)
    assert {path.name for path in tmp_path.iterdir()} == {"a.npz", "a.bvh"}
