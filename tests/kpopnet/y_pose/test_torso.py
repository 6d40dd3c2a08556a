"""The torso's rectangle, its parts, and mean shift."""

import itertools

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.y_pose.image import (
    Box,
    head_candidates,
    maximal_rectangle,
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
