"""Tips of the silhouette, and the limbs traced from them.

The tips of hands and feet are maxima of the geodesic distance from the torso (Plagemann et al. 2010). The shortest path from a
tip to the torso follows the limb.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMB_PARTS, LIMBS, PARTS
from kpopnet.geometry.cones import extend_joints, nearest_parts, part_segments
from kpopnet.geometry.depth_grid import UNREACHABLE_M, geodesic_distances

TORSO_TOLERANCE_M = 0.05
"""Points within this distance of the surface of torso or head, in metres, are sources of the geodesic distance."""
MIN_TIP_SEPARATION_M = 0.15
MIN_TIP_DISTANCE_M = 0.12
MAX_TIPS = 12
"""A tip is the maximum of the geodesic distance within `MIN_TIP_SEPARATION_M` metres, at least `MIN_TIP_DISTANCE_M` metres from
the torso; at most `MAX_TIPS` are used."""
END_TO_TIP_M = 0.08
"""Distance in metres by which the silhouette extends beyond the hand's and the foot's joint: fingers and toes."""

END_RADIUS_M, MIDDLE_RADIUS_M = 0.05, 0.06
"""Distance in metres of the joint behind the surface of hand or foot, and at elbow or knee."""


class Tips(NamedTuple):
    """Where each limb would end and bend if it had each tip.

    Attributes:
        ends_m: (4, T, 3) metres.
        middles_m: (4, T, 3) metres.
        used: (T,) whether a limb has this tip already.
    """

    ends_m: np.ndarray
    middles_m: np.ndarray
    used: np.ndarray


@njit(cache=True)
def find_tips(joints, grid, body):
    """The `Tips` of a silhouette, with limbs of the body's lengths, from (15, 3) joints with an approximately correct torso."""
    points = grid.points_m
    source = torso_points(joints, points, body)
    geodesic, predecessor = geodesic_distances(grid.neighbours, grid.edge_lengths_m, source, UNREACHABLE_M)
    tips = limb_tips(points, grid.neighbours, grid.edge_lengths_m, geodesic)
    ends, middles = np.empty((len(LIMBS), len(tips), 3)), np.empty((len(LIMBS), len(tips), 3))
    for limb in range(len(LIMBS)):
        for k in range(len(tips)):
            trace_limb(points, predecessor, tips[k], body.limbs_m[limb, 1], ends[limb, k], middles[limb, k])
    return Tips(ends, middles, np.zeros(len(tips), np.bool_))


@njit(cache=True)
def torso_points(joints, points, body):
    """(N,) whether a point lies on the torso or the head, and closer to it than to any limb."""
    is_limb = np.zeros(len(PARTS), np.bool_)
    for limb in range(len(LIMB_PARTS)):
        for k in LIMB_PARTS[limb]:
            is_limb[k] = True
    part, distances, _ = nearest_parts(
        part_segments(extend_joints(joints, body.trunk_offsets_m), PARTS, body.radii_m), points, 1
    )
    on_torso = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        on_torso[i] = not is_limb[part[i]] and abs(distances[i]) < TORSO_TOLERANCE_M
    return on_torso


@njit(cache=True)
def limb_tips(points, neighbours, edge_lengths, geodesic):
    """Indices of the points that are local maxima of the geodesic distance."""
    tips = np.empty(MAX_TIPS, np.int32)
    count = 0
    for i in range(len(points)):
        if not MIN_TIP_DISTANCE_M <= geodesic[i] < 1e8 or count == MAX_TIPS:
            continue
        is_maximum = True
        for k in range(8):  # early rejection: most points have a neighbour with a larger distance
            neighbour = neighbours[i, k]
            if neighbour >= 0 and geodesic[i] < geodesic[neighbour] < 1e8 and edge_lengths[i, k] < MIN_TIP_SEPARATION_M:
                is_maximum = False
        for j in range(len(points) if is_maximum else 0):
            if geodesic[j] < 1e8 and (geodesic[j] > geodesic[i] or (geodesic[j] == geodesic[i] and j < i)):
                dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
                if dx * dx + dy * dy + dz * dz < MIN_TIP_SEPARATION_M**2:
                    is_maximum = False
                    break
        if is_maximum:
            tips[count] = i
            count += 1
    return tips[:count]


@njit(cache=True)
def move_inside(points, index, radius, position):
    """Writes the given surface point, moved along its viewing ray by the radius to the limb's axis, into `position`."""
    x, y, z = points[index, 0], points[index, 1], points[index, 2]
    factor = 1 + radius / math.sqrt(x**2 + y**2 + z**2)
    position[0], position[1], position[2] = x * factor, y * factor, z * factor


@njit(cache=True)
def distance(a, b):
    """Euclidean distance of two (3,) points."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def trace_limb(points, predecessor, tip, lower_m, end, middle):
    """Writes end and middle of a limb with this tip: the end `END_TO_TIP_M` along the path, the middle a lower limb on."""
    point, travelled = tip, 0.0
    while predecessor[point] >= 0 and travelled < END_TO_TIP_M:
        travelled += distance(points[point], points[predecessor[point]])
        point = predecessor[point]
    move_inside(points, point, END_RADIUS_M, end)
    move_inside(points, point, MIDDLE_RADIUS_M, middle)
    while predecessor[point] >= 0 and distance(end, middle) < lower_m:
        point = predecessor[point]
        move_inside(points, point, MIDDLE_RADIUS_M, middle)
