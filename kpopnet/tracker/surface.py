"""The body's surface against the measured points: how thick a person's parts are, and how far a joint can be trusted."""

import numpy as np
from numba import njit

from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.body import KIND_OF_PART, OWNERS, PARTS, RADII_M, Body
from kpopnet.tracker.cells import Cells
from kpopnet.tracker.cones import HIDDEN_M, axes_of, extend, nearest_parts

FULL_SUPPORT = 4
"""With so many points on the parts that end at a joint its confidence is no longer limited by their number."""

DOUBTFUL_M = 0.06
"""A mean residual of that much leaves half of the confidence."""

THICKER_M = 0.05
"""A part's thickness is corrected by at most that much."""

CORRECTIONS = 4
FEWEST_POINTS = 6


@njit(cache=True)
def _offsets(joints, points, parts, radii, places):
    """(N,) the part that each point is nearest to or deepest in, and (N,) its signed distance to that part's surface."""
    return nearest_parts(axes_of(extend(joints, places), parts, radii), points, 1)[:2]


def with_thickness(body: Body, joints_m: np.ndarray, cells: Cells) -> Body:
    """The body with its parts as thick as those of the person seen in a known pose.

    Every part, together with its mirror image, grows or shrinks by the median distance of its points to its surface, a
    few times over, since points change the part they are nearest to. Parts that show too few points stay.
    """
    radii = body.radii_m.copy()
    for _ in range(CORRECTIONS):
        part, offset = _offsets(joints_m, cells.points_m, PARTS, radii, body.places_m)
        for kind in range(len(RADII_M)):
            own = offset[KIND_OF_PART[part] == kind]
            if len(own) >= FEWEST_POINTS:
                radii[kind == KIND_OF_PART] += np.median(own)
        radii = np.clip(radii, body.radii_m - THICKER_M, body.radii_m + THICKER_M)
        radii = np.maximum(radii, body.radii_m / 2)
    return body._replace(radii_m=radii)


@njit(cache=True)
def _residuals(joints, points, parts, radii, places):
    """(15, 2) sum of absolute residuals and number of points, each point counted for the nearer end of its part."""
    axes = axes_of(extend(joints, places), parts, radii)
    sums = np.zeros((len(joints), 2))
    part, offs, along = nearest_parts(axes, points, 1)
    for i in range(len(points)):
        joint = OWNERS[parts[part[i], 0] if along[i] < 0.5 else parts[part[i], 1]]
        sums[joint, 0] += min(abs(offs[i]), 2 * HIDDEN_M)
        sums[joint, 1] += 1
    return sums


def joint_confidence(joints_m: np.ndarray, cells: Cells, body: Body) -> np.ndarray:
    """(15,) in 0..1: how many points a joint's surroundings explain, and how well; 0 where nothing of them is seen."""
    sums = _residuals(joints_m, cells.points_m, PARTS, body.radii_m, body.places_m)
    residual = sums[:, 0] / np.maximum(sums[:, 1], 1)
    confidence = np.minimum(sums[:, 1] / FULL_SUPPORT, 1) / (1 + (residual / DOUBTFUL_M) ** 2)
    assert confidence.shape == (NUM_JOINTS,)
    return confidence
