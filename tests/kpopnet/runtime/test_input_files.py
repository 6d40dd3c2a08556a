"""JSON, npy and files of libraries are checked against what is declared, and refused in one line."""

import io
import math
import tracemalloc
from dataclasses import dataclass, field

import numpy as np
import pytest

from kpopnet.errors import InputError
from kpopnet.runtime.input_files import ArraySchema, names_in, open_npy, parse_json, read_text, settings_from


@dataclass
class Settings:
    name: str
    size: float = 1.0
    count: int | None = None
    widths: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.size < 0:
            raise InputError("size is negative")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({}, "f: lacks name"),
        ({"name": "a", "colour": 1}, "f: has settings unknown to this version: colour"),
        ({"name": 1}, "f: name is 1, expected str"),
        ({"name": "a", "size": True}, "f: size is True, expected float"),
        ({"name": "a", "count": 1.5}, r"f: count is 1.5, expected int \| None"),
        ({"name": "a", "widths": [1, None]}, r"f: widths is \[1, None\], expected list\[int\]"),
        ({"name": "a", "size": -1}, "f: size is negative"),
    ],
)
def test_settings_are_made_of_json_and_other_values_are_refused(value, message):
    assert settings_from(Settings, {"name": "a", "size": 2, "widths": [1]}, "f") == Settings("a", 2, None, [1])
    with pytest.raises(InputError, match=message):
        settings_from(Settings, value, "f")


def test_nan_and_infinity_are_numbers_only_where_they_are_allowed():
    assert math.isnan(parse_json("[NaN]", "f", non_finite=True)[0])
    assert parse_json("-Infinity", "f", non_finite=True) == -math.inf
    for text in ("NaN", "Infinity", "1e999"):
        with pytest.raises(InputError, match="not a finite number"):
            parse_json(text, "f", non_finite=text == "1e999")


def test_the_largest_integers_and_the_deepest_brackets_are_read_and_no_larger_and_deeper_ones():
    for number in (2**64 - 1, -(2**63)):
        assert parse_json(str(number), "f") == number
    for number in (2**64, -(2**63) - 1):
        with pytest.raises(InputError, match="does not fit into 64 bits"):
            parse_json(str(number), "f")
    assert parse_json("[" * 64 + "]" * 64, "f")
    with pytest.raises(InputError, match="at most 64 levels"):
        parse_json("[" * 65 + "]" * 65, "f")


def test_of_many_names_ten_are_listed():
    assert names_in(map(str, range(10))) == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9"
    assert names_in(map(str, range(13))).endswith("8, 9 and 3 more")


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((2, 4)), r"shape \(2, 4\), expected \(any, 3\)"),
        (np.zeros((0, 3)), "not empty"),
        (np.zeros((2, 3), complex), "type complex128"),
        (np.array([[{}]], object), "not a readable"),
    ],
)
def test_another_array_is_refused(tmp_path, array, message):
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(InputError, match=message):
        open_npy(tmp_path / "a.npy", ArraySchema("fu", (None, 3)))


def test_an_array_is_mapped_as_it_was_saved_and_refused_if_cut_off_or_one_of_several(tmp_path):
    path = tmp_path / "a.npy"
    for array in (np.arange(6.0).reshape(2, 3), np.asfortranarray(np.arange(6, dtype=np.uint16).reshape(2, 3))):
        np.save(path, array)
        np.testing.assert_array_equal(open_npy(path, ArraySchema("fu", (None, 3))), array)
    whole, several = path.read_bytes(), io.BytesIO()
    np.savez(several, np.zeros((2, 3)))
    for content in (whole[:-1], several.getvalue(), b"text"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="not a readable") as caught:
            open_npy(path, ArraySchema("fu", (None, 3)))
        assert "pickle" not in str(caught.value)  # numpy's advice for what is no .npy file


def test_more_values_than_memory_holds_are_refused_before_they_are_made():
    text = "[" + "[]," * 3_000_000 + "0]"
    tracemalloc.start()
    with pytest.raises(InputError, match="expected at most 8,000,000 values"):
        parse_json(text, "a.json")
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


def test_text_that_a_spreadsheet_saved_begins_without_its_mark(tmp_path):
    (tmp_path / "labels.csv").write_bytes(b"\xef\xbb\xbflearner,rank\n")
    assert read_text(tmp_path / "labels.csv") == "learner,rank\n"
