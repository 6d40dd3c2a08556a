"""Files of the body and the dances."""

from dataclasses import replace

import numpy as np
import pytest

from kpopnet.errors import InputError
from kpopnet.skeleton import Joint
from kpopnet.teacher.library import DANCES, Library, difficulty, preview_cm


def test_a_dance_survives_writing_and_reading(library, tmp_path):
    dance, other = library.dance("dance_001"), Library(tmp_path)
    other.write("copy", dance)
    again = other.dance("copy")
    assert again.about == dance.about and other.about("copy") == dance.about
    assert np.abs(again.quats - dance.quats).max() < 1e-4 and np.array_equal(again.joints_m, dance.joints_m)
    other.write("copy", replace(dance, about=replace(dance.about, name="Other")))
    assert other.about("copy").name == "Other"


@pytest.mark.parametrize(
    "identity", ["../body", "dance_001/../dance_001", "", ".", "Dance", "x" * 65, "dance_001\0", "dance_999"]
)
def test_what_is_no_name_of_a_dance_is_no_path(library, identity):
    with pytest.raises(InputError, match="there is no dance"):
        library.dance(identity)


def test_a_damaged_dance_is_told_in_one_line(library, tmp_path):
    other = Library(tmp_path)
    other.write("whole", library.dance("dance_001"))
    content = (tmp_path / DANCES / "whole.npz").read_bytes()
    (tmp_path / DANCES / "cut.npz").write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"cut\.npz"):
        other.dance("cut")


def test_the_preview_is_centred_and_upright(library):
    frames = np.array(preview_cm(library.dance("dance_001"))).reshape(-1, 15, 2)
    assert len(frames) == 40 and np.abs(frames.mean(axis=(0, 1))).max() < 2
    assert (frames[:, Joint.HEAD, 1] > frames[:, Joint.LEFT_FOOT, 1]).all()


def test_who_moves_faster_dances_something_more_difficult(library):
    joints_m = library.dance("dance_001").joints_m
    levels = [difficulty(joints_m, fps) for fps in (5.0, 30.0, 90.0)]
    assert levels[0] == 1 and levels[2] == 5 and levels == sorted(levels)
    assert difficulty(np.full((9, 15, 3), np.nan), 30.0) == 1
