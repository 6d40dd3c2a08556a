"""3D connected components (Algorithm 1): neighbouring pixels with similar depths belong to the same object.

The paper compares depths with one threshold epsilon_z. A camera's noise grows with the distance, for a triangulating
camera with its square, and so does the threshold here. The two passes of the paper work on runs (adjacent pixels in a
row) instead of single pixels, which gives the same components. Later steps also work on the runs, not on all pixels.
"""

import numpy as np
from numba import njit

from kpopnet.extraction.background import BACKGROUND, FAR_M, FOREGROUND

ROW, BEGIN, END, LABEL = 0, 1, 2, 3
"""Columns of runs; the last pixel of a run is END - 1."""

ONE_IN_EACH_BYTE = np.uint64(0x0101010101010101)

COMPONENT = np.dtype(
    [
        ("pixels", np.int32),
        ("area_m2", np.float32),
        ("occluded", np.int32),  # pixels whose background a person has occluded since the first image
        ("moved_m2", np.float32),  # area of the other pixels that were foreground in the previous image as well
        ("outline", np.int32),  # pairs of a pixel of the component and a 4-neighbour outside it
        ("touching", np.int32),  # those pairs whose outer pixel is background at the same depth
        ("centre_m", np.float32, 3),
        ("low_m", np.float32, 3),  # lower bounds of x, height above the floor, z
        ("high_m", np.float32, 3),  # upper bounds of the same
        ("box", np.int32, 4),  # x0, y0, x1, y1 in pixels, the last two exclusive
        ("first", np.int32, 2),  # y, x of its first pixel in row order
    ]
)
"""Statistics of one component."""


@njit(cache=True)
def label_runs(depth, kind, kinds, epsilon_z, min_pixels):
    """Connected component labelling with 4-neighbours, in the two passes of Algorithm 1.

    Args:
        depth: (H, W) float32 metres.
        kind: (H, W) uint8, see `background.FOREGROUND`.
        kinds: bits of the kinds of pixels to label.
        epsilon_z: (2,) float32 a, b: neighbours at depths z, z' are connected if they differ by at most a + b z z'.
        min_pixels: components with fewer pixels are noise and are dropped.

    Returns:
        (R, 4) int32 runs in row order with the columns ROW, BEGIN, END, LABEL, and the number of components. Labels
        start at 1, in the order of the components' first pixels.
    """
    height, width = depth.shape
    # Most pixels are of other kinds: skip eight of them at a time.
    eights, any_of_eight = kind.ravel()[: kind.size // 8 * 8].view(np.uint64), np.uint64(kinds) * ONE_IN_EACH_BYTE
    runs = np.empty((height * width, 4), np.int32)
    parent = np.empty(height * width, np.int32)  # union-find: a run itself, or an earlier run of the same component
    num_runs = above_begin = above_end = 0
    for y in range(height):
        row, row_above, kind_row = depth[y], depth[max(y - 1, 0)], kind[y]
        first = num_runs
        x = 0
        while x < width:
            if not kind_row[x] & kinds:
                eighth, offset = divmod(y * width + x, 8)
                x += 8 if offset == 0 and eighth < len(eights) and not eights[eighth] & any_of_eight else 1
                continue
            begin = x
            x += 1
            while x < width and kind_row[x] & kinds and _connected(row[x], row[x - 1], epsilon_z):
                x += 1
            runs[num_runs, ROW], runs[num_runs, BEGIN], runs[num_runs, END] = y, begin, x
            parent[num_runs] = num_runs
            # A run above that ends before this run begins also ends before all later runs of this row.
            while above_begin < above_end and runs[above_begin, END] <= begin:
                above_begin += 1
            above = above_begin
            while above < above_end and runs[above, BEGIN] < x:
                for u in range(max(begin, runs[above, BEGIN]), min(x, runs[above, END])):
                    if _connected(row[u], row_above[u], epsilon_z):
                        _union(parent, num_runs, above)
                        break
                above += 1
            num_runs += 1
        above_begin, above_end = first, num_runs
    return _number_components(runs, parent, num_runs, min_pixels)


@njit(cache=True)
def _number_components(runs, parent, num_runs, min_pixels):
    """The second pass: labels the runs, drops those of small components; returns as `label_runs`."""
    pixels = np.zeros(num_runs, np.int32)
    for run in range(num_runs - 1, -1, -1):
        pixels[run] += runs[run, END] - runs[run, BEGIN]
        if parent[run] != run:
            pixels[parent[run]] += pixels[run]
    count = kept = 0
    label = np.zeros(num_runs, np.int32)
    for run in range(num_runs):
        if parent[run] != run:
            label[run] = label[parent[run]]
        elif pixels[run] >= min_pixels:
            count += 1
            label[run] = count
        if label[run]:
            runs[kept, :LABEL] = runs[run, :LABEL]
            runs[kept, LABEL] = label[run]
            kept += 1
    return runs[:kept], count


@njit(cache=True)
def _connected(z, other, epsilon_z):
    return abs(z - other) <= epsilon_z[0] + epsilon_z[1] * z * other


@njit(cache=True)
def _union(parent, a, b):
    while parent[a] != a:
        a = parent[a]
    while parent[b] != b:
        b = parent[b]
    parent[max(a, b)] = min(a, b)


@njit(cache=True)
def label_image(runs, height, width):
    """(H, W) int32 label of every pixel, 0 for pixels in no component."""
    labels = np.zeros((height, width), np.int32)
    for run in range(len(runs)):
        labels[runs[run, ROW], runs[run, BEGIN] : runs[run, END]] = runs[run, LABEL]
    return labels


@njit(cache=True)
def component_stats(depth, kind, kinds, background, runs, count, plane, intrinsics, epsilon_z, before, num_tracks, max_step_m):
    """Statistics of the components, and the number of pixels by which each continues each tracked person.

    Args:
        depth: (H, W) float32 metres.
        kind: (H, W) uint8.
        kinds: see `label_runs`.
        background: (H, W) float32 background depth in metres.
        runs: (R, 4) from `label_runs`.
        count: number of components.
        plane: (4,) float32 the plane above which heights are measured.
        intrinsics: (4,) float32 fx, fy, cx, cy.
        epsilon_z: see `label_runs`.
        before: the previous image's (H, W) float32 depth in metres, uint8 kind, and uint8 owner: 1 to num_tracks.
        num_tracks: number of tracked people.
        max_step_m: a pixel continues the person it belonged to if its depth changed by at most this.

    Returns:
        (count + 1,) COMPONENT by label, and (count + 1, num_tracks + 1) int32 votes: the number of pixels of each
        component that continue each person.
    """
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    depth_before, kind_before, owner_before = before
    components = np.zeros(count + 1, COMPONENT)
    votes = np.zeros((count + 1, num_tracks + 1), np.int32)
    for label in range(count + 1):
        components[label].low_m[:] = np.inf
        components[label].high_m[:] = -np.inf
        components[label].box[:2] = max(height, width)
    for run in range(len(runs)):
        y, begin, end, label = runs[run]
        component = components[label]
        if component.pixels == 0:
            component.first[0], component.first[1] = y, begin
        row, row_above, row_below = depth[y], depth[max(y - 1, 0)], depth[min(y + 1, height - 1)]
        kind_above, kind_below = kind[max(y - 1, 0)], kind[min(y + 1, height - 1)]
        ray_y = (np.float32(y) - cy) / fy
        sum_x = sum_z = area_m2 = moved_m2 = np.float32(0)
        low_x = low_up = low_z = np.float32(np.inf)
        high_x = high_up = high_z = np.float32(-np.inf)
        outline = touching = occluded = 0
        for x in range(begin, end):
            z = row[x]
            point_x = z * (np.float32(x) - cx) / fx
            up = plane[0] * point_x + (plane[1] * ray_y + plane[2]) * z + plane[3]
            sum_x += point_x
            sum_z += z
            low_x, high_x = min(low_x, point_x), max(high_x, point_x)
            low_up, high_up = min(low_up, up), max(high_up, up)
            low_z, high_z = min(low_z, z), max(high_z, z)
            area_m2 += z * z
            occluded += background[y, x] > FAR_M
            moved_m2 += z * z if (background[y, x] <= FAR_M) & (kind_before[y, x] == FOREGROUND) else np.float32(0)
            number = owner_before[y, x]
            if number != 0 and number <= num_tracks and abs(z - depth_before[y, x]) <= max_step_m:
                votes[label, number] += 1
            same_above, same_below = _connected(z, row_above[x], epsilon_z), _connected(z, row_below[x], epsilon_z)
            outline += (not kind_above[x] & kinds) | (not same_above)
            outline += (not kind_below[x] & kinds) | (not same_below)
            touching += (kind_above[x] == BACKGROUND) & same_above
            touching += (kind_below[x] == BACKGROUND) & same_below
        if begin > 0:
            outline += 1
            touching += (kind[y, begin - 1] == BACKGROUND) & _connected(row[begin], row[begin - 1], epsilon_z)
        if end < width:
            outline += 1
            touching += (kind[y, end] == BACKGROUND) & _connected(row[end - 1], row[end], epsilon_z)
        component.pixels += end - begin
        component.area_m2 += area_m2 / (fx * fy)
        component.moved_m2 += moved_m2 / (fx * fy)
        component.occluded += occluded
        component.outline += outline
        component.touching += touching
        component.centre_m[0] += sum_x
        component.centre_m[1] += ray_y * sum_z
        component.centre_m[2] += sum_z
        component.low_m[0], component.high_m[0] = min(component.low_m[0], low_x), max(component.high_m[0], high_x)
        component.low_m[1], component.high_m[1] = min(component.low_m[1], low_up), max(component.high_m[1], high_up)
        component.low_m[2], component.high_m[2] = min(component.low_m[2], low_z), max(component.high_m[2], high_z)
        component.box[0], component.box[2] = min(component.box[0], begin), max(component.box[2], end)
        component.box[1], component.box[3] = min(component.box[1], y), y + 1
    for label in range(1, count + 1):
        for axis in range(3):
            components[label].centre_m[axis] /= np.float32(components[label].pixels)
    return components, votes
