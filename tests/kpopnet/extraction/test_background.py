import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.extraction.background import (
    BACKGROUND,
    FAR_M,
    FLOOR,
    FOREGROUND,
    LEARNING_RATE,
    NO_PERSON,
    OCCLUDED_M,
    UNCOVERED,
    UNMEASURED,
    classify_pixels,
    is_depth_image,
    remove_person,
    update_background,
)

EPSILON = np.array([0.01, 2 / 345], np.float32)
DELTA = np.array([0.005, 0.01], np.float32)
PLANE = np.array([0.05, -0.98, -0.19, 1.0], np.float32)
PLANE[:3] /= np.linalg.norm(PLANE[:3])
INTRINSICS = np.array([12, 13, 4.5, 3.0], np.float32)

SHAPES = st.tuples(st.integers(1, 12), st.integers(1, 19))
RAW = st.sampled_from([0, -1, np.nan, np.inf, 0.9, 1.5, 1.52, 2.0, 3.0, 19.9, 25.0])


def classify(raw, background, plane=PLANE, delta=DELTA):
    depth, kind = np.full(raw.shape, -7, np.float32), np.full(raw.shape, 77, np.uint8)
    classify_pixels(raw, background, plane, delta, EPSILON, INTRINSICS, depth, kind)
    return depth, kind


@given(st.data(), st.booleans())
@settings(deadline=None, max_examples=100)
def test_classification_equals_the_reference(data, has_floor):
    shape = data.draw(SHAPES)
    raw = data.draw(arrays(np.float32, shape, elements=RAW))
    background = data.draw(arrays(np.float32, shape, elements=st.sampled_from([1.4, 1.6, 2.1, 3.5, FAR_M, OCCLUDED_M])))
    depth, kind = classify(raw, background, PLANE, DELTA if has_floor else 0 * DELTA)
    fx, fy, cx, cy = INTRINSICS
    for y, x in np.ndindex(shape):
        z = raw[y, x]
        if not 0 < z < FAR_M:
            assert depth[y, x] == 0 and kind[y, x] == UNMEASURED
            continue
        height_m = z * np.dot(PLANE[:3], [(x - cx) / fx, (y - cy) / fy, 1]) + PLANE[3]
        known = min(background[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].min(), FAR_M if x in (0, shape[1] - 1) else np.inf)
        thickness_m = DELTA[0] + DELTA[1] * z
        if abs(height_m - thickness_m) < 1e-5:
            continue
        expected = FOREGROUND if z + EPSILON[0] + EPSILON[1] * z * z < known else BACKGROUND
        assert depth[y, x] == z
        assert kind[y, x] == (FLOOR if has_floor and height_m < thickness_m else expected)


def updated(z, known, kind=BACKGROUND, owner=NO_PERSON):
    background = np.full((1, 1), known, np.float32)
    update_background(
        np.full((1, 1), z, np.float32), np.full((1, 1), kind, np.uint8), np.full((1, 1), owner, np.uint8), background, EPSILON
    )
    return background[0, 0]


@pytest.mark.parametrize(
    ("z", "known", "kind", "owner", "expected"),
    [
        (3.02, 3.0, BACKGROUND, NO_PERSON, 3.0 + 0.02 * LEARNING_RATE),  # noise: the running mean over the last images
        (4.0, 3.0, BACKGROUND, NO_PERSON, 4.0),  # farther: replaced at once
        (2.0, 3.0, FOREGROUND, NO_PERSON, 3.0 - LEARNING_RATE),  # an object that stays in front: slowly
        (2.0, 3.0, FOREGROUND, 1, 3.0),  # a person: never
        (2.0, OCCLUDED_M, FOREGROUND, NO_PERSON, OCCLUDED_M),  # may be a part of a person
        (2.0, OCCLUDED_M, FOREGROUND, UNCOVERED, 2.0),  # certainly background
        (2.0, FAR_M, FOREGROUND, 3, FAR_M),
        (0.0, 3.0, UNMEASURED, NO_PERSON, 3.0),
        (3.0, 3.0, FLOOR, NO_PERSON, 3.0),
        (3.5, 2.0, FLOOR, NO_PERSON, FAR_M),  # the object in front of the floor is gone
    ],
)
def test_background_update(z, known, kind, owner, expected):
    assert updated(z, known, kind, owner) == pytest.approx(expected, abs=1e-5)


def test_a_moved_chair_is_learned_within_seconds_but_not_at_once():
    background, z = np.full((1, 1), 4, np.float32), np.full((1, 1), 3, np.float32)
    frames = 0
    while classify(z, background, 0 * PLANE, 0 * DELTA)[1][0, 0] == FOREGROUND:
        update_background(z, np.full((1, 1), FOREGROUND, np.uint8), np.zeros((1, 1), np.uint8), background, EPSILON)
        frames += 1
    assert 30 < frames < 150


def test_a_learned_person_is_removed_with_noisy_outline_and_shadow():
    depth = np.full((40, 60), 4, np.float32)
    silhouette = np.zeros((40, 60), bool)
    silhouette[10:30, 20:30] = True
    depth[silhouette] = 2
    depth[12, 31] = 2.05  # a noisy pixel beside them
    depth[15:20, 17:20] = 0  # their shadow
    background = np.where(depth > 0, depth, np.float32(FAR_M))
    background[20, 18] = 2.05  # where their outline was in an earlier image
    remove_person(background, depth, silhouette, focal_px=50)
    assert (background[silhouette] == OCCLUDED_M).all()
    assert background[12, 31] == background[20, 18] == OCCLUDED_M
    assert (background[15:20, 17:20] == OCCLUDED_M).all()
    others = ~silhouette & (depth == 4)
    others[20, 18] = False
    assert (background[others] == 4).all()


def test_depth_images_and_corrupt_ones():
    rng = np.random.default_rng(0)
    ramp = np.tile(np.linspace(1, 5, 64, dtype=np.float32), (48, 1))
    assert is_depth_image(ramp)
    assert is_depth_image(np.where(rng.random(ramp.shape) < 0.3, np.float32(0), ramp))
    assert not is_depth_image(np.zeros((48, 64), np.float32))
    assert not is_depth_image(np.full((48, 64), np.nan, np.float32))
    assert not is_depth_image((rng.integers(0, 65536, (48, 64)) / 1000).astype(np.float32))
    assert not is_depth_image(np.full((1, 1), 2, np.float32))
