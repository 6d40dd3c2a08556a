"""Depth-camera models: turn a perfect depth image into a measured one, with noise, quantisation, shadows and holes.

One kernel models two families. *Structured light* (Kinect v1) triangulates a projected pattern. Its depth is quantised
in disparity, and near surfaces cast a shadow on the side away from the projector. A pixel is matched by a window around
it, so noise and outlines are spatially correlated. *Time of flight* (Kinect 2, SwissRanger) has white noise that grows
towards the image's corners, a periodic error in z, and flying pixels between near and far surfaces at outlines.

Sources: Nguyen, Izadi & Lovell 2012 (axial and lateral noise of Kinect v1); Handa et al. 2014 (disparity noise, of which
half is in use, and steps); Mahler et al. 2017 (gain, ellipses). On standing people of UTD-MHAD (real Kinect v1, 320x240) the
depth steps are z^2/345 m, 68 % of the neighbouring pixels have the same depth step, and the second differences correspond to
white noise of 0.33 steps. Simulated standing people give 345, 75 % and 0.30; on a bare wall of another sensor of the kind,
smoother than clothes, half of the noise is enough (`docs/ledger.md`). What stays of the noise in films: `film_noise`.

Lengths in pixels are the sensor's own ("native") pixels and scale with the camera's focal length, so one sensor serves
640x480 and 320x240.
"""

import math
from dataclasses import dataclass, fields
from functools import cache

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import InputError, check_between, check_one_of
from synth.sensor.film_noise import FilmFrame
from synth.sensor.kernel import erase_ellipses, measure_pixels

MOST = 1e6  # of any term, in its unit
ELLIPSE_PX = (2.5, 5.0)  # range of the semi-axes of elliptic holes, native pixels
LIMB_HOLE_RADIUS_M = (0.02, 0.06)
LIMB_HOLE_DEPTH_M = 0.15  # largest difference in depth from the limb's end that a hole erases

_ANY_CAMERA = {
    "max_range_m": 8.0, "gain": 0.003, "pixel_dropout": 0.0002, "edge_dropout": 0.05, "ellipses_per_megapixel": 20.0,
    "limb_end_dropout": 0.2,
}  # fmt: skip
_STRUCTURED_LIGHT = _ANY_CAMERA | {
    "axial_offset_m": 0.4, "axial_grazing": 0.0001, "lateral_px": 0.8, "lateral_grazing_px": 0.035,
    "grain_px": 9.0, "grain_disparity_px": 0.25, "grain_flicker": 0.08,
    "baseline_m": 0.075, "disparity_step_px": 0.125, "disparity_noise_px": 0.0139, "disparity_flicker": 0.25,
}  # fmt: skip
_TIME_OF_FLIGHT = _ANY_CAMERA | {"grain_flicker": 1.0, "wiggle_m": 0.004, "flying_pixels": 0.4}

_PUBLISHED: dict[str, dict[str, float]] = {
    "ideal": {},
    "kinect_v1": _STRUCTURED_LIGHT | {
        "min_range_m": 0.4, "native_focal_px": 575.5, "axial_floor_m": 0.0012, "axial_quadratic": 0.0019,
    },
    "kinect_2": _TIME_OF_FLIGHT | {
        "min_range_m": 0.5, "native_focal_px": 365.0, "axial_floor_m": 0.003, "axial_quadratic": 0.001,
        "axial_radial": 0.0036, "wiggle_period_m": 0.47,
    },
    "swissranger": _TIME_OF_FLIGHT | {
        "min_range_m": 0.3, "max_range_m": 5.0, "native_focal_px": 204.795, "axial_floor_m": 0.009, "axial_quadratic": 0.003,
        "axial_radial": 0.0292, "wiggle_period_m": 1.25, "pixel_dropout": 0.002, "ellipses_per_megapixel": 80.0,
    },
}  # fmt: skip
"""Terms by sensor. A term that is not listed is 0 (off).

Kinect v1's focal length follows from the depth steps of UTD-MHAD with a baseline of 75 mm. Isolated dropouts are as rare
as in UTD-MHAD (6 in 100,000 pixels). A dropout of 5 %, found elsewhere, would destroy the ridge image, in which every lost
pixel is an edge.
"""


@dataclass(frozen=True)
class SensorConfig:
    """A depth camera. Every term that is None takes the published value of the named sensor.

    Attributes:
        name: ideal, kinect_v1, kinect_2 or swissranger.
        min_range_m: smallest measured depth, metres.
        max_range_m: largest measured depth, metres; 0 is no limit.
        native_focal_px: focal length in native pixels, the unit of the other terms in pixels.
        axial_floor_m: constant term of the standard deviation of the depth, metres: sigma_z = axial_floor +
            axial_quadratic (z - axial_offset)^2 + axial_radial tan(a)^2, where a is the pixel's angle from the optical
            axis, plus axial_grazing theta^2 / (sqrt(z) (pi/2 - theta)^2) where the angle theta between surface normal
            and ray exceeds 60 degrees.
        axial_quadratic: quadratic term of sigma_z, 1/m; see axial_floor_m.
        axial_offset_m: depth at which the quadratic term of sigma_z vanishes, metres; see axial_floor_m.
        axial_grazing: grazing-angle term of sigma_z; see axial_floor_m.
        axial_radial: radial term of sigma_z, metres; see axial_floor_m.
        lateral_px: standard deviation of the lateral shift of a pixel, native pixels; where theta exceeds 60 degrees,
            lateral_grazing theta / (pi/2 - theta) is added.
        lateral_grazing_px: grazing-angle term of the lateral shift, native pixels; see lateral_px.
        grain_px: correlation length of axial and lateral noise, native pixels, about the width of the matching window; up
            to 1 image pixel the noise is white.
        grain_disparity_px: change of disparity within which a film's grain becomes another, native pixels; 0: never.
        grain_flicker: share of the variance of correlated noise that each frame of a film draws again; the rest is the
            film's grain. White axial and lateral noise is the frame's own.
        baseline_m: distance of the projector to the right of the camera, metres; shadows fall to the left. A negative
            value puts the projector on the left.
        disparity_step_px: quantisation step of the disparity, native pixels; the depth steps are
            disparity_step z^2 / (native_focal baseline).
        disparity_noise_px: standard deviation of white noise on the disparity before quantisation, native pixels.
        disparity_flicker: share of that noise's variance that each frame of a film draws again.
        wiggle_m: amplitude of a systematic error that is a sine of z, metres.
        wiggle_period_m: period of that sine, metres: a quarter of the modulation's unambiguous range.
        flying_pixels: fraction of the pixels on outlines that are measured between the near and the far surface.
        gain: standard deviation of one factor on all depths of an image. Mahler's Gamma(1000, 1/1000) has 0.03, but 8 cm
            at 2.5 m would be an error of the joint labels, which are in metres, not noise of the image.
        pixel_dropout: largest fraction of lost pixels; each image draws its own fraction uniformly below it.
        edge_dropout: fraction of lost pixels on outlines.
        ellipses_per_megapixel: mean number of elliptic holes per million native pixels.
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
    grain_disparity_px: float | None = None
    grain_flicker: float | None = None
    baseline_m: float | None = None
    disparity_step_px: float | None = None
    disparity_noise_px: float | None = None
    disparity_flicker: float | None = None
    wiggle_m: float | None = None
    wiggle_period_m: float | None = None
    flying_pixels: float | None = None
    gain: float | None = None
    pixel_dropout: float | None = None
    edge_dropout: float | None = None
    ellipses_per_megapixel: float | None = None
    limb_end_dropout: float | None = None

    def __post_init__(self) -> None:
        check_one_of("sensor.name", self.name, _PUBLISHED)
        terms = _with_published(self)
        for name, value in terms.items():
            check_between(f"sensor.{name}", value, -MOST if name == "baseline_m" else 0, 1 if name in _FRACTIONS else MOST)
        if 0 < terms["max_range_m"] <= terms["min_range_m"]:
            raise InputError(f"sensor.max_range_m={terms['max_range_m']} must exceed sensor.min_range_m={terms['min_range_m']}")
        for needed, names in _NEEDED_BY.items():
            for name in names:
                if terms[name] and not terms[needed]:
                    raise InputError(f"sensor.{name} needs a sensor.{needed}")


_FRACTIONS = ("grain_flicker", "disparity_flicker", "flying_pixels", "pixel_dropout", "edge_dropout", "limb_end_dropout")

_NEEDED_BY = {
    "native_focal_px": (
        *("lateral_px", "lateral_grazing_px", "grain_px", "grain_disparity_px", "disparity_step_px", "disparity_noise_px"),
        "ellipses_per_megapixel",
    ),
    "baseline_m": ("disparity_step_px", "disparity_noise_px", "grain_disparity_px"),
    "wiggle_period_m": ("wiggle_m",),
}
"""Terms without which others, if they are not 0, have no meaning."""


def _with_published(config: SensorConfig) -> dict[str, float]:
    published = _PUBLISHED[config.name]
    given = {field.name: getattr(config, field.name) for field in fields(config) if field.name != "name"}
    return {name: published.get(name, 0.0) if value is None else value for name, value in given.items()}


@cache
def resolved(config: SensorConfig) -> SensorConfig:
    """The same sensor with published values in place of every None."""
    return SensorConfig(config.name, **_with_published(config))


SENSORS = {name: SensorConfig(name) for name in _PUBLISHED}


def measure_labelled(
    depth_m: np.ndarray,
    labels: np.ndarray,
    camera: Camera,
    config: SensorConfig,
    rng: np.random.Generator,
    limb_ends_camera_m: np.ndarray | None = None,
    film: FilmFrame | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """(h, w) float32 depth, metres, and (h, w) uint8 labels as the sensor measures them; both 0 where nothing is measured.

    `depth_m` is the (h, w) clean depth of the whole scene, 0 where there is no surface. Surfaces with label 0 in `labels`,
    (h, w) uint8, are not measured. Lateral noise moves outlines, so a pixel may show the surface of a neighbouring clean pixel.
    Of `limb_ends_camera_m`, (K, 3) hands and feet in metres, one may be lost. `film` is what the frame shares with others of
    its film; None: a single picture.
    """
    assert depth_m.shape == labels.shape == (camera.height, camera.width), (depth_m.shape, labels.shape, camera)
    config = resolved(config)
    key, single = rng.integers(2**64, dtype=np.uint64), film is None
    film = film or FilmFrame(key, rng.standard_normal(), rng.random(), (rng,))
    depth_m, labels = np.ascontiguousarray(depth_m, np.float32), np.ascontiguousarray(labels, np.uint8)
    measured, seen = measure_pixels(depth_m, labels, np.array([film.key, key]), _terms(config, camera, film, single))
    ellipses = _holes(camera, config, film.holes, limb_ends_camera_m)
    if len(ellipses):
        erase_ellipses(measured, ellipses)
        seen[measured == 0] = 0
    return measured, seen


def _terms(config: SensorConfig, camera: Camera, film: FilmFrame, single: bool) -> np.ndarray:
    """(1,) record of the sensor's terms, and of those that the kernel has in image pixels, in steps or of the film.

    All noise of a single picture is its own.
    """
    scale = camera.fx / config.native_focal_px if config.native_focal_px else 0.0
    # The unit of disparity is the quantisation step, or a native pixel for noise without quantisation.
    unit = config.disparity_step_px or 1.0
    pattern_shift = abs(config.baseline_m) * config.native_focal_px  # disparity at 1 m, native pixels
    uses_disparity = config.disparity_step_px > 0 or config.disparity_noise_px > 0
    terms = _with_published(config) | {
        **{name: getattr(camera, name) for name in ("fx", "fy", "cx", "cy")},
        "max_range": config.max_range_m or math.inf,
        "lateral": config.lateral_px * scale,
        "lateral_grazing": config.lateral_grazing_px * scale,
        "grain": max(config.grain_px * scale, 1.0),
        "grain_layers": pattern_shift / config.grain_disparity_px if config.grain_disparity_px else 0.0,
        "flicker": 1.0 if single else config.grain_flicker,
        "shadow": camera.fx * config.baseline_m,
        "steps": pattern_shift / unit if uses_disparity else 0.0,
        "step_noise": config.disparity_noise_px / unit,
        "step_flicker": 1.0 if single else config.disparity_flicker,
        "wiggle_frequency": 2 * math.pi / config.wiggle_period_m if config.wiggle_period_m else 0.0,
        "gain": 1 + config.gain * film.gain,
        "pixel_dropout": config.pixel_dropout * film.dropout,
    }
    return np.array([tuple(terms.values())], [(name, np.float32) for name in terms])


def _holes(
    camera: Camera, config: SensorConfig, births: tuple[np.random.Generator, ...], limb_ends_camera_m: np.ndarray | None
) -> np.ndarray:
    """(N, 7) float32 ellipses for `erase_ellipses`: random holes, an equal share from each generator, and a limb's end."""
    ellipses = [np.zeros((0, 7))]
    scale = camera.fx / config.native_focal_px if config.native_focal_px else 1.0
    native_megapixels = camera.width * camera.height / scale**2 / 1e6
    low = np.array([0, 0, ELLIPSE_PX[0] * scale, ELLIPSE_PX[0] * scale, 0])
    high = np.array([camera.width, camera.height, ELLIPSE_PX[1] * scale, ELLIPSE_PX[1] * scale, math.pi])
    limb_end_dropout = 1 - (1 - config.limb_end_dropout) ** (1 / len(births))
    for rng in births:
        if config.ellipses_per_megapixel:
            count = rng.poisson(config.ellipses_per_megapixel * native_megapixels / len(births))
            drawn = np.full((count, 7), np.inf)
            drawn[:, :5] = low + (high - low) * rng.random((count, 5))
            drawn[:, 5] = 0
            ellipses.append(drawn)
        if limb_ends_camera_m is not None and len(limb_ends_camera_m) and rng.random() < limb_end_dropout:
            end = limb_ends_camera_m[rng.integers(len(limb_ends_camera_m))]
            ellipses.append(spherical_hole(end, rng.uniform(*LIMB_HOLE_RADIUS_M), LIMB_HOLE_DEPTH_M, camera))
    return np.concatenate(ellipses).astype(np.float32)


def spherical_hole(centre_camera_m: np.ndarray, radius_m: float, depth_reach_m: float, camera: Camera) -> np.ndarray:
    """(1, 7) ellipse for `kernel.erase_ellipses` around a point (3,) in the camera frame; (0, 7) nearer than 5 cm, or NaN.

    The radius is that at the point's depth; depths that differ from the point's by at most `depth_reach_m` are erased.
    """
    u, v, z = camera.project(centre_camera_m)
    if not z > 0.05:
        return np.zeros((0, 7))
    radii_px = radius_m * camera.fx / z, radius_m * camera.fy / z
    return np.array([[u, v, *radii_px, 0, z - depth_reach_m, z + depth_reach_m]])
