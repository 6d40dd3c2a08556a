"""What is known of the empty room, and what of a picture is neither floor nor known room.

The paper takes for human what moves between two frames. At thirty frames a second a slow movement is smaller than the
noise, and who stops is lost. So the room is remembered, pixel by pixel, wherever no human is, and the movement of
Algorithm 1 is taken against this memory: what stands clearly in front of it has moved there at some time. People are
never learned, so they may stand still as long as they like, and furniture that they touch is told apart from them.

The memory is the mean over the last pictures. It gives way at once where something farther comes to light, and slowly to
what stays in front of it (a chair that was moved).
"""

import math

import cv2
import numpy as np
from numba import njit

NOTHING, FLOOR, ROOM, FOREGROUND = 0, 1, 2, 4
"""What a pixel shows: no measurement, floor, something that the memory knows, something in front of that. Bits, so that
several kinds can be asked for at once."""

FAR_M = 20.0
"""Depth of a room where nothing was ever measured; measurements from there on are none."""

COVERED_M = 30.0
"""Depth of a room that somebody has hidden from the first picture on."""

NOBODY, UNCOVERED = 0, 255
"""Whose a pixel is, besides the numbers of people; UNCOVERED is what has come to light where somebody was."""

OUTLINE_PX, OUTLINE_M, SHADOW_M = 2, 0.1, 0.1
"""How far around and behind somebody their outline may waver, and how far beside them the room may lie in the shadow that
they cast (a projector stands less than that beside its camera)."""

CHECKED_ROWS, UNLIKE = 4, 0.1
"""Neighbouring depths that differ by more than this share are unlike; looked at in every so many rows."""

LEARNING = 1 / 32
"""So much of the difference to the memory is learned from one picture."""


@njit(cache=True)
def is_picture(raw):
    """Whether neighbours in (H, W) raw depth are alike for the most part: not so in an empty or a broken picture."""
    height, width = raw.shape
    pairs = alike = 0
    for y in range(0, height, CHECKED_ROWS):
        row = raw[y]
        for x in range(1, width):
            before, z = row[x - 1], row[x]
            measured = (before > 0) & (z > 0)
            pairs += measured
            alike += measured & (abs(z - before) < np.float32(UNLIKE) * z)
    return alike * 2 > pairs


@njit(cache=True)
def sort_pixels(raw, room, plane, delta, epsilon, intrinsics, depth, kind):
    """Floor removal and removal of the known room, in one pass.

    Args:
        raw: (H, W) float32 metres; what is not above 0 and below FAR_M counts as not measured.
        room: (H, W) float32, the memory.
        plane: (4,) float32 the floor.
        delta: (2,) float32 a, b: less than a + b z above the plane is floor; all 0 where there is none.
        epsilon: (2,) float32 a, b: nearer than the room by more than a + b z^2 is in front of it.
        intrinsics: (4,) float32 fx, fy, cx, cy.
        depth: (H, W) float32, filled with what was measured, 0 elsewhere.
        kind: (H, W) uint8, filled.
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
        above, here, below = room[max(y - 1, 0)], room[y], room[min(y + 1, height - 1)]
        measured, cleaned, sorted_row = raw[y], depth[y], kind[y]
        # Noise goes sideways too, by about a pixel: the memory of the neighbours counts.
        for x in range(width):
            nearest[x + 1] = min(min(above[x], below[x]), here[x])
        up_y = plane[1] * (np.float32(y) - cy) / fy + plane[2]
        for x in range(width):
            z = measured[x]
            z = z if (z > zero) & (z < far) else zero
            cleaned[x] = z
            known = min(min(nearest[x], nearest[x + 2]), nearest[x + 1])
            # X_n A - d of Algorithm 1, the height above the floor
            height_m = z * (up_x[x] + up_y) + above_plane
            what = np.uint8(FOREGROUND) if z + epsilon_0 + epsilon_2 * z * z < known else np.uint8(ROOM)
            what = np.uint8(FLOOR) if has_floor & (height_m < delta_0 + delta_1 * z) else what
            sorted_row[x] = what if z > zero else np.uint8(NOTHING)


@njit(cache=True)
def learn(depth, kind, owner, room, epsilon):
    """Remembers what is neither human nor floor; arguments as in `sort_pixels`, owner (H, W) uint8."""
    height, width = depth.shape
    far, rate = np.float32(FAR_M), np.float32(LEARNING)
    for y in range(height):
        seen, what, whose, memory = depth[y], kind[y], owner[y], room[y]
        for x in range(width):
            z, known = seen[x], memory[x]
            farther = z > known + epsilon[0] + epsilon[1] * z * z
            learned = known if known > far else known + (z - known) * rate
            learned = z if farther | (whose[x] == UNCOVERED) else learned
            learned = learned if what[x] >= ROOM else known
            # Where the floor has come to light there is no room before it.
            learned = far if farther & (what[x] == FLOOR) else learned
            memory[x] = learned if (whose[x] == NOBODY) | (whose[x] == UNCOVERED) else known


def forget_human(room: np.ndarray, depth_m: np.ndarray, silhouette: np.ndarray, focal_px: float) -> None:
    """Somebody who stood still was taken for room: they are forgotten, their ragged outline and their shadow with them.

    Args:
        room: (H, W) float32 memory, changed.
        depth_m: (H, W) float32 metres.
        silhouette: (H, W) bool.
        focal_px: of the camera.
    """
    nearest_m, farthest_m = depth_m[silhouette].min(), depth_m[silhouette].max() + OUTLINE_M
    measured = depth_m > 0
    outline = grown(silhouette, OUTLINE_PX) & ((room < farthest_m) | (measured & (depth_m < farthest_m)))
    shadow = grown(silhouette, math.ceil(SHADOW_M * focal_px / nearest_m)) & ~measured & (room == FAR_M)
    room[silhouette | outline | shadow] = COVERED_M


def grown(mask: np.ndarray, reach_px: int) -> np.ndarray:
    """(H, W) bool: what is in a mask or within so many pixels of it."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)) > 0
