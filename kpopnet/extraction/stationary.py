"""Finds a person who has not moved yet, by size and shape. Not in the paper: for recordings that begin with a person.

The person is a component of the whole image, after floor removal. It has the height, width, depth and surface area of a
person who stands upright. It reaches down to the floor, does not fill its bounding box as a cupboard does, and stands
apart: what is visible next to its outline lies well behind it. Of several such components, the one with the largest
distance to what lies behind is chosen, since furniture stands along walls.
"""

import numpy as np
from numba import njit

from kpopnet.extraction.background import FLOOR, UNMEASURED

MIN_HEIGHT_M, MAX_HEIGHT_M = 1.1, 2.4
MAX_WIDTH_M, MAX_DEPTH_M = 2.2, 1.2
MIN_AREA_M2, MAX_AREA_M2 = 0.2, 1.6
MAX_FILL = 0.8
"""Largest share of the pixels of the bounding box."""

MAX_FEET_HEIGHT_M = 0.4
"""The lowest visible point is at most this high above the floor, unless it is at the image border."""

MIN_DISTANCE_M, MAX_DISTANCE_M, UNMEASURED_DISTANCE_M = 0.25, 1.5, 0.5
"""Depth difference between the outline and what is next to it, averaged over the outline: smallest average accepted; largest
value of one pixel; and value of a pixel with no measurement next to it."""

MIN_NEWCOMER_DISTANCE_M = 0.35
"""The same for a new person among others. On simulated films of two people (seeds 201 and 202) people have 0.5 to 0.95 m,
patches of wall 0.25 to 0.3 m."""


def find_stationary_person(
    depth: np.ndarray, kind: np.ndarray, labels: np.ndarray, components: np.ndarray, has_floor: bool
) -> int | None:
    """The label of the component that is most likely a standing person, None if there is none.

    Args:
        depth: (H, W) float32 metres.
        kind: (H, W) uint8, see `background.classify_pixels`.
        labels: (H, W) int32 labels of all components of the image.
        components: (N + 1,) COMPONENT, their statistics.
        has_floor: heights are above the floor.
    """
    extent_m = components["high_m"] - components["low_m"]
    box = components["box"]
    fill = components["pixels"] / np.maximum((box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1]), 1)
    likely = (extent_m[:, 1] > MIN_HEIGHT_M) & (extent_m[:, 1] < MAX_HEIGHT_M)
    likely &= (extent_m[:, 0] < MAX_WIDTH_M) & (extent_m[:, 2] < MAX_DEPTH_M)
    likely &= (components["area_m2"] > MIN_AREA_M2) & (components["area_m2"] < MAX_AREA_M2) & (fill < MAX_FILL)
    if has_floor:
        likely &= (components["low_m"][:, 1] < MAX_FEET_HEIGHT_M) | (box[:, 3] == len(depth))
    if not likely.any():
        return None
    distance_m = np.where(likely, _distances_behind(depth, kind, labels, len(components)), 0)
    best = int(np.argmax(distance_m))
    return best if distance_m[best] > MIN_DISTANCE_M else None


def stands_out(depth: np.ndarray, kind: np.ndarray, labels: np.ndarray, label: int) -> bool:
    """Whether a component of the image lies before what is next to its outline; arguments as in `find_stationary_person`.

    A patch of wall that people uncover between them does not: those who stand around it are nearer.
    """
    distance_m = _distances_behind(depth, kind, (labels == label).astype(labels.dtype), 2)[1]
    return bool(distance_m > MIN_NEWCOMER_DISTANCE_M)


@njit(cache=True)
def _distances_behind(depth, kind, labels, count):
    """(count,) mean distance in metres by which what is next to each component's outline lies behind it."""
    height, width = depth.shape
    total = np.zeros(count)
    outline = np.ones(count)
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            label = labels[y, x]
            if label == 0:
                continue
            for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                if labels[v, u] == label or kind[v, u] == FLOOR:
                    continue
                outline[label] += 1
                if kind[v, u] == UNMEASURED:
                    total[label] += UNMEASURED_DISTANCE_M
                else:
                    total[label] += min(max(depth[v, u] - depth[y, x], 0), MAX_DISTANCE_M)
    return total / outline
