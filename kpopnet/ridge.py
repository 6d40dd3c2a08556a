"""Ridge data (section 2.2): the pixels along the medial axes of the body parts, close to the long bones.

The steps are depth edges, the distance to the nearest edge, the mean distance on a circle around each pixel divided by
the pixel's own distance, and a threshold:

    edges -> distance map D_T -> circle ratio R_T -> ridge data {X: R_T(X) <= epsilon_r} -> probability map

Assumptions, where the paper is silent or wrong:

- An edge is a pixel without measurement, or a pixel behind one of its 4-neighbours by more than a threshold. Only the
  farther of the two pixels is an edge: the nearer part keeps its full width, as in front of an empty background. The
  image border is no edge, since the extent of a person beyond it is unknown.
- D_T is the exact Euclidean distance in pixels. The circle C(X) has the radius D_T(X), rounded to a quarter of a pixel,
  and consists of the pixels nearest to `CIRCLE_POINTS` evenly spaced points on it. Each pixel counts once, and only
  inside the image. Up to a radius of 5 these are all pixels on the circle; beyond, D_T varies too slowly for more
  points to change the mean.
- The paper's epsilon_r = 0.3 does not fit these definitions. On the axis of a straight limb of any width, R_T is
  1 - 2/pi = 0.363 in the plane (on the pixel grid mostly 0.36 to 0.5, of single pixels down to 0.30; 0.6 for a limb of four
  pixels), so 0.3 keeps little more than the ends of limbs.

The ridge of a box cut out of an image equals that of the whole image if the box has a margin of two empty pixels around
the person.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from kpopnet.errors import InputError, check_number, check_type

CIRCLE_POINTS = 32
RADII_PER_PIXEL = 4
NO_EDGE = 2**30
"""Squared distance of all pixels of an image without an edge."""

FARTHEST_PX = 256
"""Largest D_T; the images that are estimated from show no limb that is twice as wide (`kpopnet.camera.MOST_PIXELS`)."""


@dataclass(frozen=True)
class RidgeConfig:
    """Parameters of Eq. (2).

    Attributes:
        epsilon_r: the largest circle ratio of ridge data. On real Kinect frames, 0.55 gives nearly unbroken lines of one
            to three pixels along arms and legs; 0.5 breaks them on thin arms, 0.3 (the paper's) leaves almost no pixels,
            and 0.6 starts to fill the torso.
        edge_threshold_m: smallest depth difference in metres between neighbouring pixels that makes an edge.
        sharpness: slope by which the probability falls with the ratio, see `ridge_probability`.
    """

    epsilon_r: float = 0.55
    edge_threshold_m: float = 0.08
    sharpness: float = 3.0

    def __post_init__(self) -> None:
        # The ratio on a plane slope of D_T is 1.
        for name, below in (("epsilon_r", 1), ("edge_threshold_m", math.inf), ("sharpness", math.inf)):
            check_number(f"ridge.{name}", getattr(self, name))
            if not 0 < getattr(self, name) < below:
                raise InputError(f"ridge.{name}={getattr(self, name)}: expected a number above 0 and below {below}")


class RidgeStages(NamedTuple):
    """The intermediate and final (H, W) images of section 2.2, as in the paper's Fig. 2."""

    edges: np.ndarray  # bool, depth edges
    # float32 D_T, distance in pixels to the nearest edge: 0 on edges, inf everywhere if there is no edge
    distance_px: np.ndarray
    # float32 R_T, the mean of D_T on the circle divided by D_T at its centre; 1 on edges and where the whole circle lies
    # outside the image
    ratio: np.ndarray
    ridge: np.ndarray  # bool, the ridge data


def ridge_stages(depth_m: np.ndarray, config: RidgeConfig) -> RidgeStages:
    """All steps of section 2.2, for drawing and debugging, of (H, W) floating-point metres, 0 where nothing was measured.

    Usually it shows one segmented person. Raises InputError for anything but one image of floats, and other settings.
    """
    box, squared, ratio = _ratio_in_box(depth_m, config)
    edges, distance_px = np.ones(depth_m.shape, bool), np.zeros(depth_m.shape, np.float32)
    edges[box] = squared == 0
    distance_px[box] = np.where(squared == NO_EDGE, np.inf, np.sqrt(squared))
    ratio_image = np.ones(depth_m.shape, np.float32)
    ratio_image[box] = ratio
    return RidgeStages(edges, distance_px, ratio_image, ridge_data(depth_m, config))


def ridge_data(depth_m: np.ndarray, config: RidgeConfig) -> np.ndarray:
    """R(I), the ridge data, as an (H, W) bool mask; arguments and errors as in `ridge_stages`."""
    box, _, ratio = _ratio_in_box(depth_m, config)
    ridge = np.zeros(depth_m.shape, bool)
    # Eq. (2)
    ridge[box] = ratio <= np.float32(config.epsilon_r)
    return ridge


def ridge_probability(depth_m: np.ndarray, config: RidgeConfig) -> np.ndarray:
    """The ridge image that a network can take as a second channel: (H, W) float32 in 0..1.

    p = clip(1/2 + sharpness (epsilon_r - R_T), 0, 1): 0.5 at the threshold of ridge data, 0 on slopes of
    D_T and outside the person. The paper only says "a probability map of ridge data". Arguments and errors as in
    `ridge_stages`.
    """
    box, squared, ratio = _ratio_in_box(depth_m, config)
    probability = np.zeros(depth_m.shape, np.float32)
    offset, slope = np.float32(0.5 + config.sharpness * config.epsilon_r), np.float32(config.sharpness)
    np.clip(offset - slope * ratio, 0, 1, out=probability[box])
    if offset > slope:
        probability[box][squared == 0] = 0  # where the formula gives more
    return probability


def _ratio_in_box(depth_m: np.ndarray, config: RidgeConfig) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
    """The bounding box of the person with a margin of two pixels, and the squared distances and circle ratios in it."""
    if not isinstance(depth_m, np.ndarray) or depth_m.ndim != 2 or depth_m.dtype.kind != "f":
        raise InputError("ridge: expected one (H, W) image of floating-point metres; kpopnet.camera.depth_in_metres converts")
    check_type("ridge settings", config, RidgeConfig)
    x0, y0, width, height = cv2.boundingRect((depth_m > 0).view(np.uint8))
    box = slice(max(y0 - 2, 0), y0 + height + 2), slice(max(x0 - 2, 0), x0 + width + 2)
    depth = np.ascontiguousarray(depth_m[box], dtype=np.float32)
    squared, largest = _squared_distances(depth, np.float32(config.edge_threshold_m))
    if largest in (0, NO_EDGE):
        return box, squared, np.ones(depth.shape, np.float32)
    max_radius_px = max(32, 1 << math.isqrt(largest).bit_length())
    return box, squared, _circle_ratios(squared, largest, *_circles(max_radius_px))


@njit(cache=True)
def _squared_distances(depth, threshold):
    """(H, W) int32 squared distance to the nearest edge in pixels, and its maximum: along columns first, then along rows.

    Computed in float32, which vectorises and is exact; distances end at `FARTHEST_PX`, so that no image takes seconds.
    """
    zero, one = np.float32(0), np.float32(1)
    height, width = depth.shape
    far = np.float32(min(height + width, FARTHEST_PX))
    column = np.full((height, width), far)
    for y in range(height):
        row, above, below = depth[y], depth[max(y - 1, 0)], depth[min(y + 1, height - 1)]
        distance, before = column[y], column[max(y - 1, 0)]
        for x in range(width):
            near = row[x] - threshold
            behind = ((above[x] > zero) & (above[x] < near)) | ((below[x] > zero) & (below[x] < near))
            distance[x] = zero if behind | (not row[x] > zero) else min(before[x] + one, far)
        for x in range(width - 1):
            distance[x] = zero if (row[x + 1] > zero) & (row[x + 1] < row[x] - threshold) else distance[x]
        for x in range(width - 1):
            distance[x + 1] = zero if (row[x] > zero) & (row[x] < row[x + 1] - threshold) else distance[x + 1]
    for y in range(height - 2, -1, -1):
        distance, before = column[y], column[y + 1]
        for x in range(width):
            distance[x] = min(distance[x], before[x] + one)

    squared = np.zeros((height, width), np.int32)
    largest, edges = 0, False
    padded = np.full(3 * width, far * far)
    for y in range(height):
        distance = column[y]
        for x in range(width):
            padded[width + x] = distance[x] * distance[x]
        for x in range(width):
            middle = width + x
            best = padded[middle]
            if best == zero:
                edges = True
                continue
            step, step_squared = 1, one
            while step_squared < best and step <= width:
                best = min(best, min(padded[middle - step], padded[middle + step]) + step_squared)
                step += 1
                step_squared = np.float32(step) * np.float32(step)
            squared[y, x] = np.int32(best)
            largest = max(largest, squared[y, x])
    if not edges:
        squared[:] = NO_EDGE
        largest = NO_EDGE
    return squared, largest


@cache
def _circles(max_radius_px: int) -> tuple[np.ndarray, np.ndarray]:
    """(K, 2) int32 offsets dy, dx of circles of radii 0, 1/4, 1/2, ... up to max_radius_px pixels, and `first`.

    The circle of radius i / RADII_PER_PIXEL is offsets[first[i] : first[i + 1]].
    """
    angles = 2 * np.pi * np.arange(CIRCLE_POINTS) / CIRCLE_POINTS
    points = np.stack([np.sin(angles), np.cos(angles)], axis=1)
    radii = np.arange(max_radius_px * RADII_PER_PIXEL + 1) / RADII_PER_PIXEL
    # Rounding to 9 digits makes points half-way between two pixels independent of the last bit of the sine.
    circles = [np.unique(np.rint((radius * points).round(9)).astype(np.int32), axis=0) for radius in radii]
    first = np.cumsum([0] + [len(circle) for circle in circles]).astype(np.int32)
    return np.concatenate(circles), first


@njit(cache=True)
def _circle_ratios(squared, largest, offsets, first):
    """(H, W) float32 R_T, 1 on edges. Unsigned indices halve the time: numba does not test them for negative values."""
    height, width = squared.shape
    distance = np.sqrt(squared.ravel().astype(np.float32))
    # The offsets as index steps in the flattened map, for pixels whose circle lies inside the image.
    step = np.empty(first[int(math.sqrt(largest) * RADII_PER_PIXEL) + 2], np.uintp)
    for k in range(len(step)):
        step[k] = np.uintp(offsets[k, 0] * width + offsets[k, 1])
    ratio = np.ones((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            if squared[y, x] == 0:
                continue
            here = np.uintp(y * width + x)
            radius = distance[here]
            circle = int(radius * np.float32(RADII_PER_PIXEL) + np.float32(0.5))
            begin, end = first[circle], first[circle + 1]
            margin = int(radius) + 1
            total = np.float32(0)
            if margin <= y < height - margin and margin <= x < width - margin:
                # Four independent sums: each addition to a single sum would wait for the previous one.
                sum_1, sum_2, sum_3 = np.float32(0), np.float32(0), np.float32(0)
                k = begin
                while k + 4 <= end:
                    total += distance[here + step[np.uintp(k)]]
                    sum_1 += distance[here + step[np.uintp(k + 1)]]
                    sum_2 += distance[here + step[np.uintp(k + 2)]]
                    sum_3 += distance[here + step[np.uintp(k + 3)]]
                    k += 4
                while k < end:
                    total += distance[here + step[np.uintp(k)]]
                    k += 1
                total = (total + sum_1) + (sum_2 + sum_3)
                count = end - begin
            else:
                count = 0
                for k in range(begin, end):
                    v, u = y + offsets[k, 0], x + offsets[k, 1]
                    if 0 <= v < height and 0 <= u < width:
                        total += distance[v * width + u]
                        count += 1
            # Eq. (2): the mean over the circle divided by D_T; undefined if the circle lies outside the image
            if count:
                ratio[y, x] = total / (np.float32(count) * radius)
    return ratio
