"""What a crop costs the shipped network by torch and by ONNX Runtime, and how fast the pose estimator is with it."""

from statistics import median

import numpy as np
from stand_ins import film_of

from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose import PoseEstimator
from kpopnet.weights import FOLDER
from synth.simulated.stand_ins import EvalSim, EvalSimConfig
from tests.speed.common import Figures, one_core, timed

CROPS, ROUNDS = 20, 15
FRAMES, SETTLED = 150, 30


def measure() -> Figures:
    """On one core."""
    shipped = NetworkEstimator()
    backends = {"network.ms": NetworkEstimator(FOLDER).backend, "network.onnx_ms": shipped.backend}
    with one_core():
        return _crops(backends, shipped.model.crop_px) | _frames(shipped)


def _crops(backends: dict, crop_px: int) -> Figures:
    """A single crop, by the backends in turns."""
    crop = np.random.default_rng(0).uniform(-1, 1, (1, 1, crop_px, crop_px)).astype(np.float32)
    times_ms: dict[str, list[float]] = {name: [] for name in backends}
    for _ in range(ROUNDS):
        for name, run in backends.items():
            times_ms[name] += [timed(run, crop)[0] for _ in range(CROPS)]
    against = f"one crop of {crop_px} px, one core"
    return {name: (median(values), "ms of CPU", against) for name, values in times_ms.items()}


def _frames(network: NetworkEstimator) -> Figures:
    """Whole 320x240 frames of a dance, one after another."""
    film, figures = film_of(EvalSim(EvalSimConfig(seed=21)), 0, FRAMES), {}
    for mode, name in (("realtime", "network.path_fps"), ("best", "network.path_fps_best")):
        estimator = PoseEstimator(network, mode)
        frames_ms = [timed(estimator.update, depth_m, film.camera)[0] for depth_m in film.depth_m]
        middle, late = np.percentile(frames_ms[SETTLED:], (50, 95))
        against = f"median, {1000 / late:.0f} at the 95th percentile; raw depth to joints, mode {mode}"
        figures[name] = (1000 / middle, "frames/core-second", against)
    return figures
