import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.extraction.room import (
    COVERED_M,
    FAR_M,
    FLOOR,
    FOREGROUND,
    LEARNING,
    NOBODY,
    NOTHING,
    ROOM,
    UNCOVERED,
    forget_human,
    is_picture,
    learn,
    sort_pixels,
)

EPSILON = np.array([0.01, 2 / 345], np.float32)
DELTA = np.array([0.005, 0.01], np.float32)
PLANE = np.array([0.05, -0.98, -0.19, 1.0], np.float32)
PLANE[:3] /= np.linalg.norm(PLANE[:3])
INTRINSICS = np.array([12, 13, 4.5, 3.0], np.float32)

SHAPES = st.tuples(st.integers(1, 12), st.integers(1, 19))
RAW = st.sampled_from([0, -1, np.nan, np.inf, 0.9, 1.5, 1.52, 2.0, 3.0, 19.9, 25.0])


def sort(raw, room, plane=PLANE, delta=DELTA):
    depth, kind = np.full(raw.shape, -7, np.float32), np.full(raw.shape, 77, np.uint8)
    sort_pixels(raw, room, plane, delta, EPSILON, INTRINSICS, depth, kind)
    return depth, kind


@given(st.data(), st.booleans())
@settings(deadline=None, max_examples=100)
def test_sorting_equals_its_slow_twin(data, has_floor):
    shape = data.draw(SHAPES)
    raw = data.draw(arrays(np.float32, shape, elements=RAW))
    room = data.draw(arrays(np.float32, shape, elements=st.sampled_from([1.4, 1.6, 2.1, 3.5, FAR_M, COVERED_M])))
    depth, kind = sort(raw, room, PLANE, DELTA if has_floor else 0 * DELTA)
    fx, fy, cx, cy = INTRINSICS
    for y, x in np.ndindex(shape):
        z = raw[y, x]
        if not 0 < z < FAR_M:
            assert depth[y, x] == 0 and kind[y, x] == NOTHING
            continue
        height_m = z * np.dot(PLANE[:3], [(x - cx) / fx, (y - cy) / fy, 1]) + PLANE[3]
        known = min(room[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].min(), FAR_M if x in (0, shape[1] - 1) else np.inf)
        thickness_m = DELTA[0] + DELTA[1] * z
        if abs(height_m - thickness_m) < 1e-5:
            continue
        expected = FOREGROUND if z + EPSILON[0] + EPSILON[1] * z * z < known else ROOM
        assert depth[y, x] == z
        assert kind[y, x] == (FLOOR if has_floor and height_m < thickness_m else expected)


def learned(z, known, kind=ROOM, owner=NOBODY):
    room = np.full((1, 1), known, np.float32)
    learn(np.full((1, 1), z, np.float32), np.full((1, 1), kind, np.uint8), np.full((1, 1), owner, np.uint8), room, EPSILON)
    return room[0, 0]


@pytest.mark.parametrize(
    ("z", "known", "kind", "owner", "expected"),
    [
        (3.02, 3.0, ROOM, NOBODY, 3.0 + 0.02 * LEARNING),  # noise: the mean over the last pictures
        (4.0, 3.0, ROOM, NOBODY, 4.0),  # farther: at once
        (2.0, 3.0, FOREGROUND, NOBODY, 3.0 - LEARNING),  # something that stays in front: slowly
        (2.0, 3.0, FOREGROUND, 1, 3.0),  # somebody: never
        (2.0, COVERED_M, FOREGROUND, NOBODY, COVERED_M),  # may be a part of somebody
        (2.0, COVERED_M, FOREGROUND, UNCOVERED, 2.0),  # room for sure
        (2.0, FAR_M, FOREGROUND, 3, FAR_M),
        (0.0, 3.0, NOTHING, NOBODY, 3.0),
        (3.0, 3.0, FLOOR, NOBODY, 3.0),
        (3.5, 2.0, FLOOR, NOBODY, FAR_M),  # what was before the floor is gone
    ],
)
def test_what_is_learned(z, known, kind, owner, expected):
    assert learned(z, known, kind, owner) == pytest.approx(expected, abs=1e-5)


def test_a_chair_that_was_moved_is_learned_in_some_seconds_and_not_at_once():
    room, z = np.full((1, 1), 4, np.float32), np.full((1, 1), 3, np.float32)
    frames = 0
    while sort(z, room, 0 * PLANE, 0 * DELTA)[1][0, 0] == FOREGROUND:
        learn(z, np.full((1, 1), FOREGROUND, np.uint8), np.zeros((1, 1), np.uint8), room, EPSILON)
        frames += 1
    assert 30 < frames < 150


def test_a_person_who_was_room_is_forgotten_with_ragged_outline_and_shadow():
    depth = np.full((40, 60), 4, np.float32)
    silhouette = np.zeros((40, 60), bool)
    silhouette[10:30, 20:30] = True
    depth[silhouette] = 2
    depth[12, 31] = 2.05  # a speck beside them
    depth[15:20, 17:20] = 0  # their shadow
    room = np.where(depth > 0, depth, np.float32(FAR_M))
    room[20, 18] = 2.05  # where their outline was in a picture before
    forget_human(room, depth, silhouette, focal_px=50)
    assert (room[silhouette] == COVERED_M).all()
    assert room[12, 31] == room[20, 18] == COVERED_M
    assert (room[15:20, 17:20] == COVERED_M).all()
    others = ~silhouette & (depth == 4)
    others[20, 18] = False
    assert (room[others] == 4).all()


def test_pictures_and_what_is_none():
    rng = np.random.default_rng(0)
    ramp = np.tile(np.linspace(1, 5, 64, dtype=np.float32), (48, 1))
    assert is_picture(ramp)
    assert is_picture(np.where(rng.random(ramp.shape) < 0.3, np.float32(0), ramp))
    assert not is_picture(np.zeros((48, 64), np.float32))
    assert not is_picture(np.full((48, 64), np.nan, np.float32))
    assert not is_picture((rng.integers(0, 65536, (48, 64)) / 1000).astype(np.float32))
    assert not is_picture(np.full((1, 1), 2, np.float32))
