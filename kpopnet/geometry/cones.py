"""Distances between points and the round cones of a body.

Points and joints are in the camera frame in metres. `extend_joints` adds toes, fingers and trunk points to the joints.
"""

import math

import numpy as np
from numba import njit

from kpopnet.geometry.body import LIMBS, PARTS, RIGHT_CHEST, RIGHT_FINGERS, RIGHT_TOES, TRUNK_POINT_JOINTS
from kpopnet.skeleton import Joint

NECK, RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.NECK), int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)

FINGERS_M = 0.045
TOES_M, TOES_DOWN_M = 0.10, 0.02
"""Distance in metres from the hand joint to the fingertips along the forearm, and from the foot joint to the toes: forwards
and along the shin. Simulated hands (split train) reach 0.087 m beyond the joint on average, with all the ways in which fingers
curl and wrists bend; the radius at the fingertips is half of that. `tools/tracker_constants.py tips` prints it again."""

KNEE_BEND_GAIN_PER_M = 7.5
"""Toe direction = torso front + this gain, per metre, times the vector from the line hip-foot to the knee. With a bent knee
the foot points where the knee points, with a straight one where the torso faces."""


@njit(cache=True)
def distance(a, b):
    """Euclidean distance of two (3,) points."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def torso_frame(joints):
    """(3, 3) rows: right, down and front of the torso of (15, 3) joints, unit vectors in the camera frame."""
    frame = np.empty((3, 3))
    length = 0.0
    for c in range(3):
        frame[1, c] = (joints[RIGHT_HIP, c] + joints[LEFT_HIP, c]) / 2 - joints[NECK, c]
        frame[0, c] = joints[RIGHT_SHOULDER, c] - joints[LEFT_SHOULDER, c] + joints[RIGHT_HIP, c] - joints[LEFT_HIP, c]
        length += frame[1, c] ** 2
    _normalise(frame[1], math.sqrt(length))
    _orthogonalise(frame[0], frame[1])
    right, down = frame[0], frame[1]
    frame[2, 0] = right[1] * down[2] - right[2] * down[1]
    frame[2, 1] = right[2] * down[0] - right[0] * down[2]
    frame[2, 2] = right[0] * down[1] - right[1] * down[0]
    return frame


@njit(cache=True)
def _normalise(vector, length):
    """Divides a (3,) vector by its length in place."""
    for c in range(3):
        vector[c] /= length + 1e-9


@njit(cache=True)
def _orthogonalise(vector, unit):
    """Subtracts from a (3,) vector its projection on a unit vector and normalises the rest, in place."""
    projection = vector[0] * unit[0] + vector[1] * unit[1] + vector[2] * unit[2]
    length = 0.0
    for c in range(3):
        vector[c] -= projection * unit[c]
        length += vector[c] ** 2
    _normalise(vector, math.sqrt(length))


@njit(cache=True)
def extend_limb(joints, limb, forward):
    """Writes the fingertips or toes of limb 0 to 3 into their row after the joints; `forward` is the torso's front axis."""
    root, middle, end = LIMBS[limb, 0], LIMBS[limb, 1], LIMBS[limb, 2]
    distal, length = np.empty(3), 0.0
    for c in range(3):
        distal[c] = joints[end, c] - joints[middle, c]
        length += distal[c] ** 2
    _normalise(distal, math.sqrt(length))
    if limb < 2:
        for c in range(3):
            joints[RIGHT_FINGERS + limb, c] = joints[end, c] + FINGERS_M * distal[c]
        return
    toes = np.empty(3)
    for c in range(3):
        toes[c] = forward[c] + KNEE_BEND_GAIN_PER_M * (joints[middle, c] - (joints[root, c] + joints[end, c]) / 2)
    _orthogonalise(toes, distal)
    for c in range(3):
        joints[RIGHT_TOES + limb - 2, c] = joints[end, c] + TOES_M * toes[c] + TOES_DOWN_M * distal[c]


@njit(cache=True)
def extend_joints(joints, trunk_offsets):
    """(25, 3) rows: (15, 3) joints, toes, fingers and the trunk points at (6, 3) offsets of a Body; right before left."""
    rows = np.empty((RIGHT_CHEST + len(trunk_offsets), 3))
    for j in range(len(joints)):
        for c in range(3):
            rows[j, c] = joints[j, c]
    frame = torso_frame(joints)
    for limb in range(4):
        extend_limb(rows, limb, frame[2])
    for k in range(len(trunk_offsets)):
        for c in range(3):
            offset = trunk_offsets[k, 0] * frame[0, c] + trunk_offsets[k, 1] * frame[1, c] + trunk_offsets[k, 2] * frame[2, c]
            rows[RIGHT_CHEST + k, c] = joints[TRUNK_POINT_JOINTS[k], c] + offset
    return rows


@njit(cache=True)
def body_segments(joints, body):
    """The `part_segments` of a body in the pose of (15, 3) joints."""
    return part_segments(extend_joints(joints, body.trunk_offsets_m), body.radii_m)


@njit(cache=True)
def part_segments(rows, radii):
    """(P, 9) for each part, from the (25, 3) rows of `extend_joints` and (P, 2) radii: first end, vector to the second end,
    inverse squared length, radius at the first end, change of the radius to the second end.
    """
    segments = np.empty((len(radii), 9))
    for k in range(len(radii)):
        set_segment(segments, k, rows, radii)
    return segments


@njit(cache=True)
def set_segment(segments, k, rows, radii):
    """Writes row k of `part_segments`."""
    a, b = PARTS[k, 0], PARTS[k, 1]
    length = 0.0
    for c in range(3):
        segments[k, c] = rows[a, c]
        segments[k, 3 + c] = rows[b, c] - rows[a, c]
        length += segments[k, 3 + c] ** 2
    segments[k, 6] = 1 / (length + 1e-9)
    segments[k, 7], segments[k, 8] = radii[k, 0], radii[k, 1] - radii[k, 0]


@njit(cache=True)
def axis_point(segments, k, along):
    """x, y, z of the point at position `along` (0..1) on the axis of part k."""
    return (
        segments[k, 0] + along * segments[k, 3],
        segments[k, 1] + along * segments[k, 4],
        segments[k, 2] + along * segments[k, 5],
    )


@njit(cache=True)
def signed_distance(segments, k, x, y, z):
    """Signed distance of a point to the surface of part k, its position along the axis in 0..1, its distance to the axis."""
    return cone_signed_distance(
        segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3], segments[k, 4], segments[k, 5], segments[k, 6],
        segments[k, 7], segments[k, 8], x, y, z,
    )  # fmt: skip


@njit(cache=True)
def cone_signed_distance(x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change, x, y, z):
    """`signed_distance` with the numbers of a row of `part_segments` as scalars: loops over points with scalars vectorise."""
    px, py, pz = x - x0, y - y0, z - z0
    along = min(max((px * dx + py * dy + pz * dz) * inverse_squared_length, 0.0), 1.0)
    px -= along * dx
    py -= along * dy
    pz -= along * dz
    distance = math.sqrt(px * px + py * py + pz * pz)
    return distance - radius - along * radius_change, along, distance


@njit(cache=True)
def nearest_parts(segments, points, stride):
    """The part with the smallest signed distance to every `stride`th point: (n,) int32 its number, (n,) float32 the distance to
    its surface, metres, and (n,) float32 the position along its axis in 0..1.

    The smallest signed distance, not the smallest absolute one, is that to the surface of the union of all parts. With absolute
    ones points would rest on a part's surface inside another part, and a slightly displaced trunk would stay displaced.

    The outer loop runs over parts and the arithmetic is in single precision: the inner loop vectorises. Most of the time of
    fitting is spent here.
    """
    count = (len(points) + stride - 1) // stride
    x, y, z = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    for i in range(count):
        x[i], y[i], z[i] = points[i * stride, 0], points[i * stride, 1], points[i * stride, 2]
    part, distance, along = np.zeros(count, np.int32), np.full(count, np.float32(1e9)), np.zeros(count, np.float32)
    single, zero, one = segments.astype(np.float32), np.float32(0), np.float32(1)
    for k in range(len(segments)):
        x0, y0, z0, dx, dy, dz, inverse_squared_length, radius, radius_change = single[k]
        part_index = np.int32(k)
        for i in range(count):
            # The same as `signed_distance`.
            px, py, pz = x[i] - x0, y[i] - y0, z[i] - z0
            t = min(max((px * dx + py * dy + pz * dz) * inverse_squared_length, zero), one)
            px -= t * dx
            py -= t * dy
            pz -= t * dz
            distance_k = math.sqrt(px * px + py * py + pz * pz) - radius - t * radius_change
            nearer = distance_k < distance[i]
            part[i] = part_index if nearer else part[i]
            distance[i] = distance_k if nearer else distance[i]
            along[i] = t if nearer else along[i]
    return part, distance, along
