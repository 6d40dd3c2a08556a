"""Objects: 3D connected components of a depth image (the second part of Algorithm 1), and how far each has moved."""

import numpy as np
from numba import njit

EPSILON_Z_PER_M2 = 1.5 / 345
"""epsilon_z grows with the square of the depth, as the depth steps of a triangulating camera do (Kinect v1: z^2 / 345 m)."""

MOVED_EPSILON_Z = 4
"""A pixel has moved if it is by more than this many epsilon_z nearer than in the image before: noise of a wall is less."""

OBJECT = np.dtype(
    [
        ("area_m2", np.float32),  # of its surface, as if it faced the camera
        ("moved_m2", np.float32),  # of the part where it came in front of what was seen in the image before
        ("centre_m", np.float32, 3),  # mean of its points, camera frame
        ("box", np.int32, 4),  # x0, y0, x1, y1 in pixels, the last two exclusive
    ]
)


@njit(cache=True)
def label_components(depth_m, epsilon_z_m):
    """(H, W) int32 labels, from 1 in the order of the objects' first pixels, 0 where nothing is; and the number of objects.

    Of (H, W) float32 metres, 0 where nothing is. `epsilon_z_m` is the greatest difference in depth of neighbours of one object,
    at the camera (`EPSILON_Z_PER_M2`).
    """
    height, width = depth_m.shape
    labels, linked = np.zeros((height, width), np.int32), np.zeros(height * width + 1, np.int32)
    next_label = 1
    for y in range(height):
        for x in range(width):
            z = depth_m[y, x]
            if z == 0:
                continue
            # neighbours = connected depth pixels with the similar depth value
            left = labels[y, x - 1] if x > 0 and _is_similar(z, depth_m[y, x - 1], epsilon_z_m) else 0
            above = labels[y - 1, x] if y > 0 and _is_similar(z, depth_m[y - 1, x], epsilon_z_m) else 0
            if left == 0 and above == 0:
                labels[y, x] = linked[next_label] = next_label
                next_label += 1
            elif left == 0 or above == 0:
                labels[y, x] = left + above
            else:
                labels[y, x] = min(left, above)
                _union(linked, left, above)
    # labels_j = find(labels_j). A label is linked to a smaller one, or to itself.
    number, count = np.zeros(next_label, np.int32), 0
    for label in range(1, next_label):
        if linked[label] == label:
            count += 1
            number[label] = count
        else:
            number[label] = number[linked[label]]
    for y in range(height):
        for x in range(width):
            labels[y, x] = number[labels[y, x]]
    return labels, count


@njit(cache=True)
def measure_objects(labels, count, depth_m, before_m, intrinsics, epsilon_z_m):
    """(count + 1,) OBJECT by label, 0 where nothing is, from (H, W) float32 metres of the image and of the one before, 0 where
    nothing was measured, and (4,) float32 fx, fy, cx, cy; the others as in `label_components`.
    """
    fx, fy, cx, cy = intrinsics
    objects = np.zeros(count + 1, OBJECT)
    pixels = np.zeros(count + 1, np.int32)
    for label in range(count + 1):
        objects[label].box[:2] = max(labels.shape)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            label = labels[y, x]
            if label == 0:
                continue
            one, z, z_before = objects[label], depth_m[y, x], before_m[y, x]
            pixels[label] += 1
            one.area_m2 += z * z / (fx * fy)
            # delta d(X_i) = d^t(X_i) - d^(t-1)(X_i)
            if z < z_before and not _is_similar(z, z_before, epsilon_z_m, MOVED_EPSILON_Z):
                one.moved_m2 += z * z / (fx * fy)
            one.centre_m[0] += z * (x - cx) / fx
            one.centre_m[1] += z * (y - cy) / fy
            one.centre_m[2] += z
            one.box[0], one.box[1] = min(one.box[0], x), min(one.box[1], y)
            one.box[2], one.box[3] = max(one.box[2], x + 1), max(one.box[3], y + 1)
    for label in range(1, count + 1):
        for axis in range(3):
            objects[label].centre_m[axis] /= pixels[label]
    return objects


@njit(cache=True)
def _is_similar(z, other, epsilon_z_m, times=1):
    # |d(X_i) - d(X_i + i)| <= epsilon_z
    return abs(z - other) <= times * (epsilon_z_m + EPSILON_Z_PER_M2 * z * other)


@njit(cache=True)
def _union(linked, a, b):
    while linked[a] != a:
        a = linked[a]
    while linked[b] != b:
        b = linked[b]
    linked[max(a, b)] = min(a, b)
