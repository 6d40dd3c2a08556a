"""How fast the pose estimator turns raw depth of a room into joints, on one core."""

import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import torch

from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network
from kpopnet.pose import PoseEstimator
from synth.simulated.eval_sim import EvalSim, EvalSimConfig, EvalSimSet

FRAMES, SETTLED = 150, 30


def measure() -> dict[str, tuple[float, str, str]]:
    """Whole 320x240 frames of a dance, one after another; the weights, which do not matter here, are random."""
    film = EvalSim(EvalSimSet(EvalSimConfig(seed=21))).film(0, FRAMES)
    threads = cv2.getNumThreads(), torch.get_num_threads()
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        meta = {"step": 0, "config": {}, "metrics": {}}
        network = NetworkEstimator(
            save_checkpoint(Path(folder), build_network(ModelConfig(input="depth_ridge")), {}, meta, best=True)
        )
    figures = {}
    for mode in ("realtime", "best"):
        estimator, frames_ms = PoseEstimator(network, mode), []
        for depth_m in film.depth_m:
            started = time.process_time()
            estimator.update(depth_m, film.camera)
            frames_ms.append(1000 * (time.process_time() - started))
        settled_ms = frames_ms[SETTLED:]
        figures["network.path_fps" if mode == "realtime" else "network.path_fps_best"] = (
            1000 / float(np.median(settled_ms)),
            "frames/core-second",
            f"median, {1000 / np.percentile(settled_ms, 95):.0f} at the 95th percentile; raw depth to joints, mode {mode}",
        )
    cv2.setNumThreads(threads[0])
    torch.set_num_threads(threads[1])
    return figures
