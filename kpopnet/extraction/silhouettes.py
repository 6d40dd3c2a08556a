"""Whose each pixel is, and what is to be seen of everybody.

Most components are somebody's as a whole. Where people have grown into one, or somebody and a thing, it is divided as the
outlines go on: the paper does not say what happens then.
"""

import numpy as np
from numba import njit

from kpopnet.extraction.people import ASIDE, OVERGROWN, SHARED
from kpopnet.extraction.room import FLOOR, NOBODY, ROOM

CONTINUED_PX = 16
"""A pixel that nobody had goes to whoever had the nearest one in its run, if that is no farther away;"""

REACH_M = 0.7
"""else, among several people, to whoever's centre is nearest, if that is no farther away or ASIDE times as far aside."""

SILHOUETTE = np.dtype(
    [
        ("pixels", np.int32),
        ("area_m2", np.float32),
        ("centre_m", np.float32, 3),
        ("low_m", np.float32, 2),  # x and z
        ("high_m", np.float32, 2),
        ("box", np.int32, 4),
    ]
)
"""All that is seen of one human, as in `components.PIECE`."""


@njit(cache=True)
def paint(depth, runs, owners, centres, intrinsics, before, same_m, owner):
    """Whose each pixel is.

    Args:
        depth: (H, W) float32 metres.
        runs: (R, 4) of `connect`.
        owners: (N + 1,) uint8 by label.
        centres: (P + 1, 2) float32 x and z where everybody was, NaN for those who were not to be seen.
        intrinsics: (4,) float32 fx, fy, cx, cy.
        before: see `survey`.
        same_m: see `survey`.
        owner: (H, W) uint8, filled.

    Returns:
        (P + 1,) SILHOUETTEs by owner.
    """
    height, width = depth.shape
    depth_before, kind_before, owner_before = before
    silhouettes = np.zeros(len(centres), SILHOUETTE)
    for k in range(len(centres)):
        silhouettes[k].box[:2] = max(height, width)
        silhouettes[k].low_m[:] = np.inf
        silhouettes[k].high_m[:] = -np.inf
    owner[:] = NOBODY
    for run in range(len(runs)):
        y, begin, end, label = runs[run]
        whose = owners[label]
        if whose == NOBODY:
            continue
        if whose != SHARED and whose != OVERGROWN:
            owner[y, begin:end] = whose
            if whose < len(centres):
                _add(silhouettes[whose], depth, y, begin, end, intrinsics)
            continue
        _go_on(depth[y], begin, end, len(centres), owner_before[y], depth_before[y], same_m, owner[y])
        for x in range(begin, end):
            if whose == OVERGROWN:
                # What somebody has moved before was room; the thing was there before and nobody's.
                moved = (kind_before[y, x] == ROOM) | (kind_before[y, x] == FLOOR)
                owner[y, x] = owner[y, x] if moved or owner_before[y, x] == owner[y, x] else NOBODY
            elif owner[y, x] == NOBODY:
                owner[y, x] = _nearest(centres, depth[y, x] * (np.float32(x) - intrinsics[2]) / intrinsics[0], depth[y, x])
            if owner[y, x] != NOBODY:
                _add(silhouettes[owner[y, x]], depth, y, x, x + 1, intrinsics)
    for k in range(len(centres)):
        for axis in range(3):
            silhouettes[k].centre_m[axis] /= np.float32(max(silhouettes[k].pixels, 1))
    return silhouettes


@njit(cache=True)
def _add(silhouette, depth, y, begin, end, intrinsics):
    """A piece of a row to what is seen of somebody."""
    fx, fy, cx, cy = intrinsics
    sum_x = sum_z = squares = np.float32(0)
    low_x = low_z = np.float32(np.inf)
    high_x = high_z = np.float32(-np.inf)
    for x in range(begin, end):
        z = depth[y, x]
        point_x = z * (np.float32(x) - cx) / fx
        sum_x += point_x
        sum_z += z
        squares += z * z
        low_x, high_x = min(low_x, point_x), max(high_x, point_x)
        low_z, high_z = min(low_z, z), max(high_z, z)
    silhouette.pixels += end - begin
    silhouette.area_m2 += squares / (fx * fy)
    silhouette.centre_m[0] += sum_x
    silhouette.centre_m[1] += sum_z * (np.float32(y) - cy) / fy
    silhouette.centre_m[2] += sum_z
    silhouette.low_m[0], silhouette.high_m[0] = min(silhouette.low_m[0], low_x), max(silhouette.high_m[0], high_x)
    silhouette.low_m[1], silhouette.high_m[1] = min(silhouette.low_m[1], low_z), max(silhouette.high_m[1], high_z)
    silhouette.box[0], silhouette.box[2] = min(silhouette.box[0], begin), max(silhouette.box[2], end)
    silhouette.box[1], silhouette.box[3] = min(silhouette.box[1], y), max(silhouette.box[3], y + 1)


@njit(cache=True)
def _go_on(row, begin, end, num_owners, owner_before, depth_before, same_m, owner):
    """In a run, gives pixels to whoever had them, or else to whoever had the nearest one within CONTINUED_PX."""
    last = begin - CONTINUED_PX - 1  # pixel that somebody had
    for x in range(begin, end):
        whose = owner_before[x]
        if 1 <= whose < num_owners and abs(row[x] - depth_before[x]) <= same_m:
            owner[x] = whose
            for u in range(max(begin, last + 1, x - CONTINUED_PX), x):
                owner[u] = whose if x - u < u - last else owner[u]
            last = x
        else:
            owner[x] = owner[last] if x - last <= CONTINUED_PX else np.uint8(NOBODY)


@njit(cache=True)
def _nearest(centres, x, z):
    """Who is nearest in x and z as `_away_m` has it."""
    whose, least = np.uint8(NOBODY), np.float32(REACH_M)
    for k in range(1, len(centres)):
        away = max(abs(centres[k, 0] - x) / np.float32(ASIDE), abs(centres[k, 1] - z))
        if away < least:
            whose, least = np.uint8(k), away
    return whose
