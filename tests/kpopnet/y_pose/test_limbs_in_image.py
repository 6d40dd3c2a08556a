"""Hough lines, dominant lines, and the resulting limb."""

import itertools

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.y_pose.image import MIN_BEND_RAD, Box, dominant_lines, find_limb, hough_lines

WHOLE = Box(0, 0, 160, 160)


def draw_limb(*points: tuple[float, float], thickness: int = 11) -> tuple[np.ndarray, np.ndarray]:
    """Silhouette and ridge data of a limb through these points."""
    person = np.zeros((160, 160), np.uint8)
    for a, b in itertools.pairwise(points):
        cv2.line(person, tuple(np.rint(a).astype(int).tolist()), tuple(np.rint(b).astype(int).tolist()), 1, thickness)
    return person.astype(bool), ridge_data(person.astype(np.float32) * 2, RidgeConfig())


def along(start: np.ndarray, angle_deg: float, length: float) -> np.ndarray:
    return start + length * np.array([np.cos(np.radians(angle_deg)), -np.sin(np.radians(angle_deg))])


# The votes of a line halfway between two offset bins are split.
@given(st.floats(-170, 170), st.floats(-10, 10).filter(lambda offset: abs(offset % 1 - 0.5) > 0.01))
@settings(deadline=None, max_examples=40)
def test_the_strongest_line_passes_through_the_points(angle_deg: float, offset: float) -> None:
    direction = np.array([np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))])
    normal = np.array([-direction[1], direction[0]])
    points = np.arange(-30, 31)[:, None] * direction + offset * normal
    lines, votes = hough_lines(points, direction)
    best = lines[np.argmax(votes)]
    assert votes.max() == 61
    # The same line: angle within one step, offset within one pixel.
    assert np.array([np.cos(best[0]), np.sin(best[0])]) @ normal > np.cos(np.radians(2))
    assert best[1] == pytest.approx(offset, abs=1)


def test_two_clusters_of_lines_are_separated_and_weighted_by_votes() -> None:
    lines = np.array([[0.0, 1.0], [0.1, 2.0], [0.8, -3.0], [0.9, -4.0]])
    dominant = dominant_lines(lines, np.array([1, 3, 2, 2]), half_length_px=30)
    assert dominant == pytest.approx(np.array([[0.075, 1.75], [0.85, -3.5]]))
    single = dominant_lines(lines[:1], np.array([5]), half_length_px=30)
    assert single == pytest.approx(np.array([[0, 1], [0, 1]]))


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
    # The first line passes through the root.
    normal = np.array([np.cos(limb.dominant[0, 0]), np.sin(limb.dominant[0, 0])])
    assert abs(normal @ (root - limb.origin) - limb.dominant[0, 1]) < 5


@pytest.mark.parametrize("angle_deg", [0, 25, 45, 65, 90, 135, -80])
@pytest.mark.parametrize("fraction", [0.4, 0.51])
def test_a_straight_limb_is_divided_at_its_fraction(angle_deg: float, fraction: float) -> None:
    root = np.array([80.0, 80.0])
    hand = along(root, angle_deg, 70)
    limb = find_limb(*draw_limb(root, hand), WHOLE, root, end_px=12, upper_fraction=fraction)
    assert not limb.crossed
    assert limb.middle == pytest.approx(root + fraction * (limb.end - root), abs=2.5)
    assert abs(limb.dominant[0, 0] - limb.dominant[1, 0]) <= MIN_BEND_RAD
