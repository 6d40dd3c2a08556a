"""Ratings on the disk: the order in which a rater sees pairs, and files that are damaged or hostile."""

import json
from collections import Counter
from dataclasses import replace

import pytest

from kpopnet.datasets.dances.ratings import all_pairs, ratings_path, read_all_ratings, read_ratings, write_ratings
from kpopnet.errors import InputError

DANCES = {f"dance_{index}": ["ann", "bo", "cy", "di"] for index in range(20)}


@pytest.mark.parametrize("rater", ["eve", "fay", "gil"])
def test_every_pair_is_shown_once_and_one_of_each_dance_again_with_sides_swapped(rater):
    pairs = all_pairs(DANCES, rater, 0)
    first, again = ([one for one in pairs if one.repeat is repeat] for repeat in (False, True))
    assert len({one.pair for one in pairs}) == len(pairs) and Counter(one.dance for one in first) == dict.fromkeys(DANCES, 6)
    assert Counter(one.dance for one in again) == dict.fromkeys(DANCES, 1)
    places = {one.pair: number for number, one in enumerate(pairs)}
    for one in again:
        before = places[one.dance, one.pair[1], False]
        assert (pairs[before].left, pairs[before].right) == (one.right, one.left)
        assert places[one.pair] - before >= (5 if one is pairs[-1] else 8)  # no person remembers many pairs


def test_orders_differ_between_raters_and_seeds_and_not_between_runs():
    orders = [all_pairs(DANCES, rater, seed) for rater, seed in (("eve", 0), ("eve", 1), ("fay", 0), ("eve", 0))]
    assert orders[0] == orders[3] and orders[0] != orders[1] and orders[0] != orders[2]
    lefts = Counter(one.left for one in orders[0] if {one.left, one.right} == {"ann", "bo"})
    assert 5 <= lefts["ann"] <= 16  # of 20 or 21


def test_a_dance_of_one_learner_has_no_pairs_and_a_seed_is_a_whole_number():
    with pytest.raises(InputError, match="dance solo: expected two learners or more, found 1"):
        all_pairs({"solo": ["ann"]}, "eve", 0)
    for seed in (-1, "0", 1.5):
        with pytest.raises(InputError, match=f"seed={seed!r} must be a whole number"):
            all_pairs(DANCES, "eve", seed)


def test_a_folder_may_be_text(tmp_path):
    write_ratings(ratings_path(str(tmp_path), "eve"), [])
    assert read_ratings(str(tmp_path / "ratings" / "eve.json"), DANCES) == []
    assert read_all_ratings(str(tmp_path), DANCES) == {"eve": []}
    with pytest.raises(InputError, match="expected the path of a file or folder, got None"):
        read_all_ratings(None, DANCES)


def test_what_is_written_is_read_again(tmp_path):
    (tmp_path / "set").mkdir()
    answers = [replace(one, choice="equal") for one in all_pairs(DANCES, "Ève 2", 0)[:30]]
    write_ratings(ratings_path(tmp_path / "set", "Ève 2"), answers)
    assert read_all_ratings(tmp_path / "set", DANCES) == {"Ève 2": answers}
    assert read_ratings(ratings_path(tmp_path / "set", "fay"), DANCES) == []
    with pytest.raises(InputError, match="no ratings yet"):
        read_all_ratings(tmp_path, DANCES)


ANSWER = {"dance": "dance_0", "left": "ann", "right": "bo", "repeat": False, "choice": "left"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not valid JSON"),
        ({"format": "other"}, "expected format kpopnet ratings"),
        ({"rater": "fay"}, "rater: expected eve"),
        ({"answers": [ANSWER | {"choice": "best"}]}, "answer 0: choice: expected one of left"),
        ({"answers": [ANSWER | {"dance": "../../etc"}]}, "two learners of a dance of this set"),
        ({"answers": [ANSWER, ANSWER | {"left": "bo", "right": "ann"}]}, "answer 1: expected a new pair"),
    ],
)
def test_hostile_files_are_refused_in_one_line(tmp_path, text, message):
    path = ratings_path(tmp_path, "eve")
    write_ratings(path, [])
    path.write_text(text if isinstance(text, str) else json.dumps(json.loads(path.read_text()) | text))
    with pytest.raises(InputError, match=message) as caught:
        read_ratings(path, DANCES)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


@pytest.mark.parametrize("name", ["eve 2", "Zoé", "Zoe\u0301", "พิมพ์", "नीता"])
def test_names_of_any_script_are_names(tmp_path, name):
    path = ratings_path(tmp_path, name)
    write_ratings(path, [])
    assert path.stem == name and read_ratings(path, DANCES) == []


@pytest.mark.parametrize("name", ["", "../eve", ".eve", "eve\n", "a\\b", "x" * 300, None, 3])
def test_what_is_no_name_never_becomes_a_path(tmp_path, name):
    with pytest.raises(InputError, match="a rater's name"):
        ratings_path(tmp_path, name)
