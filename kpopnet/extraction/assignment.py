"""Assigns every pixel to a tracked person, and measures each person's silhouette.

Most components belong to one person as a whole. Where people have merged into one component, or a person and an object
have, the component is divided pixel by pixel along the silhouettes of the previous image. The paper does not say what
happens then.
"""

import numpy as np
from numba import njit

from kpopnet.extraction.association import LATERAL_RATIO, PERSON_AND_OBJECT, SEVERAL_PEOPLE
from kpopnet.extraction.background import BACKGROUND, FLOOR, NO_PERSON

MAX_GAP_PX = 16
"""A pixel that belonged to no person is assigned to the owner of the nearest owned pixel in its run, up to this far."""

MAX_DISTANCE_M = 0.7
"""Otherwise, where several people have merged, it is assigned to the person with the nearest centre: within this distance
in depth, or LATERAL_RATIO times this distance sideways."""

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
"""Statistics of all visible pixels of one person, with the meanings of `components.COMPONENT`."""


@njit(cache=True)
def assign_pixels(depth, runs, owners, centres, intrinsics, before, max_step_m, owner):
    """Assigns every pixel to a person.

    Args:
        depth: (H, W) float32 metres.
        runs: (R, 4) from `label_runs`.
        owners: (N + 1,) uint8 owner of each component by label.
        centres: (P + 1, 2) float32 x and z of each person in the previous image, NaN for people not visible there.
        intrinsics: (4,) float32 fx, fy, cx, cy.
        before: see `component_stats`.
        max_step_m: see `component_stats`.
        owner: (H, W) uint8, filled with the number of each pixel's person, or NO_PERSON.

    Returns:
        (P + 1,) SILHOUETTE by person number.
    """
    height, width = depth.shape
    depth_before, kind_before, owner_before = before
    silhouettes = np.zeros(len(centres), SILHOUETTE)
    for k in range(len(centres)):
        silhouettes[k].box[:2] = max(height, width)
        silhouettes[k].low_m[:] = np.inf
        silhouettes[k].high_m[:] = -np.inf
    owner[:] = NO_PERSON
    for run in range(len(runs)):
        y, begin, end, label = runs[run]
        number = owners[label]
        if number == NO_PERSON:
            continue
        if number != SEVERAL_PEOPLE and number != PERSON_AND_OBJECT:
            owner[y, begin:end] = number
            if number < len(centres):
                _add_pixels(silhouettes[number], depth, y, begin, end, intrinsics)
            continue
        _continue_owners(depth[y], begin, end, len(centres), owner_before[y], depth_before[y], max_step_m, owner[y])
        for x in range(begin, end):
            if number == PERSON_AND_OBJECT:
                # Pixels that were background or floor before show the person; other pixels without an owner, the object.
                moved = (kind_before[y, x] == BACKGROUND) | (kind_before[y, x] == FLOOR)
                owner[y, x] = owner[y, x] if moved or owner_before[y, x] == owner[y, x] else NO_PERSON
            elif owner[y, x] == NO_PERSON:
                point_x = depth[y, x] * (np.float32(x) - intrinsics[2]) / intrinsics[0]
                owner[y, x] = _nearest_person(centres, point_x, depth[y, x])
            if owner[y, x] != NO_PERSON:
                _add_pixels(silhouettes[owner[y, x]], depth, y, x, x + 1, intrinsics)
    for k in range(len(centres)):
        for axis in range(3):
            silhouettes[k].centre_m[axis] /= np.float32(max(silhouettes[k].pixels, 1))
    return silhouettes


@njit(cache=True)
def _add_pixels(silhouette, depth, y, begin, end, intrinsics):
    """Adds the pixels begin to end - 1 of row y to a silhouette."""
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
def _continue_owners(row, begin, end, num_owners, owner_before, depth_before, max_step_m, owner):
    """Within a run, gives each pixel its previous owner, or the owner of the nearest owned pixel within MAX_GAP_PX."""
    last = begin - MAX_GAP_PX - 1  # the last pixel with a previous owner
    for x in range(begin, end):
        number = owner_before[x]
        if 1 <= number < num_owners and abs(row[x] - depth_before[x]) <= max_step_m:
            owner[x] = number
            for u in range(max(begin, last + 1, x - MAX_GAP_PX), x):
                owner[u] = number if x - u < u - last else owner[u]
            last = x
        else:
            owner[x] = owner[last] if x - last <= MAX_GAP_PX else np.uint8(NO_PERSON)


@njit(cache=True)
def _nearest_person(centres, x, z):
    """The number of the person nearest to (x, z) by the distance of `association._distance_xz_m`."""
    number, least = np.uint8(NO_PERSON), np.float32(MAX_DISTANCE_M)
    for k in range(1, len(centres)):
        distance = max(abs(centres[k, 0] - x) / np.float32(LATERAL_RATIO), abs(centres[k, 1] - z))
        if distance < least:
            number, least = np.uint8(k), distance
    return number
