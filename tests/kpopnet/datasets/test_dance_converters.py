"""Readers of the files of ImperialDance."""

from pathlib import Path

import numpy as np
import pytest
from damaged_files import survives_damage
from recorded_points import FRAMES

from kpopnet.dance.joint_files.joint_sets import imperial_joints_m
from kpopnet.datasets.dances.converters import read_imperial
from kpopnet.errors import InputError


def test_corrupted_files_are_named(tmp_path):
    np.save(tmp_path / "whole.npy", np.zeros((2, 3, FRAMES, 21)))
    np.savez(tmp_path / "other.npz", points=np.zeros(1000))
    other = (tmp_path / "other.npz").read_bytes()
    for torn in ((tmp_path / "whole.npy").read_bytes()[:1000], b"", other):
        (tmp_path / "torn.npy").write_bytes(torn)
        with pytest.raises(InputError, match=r"torn\.npy: not a plain numpy array"):
            read_imperial(tmp_path / "torn.npy")


def test_damaged_files_are_refused_in_one_line(tmp_path):
    path = Path(tmp_path / "d.npy")
    np.save(path, np.zeros((2, 3, FRAMES, 21)))
    survives_damage(path, lambda: imperial_joints_m(np.array(read_imperial(path)[0]), "d"))
