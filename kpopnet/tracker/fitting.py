"""A body fitted to the measured points, and the misfit that tells a good pose from a bad one.

Beyond the paper. Each round every point pulls the part nearest to it onto itself, what sticks out of the silhouette or
stands in front of what was measured is pushed back, and the distances between joints are put right (position-based
dynamics, Müller et al. 2007). Started near the truth it stays there; from farther away it may not arrive, which is what
`kpopnet.tracker.proposals` is for, and `misfit` tells.

Points and joints are in the camera frame in metres throughout.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.skeleton import Joint
from kpopnet.tracker.body import MOBILITY, PARTS, Body

NECK, RIGHT_SHOULDER, LEFT_SHOULDER = int(Joint.NECK), int(Joint.RIGHT_SHOULDER), int(Joint.LEFT_SHOULDER)
RIGHT_HIP, LEFT_HIP = int(Joint.RIGHT_HIP), int(Joint.LEFT_HIP)
RIGHT_KNEE, RIGHT_FOOT = int(Joint.RIGHT_KNEE), int(Joint.RIGHT_FOOT)

CELL_PX = 4
"""One point is taken, and the nearest piece of silhouette is kept, for each square of so many pixels."""

REACH_M = 0.2
"""Points farther from every part pull at none: they may belong to a limb that is somewhere else by mistake."""

STEP = 0.8
LENGTH_SWEEPS = 3
IN_FRONT_M = 0.04
"""So far a part may stand in front of what was measured: thickness and noise."""

PUSH_BACK_M = 0.3
HIDDEN_M = 0.06
HIDDEN_COST = 0.006
"""Square metres for a place on a part that is so far behind what was measured: what can be seen is likelier."""

CLIP_M = 0.12
"""Residuals count up to this: the far ones are all equally wrong."""

FREE_SPACE_WEIGHT = 0.1
KNEE_WEIGHT = 0.02
SAMPLES_ON_PART = 5


class Cells(NamedTuple):
    """A depth image at a `CELL_PX`th of its size.

    Attributes:
        points_m: (N, 3) float64, the point seen at the middle of each cell that is measured there.
        index: (h, w) int32 its number in points_m, or -1.
        nearest: (h, w, 2) int32 row and column of the nearest cell that is measured; negative if none is.
        depth_m: (H, W) float32 the image itself.
        intrinsics: (4,) fx, fy, cx, cy.
    """

    points_m: np.ndarray
    index: np.ndarray
    nearest: np.ndarray
    depth_m: np.ndarray
    intrinsics: np.ndarray


def cells_of(depth_m: np.ndarray, camera: Camera) -> Cells:
    """(H, W) float32 depth of the person alone as cells."""
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    depth_m = np.ascontiguousarray(depth_m)
    points_m, index = _points(depth_m, intrinsics)
    return Cells(points_m, index, _nearest(index), depth_m, intrinsics)


@njit(cache=True)
def _points(depth, intrinsics):
    fx, fy, cx, cy = intrinsics
    height, width = (depth.shape[0] + CELL_PX - 1) // CELL_PX, (depth.shape[1] + CELL_PX - 1) // CELL_PX
    index = np.full((height, width), -1, np.int32)
    points = np.empty((height * width, 3))
    count = 0
    for y in range(height):
        v = min(y * CELL_PX + CELL_PX // 2, depth.shape[0] - 1)
        for x in range(width):
            u = min(x * CELL_PX + CELL_PX // 2, depth.shape[1] - 1)
            z = float(depth[v, u])
            if z > 0:
                points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
                index[y, x] = count
                count += 1
    return points[:count].copy(), index


@njit(cache=True)
def _nearest(index):
    """Each cell's nearest measured cell, handed from neighbour to neighbour in two sweeps: off by a cell at worst."""
    height, width = index.shape
    nearest = np.full((height, width, 2), -(1 << 14), np.int32)
    for y in range(height):
        for x in range(width):
            if index[y, x] >= 0:
                nearest[y, x, 0], nearest[y, x, 1] = y, x
    for sweep in range(2):
        back = -1 if sweep == 0 else 1
        for i in range(height):
            y = i if sweep == 0 else height - 1 - i
            for j in range(width):
                x = j if sweep == 0 else width - 1 - j
                best = (nearest[y, x, 0] - y) ** 2 + (nearest[y, x, 1] - x) ** 2
                if best == 0:
                    continue
                for k in range(4):
                    other_y = y + (0 if k == 0 else back)
                    other_x = x + (back if k == 0 else (0, 0, back, -back)[k])
                    if 0 <= other_y < height and 0 <= other_x < width:
                        row, column = nearest[other_y, other_x, 0], nearest[other_y, other_x, 1]
                        away = (row - y) ** 2 + (column - x) ** 2
                        if away < best:
                            best = away
                            nearest[y, x, 0], nearest[y, x, 1] = row, column
    return nearest


@njit(cache=True)
def _axes(joints, parts, radii):
    """(P, 9) of every part: its first end, the vector to the other, one over that squared, radius and its growth."""
    axes = np.empty((len(parts), 9))
    for k in range(len(parts)):
        _set_axis(axes, k, joints, parts, radii)
    return axes


@njit(cache=True)
def _set_axis(axes, k, joints, parts, radii):
    a, b = parts[k, 0], parts[k, 1]
    length = 0.0
    for c in range(3):
        axes[k, c] = joints[a, c]
        axes[k, 3 + c] = joints[b, c] - joints[a, c]
        length += axes[k, 3 + c] ** 2
    axes[k, 6] = 1 / (length + 1e-9)
    axes[k, 7], axes[k, 8] = radii[k, 0], radii[k, 1] - radii[k, 0]


@njit(cache=True)
def _off_surface(axes, k, x, y, z):
    """A point's signed distance to part k's surface, its place along the axis in 0..1, and its distance to the axis."""
    px, py, pz = x - axes[k, 0], y - axes[k, 1], z - axes[k, 2]
    along = (px * axes[k, 3] + py * axes[k, 4] + pz * axes[k, 5]) * axes[k, 6]
    along = min(max(along, 0.0), 1.0)
    px -= along * axes[k, 3]
    py -= along * axes[k, 4]
    pz -= along * axes[k, 5]
    distance = math.sqrt(px * px + py * py + pz * pz)
    return distance - axes[k, 7] - along * axes[k, 8], along, distance


@njit(cache=True)
def _nearest_parts(axes, points, every):
    """Of every `every`th point the number of the part whose surface is nearest, and the signed distance to it.

    Part by part, not point by point, which vectorises: this is where the time of fitting goes.
    """
    count = (len(points) + every - 1) // every
    x, y, z = np.empty(count), np.empty(count), np.empty(count)
    for i in range(count):
        x[i], y[i], z[i] = points[i * every, 0], points[i * every, 1], points[i * every, 2]
    part, off = np.zeros(count, np.int64), np.full(count, 1e9)
    for k in range(len(axes)):
        x0, y0, z0, dx, dy, dz = axes[k, 0], axes[k, 1], axes[k, 2], axes[k, 3], axes[k, 4], axes[k, 5]
        scale, radius, growth = axes[k, 6], axes[k, 7], axes[k, 8]
        for i in range(count):
            # As `_off_surface`
            px, py, pz = x[i] - x0, y[i] - y0, z[i] - z0
            along = min(max((px * dx + py * dy + pz * dz) * scale, 0.0), 1.0)
            px -= along * dx
            py -= along * dy
            pz -= along * dz
            off_k = math.sqrt(px * px + py * py + pz * pz) - radius - along * growth
            nearer = abs(off_k) < abs(off[i])
            part[i] = k if nearer else part[i]
            off[i] = off_k if nearer else off[i]
    return part, off


@njit(cache=True)
def _intrusion(axes, k, along, depth, nearest, intrinsics):
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


@njit(cache=True)
def _keep_lengths(joints, pairs, stiffness, lengths, mobility):
    for _ in range(LENGTH_SWEEPS):
        for k in range(len(pairs)):
            a, b = pairs[k, 0], pairs[k, 1]
            dx, dy, dz = joints[b, 0] - joints[a, 0], joints[b, 1] - joints[a, 1], joints[b, 2] - joints[a, 2]
            length = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-9
            share = stiffness[k] * (length - lengths[k]) / (length * (mobility[a] + mobility[b]))
            to_a, to_b = share * mobility[a], share * mobility[b]
            joints[a, 0] += to_a * dx
            joints[a, 1] += to_a * dy
            joints[a, 2] += to_a * dz
            joints[b, 0] -= to_b * dx
            joints[b, 1] -= to_b * dy
            joints[b, 2] -= to_b * dz


@njit(cache=True)
def _fit(start, points, every, depth, nearest, intrinsics, parts, radii, pairs, stiffness, lengths, mobility, rounds):
    joints = start.copy()
    pull, weight = np.empty((len(joints), 3)), np.empty(len(joints))
    for _ in range(rounds):
        axes = _axes(joints, parts, radii)
        pull[:] = 0
        weight[:] = 1
        part, offs = _nearest_parts(axes, points, every)
        for i in range(len(part)):
            if abs(offs[i]) > REACH_M:
                continue
            k, x, y, z = part[i], points[i * every, 0], points[i * every, 1], points[i * every, 2]
            off, t, distance = _off_surface(axes, k, x, y, z)
            a, b = parts[k, 0], parts[k, 1]
            gain = off / (distance + 1e-9)
            gx = gain * (x - axes[k, 0] - t * axes[k, 3])
            gy = gain * (y - axes[k, 1] - t * axes[k, 4])
            gz = gain * (z - axes[k, 2] - t * axes[k, 5])
            s = 1 - t
            pull[a, 0] += s * gx
            pull[a, 1] += s * gy
            pull[a, 2] += s * gz
            pull[b, 0] += t * gx
            pull[b, 1] += t * gy
            pull[b, 2] += t * gz
            weight[a] += s * s + s * t / 2
            weight[b] += t * t + s * t / 2
        for j in range(len(joints)):
            for c in range(3):
                joints[j, c] += STEP * pull[j, c] / weight[j]
        for k in range(len(parts)):
            a, b = parts[k, 0], parts[k, 1]
            for q in range(3):
                t = q / 2
                _set_axis(axes, k, joints, parts, radii)
                mx, my, mz, _ = _intrusion(axes, k, t, depth, nearest, intrinsics)
                joints[a, 0] += (1 - t) * mx / 2
                joints[a, 1] += (1 - t) * my / 2
                joints[a, 2] += (1 - t) * mz / 2
                joints[b, 0] += t * mx / 2
                joints[b, 1] += t * my / 2
                joints[b, 2] += t * mz / 2
        _keep_lengths(joints, pairs, stiffness, lengths, mobility)
    return joints


def fit(joints_m: np.ndarray, cells: Cells, body: Body, rounds: int, every: int = 1) -> np.ndarray:
    """(15, 3) float64 the joints after some rounds of fitting to every `every`th point."""
    return _fit(
        joints_m, cells.points_m, every, cells.depth_m, cells.nearest, cells.intrinsics,
        PARTS, body.radii_m, body.pairs, body.stiffness, body.lengths_m, MOBILITY, rounds,
    )  # fmt: skip


@njit(cache=True)
def _outside(axes, k, depth, nearest, intrinsics):
    """Mean squared intrusion of part k, clipped."""
    total = 0.0
    for q in range(SAMPLES_ON_PART):
        mx, my, mz, hidden = _intrusion(axes, k, q / (SAMPLES_ON_PART - 1), depth, nearest, intrinsics)
        total += min(mx * mx + my * my + mz * mz + (HIDDEN_COST if hidden else 0.0), CLIP_M * CLIP_M)
    return total / SAMPLES_ON_PART


@njit(cache=True)
def knees_backwards(joints):
    """Sum of squares of how far each knee lies behind the line from hip to foot, as the torso faces: none ever does.

    It is what tells front from back best in a depth image, where a back looks much like a chest.
    """
    up_x = joints[NECK, 0] - (joints[RIGHT_HIP, 0] + joints[LEFT_HIP, 0]) / 2
    up_y = joints[NECK, 1] - (joints[RIGHT_HIP, 1] + joints[LEFT_HIP, 1]) / 2
    up_z = joints[NECK, 2] - (joints[RIGHT_HIP, 2] + joints[LEFT_HIP, 2]) / 2
    right_x, right_y, right_z = (
        joints[RIGHT_SHOULDER, 0] - joints[LEFT_SHOULDER, 0] + joints[RIGHT_HIP, 0] - joints[LEFT_HIP, 0],
        joints[RIGHT_SHOULDER, 1] - joints[LEFT_SHOULDER, 1] + joints[RIGHT_HIP, 1] - joints[LEFT_HIP, 1],
        joints[RIGHT_SHOULDER, 2] - joints[LEFT_SHOULDER, 2] + joints[RIGHT_HIP, 2] - joints[LEFT_HIP, 2],
    )
    front_x, front_y, front_z = (
        up_y * right_z - up_z * right_y,
        up_z * right_x - up_x * right_z,
        up_x * right_y - up_y * right_x,
    )
    length = math.sqrt(front_x**2 + front_y**2 + front_z**2) + 1e-9
    total = 0.0
    for side in range(2):
        hip, knee, foot = RIGHT_HIP + side, RIGHT_KNEE + side, RIGHT_FOOT + side
        out = (joints[knee, 0] - (joints[hip, 0] + joints[foot, 0]) / 2) * front_x
        out += (joints[knee, 1] - (joints[hip, 1] + joints[foot, 1]) / 2) * front_y
        out += (joints[knee, 2] - (joints[hip, 2] + joints[foot, 2]) / 2) * front_z
        total += min(out / length, 0.0) ** 2
    return total


@njit(cache=True)
def _misfit(joints, points, every, depth, nearest, intrinsics, parts, radii):
    axes = _axes(joints, parts, radii)
    _, offs = _nearest_parts(axes, points, every)
    residual = 0.0
    for off in offs:
        residual += min(off * off, CLIP_M * CLIP_M)
    outside = 0.0
    for k in range(len(parts)):
        outside += _outside(axes, k, depth, nearest, intrinsics)
    return residual / max(len(offs), 1) + FREE_SPACE_WEIGHT * outside / len(parts) + KNEE_WEIGHT * knees_backwards(joints)


def misfit(joints_m: np.ndarray, cells: Cells, body: Body, every: int = 1) -> float:
    """How badly a pose explains the picture, in square metres.

    Points off every surface, parts where nothing is or that are hidden, and knees that bend backwards.
    """
    return _misfit(
        joints_m, cells.points_m, every, cells.depth_m, cells.nearest, cells.intrinsics, PARTS, body.radii_m
    )
