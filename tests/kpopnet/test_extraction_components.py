from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.extraction.components import PIECE, connect, label_image, survey
from kpopnet.extraction.room import FAR_M, FLOOR, FOREGROUND, NOTHING, ROOM

EPSILON_Z = np.array([0.03, 1.5 / 345], np.float32)
INTRINSICS = np.array([40, 42, 11.5, 9.25], np.float32)
PLANE = np.array([0.02, -0.99, -0.14, 1.1], np.float32)

SIZES = st.tuples(st.integers(1, 20), st.integers(1, 27))


@st.composite
def pictures(draw):
    shape = draw(SIZES)
    depth = draw(arrays(np.float32, shape, elements=st.sampled_from([1.0, 1.03, 1.06, 2.0, 2.04, 2.08, 4.0, 4.09, 4.2])))
    kind = draw(arrays(np.uint8, shape, elements=st.sampled_from([NOTHING, FLOOR, ROOM, FOREGROUND, FOREGROUND])))
    return np.where(kind == NOTHING, np.float32(0), depth), kind


def alike(a, b):
    return abs(a - b) <= EPSILON_Z[0] + EPSILON_Z[1] * a * b


def neighbours(y, x, shape):
    for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
        if 0 <= v < shape[0] and 0 <= u < shape[1]:
            yield v, u


def slow_labels(depth, wanted, least_pixels):
    """Floods one component after the other."""
    labels, count = np.zeros(depth.shape, np.int32), 0
    visited = ~wanted
    for start in zip(*wanted.nonzero(), strict=True):
        if visited[start]:
            continue
        component, queue = [start], deque([start])
        visited[start] = True
        while queue:
            y, x = queue.popleft()
            for n in neighbours(y, x, depth.shape):
                if not visited[n] and alike(depth[y, x], depth[n]):
                    visited[n] = True
                    component.append(n)
                    queue.append(n)
        if len(component) >= least_pixels:
            count += 1
            labels[tuple(np.transpose(component))] = count
    return labels, count


def connected(depth, kind, kinds=FOREGROUND, least_pixels=1):
    runs, count = connect(depth, kind, kinds, EPSILON_Z, least_pixels)
    return label_image(runs, *depth.shape), count


@given(pictures(), st.sampled_from([FOREGROUND, ROOM | FOREGROUND]), st.integers(1, 5))
@settings(deadline=None, max_examples=150)
def test_components_equal_their_slow_twins(picture, kinds, least_pixels):
    depth, kind = picture
    labels, count = connected(depth, kind, kinds, least_pixels)
    slow, slow_count = slow_labels(depth, (kind & kinds) > 0, least_pixels)
    assert count == slow_count
    assert np.array_equal(labels, slow)


@given(pictures())
@settings(deadline=None, max_examples=60)
def test_the_mirrored_picture_has_the_mirrored_components(picture):
    depth, kind = picture
    labels, count = connected(depth, kind)
    for flip in (np.fliplr, np.flipud):
        again, same = connected(np.ascontiguousarray(flip(depth)), np.ascontiguousarray(flip(kind)))
        assert same == count
        pairs = set(zip(labels.ravel().tolist(), flip(again).ravel().tolist(), strict=True))
        assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def boxes(gap_m, z=2.0):
    depth = np.zeros((60, 80), np.float32)
    depth[10:50, 10:40] = z
    depth[10:50, 40:70] = z + gap_m
    return depth, np.where(depth > 0, np.uint8(FOREGROUND), np.uint8(NOTHING))


@pytest.mark.parametrize(("gap_m", "z", "expected"), [(0.2, 2, 2), (0.0, 2, 1), (0.04, 2, 1), (0.08, 2, 2), (0.08, 4, 1)])
def test_two_touching_boxes_are_one_object_if_their_depth_is_the_same_within_the_noise(gap_m, z, expected):
    assert connected(*boxes(gap_m, z))[1] == expected


def test_a_slope_is_one_object_however_deep_it_goes():
    depth = np.tile(np.linspace(1, 4, 100, dtype=np.float32), (30, 1))
    assert connected(depth, np.full(depth.shape, FOREGROUND, np.uint8))[1] == 1


def test_a_spiral_takes_many_unions_and_is_one():
    kind = np.zeros((41, 41), np.uint8)
    for ring in range(0, 20, 4):
        kind[ring : 41 - ring, ring] = kind[ring, ring : 41 - ring] = FOREGROUND
        kind[40 - ring, ring : 41 - ring] = kind[ring + 2 : 41 - ring, 40 - ring] = FOREGROUND
        kind[ring + 2, ring + 4 : 41 - ring] = FOREGROUND
        kind[ring + 2 : ring + 5, ring + 4] = FOREGROUND
    depth = np.where(kind > 0, np.float32(2), np.float32(0))
    labels, count = connected(depth, kind)
    assert (labels > 0).sum() == (kind > 0).sum() and count == slow_labels(depth, kind > 0, 1)[1] == 1


@given(pictures(), st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=60)
def test_the_survey_equals_its_slow_twin(picture, seed):
    depth, kind = picture
    rng = np.random.default_rng(seed)
    shape = depth.shape
    room = rng.choice(np.array([1.5, 2.1, 4.5, FAR_M, 30], np.float32), shape)
    before = (
        depth + rng.choice(np.array([0, 0, 0.05, 0.3], np.float32), shape),
        rng.choice(np.array([NOTHING, ROOM, FOREGROUND], np.uint8), shape),
        rng.choice(np.array([0, 1, 2, 255], np.uint8), shape),
    )
    runs, count = connect(depth, kind, FOREGROUND, EPSILON_Z, 1)
    labels = label_image(runs, *shape)
    arguments = (room, runs, count, PLANE, INTRINSICS, EPSILON_Z, before, 2, np.float32(0.1))
    pieces, votes = survey(depth, kind, FOREGROUND, *arguments)
    assert pieces.dtype == PIECE and len(pieces) == count + 1 and votes.shape == (count + 1, 3)
    fx, fy, cx, cy = INTRINSICS
    for label in range(1, count + 1):
        y, x = (labels == label).nonzero()
        z, piece = depth[y, x], pieces[label]
        points = np.stack([z * (x - cx) / fx, z * (y - cy) / fy, z], axis=1)
        heights = points @ PLANE[:3] + PLANE[3]
        ranges = np.stack([points[:, 0], heights, z], axis=1)
        areas = z**2 / (fx * fy)
        covered = room[y, x] > FAR_M
        assert piece["pixels"] == len(y)
        assert piece["first"].tolist() == [y[0], x[0]]
        assert piece["box"].tolist() == [x.min(), y.min(), x.max() + 1, y.max() + 1]
        assert piece["area_m2"] == pytest.approx(areas.sum(), rel=1e-4)
        assert piece["covered"] == covered.sum()
        assert piece["moved_m2"] == pytest.approx(areas[~covered & (before[1][y, x] == FOREGROUND)].sum(), rel=1e-4)
        assert piece["centre_m"] == pytest.approx(points.mean(axis=0), abs=1e-4)
        assert piece["low_m"] == pytest.approx(ranges.min(axis=0), abs=1e-4)
        assert piece["high_m"] == pytest.approx(ranges.max(axis=0), abs=1e-4)
        outline = touching = 0
        for pixel in zip(y, x, strict=True):
            for n in neighbours(*pixel, shape):
                inside = kind[n] == FOREGROUND and alike(depth[pixel], depth[n])
                outline += not inside
                touching += kind[n] == ROOM and bool(alike(depth[pixel], depth[n]))
        assert (piece["outline"], piece["touching"]) == (outline, touching)
        same = np.abs(z - before[0][y, x]) <= np.float32(0.1)
        assert votes[label].tolist() == [0, *((before[2][y, x] == k)[same].sum() for k in (1, 2))]
