"""Thickness of a person's parts, from the distances of the points to the body's surface."""

import numpy as np
from numba import njit

from kpopnet.geometry.body import PART_KIND, PARTS, RADII_M, Body
from kpopnet.geometry.cones import extend_joints, nearest_parts, part_segments
from kpopnet.geometry.depth_grid import DepthGrid

MAX_CORRECTION_M = 0.05
"""Largest correction of a part's radius, in metres."""

CORRECTION_ITERATIONS = 4
MIN_PART_POINTS = 6
"""Number of correction iterations, and the minimum number of points for which a part's radius is corrected."""

NUM_KINDS = len(RADII_M)


@njit(cache=True)
def _fit_radii(joints, points, radii, trunk_offsets):
    """(P, 2) radii of `fit_thickness`, metres."""
    rows, fitted = extend_joints(joints, trunk_offsets), radii.copy()
    for _ in range(CORRECTION_ITERATIONS):
        part, distance, _ = nearest_parts(part_segments(rows, PARTS, fitted), points, 1)
        # The distances sorted by kind of part
        count = np.zeros(NUM_KINDS + 1, np.int64)
        for i in range(len(part)):
            count[PART_KIND[part[i]] + 1] += 1
        begin = np.cumsum(count)
        by_kind, filled = np.empty(len(part)), begin.copy()
        for i in range(len(part)):
            kind = PART_KIND[part[i]]
            by_kind[filled[kind]] = distance[i]
            filled[kind] += 1
        correction = np.zeros(NUM_KINDS)
        for kind in range(NUM_KINDS):
            if count[kind + 1] >= MIN_PART_POINTS:
                correction[kind] = np.median(by_kind[begin[kind] : begin[kind + 1]])
        for k in range(len(PARTS)):
            for c in range(2):
                most, least = radii[k, c] + MAX_CORRECTION_M, max(radii[k, c] - MAX_CORRECTION_M, radii[k, c] / 2)
                fitted[k, c] = min(max(fitted[k, c] + correction[PART_KIND[k]], least), most)
    return fitted


def fit_thickness(body: Body, joints_m: np.ndarray, grid: DepthGrid) -> Body:
    """The body with its radii fitted to the person seen in a known pose.

    Every part, together with its mirror image, grows or shrinks by the median signed distance of its points. This is iterated,
    since points change their nearest part. Parts with too few points keep their radii.

    Args:
        body: the body to correct.
        joints_m: (15, 3) the pose in the camera frame in metres.
        grid: the depth image.
    """
    return body._replace(radii_m=_fit_radii(joints_m, grid.points_m, body.radii_m, body.trunk_offsets_m))
