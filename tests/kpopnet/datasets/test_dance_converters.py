"""Readers of the files of ImperialDance and AIST++."""

import io
import json
import pickle
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from damaged_files import HOSTILE_JSON, is_refused, survives_damage
from recorded_points import FRAMES, coco

from kpopnet.dance.joint_sets import aist_joints_m, imperial_joints_m
from kpopnet.datasets.dances.converters import read_aist, read_imperial
from kpopnet.errors import InputError


def test_keypoints_are_read_without_running_code(tmp_path):
    points = coco(unit_m=0.01)
    (tmp_path / "a.json").write_text(json.dumps({"keypoints3d": points.tolist()}))
    np.savez(tmp_path / "a.npz", keypoints3d=points * 2, keypoints3d_optim=points)
    np.testing.assert_allclose(read_aist(tmp_path / "a.json"), points)
    np.testing.assert_allclose(read_aist(tmp_path / "a.npz"), points)

    (tmp_path / "ran").unlink(missing_ok=True)

    class Hostile:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "ran",))

    (tmp_path / "a.pkl").write_bytes(pickle.dumps(Hostile()))
    with pytest.raises(InputError, match="a pickle can run code"):
        read_aist(tmp_path / "a.pkl")
    np.savez(tmp_path / "b.npz", keypoints3d=np.array([Hostile()], object))
    (tmp_path / "c.npz").write_bytes(pickle.dumps(Hostile()))
    for name in ("b.npz", "c.npz", "missing.json"):
        with pytest.raises(InputError, match="keypoints3d could not be read"):
            read_aist(tmp_path / name)
    assert not (tmp_path / "ran").exists()
    (tmp_path / "d.json").write_text(json.dumps({"keypoints3d": [[1, 2]]}))
    with pytest.raises(InputError, match=r"expected \(frames, 17, 3\)"):
        read_aist(tmp_path / "d.json")


def test_corrupted_files_are_named(tmp_path):
    np.savez(tmp_path / "whole.npz", keypoints3d=coco())
    np.savez_compressed(tmp_path / "packed.npz", keypoints3d=np.random.default_rng(0).normal(size=(FRAMES, 17, 3)))
    np.save(tmp_path / "whole.npy", np.zeros((2, 3, FRAMES, 21)))
    whole, packed = ((tmp_path / name).read_bytes() for name in ("whole.npz", "packed.npz"))
    middle = len(packed) // 2
    for torn in (whole[: len(whole) // 2], b"", packed[:middle] + bytes(100) + packed[middle + 100 :]):
        (tmp_path / "torn.npz").write_bytes(torn)
        with pytest.raises(InputError, match=r"torn\.npz: keypoints3d could not be read"):
            read_aist(tmp_path / "torn.npz")
    for torn in ((tmp_path / "whole.npy").read_bytes()[:1000], b"", whole[: len(whole) // 2]):
        (tmp_path / "torn.npy").write_bytes(torn)
        with pytest.raises(InputError, match=r"torn\.npy: not a plain numpy array"):
            read_imperial(tmp_path / "torn.npy")


def test_hostile_json_is_refused_in_one_line(tmp_path):
    path = tmp_path / "a.json"
    points = coco().tolist()
    for hostile in (*HOSTILE_JSON, '"1"', "[[[1]]]", '"\u0661"', "false"):
        for place in ("keypoints", "frame", "number"):
            damaged = [["@"]] if place == "frame" else [[["@", 0, 0], *points[0][1:]], *points[1:]]
            text = json.dumps({"keypoints3d": "@" if place == "keypoints" else damaged}).replace('"@"', hostile)
            path.write_text(text)
            if place != "number" or hostile not in ("NaN", "Infinity", "null", "-1", "1e30", "100000"):
                assert is_refused(lambda: read_aist(path)), (place, hostile)
        path.write_text(hostile)
        assert is_refused(lambda: read_aist(path))


def test_damaged_files_are_refused_in_one_line(tmp_path):
    np.savez(tmp_path / "a.npz", keypoints3d=coco())
    np.savez_compressed(tmp_path / "b.npz", keypoints3d=coco())
    (tmp_path / "c.json").write_text(json.dumps({"keypoints3d": coco()[:3].tolist()}))
    np.save(tmp_path / "d.npy", np.zeros((2, 3, FRAMES, 21)))
    for name in ("a.npz", "b.npz", "c.json"):
        survives_damage(tmp_path / name, partial(read_as_aist, tmp_path / name))
    survives_damage(tmp_path / "d.npy", lambda: imperial_joints_m(np.array(read_imperial(tmp_path / "d.npy")[0]), "d"))


def read_as_aist(path: Path) -> np.ndarray:
    return aist_joints_m(read_aist(path), str(path))


def test_declared_shapes_beyond_the_budget_are_refused_before_they_are_allocated(tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**32, 17, 3)})
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("keypoints3d.npy", header.getvalue())
    with pytest.raises(InputError, match=r"would take 1752\.3 GB"):
        read_aist(tmp_path / "a.npz")


def test_points_far_away_are_refused():
    points = coco()
    points[0, 0] = 1e30
    with pytest.raises(InputError, match=r"a coordinate of 1e\+30"):
        aist_joints_m(points, "x")
