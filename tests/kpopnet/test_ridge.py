import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kpopnet import ridge
from kpopnet.errors import InputError
from kpopnet.ridge import RidgeConfig, ridge_data, ridge_probability, ridge_stages

CONFIG = RidgeConfig()


def reference_edges(depth, threshold):
    height, width = depth.shape
    edges = np.zeros(depth.shape, bool)
    for y in range(height):
        for x in range(width):
            edges[y, x] = not depth[y, x] > 0
            for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                if 0 <= v < height and 0 <= u < width and 0 < depth[v, u] < depth[y, x] - np.float32(threshold):
                    edges[y, x] = True
    return edges


def reference_distance(edges):
    v, u = edges.nonzero()
    y, x = np.mgrid[: edges.shape[0], : edges.shape[1]]
    if not len(v):
        return np.full(edges.shape, np.inf, np.float32)
    return np.sqrt(((y[..., None] - v) ** 2 + (x[..., None] - u) ** 2).min(-1).astype(np.float32))


def reference_ratio(distance):
    """Eq. (2) computed literally, with the circle drawn point by point; float32 in four sums, in the order of the kernel."""
    height, width = distance.shape
    ratio = np.ones(distance.shape, np.float32)
    for y, x in zip(*((distance > 0) & np.isfinite(distance)).nonzero(), strict=True):
        radius = math.floor(float(distance[y, x]) * 4 + 0.5) / 4
        circle = set()
        for i in range(ridge.CIRCLE_POINTS):
            angle = 2 * math.pi * i / ridge.CIRCLE_POINTS
            circle.add(tuple(round(round(radius * f(angle), 9)) for f in (math.sin, math.cos)))
        values = [
            distance[y + dy, x + dx]
            for dy, dx in sorted(circle)
            if 0 <= y + dy < height and 0 <= x + dx < width
        ]  # fmt: skip
        sums = [np.float32(0)] * 4
        margin = int(distance[y, x]) + 1
        inside = margin <= y < height - margin and margin <= x < width - margin
        whole = len(values) // 4 * 4 if inside else 0
        for i, value in enumerate(values):
            sums[i % 4 if i < whole else 0] += value
        total = (sums[0] + sums[1]) + (sums[2] + sums[3])
        if values:
            ratio[y, x] = total / (np.float32(len(values)) * distance[y, x])
    return ratio


def limb(half_width_px, angle_deg, shift=0.0, size=120):
    """A straight limb across the image, and each pixel's distance from its axis."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    angle = math.radians(angle_deg)
    off = np.abs(x * math.cos(angle) + y * math.sin(angle) + shift)
    return np.where(off <= half_width_px, 2.0, 0).astype(np.float32), off


DEPTHS = arrays(
    np.float32,
    st.tuples(st.integers(1, 24), st.integers(1, 24)),
    elements=st.sampled_from([0, 0, 2, 2, 2, 2, 2.0625, 2.3125]),
)


@given(DEPTHS)
@example(np.pad(np.zeros((1, 1), np.float32), ((0, 4), (0, 12)), constant_values=2))  # circles larger than the image
@settings(deadline=None, max_examples=40)
def test_every_stage_equals_the_reference(depth):
    stages = ridge_stages(depth, CONFIG)
    edges = reference_edges(depth, CONFIG.edge_threshold_m)
    distance = reference_distance(edges)
    ratio = reference_ratio(distance)
    assert np.array_equal(stages.edges, edges)
    assert np.array_equal(stages.distance_px, distance)
    assert np.array_equal(stages.ratio, ratio)
    assert np.array_equal(stages.ridge, ratio <= np.float32(CONFIG.epsilon_r))
    assert np.array_equal(ridge_data(depth, CONFIG), stages.ridge)
    assert np.array_equal(ridge_probability(depth, CONFIG) >= 0.5, stages.ridge)  # one half at the threshold


@pytest.mark.parametrize(("half_width", "angle"), [(3, 0), (4, 17), (9, 63)])
def test_the_default_marks_the_axes_of_limbs_and_the_papers_value_does_not(half_width, angle):
    marked, paper, rows = 0, 0, 0
    depth, off = limb(half_width, angle)
    near_line = off <= max(1.0, 0.4 * half_width)
    ridge_here = ridge_data(depth, CONFIG)
    paper_here = ridge_data(depth, RidgeConfig(epsilon_r=0.3))
    for y in range(30, 90):
        axis = (slice(y, y + 1), slice(None)) if angle <= 45 else (slice(None), slice(y, y + 1))
        rows += 1
        marked += (ridge_here & near_line)[axis].any()
        paper += paper_here[axis].any()
    assert marked > 0.85 * rows
    assert paper < 0.05 * rows
    inner = np.s_[30:90, 30:90]
    assert not (ridge_here[inner] & (off[inner] > max(1.5, 0.6 * half_width))).any()


@given(DEPTHS, st.integers(2, 9), st.integers(2, 9), st.integers(2, 9), st.integers(2, 9))
@settings(deadline=None, max_examples=20)
def test_a_box_has_the_ridge_of_the_whole_image(depth, top, bottom, left, right):
    box = np.pad(depth, 2)
    whole = np.pad(depth, ((top, bottom), (left, right)))
    part = np.s_[top - 2 : top + depth.shape[0] + 2, left - 2 : left + depth.shape[1] + 2]
    assert np.array_equal(ridge_probability(whole, CONFIG)[part], ridge_probability(box, CONFIG))


def test_what_is_no_image_or_setting_is_refused():
    for mistaken, message in (
        (lambda: ridge_data(np.ones((9, 9), np.uint16), CONFIG), "ridge: expected one .* image of floating-point metres"),
        (lambda: ridge_stages(np.ones((9, 9)), 0.55), r"ridge settings: expected a kpopnet\.ridge\.RidgeConfig, got 0\.55"),
        (lambda: RidgeConfig(epsilon_r="0.5"), r"ridge\.epsilon_r='0\.5': expected a number"),
    ):
        with pytest.raises(InputError, match=message):
            mistaken()


def test_distances_end_where_no_limb_is_as_wide():
    """In wide flat images, which take seconds otherwise; an image without any edge has none."""
    depth = np.full((5, 3 * ridge.FARTHEST_PX), 2.0, np.float32)
    assert np.isinf(ridge_stages(depth, CONFIG).distance_px).all()
    depth[:, 0] = 0
    distance_px = ridge_stages(depth, CONFIG).distance_px
    np.testing.assert_array_equal(
        distance_px, np.broadcast_to(np.minimum(np.arange(depth.shape[1]), ridge.FARTHEST_PX), depth.shape)
    )


def test_nan_counts_as_not_measured_and_views_are_accepted():
    depth, _ = limb(6, 0)
    holed = depth.copy()
    holed[depth == 0] = np.nan
    assert np.array_equal(ridge_probability(holed, CONFIG), ridge_probability(depth, CONFIG))
    wide = np.repeat(depth, 2, axis=1)[:, ::2].astype(np.float64)
    assert np.array_equal(ridge_probability(wide, CONFIG), ridge_probability(depth, CONFIG))
