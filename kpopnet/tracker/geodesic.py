"""Geodesic distance: the shortest way inside a silhouette, over neighbouring cells (Eq. (10), and tips of limbs)."""

import math

import numpy as np
from numba import njit

JUMP_M = 0.08
"""Neighbouring cells whose depths differ by more belong to parts that only look connected."""

JUMP_COST = 3.0
"""A way across such a jump counts so many times its length: dear, but open to a limb that is cut off all around."""

NOWHERE_M = 1e9
"""The length where there is no way."""


@njit(cache=True)
def neighbourhood(points, index):
    """What the cells of a picture are surrounded by, for any number of `shortest_ways`.

    Args:
        points: (N, 3) of the cells, numbered row by row.
        index: (h, w) numbers of the points, -1 for none.

    Returns:
        (N, 8) int32 the neighbours' numbers, -1 from where there are no more, and (N, 8) the lengths of the steps there.
    """
    neighbours, steps = np.full((len(points), 8), -1, np.int32), np.empty((len(points), 8))
    for y in range(index.shape[0]):
        for x in range(index.shape[1]):
            here, count = index[y, x], 0
            if here < 0:
                continue
            for v in range(max(y - 1, 0), min(y + 2, index.shape[0])):
                for u in range(max(x - 1, 0), min(x + 2, index.shape[1])):
                    there = index[v, u]
                    if there < 0 or there == here:
                        continue
                    dx = points[here, 0] - points[there, 0]
                    dy = points[here, 1] - points[there, 1]
                    dz = points[here, 2] - points[there, 2]
                    step = math.sqrt(dx * dx + dy * dy + dz * dz)
                    neighbours[here, count] = there
                    steps[here, count] = step * JUMP_COST if abs(dz) > JUMP_M else step
                    count += 1
    return neighbours, steps


@njit(cache=True)
def shortest_ways(neighbours, steps, source, farthest_m):
    """Lengths of the shortest ways to a source, for those no longer than `farthest_m`.

    Cells whose length has changed wait in a line to tell their neighbours (Bellman and Ford's algorithm): with all sources
    first in it hardly any cell waits twice, and where ways end early most cells are never looked at.

    Args:
        neighbours: of `neighbourhood`.
        steps: of `neighbourhood`.
        source: (N,) bool.
        farthest_m: longer ways are not looked for.

    Returns:
        (N,) lengths in metres, `NOWHERE_M` where there is no way, and (N,) int32 the next point on it, -1 at its end.
    """
    size = len(source)
    length, onward = np.full(size, NOWHERE_M), np.full(size, -1, np.int32)
    line, waits = np.empty(size, np.int32), source.copy()
    first = waiting = 0
    for i in range(size):
        if source[i]:
            length[i] = 0.0
            line[waiting] = i
            waiting += 1
    while waiting:
        here = line[first]
        first = first + 1 if first + 1 < size else 0
        waiting -= 1
        waits[here] = False
        for k in range(8):
            there = neighbours[here, k]
            if there < 0:
                break
            way = length[here] + steps[here, k]
            if way < length[there] - 1e-9 and way <= farthest_m:
                length[there], onward[there] = way, here
                if not waits[there]:
                    last = first + waiting
                    line[last if last < size else last - size] = there
                    waits[there] = True
                    waiting += 1
    return length, onward
