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


@njit(cache=True)
def _surface_distances(joints, points, parts, radii, trunk_offsets):
    """(N,) the part with the smallest signed distance for each point, and (N,) that distance in metres."""
    return nearest_parts(part_segments(extend_joints(joints, trunk_offsets), parts, radii), points, 1)[:2]


def fit_thickness(body: Body, joints_m: np.ndarray, grid: DepthGrid) -> Body:
    """The body with its radii fitted to the person seen in a known pose.

    Every part, together with its mirror image, grows or shrinks by the median signed distance of its points. This is iterated,
    since points change their nearest part. Parts with too few points keep their radii.

    Args:
        body: the body to correct.
        joints_m: (15, 3) the pose in the camera frame in metres.
        grid: the depth image.
    """
    radii = body.radii_m.copy()
    for _ in range(CORRECTION_ITERATIONS):
        part, distance = _surface_distances(joints_m, grid.points_m, PARTS, radii, body.trunk_offsets_m)
        for kind in range(len(RADII_M)):
            part_distances = distance[PART_KIND[part] == kind]
            if len(part_distances) >= MIN_PART_POINTS:
                radii[kind == PART_KIND] += np.median(part_distances)
        radii = np.clip(radii, body.radii_m - MAX_CORRECTION_M, body.radii_m + MAX_CORRECTION_M)
        radii = np.maximum(radii, body.radii_m / 2)
    return body._replace(radii_m=radii)
