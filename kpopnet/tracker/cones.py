"""Round cones against points: distances to the parts of a body, and where a part contradicts the picture.

Points and joints are in the camera frame in metres; `extend` gives the joints toes, fingers and a trunk.
"""

import math

import numpy as np
from numba import njit

from kpopnet.skeleton import Joint
from kpopnet.tracker.body import LIMBS, PLACE_JOINTS, RIGHT_CHEST, RIGHT_FINGERS, RIGHT_TOES
from kpopnet.tracker.cells import CELL_PX

NECK, RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.NECK), int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)

FINGERS_M = 0.08
TOES_M, TOES_DOWN_M = 0.10, 0.02
"""How far hands and feet go on beyond their joints: fingers along the forearm, toes forwards and down the shin."""

BENT_KNEE = 7.5
"""A foot points where the torso faces, the more to where its knee points the more that is bent: by this a metre."""

IN_FRONT_M = 0.04
"""So far a part may stand in front of what was measured: thickness and noise."""

PUSH_BACK_M = 0.3
HIDDEN_M = 0.06


@njit(cache=True)
def frame_of(joints):
    """(3, 3) rows: the torso's right, down and front, unit vectors in the camera frame."""
    frame = np.empty((3, 3))
    length = 0.0
    for c in range(3):
        frame[1, c] = (joints[RIGHT_HIP, c] + joints[LEFT_HIP, c]) / 2 - joints[NECK, c]
        frame[0, c] = joints[RIGHT_SHOULDER, c] - joints[LEFT_SHOULDER, c] + joints[RIGHT_HIP, c] - joints[LEFT_HIP, c]
        length += frame[1, c] ** 2
    _scale(frame[1], math.sqrt(length))
    _take_away(frame[0], frame[1])
    right, down = frame[0], frame[1]
    frame[2, 0] = right[1] * down[2] - right[2] * down[1]
    frame[2, 1] = right[2] * down[0] - right[0] * down[2]
    frame[2, 2] = right[0] * down[1] - right[1] * down[0]
    return frame


@njit(cache=True)
def _scale(vector, length):
    for c in range(3):
        vector[c] /= length + 1e-9


@njit(cache=True)
def _take_away(vector, unit):
    """Leaves of a vector what is across to a unit vector, at length one."""
    along = vector[0] * unit[0] + vector[1] * unit[1] + vector[2] * unit[2]
    length = 0.0
    for c in range(3):
        vector[c] -= along * unit[c]
        length += vector[c] ** 2
    _scale(vector, math.sqrt(length))


@njit(cache=True)
def extend_limb(joints, limb, front):
    """Writes the far end of a hand or a foot, the row after the joints that belongs to limb 0 to 3."""
    root, middle, end = LIMBS[limb, 0], LIMBS[limb, 1], LIMBS[limb, 2]
    along, length = np.empty(3), 0.0
    for c in range(3):
        along[c] = joints[end, c] - joints[middle, c]
        length += along[c] ** 2
    _scale(along, math.sqrt(length))
    if limb < 2:
        for c in range(3):
            joints[RIGHT_FINGERS + limb, c] = joints[end, c] + FINGERS_M * along[c]
        return
    toes = np.empty(3)
    for c in range(3):
        toes[c] = front[c] + BENT_KNEE * (joints[middle, c] - (joints[root, c] + joints[end, c]) / 2)
    _take_away(toes, along)
    for c in range(3):
        joints[RIGHT_TOES + limb - 2, c] = joints[end, c] + TOES_M * toes[c] + TOES_DOWN_M * along[c]


@njit(cache=True)
def extend(joints, places):
    """(25, 3) the (15, 3) joints, then toes, fingers and the (6, 3) places in the trunk of a Body, right before left."""
    rows = np.empty((RIGHT_CHEST + len(places), 3))
    rows[: len(joints)] = joints
    frame = frame_of(joints)
    for limb in range(4):
        extend_limb(rows, limb, frame[2])
    for k in range(len(places)):
        for c in range(3):
            way = places[k, 0] * frame[0, c] + places[k, 1] * frame[1, c] + places[k, 2] * frame[2, c]
            rows[RIGHT_CHEST + k, c] = joints[PLACE_JOINTS[k], c] + way
    return rows


@njit(cache=True)
def axes_of(joints, parts, radii):
    """(P, 9) of every part: its first end, the vector to the other, one over that squared, radius and its growth."""
    axes = np.empty((len(parts), 9))
    for k in range(len(parts)):
        set_axis(axes, k, joints, parts, radii)
    return axes


@njit(cache=True)
def set_axis(axes, k, joints, parts, radii):
    a, b = parts[k, 0], parts[k, 1]
    length = 0.0
    for c in range(3):
        axes[k, c] = joints[a, c]
        axes[k, 3 + c] = joints[b, c] - joints[a, c]
        length += axes[k, 3 + c] ** 2
    axes[k, 6] = 1 / (length + 1e-9)
    axes[k, 7], axes[k, 8] = radii[k, 0], radii[k, 1] - radii[k, 0]


@njit(cache=True)
def off_surface(axes, k, x, y, z):
    """A point's signed distance to part k's surface, its place along the axis in 0..1, and its distance to the axis."""
    return off_cone(axes[k, 0], axes[k, 1], axes[k, 2], axes[k, 3], axes[k, 4], axes[k, 5], axes[k, 6], axes[k, 7], axes[k, 8],
                    x, y, z)  # fmt: skip


@njit(cache=True)
def off_cone(x0, y0, z0, dx, dy, dz, scale, radius, growth, x, y, z):
    """`off_surface` of the part whose row of `axes_of` comes first: loops over points that name its numbers vectorise."""
    px, py, pz = x - x0, y - y0, z - z0
    along = min(max((px * dx + py * dy + pz * dz) * scale, 0.0), 1.0)
    px -= along * dx
    py -= along * dy
    pz -= along * dz
    distance = math.sqrt(px * px + py * py + pz * pz)
    return distance - radius - along * growth, along, distance


@njit(cache=True)
def nearest_parts(axes, points, every):
    """Of every `every`th point the number of the part that it is nearest to or deepest in, the signed distance to that part's
    surface, and the place along its axis in 0..1; the last two are float32.

    The least signed distance, not the least absolute one, is that to the surface of all parts together. A surface inside
    another part is none: points would rest on it, and a trunk that is a little beside would stay there.

    Part by part, not point by point, and in single precision, which vectorises: this is where the time of fitting goes.
    """
    count = (len(points) + every - 1) // every
    x, y, z = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    for i in range(count):
        x[i], y[i], z[i] = points[i * every, 0], points[i * every, 1], points[i * every, 2]
    part, off, along = np.zeros(count, np.int32), np.full(count, np.float32(1e9)), np.zeros(count, np.float32)
    single, zero, one = axes.astype(np.float32), np.float32(0), np.float32(1)
    for k in range(len(axes)):
        x0, y0, z0, dx, dy, dz, scale, radius, growth = single[k]
        number = np.int32(k)
        for i in range(count):
            # As `off_surface`
            px, py, pz = x[i] - x0, y[i] - y0, z[i] - z0
            t = min(max((px * dx + py * dy + pz * dz) * scale, zero), one)
            px -= t * dx
            py -= t * dy
            pz -= t * dz
            off_k = math.sqrt(px * px + py * py + pz * pz) - radius - t * growth
            nearer = off_k < off[i]
            part[i] = number if nearer else part[i]
            off[i] = off_k if nearer else off[i]
            along[i] = t if nearer else along[i]
    return part, off, along


@njit(cache=True)
def intrusion(axes, k, along, depth, nearest, intrinsics):
    """How a place on part k's axis contradicts the picture.

    Returns the way out of the contradiction in metres, 0 if there is none, and whether the place is hidden.
    """
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    x, y, z = axes[k, 0] + along * axes[k, 3], axes[k, 1] + along * axes[k, 4], axes[k, 2] + along * axes[k, 5]
    if z < 0.2:
        return 0.0, 0.0, 0.0, False
    u, v = int(np.rint(x * fx / z + cx)), int(np.rint(y * fy / z + cy))
    if u < 0 or v < 0 or v >= depth.shape[0] or u >= depth.shape[1]:
        return 0.0, 0.0, 0.0, False
    if depth[v, u] > 0:
        front = z - axes[k, 7] - along * axes[k, 8]
        behind = depth[v, u] - front
        return 0.0, 0.0, (min(behind, PUSH_BACK_M) if behind > IN_FRONT_M else 0.0), behind < -HIDDEN_M
    row, column = nearest[v // CELL_PX, u // CELL_PX, 0], nearest[v // CELL_PX, u // CELL_PX, 1]
    if row < 0 or (row == v // CELL_PX and column == u // CELL_PX):
        return 0.0, 0.0, 0.0, False
    middle = (CELL_PX - 1) / 2
    return (column * CELL_PX + middle - cx) * z / fx - x, (row * CELL_PX + middle - cy) * z / fy - y, 0.0, False
