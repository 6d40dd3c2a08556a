"""A depth image sampled on a coarse grid: the few hundred points that a body is fitted to, and what lies near them.

Points are in the camera frame in metres. Depth of noisy sensors is smoothed first: a time-of-flight camera's pixel errs by 3 to
6 cm at 2.5 to 4 m, more than a limb is thick, and a fit to one pixel in a cell cannot average over that. Structured light's
pixels are good to a centimetre and stay as they are.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera

CELL_M = 0.025
"""Side of a grid cell at the person's depth in metres, rounded to whole pixels. Each cell contributes one point."""

LEAST_CELLS, MOST_CELLS = 100, 6000
"""Cells shrink or grow where the depth fills fewer or more than about this number: no person does, but noise and whole rooms
would."""

SAMPLING_PX = 4
"""The person's depth is the mean over every fourth pixel of every fourth row."""

MIN_POINTS = 20
"""Smallest number of measured cells from which a pose is estimated."""

MAX_NOISE_M = 0.025
"""Depth with a greater standard deviation of its noise is smoothed: a simulated Kinect's is smaller up to
5 m, a SwissRanger's greater from 2.2 m on."""

MEDIAN_DIFFERENCE = 0.6745 * np.sqrt(1.25)
"""Median absolute difference between a pixel and the mean of its four neighbours, for Gaussian noise of unit variance."""

ROW_STRIDE, WINDOW = 4, 5
"""The noise is measured in every fourth row. Side of the median filter's window, pixels: 3 finds hands better, 5 feet, 7
neither (docs/ledger.md)."""

DEPTH_JUMP_M = 0.08
"""Neighbouring cells whose depths differ by more than this, in metres, belong to parts that only appear connected."""

JUMP_FACTOR = 3.0
"""Factor on the length of an edge across such a depth jump. The edge is costly but usable, so that a limb with depth jumps
all around it stays reachable."""

UNREACHABLE_M = 1e9
"""Distance of points without a path to a source, in metres."""

MIN_TIP_SEPARATION_M, MIN_TIP_DISTANCE_M, MAX_TIPS = 0.15, 0.12, 12
"""A tip is the maximum of the geodesic distance within `MIN_TIP_SEPARATION_M` metres, at least `MIN_TIP_DISTANCE_M` metres from
the source; at most `MAX_TIPS` are used."""


class DepthGrid(NamedTuple):
    """A depth image sampled once per cell of about `CELL_M` x `CELL_M` at the person's depth."""

    points_m: np.ndarray  # (N, 3) float64, the point at the middle pixel of each measured cell, in the camera frame in metres
    neighbours: np.ndarray  # (N, 8) int32 neighbours of each point, see `kpopnet.geometry.depth_grid.neighbour_graph`
    edge_lengths_m: np.ndarray  # (N, 8) float64 lengths of the edges to the neighbours in metres
    nearest: np.ndarray  # (h, w, 2) int32 row and column of the nearest measured cell; negative if no cell is measured
    depth_m: np.ndarray  # (H, W) float32 the depth image in metres, `denoised`
    intrinsics: np.ndarray  # (5,) fx, fy, cx, cy and the side of a cell, in pixels


def build_depth_grid(depth_m: np.ndarray, camera: Camera) -> DepthGrid:
    """Samples an (H, W) float32 depth image in metres, which shows only the person, on the grid."""
    depth_m = denoised(np.ascontiguousarray(depth_m))
    intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy, _cell_side_px(depth_m, camera.fx)])
    points_m, index = cell_points(depth_m, intrinsics)
    return DepthGrid(points_m, *neighbour_graph(points_m, index), _nearest(index), depth_m, intrinsics)


def _cell_side_px(depth_m: np.ndarray, fx: float) -> int:
    """Side in pixels of a cell of `CELL_M` at the mean depth, within the limits that `LEAST_CELLS` and `MOST_CELLS` set."""
    sampled_m = depth_m[::SAMPLING_PX, ::SAMPLING_PX]
    measured_m = sampled_m[sampled_m > 0]
    if not len(measured_m):
        return SAMPLING_PX
    least_px, most_px = (SAMPLING_PX * math.sqrt(len(measured_m) / cells) for cells in (MOST_CELLS, LEAST_CELLS))
    return max(1, round(min(max(CELL_M * fx / measured_m.mean(dtype=np.float64), least_px), most_px)))


@njit(cache=True)
def cell_points(depth, intrinsics):
    """Back-projects the middle pixel of each cell: (N, 3) points in the camera frame in metres, and the (h, w) int32 number of
    each cell's point, -1 without one. `intrinsics` are those of `DepthGrid`.
    """
    fx, fy, cx, cy, cell_px = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], int(intrinsics[4])
    height, width = (depth.shape[0] + cell_px - 1) // cell_px, (depth.shape[1] + cell_px - 1) // cell_px
    index = np.full((height, width), -1, np.int32)
    points = np.empty((height * width, 3))
    count = 0
    for y in range(height):
        v = min(y * cell_px + cell_px // 2, depth.shape[0] - 1)
        for x in range(width):
            u = min(x * cell_px + cell_px // 2, depth.shape[1] - 1)
            z = float(depth[v, u])
            if z > 0:
                points[count, 0], points[count, 1], points[count, 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
                index[y, x] = count
                count += 1
    return points[:count].copy(), index


@njit(cache=True)
def _nearest(index):
    """(h, w, 2) row and column of the nearest measured cell; negative if no cell is measured.

    Propagated between neighbours in two sweeps of the measured cells' bounding box: the distance is at most one cell larger
    than the true minimum. Cells outside the box, most of an image, take the nearest of the box's cell next to them.
    """
    height, width = index.shape
    nearest = np.full((height, width, 2), -(1 << 14), np.int32)
    top, bottom, left, right = height, -1, width, -1
    for y in range(height):
        for x in range(width):
            if index[y, x] >= 0:
                nearest[y, x, 0], nearest[y, x, 1] = y, x
                top, bottom, left, right = min(top, y), y, min(left, x), max(right, x)
    if bottom < 0:
        return nearest
    for step in (1, -1):
        for y in range(top, bottom + 1) if step > 0 else range(bottom, top - 1, -1):
            for x in range(left, right + 1) if step > 0 else range(right, left - 1, -1):
                if index[y, x] < 0:
                    _take_nearer(nearest, y, x, step)
    for y in range(height):
        for x in range(width):
            row, column = min(max(y, top), bottom), min(max(x, left), right)
            nearest[y, x, 0], nearest[y, x, 1] = nearest[row, column, 0], nearest[row, column, 1]
    return nearest


@njit(cache=True)
def _take_nearer(nearest, y, x, step):
    """Gives a cell the nearest measured cell of the four neighbours before it in a sweep, if that is nearer than its own."""
    height, width, _ = nearest.shape
    best = (nearest[y, x, 0] - y) ** 2 + (nearest[y, x, 1] - x) ** 2
    for dy, dx in ((0, step), (step, 0), (step, 1), (step, -1)):
        if 0 <= y - dy < height and 0 <= x - dx < width:
            row, column = nearest[y - dy, x - dx, 0], nearest[y - dy, x - dx, 1]
            distance = (row - y) ** 2 + (column - x) ** 2
            if distance < best:
                best = distance
                nearest[y, x, 0], nearest[y, x, 1] = row, column


def denoised(depth_m: np.ndarray) -> np.ndarray:
    """The (H, W) depth of a person, metres: medians around measured pixels where the sensor is noisy, else the same array."""
    return _medians(depth_m) if _is_noisy(depth_m) else depth_m


@njit(cache=True)
def _is_noisy(depth):
    """Whether most pixels differ from the mean of their four neighbours as they would with noise above `MAX_NOISE_M`."""
    height, width = depth.shape
    limit = np.float32(MAX_NOISE_M * MEDIAN_DIFFERENCE)
    inner = noisy = 0
    for y in range(1, height - 1, ROW_STRIDE):
        above, row, below = depth[y - 1], depth[y], depth[y + 1]
        for x in range(1, width - 1):
            if row[x] > 0 and row[x - 1] > 0 and row[x + 1] > 0 and above[x] > 0 and below[x] > 0:
                inner += 1
                mean = (row[x - 1] + row[x + 1] + above[x] + below[x]) / np.float32(4)
                noisy += abs(row[x] - mean) > limit
    return 2 * noisy > inner


@njit(cache=True)
def _medians(depth):
    """(H, W) the median of the measured pixels in the window around each measured pixel, 0 elsewhere."""
    height, width = depth.shape
    reach = WINDOW // 2
    smooth, around = np.zeros_like(depth), np.empty(WINDOW * WINDOW, depth.dtype)
    for y in range(height):
        for x in range(width):
            if depth[y, x] == 0:
                continue
            count = 0
            for v in range(max(y - reach, 0), min(y + reach + 1, height)):
                for u in range(max(x - reach, 0), min(x + reach + 1, width)):
                    if depth[v, u] > 0:
                        # Insertion into the sorted ones before
                        at = count
                        while at > 0 and around[at - 1] > depth[v, u]:
                            around[at] = around[at - 1]
                            at -= 1
                        around[at] = depth[v, u]
                        count += 1
            smooth[y, x] = (around[(count - 1) // 2] + around[count // 2]) / np.float32(2)
    return smooth


@njit(cache=True)
def neighbour_graph(points, index):
    """The 8-connected graph of the measured cells, from the (N, 3) points and the (h, w) numbers of `cell_points`: (N, 8) int32
    numbers of the neighbours, padded with -1, and (N, 8) lengths of the edges to them in metres.
    """
    neighbours, edge_lengths = np.full((len(points), 8), -1, np.int32), np.empty((len(points), 8))
    for y in range(index.shape[0]):
        for x in range(index.shape[1]):
            point, count = index[y, x], 0
            if point < 0:
                continue
            for v in range(max(y - 1, 0), min(y + 2, index.shape[0])):
                for u in range(max(x - 1, 0), min(x + 2, index.shape[1])):
                    neighbour = index[v, u]
                    if neighbour < 0 or neighbour == point:
                        continue
                    dx = points[point, 0] - points[neighbour, 0]
                    dy = points[point, 1] - points[neighbour, 1]
                    dz = points[point, 2] - points[neighbour, 2]
                    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
                    neighbours[point, count] = neighbour
                    edge_lengths[point, count] = distance * JUMP_FACTOR if abs(dz) > DEPTH_JUMP_M else distance
                    count += 1
    return neighbours, edge_lengths


@njit(cache=True)
def geodesic_distances(neighbours, edge_lengths, source, max_distance_m):
    """The geodesic distance of every point to the nearest of (N,) bool sources on a `neighbour_graph`, up to `max_distance_m`.

    (N,) distances in metres, `UNREACHABLE_M` where there is no path, and (N,) int32 the next point on the path to the source,
    -1 at sources and where there is no path. Bellman-Ford algorithm with a queue: a point whose distance decreased is queued to
    update its neighbours. All sources start in the queue. Then hardly any point is queued twice, and with a small limit most
    points are never visited.
    """
    size = len(source)
    distance, predecessor = np.full(size, UNREACHABLE_M), np.full(size, -1, np.int32)
    queue, queued = np.empty(size, np.int32), source.copy()
    head = queue_length = 0
    for i in range(size):
        if source[i]:
            distance[i] = 0.0
            queue[queue_length] = i
            queue_length += 1
    while queue_length:
        point = queue[head]
        head = head + 1 if head + 1 < size else 0
        queue_length -= 1
        queued[point] = False
        for k in range(8):
            neighbour = neighbours[point, k]
            if neighbour < 0:
                break
            candidate = distance[point] + edge_lengths[point, k]
            if candidate < distance[neighbour] - 1e-9 and candidate <= max_distance_m:
                distance[neighbour], predecessor[neighbour] = candidate, point
                if not queued[neighbour]:
                    tail = head + queue_length
                    queue[tail if tail < size else tail - size] = neighbour
                    queued[neighbour] = True
                    queue_length += 1
    return distance, predecessor


@njit(cache=True)
def farthest_points(points, neighbours, edge_lengths, geodesic):
    """Indices of the tips of a silhouette: the local maxima of (N,) geodesic distances."""
    tips = np.empty(MAX_TIPS, np.int32)
    count = 0
    for i in range(len(points)):
        if not MIN_TIP_DISTANCE_M <= geodesic[i] < 1e8 or count == MAX_TIPS:
            continue
        is_maximum = True
        for k in range(8):  # early rejection: most points have a neighbour with a larger distance
            neighbour = neighbours[i, k]
            if neighbour >= 0 and geodesic[i] < geodesic[neighbour] < 1e8 and edge_lengths[i, k] < MIN_TIP_SEPARATION_M:
                is_maximum = False
        for j in range(len(points) if is_maximum else 0):
            if geodesic[j] < 1e8 and (geodesic[j] > geodesic[i] or (geodesic[j] == geodesic[i] and j < i)):
                dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
                if dx * dx + dy * dy + dz * dz < MIN_TIP_SEPARATION_M**2:
                    is_maximum = False
                    break
        if is_maximum:
            tips[count] = i
            count += 1
    return tips[:count]
