"""What a depth camera makes of a perfect depth image: noise, steps, shadows and holes.

Two families, one kernel. *Structured light* (Kinect v1) triangulates a projected pattern: its depth comes in steps of
disparity, near things throw a shadow away from the projector, and since a pixel is matched by a window around it, noise
is blotchy and outlines wobble in pieces. *Time of flight* (Kinect 2, SwissRanger) has noise that is white and grows
towards the image's corners, a wiggle in z, and flying pixels between near and far at outlines.

Sources: Nguyen, Izadi & Lovell 2012 (axial and lateral noise of Kinect v1); Handa et al. 2014 (disparity noise and
steps); Mahler et al. 2017 (gain, ellipses). On people of UTD-MHAD (real Kinect v1, 320x240) the depth steps are
z^2/345 m, 67 % of the neighbouring pixels share one, and second differences amount to 0.35 steps of white noise; the
same figures of smooth capsule people with the published terms below are 345, 66 % and 0.37.

Lengths in pixels are the sensor's own ("native") pixels and scale with the camera's focal length, so the same
sensor can be asked for 640x480 or 320x240.
"""

import math
from dataclasses import dataclass, fields
from functools import cache

import numpy as np
from numba import njit
from scipy.special import ndtri

from kpopnet.camera import Camera
from kpopnet.errors import InputError

EDGE_M = 0.1
"""Neighbours that differ by more stand on two sides of an outline."""

ELLIPSE_PX = (2.5, 5.0)
LIMB_HOLE_M = (0.02, 0.06)
LIMB_HOLE_DEPTH_M = 0.15
ABOVE_ZERO = 1024
"""Makes any shift in pixels positive, so that int() rounds down."""

_PUBLISHED: dict[str, dict[str, float]] = {
    "ideal": {},
    "kinect_v1": {
        "min_range_m": 0.4,
        "max_range_m": 8.0,
        "native_focal_px": 575.5,
        "axial_floor_m": 0.0012,
        "axial_quadratic": 0.0019,
        "axial_offset_m": 0.4,
        "axial_grazing": 0.0001,
        "lateral_px": 0.8,
        "lateral_grazing_px": 0.035,
        "grain_px": 9.0,
        "baseline_m": 0.075,
        "disparity_step_px": 0.125,
        "disparity_noise_px": 0.027778,
        "gain": 0.003,
        "pixel_dropout": 0.0002,
        "edge_dropout": 0.05,
        "ellipses_per_megapixel": 20.0,
        "limb_end_dropout": 0.2,
    },
    "kinect_2": {
        "min_range_m": 0.5,
        "max_range_m": 8.0,
        "native_focal_px": 365.0,
        "axial_floor_m": 0.003,
        "axial_quadratic": 0.001,
        "axial_radial": 0.0036,
        "wiggle_m": 0.004,
        "wiggle_period_m": 0.47,
        "flying_pixels": 0.4,
        "gain": 0.003,
        "pixel_dropout": 0.0002,
        "edge_dropout": 0.05,
        "ellipses_per_megapixel": 20.0,
        "limb_end_dropout": 0.2,
    },
    "swissranger": {
        "min_range_m": 0.3,
        "max_range_m": 5.0,
        "native_focal_px": 204.795,
        "axial_floor_m": 0.009,
        "axial_quadratic": 0.003,
        "axial_radial": 0.0292,
        "wiggle_m": 0.004,
        "wiggle_period_m": 1.25,
        "flying_pixels": 0.4,
        "gain": 0.003,
        "pixel_dropout": 0.002,
        "edge_dropout": 0.05,
        "ellipses_per_megapixel": 80.0,
        "limb_end_dropout": 0.2,
    },
}
"""Terms by sensor; what is not named here is 0 (off). Kinect v1's focal length is the one that the depth steps of
UTD-MHAD give with a baseline of 75 mm. Isolated drop-outs are as rare as there (6 in 100,000 pixels): the 5 % found
elsewhere would leave nothing of the ridge, to which every lost pixel is an edge."""


@dataclass(frozen=True)
class SensorConfig:
    """A sensor by name; every term left at None is that sensor's published value.

    Attributes:
        name: ideal, kinect_v1, kinect_2 or swissranger.
        min_range_m: nothing is measured nearer,
        max_range_m: or farther (0: no limit).
        native_focal_px: the focal length that goes with the native pixels of the other terms.
        axial_floor_m: sigma_z = axial_floor + axial_quadratic (z - axial_offset)^2 + axial_radial tan(a)^2, where a is
            the pixel's angle from the optical axis, and seen at more than 60 degrees from the normal besides
            axial_grazing theta^2 / (sqrt(z) (pi/2 - theta)^2).
        axial_quadratic: see axial_floor_m; 1/m.
        axial_offset_m: see axial_floor_m.
        axial_grazing: see axial_floor_m.
        axial_radial: see axial_floor_m; metres.
        lateral_px: sigma of the sideways shift of what a pixel shows; at more than 60 degrees
            lateral_grazing theta / (pi/2 - theta) more.
        lateral_grazing_px: see lateral_px.
        grain_px: how far axial and lateral noise go together, about the width of the matching window; up to 1: white.
        baseline_m: distance of the projector to the camera's right; shadows fall to the left. Negative: the other side.
        disparity_step_px: disparities are multiples of it: steps of depth_step z^2 / (native_focal baseline).
        disparity_noise_px: sigma of white noise on the disparity, before the steps.
        wiggle_m: amplitude of a systematic error that swings with z,
        wiggle_period_m: and its period, a quarter of the modulation's unambiguous range.
        flying_pixels: share of the pixels on outlines that land between near and far.
        gain: sigma of one factor on all depths of an image. Mahler's Gamma(1000, 1/1000) has 0.03, but 8 cm at 2.5 m
            would be no noise to a person's joints in metres but an error of the labels.
        pixel_dropout: largest share of lost pixels; an image draws its own share below it.
        edge_dropout: share of lost pixels on outlines.
        ellipses_per_megapixel: mean number of elliptic holes in a million native pixels.
        limb_end_dropout: probability that the end of one limb is lost.
    """

    name: str = "kinect_v1"
    min_range_m: float | None = None
    max_range_m: float | None = None
    native_focal_px: float | None = None
    axial_floor_m: float | None = None
    axial_quadratic: float | None = None
    axial_offset_m: float | None = None
    axial_grazing: float | None = None
    axial_radial: float | None = None
    lateral_px: float | None = None
    lateral_grazing_px: float | None = None
    grain_px: float | None = None
    baseline_m: float | None = None
    disparity_step_px: float | None = None
    disparity_noise_px: float | None = None
    wiggle_m: float | None = None
    wiggle_period_m: float | None = None
    flying_pixels: float | None = None
    gain: float | None = None
    pixel_dropout: float | None = None
    edge_dropout: float | None = None
    ellipses_per_megapixel: float | None = None
    limb_end_dropout: float | None = None

    def __post_init__(self) -> None:
        if self.name not in _PUBLISHED:
            raise InputError(f"sensor.name must be one of {', '.join(_PUBLISHED)}, not {self.name!r}")
        terms = _with_published(self)
        for name, value in terms.items():
            if not math.isfinite(value) or (value < 0 and name != "baseline_m"):
                raise InputError(f"sensor.{name} must be a finite number from 0 on, not {value}")
        for name in ("flying_pixels", "pixel_dropout", "edge_dropout", "limb_end_dropout"):
            if terms[name] > 1:
                raise InputError(f"sensor.{name} is a share and must lie between 0 and 1, not {terms[name]}")
        if terms["max_range_m"] and terms["max_range_m"] <= terms["min_range_m"]:
            raise InputError(
                f"sensor.max_range_m={terms['max_range_m']} must be beyond sensor.min_range_m={terms['min_range_m']}"
            )
        in_native_px = (
            "lateral_px", "grain_px", "disparity_step_px", "disparity_noise_px", "ellipses_per_megapixel"
        )  # fmt: skip
        for name in in_native_px:
            if terms[name] and not terms["native_focal_px"]:
                raise InputError(f"sensor.{name} is in native pixels: set sensor.native_focal_px too")
        if (terms["disparity_step_px"] or terms["disparity_noise_px"]) and not terms["baseline_m"]:
            raise InputError("sensor.disparity_step_px and sensor.disparity_noise_px need a sensor.baseline_m")
        if terms["wiggle_m"] and not terms["wiggle_period_m"]:
            raise InputError("sensor.wiggle_m needs a sensor.wiggle_period_m")


def _with_published(config: SensorConfig) -> dict[str, float]:
    published = _PUBLISHED[config.name]
    given = {field.name: getattr(config, field.name) for field in fields(config) if field.name != "name"}
    return {name: published.get(name, 0.0) if value is None else value for name, value in given.items()}


@cache
def resolved(config: SensorConfig) -> SensorConfig:
    """The same sensor with every term a number: its own, or the published one where it has None."""
    return SensorConfig(config.name, **_with_published(config))


SENSORS = {name: SensorConfig(name) for name in _PUBLISHED}


def measure(
    depth_m: np.ndarray,
    camera: Camera,
    config: SensorConfig,
    rng: np.random.Generator,
    limb_ends_camera_m: np.ndarray | None = None,
) -> np.ndarray:
    """A clean depth image as the sensor measures it.

    Args:
        depth_m: (h, w) float32 metres of the whole scene, people and background, 0 where there is nothing.
        camera: the camera of these pixels; may be a cropped one.
        config: the sensor.
        rng: the only source of chance.
        limb_ends_camera_m: (K, 3) hands and feet, whose ends may get lost; none without it.

    Returns:
        (h, w) float32 metres, 0 where nothing was measured.
    """
    return measure_labelled(depth_m, np.ones(depth_m.shape, np.uint8), camera, config, rng, limb_ends_camera_m)[0]


def measure_labelled(
    depth_m: np.ndarray,
    labels: np.ndarray,
    camera: Camera,
    config: SensorConfig,
    rng: np.random.Generator,
    limb_ends_camera_m: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """`measure`, keeping track of what each pixel shows, and only for what is labelled.

    Lateral noise moves outlines, so a pixel may come to show what lies beside it in the clean image.

    Args:
        depth_m: as in `measure`.
        labels: (h, w) uint8, what each clean pixel shows; 0 is never measured.
        camera: as in `measure`.
        config: as in `measure`.
        rng: as in `measure`.
        limb_ends_camera_m: as in `measure`.

    Returns:
        (h, w) float32 metres, 0 where nothing or nothing labelled was measured, and the (h, w) uint8 labels of what the
        pixels show, 0 where the first is 0.
    """
    if depth_m.shape != (camera.height, camera.width) or labels.shape != depth_m.shape:
        raise InputError(
            f"sensor: depth is {depth_m.shape}, labels are {labels.shape}, "
            f"the camera has (height, width) = ({camera.height}, {camera.width}); all must be equal"
        )
    config = resolved(config)
    key = rng.integers(2**64, dtype=np.uint64)
    terms = _terms(config, camera, gain=1 + config.gain * rng.standard_normal(), dropout_draw=rng.random())
    measured, seen = _measure(
        np.ascontiguousarray(depth_m, dtype=np.float32), np.ascontiguousarray(labels, dtype=np.uint8), key, terms
    )
    ellipses = _holes(camera, config, rng, limb_ends_camera_m)
    if len(ellipses):
        erase_ellipses(measured, ellipses)
        seen[measured == 0] = 0
    return measured, seen


_TERMS = (
    "fx", "fy", "cx", "cy", "min_range", "max_range",
    "axial_floor", "axial_quadratic", "axial_offset", "axial_grazing", "axial_radial",
    "lateral", "lateral_grazing", "grain", "shadow", "steps", "step_noise", "rounded",
    "wiggle", "wiggle_frequency", "flying_pixels", "gain", "pixel_dropout", "edge_dropout",
)  # fmt: skip
_TERMS_DTYPE = np.dtype([(name, np.float32) for name in _TERMS])


def _terms(config: SensorConfig, camera: Camera, gain: float, dropout_draw: float) -> np.ndarray:
    """(1,) record of the terms in the image's own pixels: what the kernel takes most quickly."""
    scale = camera.fx / config.native_focal_px if config.native_focal_px else 0.0
    # Disparity is counted in steps, or in native pixels when there is noise but no steps.
    unit = config.disparity_step_px or 1.0
    uses_disparity = config.disparity_step_px > 0 or config.disparity_noise_px > 0
    terms = np.zeros(1, _TERMS_DTYPE)
    terms[0] = (
        camera.fx, camera.fy, camera.cx, camera.cy,
        config.min_range_m,
        config.max_range_m or math.inf,
        config.axial_floor_m, config.axial_quadratic, config.axial_offset_m, config.axial_grazing, config.axial_radial,
        config.lateral_px * scale,
        config.lateral_grazing_px * scale,
        max(config.grain_px * scale, 1.0),
        camera.fx * config.baseline_m,
        abs(config.baseline_m) * config.native_focal_px / unit if uses_disparity else 0.0,
        config.disparity_noise_px / unit,
        config.disparity_step_px > 0,
        config.wiggle_m,
        2 * math.pi / config.wiggle_period_m if config.wiggle_period_m else 0.0,
        config.flying_pixels,
        gain,
        config.pixel_dropout * dropout_draw,
        config.edge_dropout,
    )  # fmt: skip
    return terms


NORMALS = ndtri((np.arange(4096) + 0.5) / 4096)
NORMALS = (NORMALS / NORMALS.std()).astype(np.float32)
"""Normal deviates by twelve random bits: 64 bits of one hash make several draws."""


@njit(cache=True)
def _random_bits(key, counter):
    """64 random bits, a pure function of its arguments (SplitMix64, Steele et al. 2014)."""
    z = key + np.uint64(counter) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit(cache=True)
def _normal(bits, shift):
    return NORMALS[np.uintp((bits >> np.uint64(shift)) & np.uint64(4095))]


@njit(cache=True)
def _uniform(bits, shift, count):
    """A number between 0 and 1 of so many bits, at most 24."""
    drawn = np.int32((bits >> np.uint64(shift)) & np.uint64((1 << count) - 1))
    return (np.float32(drawn) + np.float32(0.5)) / np.float32(1 << count)


@njit(cache=True)
def _grain_cells(size, grain):
    """Where each pixel of a row or column lies between lattice points, with weights that keep the variance at 1."""
    cell = np.empty(size, np.int32)
    weights = np.empty((size, 2), np.float32)
    for i in range(size):
        position = i / grain
        cell[i] = int(position)
        after = position - cell[i]
        norm = math.sqrt(after * after + (1 - after) * (1 - after))
        weights[i, 0] = (1 - after) / norm
        weights[i, 1] = after / norm
    return cell, weights


@njit(cache=True)
def _noise_lattice(height, width, key, counter):
    """(height, 3, width) normal deviates: the fields along z, x and y."""
    lattice = np.empty((height, 3, width), np.float32)
    for i in range(height):
        for j in range(width):
            bits = _random_bits(key, counter + i * width + j)
            for k in range(3):
                lattice[i, k, j] = _normal(bits, 12 * k)
    return lattice


@njit(cache=True)
def _shadowed(row, shadow, lost):
    """Marks the pixels of a row that the projector does not reach.

    Seen from a projector at x = baseline, pixel u of depth z lies at u - f baseline / z (`shadow` is f baseline). Going
    away from the projector's side these positions fall steadily, except behind something nearer.
    """
    width = len(row)
    side = np.float32(1) if shadow > 0 else np.float32(-1)
    lit = np.float32(np.inf)
    for i in range(width):
        u = width - 1 - i if shadow > 0 else i
        lost[u] = False
        if row[u] > 0:
            position = side * (np.float32(u) - shadow / row[u])
            lost[u] = position > lit + np.float32(0.5)
            lit = min(lit, position)


@njit(cache=True)
def _slope(before, here, after):
    """The gentler of the two differences, so that an outline is not taken for a steep surface."""
    a = here - before if before > 0 else np.float32(0)
    b = after - here if after > 0 else np.float32(0)
    return a if abs(a) < abs(b) else b


@njit(cache=True)
def _labelled_spans(labels, reach):
    """For each row the first and last pixel, exclusive, within reach of a label."""
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
        reached[y] = max(begin - reach, 0), min(end + reach, width) if end else 0
    return reached


@njit(cache=True)
def _measure(depth, labels, key, terms):
    """Every term for every pixel that may show something labelled; `SensorConfig` says what they are."""
    t = terms[0]
    height, width = depth.shape
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    measured = np.zeros((height, width), np.float32)
    seen = np.zeros((height, width), np.uint8)

    # Grainy noise is interpolated from a lattice, white noise drawn for each pixel; both beyond the pixels' counters.
    grainy = t.grain > one
    cell_y, weight_y = _grain_cells(height, t.grain)
    cell_x, weight_x = _grain_cells(width, t.grain)
    lattice = _noise_lattice(cell_y[-1] + 2 if grainy else 0, cell_x[-1] + 2 if grainy else 0, key, height * width)
    grain = np.empty((3, lattice.shape[2]), np.float32)
    lost = np.zeros((height, width), np.bool_)
    if t.shadow != zero:
        for y in range(height):
            _shadowed(depth[y], t.shadow, lost[y])
    flat_depth, flat_labels, flat_lost = depth.ravel(), labels.ravel(), lost.ravel()
    minds_grazing = t.axial_grazing > zero or t.lateral_grazing > zero
    per_fx, above_zero = one / t.fx, np.float32(ABOVE_ZERO + 0.5)
    spans = _labelled_spans(labels, 1 + int(4 * t.lateral) if t.lateral > zero else 0)
    for y in range(height):
        for k in range(3):
            for j in range(lattice.shape[2]):
                upper, lower = lattice[cell_y[y], k, j], lattice[cell_y[y] + 1, k, j]
                grain[k, j] = upper * weight_y[y, 0] + lower * weight_y[y, 1]
        above, row, below = depth[max(y - 1, 0)], depth[y], depth[min(y + 1, height - 1)]
        ray_y = (np.float32(y) - t.cy) / t.fy
        for x in range(spans[y, 0], spans[y, 1]):
            bits = _random_bits(key, y * width + x)
            if grainy:
                cell, w0, w1 = np.uintp(cell_x[x]), weight_x[x, 0], weight_x[x, 1]
                noise_x = grain[1, cell] * w0 + grain[1, cell + np.uintp(1)] * w1
                noise_y = grain[2, cell] * w0 + grain[2, cell + np.uintp(1)] * w1
            else:
                more_bits = _random_bits(key, (height + y) * width + x)
                noise_z, noise_x, noise_y = _normal(more_bits, 0), _normal(more_bits, 12), _normal(more_bits, 24)
            # theta, between the ray and the surface's normal, matters only where it is large.
            here = row[x]
            ray_x = (np.float32(x) - t.cx) * per_fx
            ray_squared = ray_x * ray_x + ray_y * ray_y
            lateral, grazing = t.lateral, zero
            if minds_grazing and labels[y, x] and here > zero:
                left, right = row[max(x - 1, 0)], row[min(x + 1, width - 1)]
                up, down = above[x], below[x]
                steep_x, steep_y = _slope(left, here, right) * t.fx, _slope(up, here, down) * t.fy
                normal_z = here + steep_x * ray_x + steep_y * ray_y
                lengths = (steep_x * steep_x + steep_y * steep_y + normal_z * normal_z) * (ray_squared + one)
                # 1 / cos(60 degrees)^2 = 4
                if lengths > np.float32(4) * here * here:
                    rest = np.float32(max(math.asin(here / math.sqrt(lengths)), 0.05))
                    theta = np.float32(math.pi / 2) - rest
                    lateral += t.lateral_grazing * theta / rest
                    grazing = t.axial_grazing * theta * theta / (math.sqrt(here) * rest * rest)

            # Sideways: the pixel shows what lies a little beside it. (math.floor costs more than all else here.)
            shown = np.uintp(y * width + x)
            if lateral > zero:
                u = min(max(x + int(lateral * noise_x + above_zero) - ABOVE_ZERO, 0), width - 1)
                v = min(max(y + int(lateral * noise_y + above_zero) - ABOVE_ZERO, 0), height - 1)
                shown = np.uintp(v * width + u)
            label, z = flat_labels[shown], flat_depth[shown]
            if label == 0 or flat_lost[shown] or not z > zero:
                continue

            # Lost and flying pixels.
            if _uniform(bits, 12, 24) < t.pixel_dropout:
                continue
            left, right = row[max(x - 1, 0)], row[min(x + 1, width - 1)]
            up, down = above[x], below[x]
            near, far = min(here, left, right, up, down), max(here, left, right, up, down)
            if far - near > np.float32(EDGE_M):
                fate = _uniform(bits, 36, 14)
                if fate < t.edge_dropout:
                    continue
                if fate > one - t.flying_pixels and near > zero:
                    z = near + _uniform(bits, 50, 14) * (far - near)

            # Along the ray.
            if grainy:
                noise_z = grain[0, cell] * w0 + grain[0, cell + np.uintp(1)] * w1
            beyond = z - t.axial_offset
            sigma = t.axial_floor + t.axial_quadratic * beyond * beyond + t.axial_radial * ray_squared
            z = t.gain * z + (sigma + grazing) * noise_z
            if t.wiggle > zero:
                z += t.wiggle * np.float32(math.sin(t.wiggle_frequency * z))
            if t.steps > zero:
                disparity = t.steps / z + t.step_noise * _normal(bits, 0)
                if t.rounded > zero:
                    disparity = np.float32(int(disparity + half))
                z = t.steps / disparity if disparity > zero else zero
            if t.min_range <= z <= t.max_range and z > zero:
                measured[y, x] = z
                seen[y, x] = label
    return measured, seen


def _holes(
    camera: Camera, config: SensorConfig, rng: np.random.Generator, limb_ends_camera_m: np.ndarray | None
) -> np.ndarray:
    """(N, 7) float32 ellipses, see `erase_ellipses`: holes anywhere, and perhaps the end of a limb."""
    ellipses = np.zeros((0, 7))
    if config.ellipses_per_megapixel:
        scale = camera.fx / config.native_focal_px
        native_megapixels = camera.width * camera.height / scale**2 / 1e6
        count = rng.poisson(config.ellipses_per_megapixel * native_megapixels)
        low = np.array([0, 0, ELLIPSE_PX[0] * scale, ELLIPSE_PX[0] * scale, 0])
        high = np.array([camera.width, camera.height, ELLIPSE_PX[1] * scale, ELLIPSE_PX[1] * scale, math.pi])
        ellipses = np.full((count, 7), np.inf)
        ellipses[:, :5] = low + (high - low) * rng.random((count, 5))
        ellipses[:, 5] = 0
    if limb_ends_camera_m is not None and len(limb_ends_camera_m) and rng.random() < config.limb_end_dropout:
        end = limb_ends_camera_m[rng.integers(len(limb_ends_camera_m))]
        ellipses = np.concatenate([ellipses, ball(end, rng.uniform(*LIMB_HOLE_M), LIMB_HOLE_DEPTH_M, camera)])
    return ellipses.astype(np.float32)


def ball(centre_camera_m: np.ndarray, radius_m: float, depth_reach_m: float, camera: Camera) -> np.ndarray:
    """(1, 7) a round hole around a point, for `erase_ellipses`; (0, 7) if the point is unknown or behind the camera."""
    u, v, z = camera.project(centre_camera_m)
    if not z > 0.05:
        return np.zeros((0, 7))
    radii_px = radius_m * camera.fx / z, radius_m * camera.fy / z
    return np.array([[u, v, *radii_px, 0, z - depth_reach_m, z + depth_reach_m]])


@njit(cache=True)
def erase_ellipses(depth, ellipses):
    """Sets depth to 0, in place, inside ellipses.

    Args:
        depth: (h, w) float32 metres.
        ellipses: (N, 7) float32 u, v, radii along the two axes in pixels, the first axis's angle, nearest and farthest
            depth that is erased.
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
