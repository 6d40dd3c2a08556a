"""The per-pixel part of the sensor model, in numba.

Random numbers are hashes of a key and the pixel's number. The result of a pixel therefore does not depend on which other
pixels are measured, or in what order. Arithmetic is float32: `np.float32` wraps every constant that would promote it to
float64. `t` is the record that `model._terms` makes.
"""

import math

import numpy as np
from numba import njit
from scipy.special import ndtri

EDGE_M = 0.1
"""A pixel lies on an outline if it and its four neighbours differ by more than this depth, metres: over two pixels, whatever
their slope. So far floors and walls count too in small images: of room images of 160 by 128 pixels 31 % of the pixels, three
quarters of them on one plane, of 640 by 576 5 %. A second difference would spare them; it is left to the next generator, since
all networks learnt from this one and all benchmarks were measured with it."""

INT_OFFSET_PX = 1024
"""Added to a shift in pixels before int() so that int() rounds down; math.floor would cost more than the rest."""

NODES, LAYER, FILM_PIXELS = 1 << 40, 1 << 32, 1 << 50
"""Hash counters beyond those of all pixels: of the lattice's nodes, LAYER apart for each layer of depth, and of the film's
noise at single pixels."""

NORMALS = ndtri((np.arange(4096) + 0.5) / 4096)
NORMALS = (NORMALS / NORMALS.std()).astype(np.float32)
"""Normal deviates by 12-bit index: the 64 bits of one hash give several draws."""


@njit(cache=True)
def _random_bits(key, counter):
    """64 random bits, a pure function of key and counter (SplitMix64, Steele et al. 2014)."""
    z = key + np.uint64(counter) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True)
def _normal(bits, shift):
    """A standard normal deviate from the 12 bits above `shift`."""
    return NORMALS[np.uintp((bits >> np.uint64(shift)) & np.uint64(4095))]


@njit(cache=True)
def _uniform(bits, shift, count):
    """A uniform number in (0, 1) from the `count` bits above `shift`; count is at most 24."""
    drawn = np.int32((bits >> np.uint64(shift)) & np.uint64((1 << count) - 1))
    return (np.float32(drawn) + np.float32(0.5)) / np.float32(1 << count)


@njit(cache=True)
def _grain_cells(size, centre, grain):
    """Lattice cell of each pixel of a row or column, and its interpolation weights (size, 2), which keep the variance 1.

    Nodes lie at whole multiples of `grain` from the principal point, so that a crop has those of the whole image. Cells
    count from the first one; its number comes last.
    """
    cell = np.empty(size, np.int32)
    weights = np.empty((size, 2), np.float32)
    first = math.floor(-centre / grain)
    for i in range(size):
        position = (i - centre) / grain - first
        cell[i] = int(position)
        after = position - cell[i]
        norm = math.sqrt(after * after + (1 - after) * (1 - after))
        weights[i, 0] = (1 - after) / norm
        weights[i, 1] = after / norm
    return cell, weights, first


@njit(cache=True)
def _node_pixel(node, centre, grain, size):
    """The pixel of a row or column nearest to a node."""
    return min(max(int(centre + node * grain + 0.5), 0), size - 1)


@njit(cache=True)
def _noise_lattice(depth, cells, keys, t):
    """(rows, 3, columns) normal deviates at the lattice's nodes: the noise fields along z, x and y.

    A share `flicker` of the variance is of the frame's key, the rest of the film's. The film's is interpolated between
    layers of disparity at the node's own depth, so that it changes where the surface moves in depth. Nodes stay
    independent, whatever the depths.
    """
    (cell_y, first_y), (cell_x, first_x) = cells
    height, width = cell_y[-1] + 2, cell_x[-1] + 2
    lattice = np.empty((height, 3, width), np.float32)
    film, frame = np.float32(math.sqrt(1 - t.flicker)), np.float32(math.sqrt(t.flicker))
    for i in range(height):
        for j in range(width):
            node = NODES + (first_y + i) * 65536 + first_x + j
            bits = _random_bits(keys[1], node)
            for k in range(3):
                lattice[i, k, j] = frame * _normal(bits, 12 * k)
            if film > np.float32(0):
                row = _node_pixel(first_y + i, t.cy, t.grain, depth.shape[0])
                z = depth[row, _node_pixel(first_x + j, t.cx, t.grain, depth.shape[1])]
                position = t.grain_layers / max(z, np.float32(0.01))
                layer = int(position)
                after = position - np.float32(layer)
                weight = film / np.float32(math.sqrt(after * after + (1 - after) * (1 - after)))
                near = _random_bits(keys[0], node + layer * LAYER)
                far = _random_bits(keys[0], node + (layer + 1) * LAYER)
                for k in range(3):
                    lattice[i, k, j] += weight * ((1 - after) * _normal(near, 12 * k) + after * _normal(far, 12 * k))
    return lattice


@njit(cache=True)
def _grain_row(lattice, cell, weights, grain):
    """Interpolates the lattice's three fields at one row of pixels, into grain (3, lattice width)."""
    for k in range(3):
        for j in range(lattice.shape[2]):
            grain[k, j] = lattice[cell, k, j] * weights[0] + lattice[cell + 1, k, j] * weights[1]


@njit(cache=True)
def _grained(grain, k, cell, w0, w1):
    """Interpolates field k of a row at one pixel."""
    return grain[k, cell] * w0 + grain[k, cell + np.uintp(1)] * w1


@njit(cache=True)
def _shadows(depth, shadow):
    """(h, w) bool: the pixels that the projector does not illuminate.

    In the view of a projector at x = baseline, pixel u of depth z lies at u - f baseline / z (`shadow` is f baseline).
    From the projector's side of the row to the other, these positions move monotonically except behind a nearer surface.
    A surface ends at the middle of its last pixel: shadows are one pixel narrower than by triangulation.
    """
    height, width = depth.shape
    lost = np.zeros(depth.shape, np.bool_)
    side = np.float32(1) if shadow > 0 else np.float32(-1)
    for y in range(height if shadow != np.float32(0) else 0):
        lit = np.float32(np.inf)
        for i in range(width):
            u = width - 1 - i if shadow > 0 else i
            if depth[y, u] > 0:
                position = side * (np.float32(u) - shadow / depth[y, u])
                lost[y, u] = position > lit + np.float32(0.5)
                lit = min(lit, position)
    return lost


@njit(cache=True)
def _slope(before, here, after):
    """The smaller of the two one-sided differences, so that an outline does not count as a steep surface."""
    a = here - before if before > 0 else np.float32(0)
    b = after - here if after > 0 else np.float32(0)
    return a if abs(a) < abs(b) else b


@njit(cache=True)
def _labelled_spans(labels, reach):
    """For each row, the range first, last + 1 of the pixels within `reach` pixels of a label."""
    height, width = labels.shape
    spans = np.zeros((height, 2), np.int64)
    spans[:, 0] = width
    for y in range(height):
        for x in range(width):
            if labels[y, x]:
                spans[y, 0], spans[y, 1] = min(spans[y, 0], x), x + 1
    reached = np.empty_like(spans)
    for y in range(height):
        begin, end = width, 0
        for v in range(max(y - reach, 0), min(y + reach + 1, height)):
            begin, end = min(begin, spans[v, 0]), max(end, spans[v, 1])
        reached[y, 0], reached[y, 1] = max(begin - reach, 0), min(end + reach, width) if end else 0
    return reached


@njit(cache=True)
def _grazing_noise(here, beside, ray_x, ray_y, t):
    """Increase of the lateral shift and of sigma_z on a steep surface; theta is the angle between its normal and the ray."""
    left, right, up, down = beside
    steep_x, steep_y = _slope(left, here, right) * t.fx, _slope(up, here, down) * t.fy
    normal_z = here + steep_x * ray_x + steep_y * ray_y
    ray_squared = ray_x * ray_x + ray_y * ray_y
    lengths = (steep_x * steep_x + steep_y * steep_y + normal_z * normal_z) * (ray_squared + np.float32(1))
    # Only for theta above 60 degrees: 1 / cos(60 degrees)^2 = 4.
    if not lengths > np.float32(4) * here * here:
        return np.float32(0), np.float32(0)
    rest = np.float32(max(math.asin(here / math.sqrt(lengths)), 0.05))
    theta = np.float32(math.pi / 2) - rest
    return t.lateral_grazing * theta / rest, t.axial_grazing * theta * theta / (math.sqrt(here) * rest * rest)


@njit(cache=True)
def _shifted(at, shift, size):
    """The pixel nearest to at + shift, clamped to the image."""
    return min(max(at + int(shift + np.float32(INT_OFFSET_PX + 0.5)) - INT_OFFSET_PX, 0), size - 1)


@njit(cache=True)
def _lost_or_flying(z, near, far, bits, t):
    """0 for a dropped pixel, a depth between near and far for a flying pixel on an outline, else z."""
    if _uniform(bits, 12, 24) < t.pixel_dropout:
        return np.float32(0)
    if far - near > np.float32(EDGE_M):
        fate = _uniform(bits, 36, 14)
        if fate < t.edge_dropout:
            return np.float32(0)
        if fate > np.float32(1) - t.flying_pixels and near > np.float32(0):
            return near + _uniform(bits, 50, 14) * (far - near)
    return z


@njit(cache=True)
def _film_steps(right, below, z, noise, film_key, t):
    """A frame's white noise on the disparity after the film's has taken its share.

    The film's depends on the pixel, counted from the principal point, and on the layer of the disparity of z.
    """
    layer = int(t.grain_layers / max(z, np.float32(0.01)))
    bits = _random_bits(film_key, FILM_PIXELS + layer * LAYER + below * 65536 + right)
    return math.sqrt(t.step_flicker) * noise + math.sqrt(np.float32(1) - t.step_flicker) * _normal(bits, 0)


@njit(cache=True)
def _axial_error(z, grazing, noise_z, noise_steps, ray_squared, t):
    """The depth after gain, axial noise, wiggle, and disparity noise and quantisation."""
    zero = np.float32(0)
    beyond = z - t.axial_offset_m
    sigma = t.axial_floor_m + t.axial_quadratic * beyond * beyond + t.axial_radial * ray_squared
    z = t.gain * z + (sigma + grazing) * noise_z
    if t.wiggle_m > zero:
        z += t.wiggle_m * np.float32(math.sin(t.wiggle_frequency * z))
    if t.steps > zero:
        disparity = t.steps / z + t.step_noise * noise_steps
        if t.disparity_step_px > zero:
            disparity = np.float32(int(disparity + np.float32(0.5)))
        z = t.steps / disparity if disparity > zero else zero
    return z


@njit(cache=True)
def measure_pixels(depth, labels, keys, terms):
    """(h, w) float32 measured depth in metres and (h, w) uint8 label of the measured surface; 0 where nothing is measured.

    From (h, w) float32 clean depth in metres, (h, w) uint8 labels, of which 0 is not measured, (2,) uint64 keys of the film's
    noise, which stays, and of the frame's own, and the (1,) record of terms.
    """
    t = terms[0]
    (height, width), key = depth.shape, keys[1]
    zero, one = np.float32(0), np.float32(1)
    measured, seen = np.zeros((height, width), np.float32), np.zeros((height, width), np.uint8)
    # Correlated noise is interpolated from a lattice, white noise is drawn per pixel and frame.
    grainy, lattice = t.grain > one, np.empty((0, 3, 0), np.float32)
    cell_y, weight_y, first_y = _grain_cells(height, t.cy, t.grain)
    cell_x, weight_x, first_x = _grain_cells(width, t.cx, t.grain)
    if grainy:
        lattice = _noise_lattice(depth, ((cell_y, first_y), (cell_x, first_x)), keys, t)
    grain = np.empty((3, lattice.shape[2]), np.float32)
    flat_depth, flat_labels, flat_lost = depth.ravel(), labels.ravel(), _shadows(depth, t.shadow).ravel()
    uses_grazing = t.axial_grazing > zero or t.lateral_grazing > zero
    spans = _labelled_spans(labels, 1 + int(4 * t.lateral) if t.lateral > zero else 0)
    for y in range(height):
        _grain_row(lattice, cell_y[y], weight_y[y], grain)
        above, row, below = depth[max(y - 1, 0)], depth[y], depth[min(y + 1, height - 1)]
        ray_y = (np.float32(y) - t.cy) / t.fy
        for x in range(spans[y, 0], spans[y, 1]):
            bits = _random_bits(key, y * width + x)
            if grainy:
                cell, w0, w1 = np.uintp(cell_x[x]), weight_x[x, 0], weight_x[x, 1]
                noise_x, noise_y = _grained(grain, 1, cell, w0, w1), _grained(grain, 2, cell, w0, w1)
            else:
                more_bits = _random_bits(key, (height + y) * width + x)
                noise_z, noise_x, noise_y = _normal(more_bits, 0), _normal(more_bits, 12), _normal(more_bits, 24)
            ray_x = (np.float32(x) - t.cx) * (one / t.fx)
            here, beside = row[x], (row[max(x - 1, 0)], row[min(x + 1, width - 1)], above[x], below[x])
            lateral, grazing = t.lateral, zero
            if uses_grazing and labels[y, x] and here > zero:
                lateral_more, grazing = _grazing_noise(here, beside, ray_x, ray_y, t)
                lateral += lateral_more
            # Lateral noise: the pixel shows the surface of a nearby pixel.
            shown = np.uintp(y * width + x)
            if lateral > zero:
                u, v = _shifted(x, lateral * noise_x, width), _shifted(y, lateral * noise_y, height)
                shown = np.uintp(v * width + u)
            label, z = flat_labels[shown], flat_depth[shown]
            if label == 0 or flat_lost[shown] or not z > zero:
                continue
            z = _lost_or_flying(z, min(here, min(beside)), max(here, max(beside)), bits, t)
            if z == zero:
                continue
            if grainy:
                noise_z = _grained(grain, 0, cell, w0, w1)
            noise_steps = _normal(bits, 0)
            if t.step_flicker < one:
                noise_steps = _film_steps(x - math.floor(t.cx), y - math.floor(t.cy), z, noise_steps, keys[0], t)
            z = _axial_error(z, grazing, noise_z, noise_steps, ray_x * ray_x + ray_y * ray_y, t)
            if t.min_range_m <= z <= t.max_range and z > zero:
                measured[y, x], seen[y, x] = z, label
    return measured, seen


@njit(cache=True)
def erase_ellipses(depth, ellipses):
    """Sets (h, w) float32 depth in metres to 0, in place, inside (N, 7) float32 ellipses: centre u, v and the two semi-axes in
    pixels, the angle of the first axis in radians, nearest and farthest depth in metres that is erased.
    """
    height, width = depth.shape
    for u, v, a, b, angle, near, far in ellipses:
        reach = max(a, b)
        cos, sin = math.cos(angle), math.sin(angle)
        for y in range(max(int(v - reach), 0), min(int(v + reach) + 2, height)):
            for x in range(max(int(u - reach), 0), min(int(u + reach) + 2, width)):
                along = ((x - u) * cos + (y - v) * sin) / a
                across = ((y - v) * cos - (x - u) * sin) / b
                if along * along + across * across <= 1 and near <= depth[y, x] <= far:
                    depth[y, x] = 0
