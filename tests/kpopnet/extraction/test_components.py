from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet.extraction.background import BACKGROUND, FAR_M, FLOOR, FOREGROUND, UNMEASURED
from kpopnet.extraction.components import COMPONENT, component_stats, label_image, label_runs

EPSILON_Z = np.array([0.03, 1.5 / 345], np.float32)
INTRINSICS = np.array([40, 42, 11.5, 9.25], np.float32)
PLANE = np.array([0.02, -0.99, -0.14, 1.1], np.float32)

SIZES = st.tuples(st.integers(1, 20), st.integers(1, 27))


@st.composite
def images(draw):
    shape = draw(SIZES)
    depth = draw(arrays(np.float32, shape, elements=st.sampled_from([1.0, 1.03, 1.06, 2.0, 2.04, 2.08, 4.0, 4.09, 4.2])))
    kind = draw(arrays(np.uint8, shape, elements=st.sampled_from([UNMEASURED, FLOOR, BACKGROUND, FOREGROUND, FOREGROUND])))
    return np.where(kind == UNMEASURED, np.float32(0), depth), kind


def similar(a, b):
    return abs(a - b) <= EPSILON_Z[0] + EPSILON_Z[1] * a * b


def neighbours(y, x, shape):
    for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
        if 0 <= v < shape[0] and 0 <= u < shape[1]:
            yield v, u


def reference_labels(depth, wanted, min_pixels):
    """Flood fill, one component at a time."""
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
                if not visited[n] and similar(depth[y, x], depth[n]):
                    visited[n] = True
                    component.append(n)
                    queue.append(n)
        if len(component) >= min_pixels:
            count += 1
            labels[tuple(np.transpose(component))] = count
    return labels, count


def connected(depth, kind, kinds=FOREGROUND, min_pixels=1):
    runs, count = label_runs(depth, kind, kinds, EPSILON_Z, min_pixels)
    return label_image(runs, *depth.shape), count


@given(images(), st.sampled_from([FOREGROUND, BACKGROUND | FOREGROUND]), st.integers(1, 5))
@settings(deadline=None, max_examples=150)
def test_components_equal_the_reference(image, kinds, min_pixels):
    depth, kind = image
    labels, count = connected(depth, kind, kinds, min_pixels)
    expected, expected_count = reference_labels(depth, (kind & kinds) > 0, min_pixels)
    assert count == expected_count
    assert np.array_equal(labels, expected)


def boxes(gap_m, z=2.0):
    depth = np.zeros((60, 80), np.float32)
    depth[10:50, 10:40] = z
    depth[10:50, 40:70] = z + gap_m
    return depth, np.where(depth > 0, np.uint8(FOREGROUND), np.uint8(UNMEASURED))


@pytest.mark.parametrize(("gap_m", "z", "expected"), [(0.2, 2, 2), (0.0, 2, 1), (0.04, 2, 1), (0.08, 2, 2), (0.08, 4, 1)])
def test_two_adjacent_boxes_are_one_object_if_their_depths_agree_within_the_noise(gap_m, z, expected):
    assert connected(*boxes(gap_m, z))[1] == expected


@given(images(), st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=60)
def test_component_stats_equal_the_reference(image, seed):
    depth, kind = image
    rng = np.random.default_rng(seed)
    shape = depth.shape
    background = rng.choice(np.array([1.5, 2.1, 4.5, FAR_M, 30], np.float32), shape)
    before = (
        depth + rng.choice(np.array([0, 0, 0.05, 0.3], np.float32), shape),
        rng.choice(np.array([UNMEASURED, BACKGROUND, FOREGROUND], np.uint8), shape),
        rng.choice(np.array([0, 1, 2, 255], np.uint8), shape),
    )
    runs, count = label_runs(depth, kind, FOREGROUND, EPSILON_Z, 1)
    labels = label_image(runs, *shape)
    arguments = (background, runs, count, PLANE, INTRINSICS, EPSILON_Z, before, 2, np.float32(0.1))
    components, votes = component_stats(depth, kind, FOREGROUND, *arguments)
    assert components.dtype == COMPONENT and len(components) == count + 1 and votes.shape == (count + 1, 3)
    fx, fy, cx, cy = INTRINSICS
    for label in range(1, count + 1):
        y, x = (labels == label).nonzero()
        z, stats = depth[y, x], components[label]
        points = np.stack([z * (x - cx) / fx, z * (y - cy) / fy, z], axis=1)
        heights = points @ PLANE[:3] + PLANE[3]
        ranges = np.stack([points[:, 0], heights, z], axis=1)
        areas = z**2 / (fx * fy)
        occluded = background[y, x] > FAR_M
        assert stats["pixels"] == len(y)
        assert stats["first"].tolist() == [y[0], x[0]]
        assert stats["box"].tolist() == [x.min(), y.min(), x.max() + 1, y.max() + 1]
        assert stats["area_m2"] == pytest.approx(areas.sum(), rel=1e-4)
        assert stats["occluded"] == occluded.sum()
        assert stats["moved_m2"] == pytest.approx(areas[~occluded & (before[1][y, x] == FOREGROUND)].sum(), rel=1e-4)
        assert stats["centre_m"] == pytest.approx(points.mean(axis=0), abs=1e-4)
        assert stats["low_m"] == pytest.approx(ranges.min(axis=0), abs=1e-4)
        assert stats["high_m"] == pytest.approx(ranges.max(axis=0), abs=1e-4)
        outline = touching = 0
        for pixel in zip(y, x, strict=True):
            for n in neighbours(*pixel, shape):
                inside = kind[n] == FOREGROUND and similar(depth[pixel], depth[n])
                outline += not inside
                touching += kind[n] == BACKGROUND and bool(similar(depth[pixel], depth[n]))
        assert (stats["outline"], stats["touching"]) == (outline, touching)
        same = np.abs(z - before[0][y, x]) <= np.float32(0.1)
        assert votes[label].tolist() == [0, *((before[2][y, x] == k)[same].sum() for k in (1, 2))]
