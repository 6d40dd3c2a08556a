"""Somebody who has not moved yet, by size and shape: not in the paper, for recordings that begin with a person in them.

Such a person is a component of the whole picture (the floor removed) that is as tall, wide, deep and large as somebody
who stands upright and reaches down to the floor, that does not fill the box around it as a cupboard does, and that
stands apart: what is to be seen beside its outline lies well behind it. Where several do, it is the one that stands
farthest before what is behind it, since furniture stands along walls.
"""

import numpy as np
from numba import njit

from kpopnet.extraction.room import FLOOR, NOTHING

LEAST_HEIGHT_M, MOST_HEIGHT_M = 1.1, 2.4
MOST_WIDTH_M, MOST_DEPTH_M = 2.2, 1.2
LEAST_AREA_M2, MOST_AREA_M2 = 0.2, 1.6
MOST_FILLED = 0.8
"""Share of the box around it in the picture."""

FEET_M = 0.4
"""The lowest point that is seen lies no higher above the floor, unless it is at the picture's rim."""

LEAST_APART_M, MOST_APART_M, UNMEASURED_APART_M = 0.25, 1.5, 0.5
"""How far what is beside the outline lies behind it, in the mean over the outline: at least; at most counted; and what
counts where nothing was measured there."""


def find_standing(
    depth: np.ndarray, kind: np.ndarray, labels: np.ndarray, pieces: np.ndarray, has_floor: bool
) -> int | None:
    """The label of the component that is most likely somebody standing, None if there is none.

    Args:
        depth: (H, W) float32 metres.
        kind: (H, W) uint8, see `room.sort_pixels`.
        labels: (H, W) int32 of all components of the picture.
        pieces: (N + 1,) what they are like.
        has_floor: heights are above the floor.
    """
    extent_m = pieces["high_m"] - pieces["low_m"]
    box = pieces["box"]
    filled = pieces["pixels"] / np.maximum((box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1]), 1)
    likely = (extent_m[:, 1] > LEAST_HEIGHT_M) & (extent_m[:, 1] < MOST_HEIGHT_M)
    likely &= (extent_m[:, 0] < MOST_WIDTH_M) & (extent_m[:, 2] < MOST_DEPTH_M)
    likely &= (pieces["area_m2"] > LEAST_AREA_M2) & (pieces["area_m2"] < MOST_AREA_M2) & (filled < MOST_FILLED)
    if has_floor:
        likely &= (pieces["low_m"][:, 1] < FEET_M) | (box[:, 3] == len(depth))
    if not likely.any():
        return None
    apart_m = np.where(likely, _stands_apart(depth, kind, labels, len(pieces)), 0)
    best = int(np.argmax(apart_m))
    return best if apart_m[best] > LEAST_APART_M else None


@njit(cache=True)
def _stands_apart(depth, kind, labels, count):
    """(count,) how far what is beside each component's outline lies behind it, in the mean over the outline."""
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
                if kind[v, u] == NOTHING:
                    total[label] += UNMEASURED_APART_M
                else:
                    total[label] += min(max(depth[v, u] - depth[y, x], 0), MOST_APART_M)
    return total / outline
