"""Connected components against a graph of pixels, and what is measured of an object against boxes of known size."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kpopnet.camera import Camera
from kpopnet.paper_extraction.objects import EPSILON_Z_PER_M2, label_components, measure_objects

CAMERA = Camera(100.0, 80.0, 9.5, 7.0, 24, 18)
INTRINSICS = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy], np.float32)
EPSILON_Z_M = np.float32(0.03)


def labels_of_graph(depth_m: np.ndarray) -> np.ndarray:
    """The slow twin: pixels are nodes, similar neighbours are edges; labels in the order of first pixels."""
    nodes = np.arange(depth_m.size).reshape(depth_m.shape)
    edges = []
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        z, other = depth_m[a], depth_m[b]
        similar = (z > 0) & (other > 0) & (np.abs(z - other) <= EPSILON_Z_M + EPSILON_Z_PER_M2 * z * other)
        edges.append(np.stack([nodes[a][similar], nodes[b][similar]]))
    row, column = np.concatenate(edges, axis=1)
    _, found = connected_components(coo_array((np.ones(len(row)), (row, column)), shape=(depth_m.size,) * 2), directed=False)
    labels, numbers = np.zeros(depth_m.size, int), {}
    for pixel in np.flatnonzero(depth_m.ravel()):
        labels[pixel] = numbers.setdefault(found[pixel], len(numbers) + 1)
    return labels.reshape(depth_m.shape)


def comb() -> np.ndarray:
    """Teeth that only the last row joins: as many labels linked to one."""
    depth_m = np.zeros((18, 24), np.float32)
    depth_m[:, ::2] = depth_m[-1] = 2
    return depth_m


def random_depth(seed: int) -> np.ndarray:
    """Two thirds measured, some neighbours at similar depths."""
    return np.random.default_rng(seed).choice([0, 2, 2.04, 2.06, 2.12, 3], (18, 24), p=[0.3, *[0.14] * 5]).astype(np.float32)


@pytest.mark.parametrize("depth_m", [comb(), np.zeros((18, 24), np.float32), *map(random_depth, range(6))])
def test_labels_are_the_connected_components_of_the_graph_of_pixels(depth_m):
    labels, count = label_components(depth_m, EPSILON_Z_M)
    expected = labels_of_graph(depth_m)
    assert np.array_equal(labels, expected) and count == expected.max()


def test_an_object_is_measured_where_it_came_nearer():
    before_m = np.full((18, 24), 4, np.float32)
    before_m[4:8, 5:9] = 2  # where the box was
    before_m[10:12, 13:15] = 0  # not measured
    depth_m = np.zeros((18, 24), np.float32)
    depth_m[4:12, 7:15] = 2
    labels, count = label_components(depth_m, EPSILON_Z_M)
    (_, box) = measure_objects(labels, count, depth_m, before_m, INTRINSICS, EPSILON_Z_M)
    pixel_m2 = 2**2 / (CAMERA.fx * CAMERA.fy)
    assert box["area_m2"] == pytest.approx(64 * pixel_m2)
    assert box["moved_m2"] == pytest.approx((64 - 4 * 2 - 2 * 2) * pixel_m2)
    assert box["box"].tolist() == [7, 4, 15, 12]
    assert box["centre_m"] == pytest.approx(CAMERA.back_project(np.array([10.5, 7.5, 2.0])), abs=1e-6)


@pytest.mark.parametrize(("before_z_m", "moves"), [(2.15, False), (1.0, False), (2.25, True)])
def test_what_is_farther_than_before_or_hardly_nearer_has_not_moved(before_z_m, moves):
    depth_m, before_m = np.full((18, 24), 2, np.float32), np.full((18, 24), before_z_m, np.float32)
    labels, count = label_components(depth_m, EPSILON_Z_M)
    moved_m2 = measure_objects(labels, count, depth_m, before_m, INTRINSICS, EPSILON_Z_M)[1]["moved_m2"]
    assert (moved_m2 > 0) == moves
