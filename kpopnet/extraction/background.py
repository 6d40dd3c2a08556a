"""Background model of the empty room, and the classification of each pixel against it.

The paper calls human what moves between two frames. At thirty frames per second, a slow movement is smaller than the
noise, and a person who stops is lost. Therefore this module keeps a background depth for every pixel where no person is.
The movement of Algorithm 1 is measured against this background: whatever stands clearly in front of it has moved there
at some time. People are never learned into the background, so they may stand still for any length of time, and furniture
that they touch is separated from them.

The background is a running mean over the last images. It is replaced at once where a greater depth is measured, and
changes slowly where something stays in front of it (a chair that was moved).
"""

import math

import cv2
import numpy as np
from numba import njit

UNMEASURED, FLOOR, BACKGROUND, FOREGROUND = 0, 1, 2, 4
"""Kind of a pixel: no measurement; floor; at the depth of the background; in front of the background. The values are bits,
so that a set of kinds is one integer."""

FAR_M = 20.0
"""Background depth of a pixel that was never measured. Measurements at this depth or beyond count as not measured."""

OCCLUDED_M = 30.0
"""Background depth of a pixel that a person has occluded since the first image."""

NO_PERSON, UNCOVERED = 0, 255
"""Owners of pixels besides the numbers of the tracked people. UNCOVERED is background that a person occluded before."""

OUTLINE_PX, OUTLINE_M, SHADOW_M = 2, 0.1, 0.1
"""A person's outline varies by up to OUTLINE_PX in the image and OUTLINE_M in depth. The shadow of a person on the
background is at most SHADOW_M wide (the distance between a structured-light projector and its camera is smaller)."""

ROW_STRIDE, MAX_RELATIVE_STEP = 4, 0.1
"""`is_depth_image` tests every fourth row. Depths of neighbouring pixels are similar if they differ by less than this
fraction."""

LEARNING_RATE = 1 / 32
"""Fraction of the difference to the measured depth by which one image changes the background."""


@njit(cache=True)
def is_depth_image(raw):
    """Whether most neighbouring pixels of (H, W) raw depth have similar depths; false for an empty or corrupt image."""
    height, width = raw.shape
    pairs = similar = 0
    for y in range(0, height, ROW_STRIDE):
        row = raw[y]
        for x in range(1, width):
            before, z = row[x - 1], row[x]
            measured = (before > 0) & (z > 0)
            pairs += measured
            similar += measured & (abs(z - before) < np.float32(MAX_RELATIVE_STEP) * z)
    return similar * 2 > pairs


@njit(cache=True)
def classify_pixels(raw, background, plane, delta, epsilon, intrinsics, depth, kind):
    """Removes the floor and the known background, in one pass.

    Args:
        raw: (H, W) float32 metres; values outside 0 < z < FAR_M count as not measured.
        background: (H, W) float32 background depth in metres.
        plane: (4,) float32 the floor plane.
        delta: (2,) float32 a, b: a pixel less than a + b z above the plane is floor; both 0 if there is no floor.
        epsilon: (2,) float32 a, b: a pixel nearer than the background by more than a + b z^2 is foreground.
        intrinsics: (4,) float32 fx, fy, cx, cy.
        depth: (H, W) float32, filled with the measured depth in metres, 0 where not measured.
        kind: (H, W) uint8, filled with UNMEASURED, FLOOR, BACKGROUND or FOREGROUND.
    """
    height, width = raw.shape
    fx, fy, cx, cy = intrinsics
    epsilon_0, epsilon_2 = epsilon
    delta_0, delta_1 = delta
    above_plane, has_floor = plane[3], delta_1 > 0
    zero, far = np.float32(0), np.float32(FAR_M)
    up_x = np.empty(width, np.float32)
    for x in range(width):
        up_x[x] = plane[0] * (np.float32(x) - cx) / fx
    nearest = np.empty(width + 2, np.float32)
    nearest[0] = nearest[-1] = far
    for y in range(height):
        above, here, below = background[max(y - 1, 0)], background[y], background[min(y + 1, height - 1)]
        measured, depth_row, kind_row = raw[y], depth[y], kind[y]
        # Noise also displaces depth edges by about a pixel: compare with the nearest background in a 3x3 window.
        for x in range(width):
            nearest[x + 1] = min(min(above[x], below[x]), here[x])
        up_y = plane[1] * (np.float32(y) - cy) / fy + plane[2]
        for x in range(width):
            z = measured[x]
            z = z if (z > zero) & (z < far) else zero
            depth_row[x] = z
            background_z = min(min(nearest[x], nearest[x + 2]), nearest[x + 1])
            # X_n A - d of Algorithm 1: the height above the floor
            height_m = z * (up_x[x] + up_y) + above_plane
            found = np.uint8(FOREGROUND) if z + epsilon_0 + epsilon_2 * z * z < background_z else np.uint8(BACKGROUND)
            found = np.uint8(FLOOR) if has_floor & (height_m < delta_0 + delta_1 * z) else found
            kind_row[x] = found if z > zero else np.uint8(UNMEASURED)


@njit(cache=True)
def update_background(depth, kind, owner, background, epsilon):
    """Updates the background where there is neither a person nor floor.

    Args:
        depth: (H, W) float32 metres, from `classify_pixels`.
        kind: (H, W) uint8, from `classify_pixels`.
        owner: (H, W) uint8 the person that each pixel belongs to, NO_PERSON or UNCOVERED.
        background: (H, W) float32 metres, changed.
        epsilon: (2,) float32, as in `classify_pixels`.
    """
    height, width = depth.shape
    far, rate = np.float32(FAR_M), np.float32(LEARNING_RATE)
    for y in range(height):
        depth_row, kind_row, owner_row, background_row = depth[y], kind[y], owner[y], background[y]
        for x in range(width):
            z, known = depth_row[x], background_row[x]
            farther = z > known + epsilon[0] + epsilon[1] * z * z
            updated = known if known > far else known + (z - known) * rate
            updated = z if farther | (owner_row[x] == UNCOVERED) else updated
            updated = updated if kind_row[x] >= BACKGROUND else known
            # Floor behind the stored background: the object that stood there is gone.
            updated = far if farther & (kind_row[x] == FLOOR) else updated
            background_row[x] = updated if (owner_row[x] == NO_PERSON) | (owner_row[x] == UNCOVERED) else known


def remove_person(background: np.ndarray, depth_m: np.ndarray, silhouette: np.ndarray, focal_px: float) -> None:
    """Removes from the background a person who stood still and was learned, with their noisy outline and their shadow.

    Args:
        background: (H, W) float32 metres, changed.
        depth_m: (H, W) float32 metres.
        silhouette: (H, W) bool, the person's pixels.
        focal_px: focal length in pixels.
    """
    nearest_m, farthest_m = depth_m[silhouette].min(), depth_m[silhouette].max() + OUTLINE_M
    measured = depth_m > 0
    outline = dilated(silhouette, OUTLINE_PX) & ((background < farthest_m) | (measured & (depth_m < farthest_m)))
    shadow = dilated(silhouette, math.ceil(SHADOW_M * focal_px / nearest_m)) & ~measured & (background == FAR_M)
    background[silhouette | outline | shadow] = OCCLUDED_M


def dilated(mask: np.ndarray, radius_px: int) -> np.ndarray:
    """(H, W) bool: the mask dilated by a square of side 2 radius_px + 1."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * radius_px + 1, 2 * radius_px + 1), np.uint8)) > 0
