"""3D connected components (Algorithm 1): pixels side by side whose depths are alike belong to the same object.

The paper compares with one threshold epsilon_z. A camera's noise grows with the distance, for a triangulating one with
its square, and so does the threshold here. Its two passes go over runs, pixels side by side in a row, instead of single
pixels, which gives the same components; what comes after goes over the runs as well, and not over the picture.
"""

import numpy as np
from numba import njit

from kpopnet.extraction.room import FAR_M, FOREGROUND, ROOM

ROW, BEGIN, END, LABEL = 0, 1, 2, 3
"""Columns of runs: the last pixel is END - 1."""

ONE_IN_EACH_BYTE = np.uint64(0x0101010101010101)

PIECE = np.dtype(
    [
        ("pixels", np.int32),
        ("area_m2", np.float32),
        ("covered", np.int32),  # pixels where somebody has always been
        ("moved_m2", np.float32),  # surface elsewhere that was in front of the room in the picture before as well
        ("outline", np.int32),  # neighbours of its pixels that are not in it,
        ("touching", np.int32),  # and how many of them are room at the same depth
        ("centre_m", np.float32, 3),
        ("low_m", np.float32, 3),  # x, height, z: the box around it, along the camera's x and z and along the vertical
        ("high_m", np.float32, 3),
        ("box", np.int32, 4),  # x0, y0, x1, y1 in pixels, the last two exclusive
        ("first", np.int32, 2),  # y, x of its first pixel
    ]
)
"""One component."""


@njit(cache=True)
def connect(depth, kind, kinds, epsilon_z, least_pixels):
    """Algorithm 1's two passes of connected component labelling, with 4-neighbours.

    Args:
        depth: (H, W) float32 metres.
        kind: (H, W) uint8, see `room.ROOM`.
        kinds: those of which pixels are labelled.
        epsilon_z: (2,) float32 a, b: neighbours at depths z, z' that differ by at most a + b z z' are connected.
        least_pixels: components of fewer are noise, and left out.

    Returns:
        (R, 4) int32 runs in order, see ROW, with labels from 1 in the order of the components' first pixels, and how many
        components there are.
    """
    height, width = depth.shape
    # Most pixels are of other kinds: they are passed by in eights.
    eights, any_of_eight = kind.ravel()[: kind.size // 8 * 8].view(np.uint64), np.uint64(kinds) * ONE_IN_EACH_BYTE
    runs = np.empty((height * width, 4), np.int32)
    linked = np.empty(height * width, np.int32)  # a run is linked to itself, or to an earlier one of its component
    num_runs = above_begin = above_end = 0
    for y in range(height):
        row, row_above, what = depth[y], depth[max(y - 1, 0)], kind[y]
        first = num_runs
        x = 0
        while x < width:
            if not what[x] & kinds:
                eighth, beside = divmod(y * width + x, 8)
                x += 8 if beside == 0 and eighth < len(eights) and not eights[eighth] & any_of_eight else 1
                continue
            begin = x
            x += 1
            while x < width and what[x] & kinds and _alike(row[x], row[x - 1], epsilon_z):
                x += 1
            runs[num_runs, ROW], runs[num_runs, BEGIN], runs[num_runs, END] = y, begin, x
            linked[num_runs] = num_runs
            # Runs of the row above that end before this one begins are before all that follow, too.
            while above_begin < above_end and runs[above_begin, END] <= begin:
                above_begin += 1
            above = above_begin
            while above < above_end and runs[above, BEGIN] < x:
                for u in range(max(begin, runs[above, BEGIN]), min(x, runs[above, END])):
                    if _alike(row[u], row_above[u], epsilon_z):
                        _union(linked, num_runs, above)
                        break
                above += 1
            num_runs += 1
        above_begin, above_end = first, num_runs
    pixels = np.zeros(num_runs, np.int32)
    for run in range(num_runs - 1, -1, -1):
        pixels[run] += runs[run, END] - runs[run, BEGIN]
        if linked[run] != run:
            pixels[linked[run]] += pixels[run]
    count = kept = 0
    label = np.zeros(num_runs, np.int32)
    for run in range(num_runs):
        if linked[run] != run:
            label[run] = label[linked[run]]
        elif pixels[run] >= least_pixels:
            count += 1
            label[run] = count
        if label[run]:
            runs[kept, :LABEL] = runs[run, :LABEL]
            runs[kept, LABEL] = label[run]
            kept += 1
    return runs[:kept], count


@njit(cache=True)
def _alike(z, other, epsilon_z):
    return abs(z - other) <= epsilon_z[0] + epsilon_z[1] * z * other


@njit(cache=True)
def _union(linked, a, b):
    while linked[a] != a:
        a = linked[a]
    while linked[b] != b:
        b = linked[b]
    linked[max(a, b)] = min(a, b)


@njit(cache=True)
def label_image(runs, height, width):
    """(H, W) int32 label of every pixel, 0 for those in no component."""
    labels = np.zeros((height, width), np.int32)
    for run in range(len(runs)):
        labels[runs[run, ROW], runs[run, BEGIN] : runs[run, END]] = runs[run, LABEL]
    return labels


@njit(cache=True)
def survey(depth, kind, kinds, room, runs, count, plane, intrinsics, epsilon_z, before, num_people, same_m):
    """What the components are like, and which people they continue.

    Args:
        depth: (H, W) float32 metres.
        kind: (H, W) uint8.
        kinds: see `connect`.
        room: (H, W) float32, the memory of the room.
        runs: (R, 4) of `connect`.
        count: how many components there are.
        plane: (4,) float32, of which the height above is taken.
        intrinsics: (4,) float32 fx, fy, cx, cy.
        epsilon_z: see `connect`.
        before: of the picture before the (H, W) float32 depth in metres, uint8 kind, and uint8 owner: 1 to num_people.
        num_people: how many people are known.
        same_m: a pixel continues a human whose it was if its depth has not changed by more.

    Returns:
        (count + 1,) PIECEs by label, and (count + 1, num_people + 1) int32: how many pixels of each continue each human.
    """
    height, width = depth.shape
    fx, fy, cx, cy = intrinsics
    depth_before, kind_before, owner_before = before
    pieces = np.zeros(count + 1, PIECE)
    votes = np.zeros((count + 1, num_people + 1), np.int32)
    for label in range(count + 1):
        pieces[label].low_m[:] = np.inf
        pieces[label].high_m[:] = -np.inf
        pieces[label].box[:2] = max(height, width)
    for run in range(len(runs)):
        y, begin, end, label = runs[run]
        piece = pieces[label]
        if piece.pixels == 0:
            piece.first[0], piece.first[1] = y, begin
        row, row_above, row_below = depth[y], depth[max(y - 1, 0)], depth[min(y + 1, height - 1)]
        what_above, what_below = kind[max(y - 1, 0)], kind[min(y + 1, height - 1)]
        ray_y = (np.float32(y) - cy) / fy
        sum_x = sum_z = area_m2 = moved_m2 = np.float32(0)
        low_x = low_up = low_z = np.float32(np.inf)
        high_x = high_up = high_z = np.float32(-np.inf)
        outline = touching = covered = 0
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
            covered += room[y, x] > FAR_M
            moved_m2 += z * z if (room[y, x] <= FAR_M) & (kind_before[y, x] == FOREGROUND) else np.float32(0)
            whose = owner_before[y, x]
            if whose != 0 and whose <= num_people and abs(z - depth_before[y, x]) <= same_m:
                votes[label, whose] += 1
            alike_above, alike_below = _alike(z, row_above[x], epsilon_z), _alike(z, row_below[x], epsilon_z)
            outline += (not what_above[x] & kinds) | (not alike_above)
            outline += (not what_below[x] & kinds) | (not alike_below)
            touching += (what_above[x] == ROOM) & alike_above
            touching += (what_below[x] == ROOM) & alike_below
        if begin > 0:
            outline += 1
            touching += (kind[y, begin - 1] == ROOM) & _alike(row[begin], row[begin - 1], epsilon_z)
        if end < width:
            outline += 1
            touching += (kind[y, end] == ROOM) & _alike(row[end - 1], row[end], epsilon_z)
        piece.pixels += end - begin
        piece.area_m2 += area_m2 / (fx * fy)
        piece.moved_m2 += moved_m2 / (fx * fy)
        piece.covered += covered
        piece.outline += outline
        piece.touching += touching
        piece.centre_m[0] += sum_x
        piece.centre_m[1] += ray_y * sum_z
        piece.centre_m[2] += sum_z
        piece.low_m[0], piece.high_m[0] = min(piece.low_m[0], low_x), max(piece.high_m[0], high_x)
        piece.low_m[1], piece.high_m[1] = min(piece.low_m[1], low_up), max(piece.high_m[1], high_up)
        piece.low_m[2], piece.high_m[2] = min(piece.low_m[2], low_z), max(piece.high_m[2], high_z)
        piece.box[0], piece.box[2] = min(piece.box[0], begin), max(piece.box[2], end)
        piece.box[1], piece.box[3] = min(piece.box[1], y), y + 1
    for label in range(1, count + 1):
        for axis in range(3):
            pieces[label].centre_m[axis] /= np.float32(pieces[label].pixels)
    return pieces, votes
