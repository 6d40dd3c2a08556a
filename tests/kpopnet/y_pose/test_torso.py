"""The torso's rectangle, its parts, and mean shift."""

import itertools

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.y_pose.image import (
    MEAN_SHIFT_STARTS,
    Box,
    head_candidates,
    maximal_rectangle,
    mean_pixel,
    six_parts,
    torso_rectangle,
)


def slow_largest_area(person: np.ndarray) -> int:
    height, width = person.shape
    best = 0
    for y0 in range(height):
        for y1 in range(y0 + 1, height + 1):
            for x0 in range(width):
                for x1 in range(x0 + 1, width + 1):
                    if person[y0:y1, x0:x1].all():
                        best = max(best, (y1 - y0) * (x1 - x0))
    return best


@given(arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([True, True, True, False])))
@settings(deadline=None, max_examples=80)
def test_the_maximal_rectangle_is_inside_and_of_maximal_area(person: np.ndarray) -> None:
    found = maximal_rectangle(person)
    assert person[found.pixels].all()
    assert (found.x1 - found.x0) * found.height == slow_largest_area(person)
    torso = torso_rectangle(person)
    assert 0 <= torso.x0 <= torso.x1 <= person.shape[1]
    assert 0 <= torso.y0 <= torso.y1 <= person.shape[0]


def figure(head_half_width: int) -> np.ndarray:
    """Trunk from row 60, narrow in the waist, to the crotch at 130, with head, obliquely raised arms and legs apart."""
    person = np.zeros((240, 200), np.uint8)
    trunk = [(78, 60), (122, 60), (114, 95), (120, 130), (80, 130), (86, 95)]
    cv2.fillPoly(person, [np.array(trunk)], 1)
    person[25:62, 100 - head_half_width : 101 + head_half_width] = 1
    for sign in (-1, 1):
        cv2.line(person, (100 + sign * 20, 66), (100 + sign * 70, 16), 1, 11)
        cv2.line(person, (100 + sign * 13, 120), (100 + sign * 40, 230), 1, 15)
    return person.astype(bool)


@pytest.mark.parametrize("head_half_width", [6, 9, 11, 13])
def test_the_torso_excludes_a_head_of_any_width(head_half_width: int) -> None:
    person = figure(head_half_width)
    torso = torso_rectangle(person)
    assert 56 <= torso.y0 <= 64
    assert 126 <= torso.y1 <= 140
    assert abs(torso.middle_u - 100) <= 2
    if head_half_width == 13:
        assert maximal_rectangle(person).y0 < 40  # without the rule the head is included


def test_parts_are_three_rows_of_two_and_mirror() -> None:
    width = 200
    for x0, x1 in ((80, 120), (80, 121)):
        torso = Box(x0, 60, x1, 130)
        parts = six_parts(torso)
        mirrored = six_parts(Box(width - x1, 60, width - x0, 130))
        for k in range(0, 6, 2):
            left, right = parts[k], parts[k + 1]
            assert left.y0 == right.y0 and left.y1 == right.y1
            assert left.x1 <= torso.middle_u + 0.5 and right.x0 >= torso.middle_u - 0.5
            assert mirrored[k] == Box(width - right.x1, right.y0, width - right.x0, right.y1)
    rows = [parts[k] for k in (0, 2, 4)]
    assert all(above.y1 == below.y0 for above, below in itertools.pairwise(rows))


def test_parts_never_begin_outside_the_image() -> None:
    for part in six_parts(Box(0, 0, 10, 60)):
        assert min(part) >= 0
        assert mean_pixel(np.ones((60, 40), bool), part) is not None or part.x1 <= part.x0 or part.y1 <= part.y0


def test_mean_pixel_uses_only_the_part() -> None:
    mask = np.zeros((20, 20), bool)
    mask[5:8, 4:7] = True
    mask[15, 15] = True
    assert mean_pixel(mask, Box(0, 0, 12, 12)) == pytest.approx([5, 6])
    assert mean_pixel(mask, Box(8, 8, 12, 12)) is None


def test_mean_shift_returns_the_larger_mode_first() -> None:
    ridge = np.zeros((80, 100), bool)
    ridge[18:23, 48:53] = True  # a head
    ridge[40, 44:47] = True  # something at the collar
    ridge[20:25, 5:30] = True  # an arm, outside the search width
    ridge[60:75, 50] = True  # the torso itself
    found = head_candidates(ridge, Box(40, 50, 61, 110), radius_px=8)
    assert found[0] == pytest.approx([50, 20], abs=0.1)
    assert found[1] == pytest.approx([45, 40], abs=0.1)
    assert len(found) == 2


def test_without_ridge_data_above_the_torso_there_is_no_head() -> None:
    assert head_candidates(np.zeros((80, 100), bool), Box(40, 50, 61, 110), 8).shape == (0, 2)
    assert head_candidates(np.ones((80, 100), bool), Box(40, 0, 61, 60), 8).shape == (0, 2)


def test_mean_shift_limits_the_number_of_starts() -> None:
    ridge = np.zeros((200, 200), bool)
    ridge[20:180:2, 70:130:2] = True
    assert 0 < len(head_candidates(ridge, Box(80, 190, 121, 310), 8)) <= MEAN_SHIFT_STARTS
