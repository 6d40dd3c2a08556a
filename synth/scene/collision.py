"""Whether a posed body stands in a wall or in furniture."""

import numpy as np
from numba import njit


@njit(cache=True)
def overlaps_boxes(vertices_m, place_m, centres_m, halves_m, yaws_rad, clearance_m):
    """Whether any vertex lies in a box, or within a clearance of its sides.

    Args:
        vertices_m: (V, 3) body at the origin, world axes.
        place_m: (3,) translation of the body.
        centres_m: (K, 3) centres of the boxes, world frame.
        halves_m: (K, 3) half sizes along each box's own axes.
        yaws_rad: (K,) rotations of the boxes about the vertical.
        clearance_m: by which each box is larger on every side.
    """
    low, high = vertices_m[0].astype(np.float64), vertices_m[0].astype(np.float64)
    for i in range(len(vertices_m)):
        for axis in range(3):
            low[axis] = min(low[axis], vertices_m[i, axis])
            high[axis] = max(high[axis], vertices_m[i, axis])
    low, high = low + place_m - clearance_m, high + place_m + clearance_m
    for box in range(len(centres_m)):
        cos, sin = np.cos(yaws_rad[box]), np.sin(yaws_rad[box])
        half_x, half_y, half_z = halves_m[box]
        x, y, z = centres_m[box]
        reach_x, reach_y = abs(cos) * half_x + abs(sin) * half_y, abs(sin) * half_x + abs(cos) * half_y
        apart = x - reach_x > high[0] or x + reach_x < low[0] or y - reach_y > high[1] or y + reach_y < low[1]
        if apart or z - half_z > high[2] or z + half_z < low[2]:
            continue
        for i in range(len(vertices_m)):
            if abs(vertices_m[i, 2] + place_m[2] - z) >= half_z + clearance_m:
                continue
            off_x, off_y = vertices_m[i, 0] + place_m[0] - x, vertices_m[i, 1] + place_m[1] - y
            if abs(cos * off_x + sin * off_y) < half_x + clearance_m and abs(cos * off_y - sin * off_x) < half_y + clearance_m:
                return True
    return False
