"""HDF5 files on one's own disk: what is not as declared is refused in one line."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from kpopnet.errors import InputError
from kpopnet.runtime.hdf5_files import Hdf5Schema, attributes_of, open_hdf5, read_array
from kpopnet.runtime.input_files import BUDGET_VARIABLE, ArraySchema

SCHEMA = Hdf5Schema(
    "a test",
    {
        "a": ArraySchema("f", ("N", 3)),
        "n": ArraySchema("iu", ("N",)),
        "words": ArraySchema("S", ("N",)),
        "more": ArraySchema("f", (None,), required=False),
    },
    {"count": int, "camera": list[float], "note": str},
    optional=("note",),
    fixed={"format": "test", "version": 1},
    remedy="make it again",
)


def write(path: Path, attributes: dict | None = None, **arrays) -> Path:
    """A valid file, but for what is given; None leaves out."""
    whole = {"a": np.ones((4, 3), ">f4"), "n": np.arange(4), "words": np.array([b"x"] * 4)} | arrays
    values = {"format": "test", "version": 1, "count": 4, "camera": np.ones(6), "note": "é"} | (attributes or {})
    with h5py.File(path, "w") as file:
        for name, array in whole.items():
            if array is not None:
                file.create_dataset(name, data=array)
        file.attrs.update({name: one for name, one in values.items() if one is not None})
    return path


def test_what_is_stored_is_read(tmp_path):
    texts = np.array(["a", "b", "é", ""], object)
    with open_hdf5(write(tmp_path / "x.h5", words=texts), SCHEMA) as file:
        assert attributes_of(file) == {"format": "test", "version": 1, "count": 4, "camera": [1.0] * 6, "note": "é"}
        read = read_array(file, "a")
        assert read.dtype == np.float32 and read.tolist() == [[1.0] * 3] * 4
        assert [one.decode() for one in read_array(file, "words")] == texts.tolist()


@pytest.mark.parametrize(
    ("arrays", "attributes", "message"),
    [
        ({"n": None}, {}, "expected an array n, found a, words$"),
        ({"n": np.arange(5)}, {}, r"n: shape \(5,\), expected \(N = 4\)"),
        ({"words": np.arange(4)}, {}, "words: type int64, expected kind S"),
        ({}, {"count": None}, "attributes: lacks count"),
        ({}, {"count": 0.5}, "attributes: count is 0.5, expected int"),
        ({}, {"version": 2}, "attribute version: expected 1, found 2"),
    ],
)
def test_other_contents_are_refused(tmp_path, arrays, attributes, message):
    path = write(tmp_path / "x.h5", attributes, **arrays)
    with pytest.raises(InputError, match=rf"x\.h5.*{message}"), open_hdf5(path, SCHEMA):
        pass


def test_a_link_to_another_file_is_refused(tmp_path):
    write(tmp_path / "other.h5")
    with h5py.File(write(tmp_path / "x.h5", a=None), "a") as file:
        file["a"] = h5py.ExternalLink("other.h5", "a")
    with pytest.raises(InputError, match=r"x\.h5: a lies in another file"), open_hdf5(tmp_path / "x.h5", SCHEMA):
        pass


def test_a_missing_or_damaged_file_is_refused_with_the_remedy(tmp_path):
    path = write(tmp_path / "x.h5")
    whole = path.read_bytes()
    for size in (0, 100, len(whole) // 2):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match=r"x\.h5: a test cannot be read .*; make it again"), open_hdf5(path, SCHEMA):
            pass
    with pytest.raises(InputError, match="no such file; expected a test"), open_hdf5(tmp_path / "x\0.h5", SCHEMA):
        pass


def test_what_is_read_at_once_is_limited(tmp_path, monkeypatch):
    with h5py.File(write(tmp_path / "x.h5"), "a") as file:
        file.create_dataset("more", (2**40,), "f4", chunks=(1024,))
    with pytest.raises(InputError, match=r"more .* would take 4398\.0 GB"), open_hdf5(tmp_path / "x.h5", SCHEMA) as file:
        read_array(file, "more")
    monkeypatch.setenv(BUDGET_VARIABLE, "1e-8")
    with pytest.raises(InputError, match="would take"), open_hdf5(tmp_path / "x.h5", SCHEMA) as file:
        read_array(file, "a")
