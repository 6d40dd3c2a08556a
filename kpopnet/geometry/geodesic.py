"""Geodesic distances on a depth image: shortest paths over 8-connected grid cells (Eq. (10), and tips of limbs)."""

import math

import numpy as np
from numba import njit

DEPTH_JUMP_M = 0.08
"""Neighbouring cells whose depths differ by more than this, in metres, belong to parts that only appear connected."""

JUMP_FACTOR = 3.0
"""Factor on the length of an edge across such a depth jump. The edge is costly but usable, so that a limb with depth jumps
all around it stays reachable."""

UNREACHABLE_M = 1e9
"""Distance of points without a path to a source, in metres."""


@njit(cache=True)
def neighbour_graph(points, index):
    """Builds the 8-connected graph of the measured cells, for any number of calls of `geodesic_distances`.

    Args:
        points: (N, 3) points of the cells in metres, numbered row by row.
        index: (h, w) point number of each cell, -1 for cells without a measurement.

    Returns:
        (N, 8) int32 point numbers of the neighbours, padded with -1, and (N, 8) lengths of the edges to them in metres.
    """
    neighbours, edge_lengths = np.full((len(points), 8), -1, np.int32), np.empty((len(points), 8))
    for y in range(index.shape[0]):
        for x in range(index.shape[1]):
            point, count = index[y, x], 0
            if point < 0:
                continue
            for v in range(max(y - 1, 0), min(y + 2, index.shape[0])):
                for u in range(max(x - 1, 0), min(x + 2, index.shape[1])):
                    neighbour = index[v, u]
                    if neighbour < 0 or neighbour == point:
                        continue
                    dx = points[point, 0] - points[neighbour, 0]
                    dy = points[point, 1] - points[neighbour, 1]
                    dz = points[point, 2] - points[neighbour, 2]
                    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
                    neighbours[point, count] = neighbour
                    edge_lengths[point, count] = distance * JUMP_FACTOR if abs(dz) > DEPTH_JUMP_M else distance
                    count += 1
    return neighbours, edge_lengths


@njit(cache=True)
def geodesic_distances(neighbours, edge_lengths, source, max_distance_m):
    """Computes the geodesic distance of every point to its nearest source, up to `max_distance_m`.

    Bellman-Ford algorithm with a queue: a point whose distance decreased is queued to update its neighbours. All sources
    start in the queue. Then hardly any point is queued twice, and with a small limit most points are never visited.

    Args:
        neighbours: (N, 8) from `neighbour_graph`.
        edge_lengths: (N, 8) metres, from `neighbour_graph`.
        source: (N,) bool.
        max_distance_m: paths longer than this are not searched.

    Returns:
        (N,) distances in metres, `UNREACHABLE_M` where there is no path, and (N,) int32 the next point on the path to the
        source, -1 at sources and where there is no path.
    """
    size = len(source)
    distance, predecessor = np.full(size, UNREACHABLE_M), np.full(size, -1, np.int32)
    queue, queued = np.empty(size, np.int32), source.copy()
    head = queue_length = 0
    for i in range(size):
        if source[i]:
            distance[i] = 0.0
            queue[queue_length] = i
            queue_length += 1
    while queue_length:
        point = queue[head]
        head = head + 1 if head + 1 < size else 0
        queue_length -= 1
        queued[point] = False
        for k in range(8):
            neighbour = neighbours[point, k]
            if neighbour < 0:
                break
            candidate = distance[point] + edge_lengths[point, k]
            if candidate < distance[neighbour] - 1e-9 and candidate <= max_distance_m:
                distance[neighbour], predecessor[neighbour] = candidate, point
                if not queued[neighbour]:
                    tail = head + queue_length
                    queue[tail if tail < size else tail - size] = neighbour
                    queued[neighbour] = True
                    queue_length += 1
    return distance, predecessor
