"""Geodesic distance: the shortest way inside a silhouette, over neighbouring cells (Eq. (10), and tips of limbs)."""

import math

import numpy as np
from numba import njit

JUMP_M = 0.08
"""Neighbouring cells whose depths differ by more belong to parts that only look connected."""

JUMP_COST = 3.0
"""A way across such a jump counts so many times its length: dear, but open to a limb that is cut off all around."""

MOST_SWEEPS = 12
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
def shortest_ways(neighbours, steps, source):
    """Lengths of the shortest ways to a source.

    Args:
        neighbours: of `neighbourhood`.
        steps: of `neighbourhood`.
        source: (N,) bool.

    Returns:
        (N,) lengths in metres, `NOWHERE_M` where there is no way, and (N,) int32 the next point on it, -1 at its end.
    """
    length = np.where(source, 0.0, NOWHERE_M)
    onward = np.full(len(source), -1, np.int32)
    for sweep in range(MOST_SWEEPS):
        changed = False
        for i in range(len(source)):
            here = i if sweep % 2 == 0 else len(source) - 1 - i
            least = length[here]
            if least == 0:
                continue
            for k in range(8):
                there = neighbours[here, k]
                if there < 0:
                    break
                if length[there] + steps[here, k] < least - 1e-9:
                    least = length[there] + steps[here, k]
                    onward[here] = there
            if least < length[here]:
                length[here] = least
                changed = True
        if not changed:
            break
    return length, onward
