"""Dances of the user's own: what a file holds, and which part of it is taken."""

import zipfile

import numpy as np
import pytest

from kpopnet.dance.joint_files.reader import read_performance
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.teacher.adding import at_rate
from kpopnet.teacher.own_dances import holds_depth, kpop_teachers, part_of


def test_depth_and_joints_are_told_apart(tmp_path):
    np.savez(tmp_path / "depth.npz", depth_mm=np.zeros((1, 2, 2), np.uint16))
    np.savez(tmp_path / "joints.npz", joints_m=np.zeros((1, 15, 3)), times_s=np.zeros(1))
    assert holds_depth(tmp_path / "depth.npz") and not holds_depth(tmp_path / "joints.npz")
    assert holds_depth(tmp_path) and holds_depth(tmp_path / "dance.bag") and not holds_depth(tmp_path / "dance.BVH")


def test_a_damaged_archive_is_left_to_the_reader(tmp_path):
    path = tmp_path / "joints.npz"
    np.savez(path, joints_m=np.zeros((2, 15, 3)))
    whole = path.read_bytes()
    directory = whole.rindex(b"PK\x01\x02")
    path.write_bytes(whole[:directory] + b"XXXX" + whole[directory + 4 :])
    assert zipfile.is_zipfile(path) and not holds_depth(path)
    with pytest.raises(InputError):
        read_performance(path)
    assert not holds_depth(tmp_path / "missing.npz")


def test_a_part_is_cut_by_seconds_from_the_first_image_on():
    times_s = 7 + np.arange(50) / 10
    whole = Performance(np.random.default_rng(0).normal(size=(50, 15, 3)), times_s, np.ones((50, 15)))
    part = part_of(whole, 1.0, 2.05, "dance")
    np.testing.assert_allclose(part.times_s, np.arange(11) / 10, atol=1e-9)
    np.testing.assert_array_equal(part.joints_m, whole.joints_m[10:21])
    assert len(part_of(whole, 0.0, None, "dance")) == 50
    for from_s, to_s in ((9.0, None), (2.0, 1.0), (float("nan"), None)):
        with pytest.raises(InputError, match=r"dance: lasts 4.9 s; nothing is left from"):
            part_of(whole, from_s, to_s, "dance")


def test_a_folder_without_teachers_is_no_set(tmp_path):
    (tmp_path / "dance").mkdir()
    assert kpop_teachers(tmp_path) == {} and kpop_teachers(tmp_path / "file.bvh") == {}


@pytest.mark.parametrize("last_s", [901.0, 7000.0])
def test_a_recording_of_hours_is_not_laid_out_frame_by_frame(last_s):
    """The file of a try may tell any time when somebody has edited it."""
    with pytest.raises(InputError, match="at most 900 s"):
        at_rate(Performance(np.zeros((2, 15, 3)), np.array([0.0, last_s])), 30.0)
