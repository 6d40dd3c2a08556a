"""The image of a person in the Y pose: the torso's rectangle and its parts, mean shift, Hough lines and limbs."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.y_pose.image import (
    maximal_rectangle,
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
