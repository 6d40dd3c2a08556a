"""Sensors with single terms, what they see of walls, and whole measured images."""

from dataclasses import fields

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from synth.sensor.model import SensorConfig, measure_labelled

CAMERA = CAMERAS["kinect_v1"]


def only(name: str = "kinect_v1", **terms: float) -> SensorConfig:
    """The sensor with only these terms; all others are off."""
    off = {field.name: 0.0 for field in fields(SensorConfig)[1:]}
    return SensorConfig(name, **(off | {"native_focal_px": 575.5} | terms))


def wall(z_m: float, camera: Camera = CAMERA) -> np.ndarray:
    """(h, w) depth of a wall at right angles to the optical axis."""
    return np.full((camera.height, camera.width), z_m, np.float32)


def measure(depth_m: np.ndarray, config: SensorConfig, seed=0, camera: Camera = CAMERA, limb_ends_m=None) -> np.ndarray:
    """(h, w) float32 measured depth of all surfaces of an image; `seed` may be a generator."""
    rng = np.random.default_rng(seed)
    return measure_labelled(depth_m, np.ones(depth_m.shape, np.uint8), camera, config, rng, limb_ends_m)[0]
