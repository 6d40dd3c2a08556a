"""The image of a person in the Y pose: the torso's rectangle and its parts, mean shift, Hough lines and limbs."""

import itertools

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.y_pose.image import (
    Box,
    find_limb,
    maximal_rectangle,
    torso_rectangle,
)

WHOLE = Box(0, 0, 160, 160)


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


def draw_limb(*points: tuple[float, float], thickness: int = 11) -> tuple[np.ndarray, np.ndarray]:
    """Silhouette and ridge data of a limb through these points."""
    person = np.zeros((160, 160), np.uint8)
    for a, b in itertools.pairwise(points):
        cv2.line(person, tuple(np.rint(a).astype(int).tolist()), tuple(np.rint(b).astype(int).tolist()), 1, thickness)
    return person.astype(bool), ridge_data(person.astype(np.float32) * 2, RidgeConfig())


def along(start: np.ndarray, angle_deg: float, length: float) -> np.ndarray:
    return start + length * np.array([np.cos(np.radians(angle_deg)), -np.sin(np.radians(angle_deg))])


@pytest.mark.parametrize("angle_deg", [10, 35, 60, 120, 160, -100, -70])
def test_the_middle_of_a_bent_limb_is_at_the_bend(angle_deg: float) -> None:
    root = np.array([80.0, 80.0])
    elbow = along(root, angle_deg - 20, 34)
    hand = along(elbow, angle_deg + 20, 36)
    limb = find_limb(*draw_limb(root, elbow, hand), WHOLE, root, end_px=12, upper_fraction=0.4)
    assert limb.crossed
    assert limb.middle == pytest.approx(elbow, abs=4)
    assert np.linalg.norm(limb.tip - hand) < 10
    assert np.linalg.norm(limb.end - hand) < 8


@pytest.mark.parametrize("angle_deg", [0, 25, 45, 65, 90, 135, -80])
@pytest.mark.parametrize("fraction", [0.4, 0.51])
def test_a_straight_limb_is_divided_at_its_fraction(angle_deg: float, fraction: float) -> None:
    root = np.array([80.0, 80.0])
    hand = along(root, angle_deg, 70)
    limb = find_limb(*draw_limb(root, hand), WHOLE, root, end_px=12, upper_fraction=fraction)
    assert not limb.crossed
    assert limb.middle == pytest.approx(root + fraction * (limb.end - root), abs=2.5)
