"""What one frame costs a network, run by torch and by ONNX Runtime."""

import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
import torch

from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_network, save_checkpoint
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.networks.network import build_network
from kpopnet.networks.onnx.export import export_network

CROPS, ROUNDS = 20, 15


def measure() -> dict[str, tuple[float, str, str]]:
    """A single crop on one thread, in turns; the weights, which do not matter here, are random."""
    model = ModelConfig(input="depth_ridge")
    with tempfile.TemporaryDirectory() as folder:
        meta = {"step": 0, "config": {}, "metrics": {}}
        checkpoint = save_checkpoint(Path(folder), build_network(model), {}, meta, best=True)
        exported = Path(folder) / "pose.onnx"
        export_network(*load_network(checkpoint), exported)
        backends = {"network.ms": NetworkEstimator(checkpoint).backend, "network.onnx_ms": NetworkEstimator(exported).backend}
    crop = np.random.default_rng(0).uniform(-1, 1, (1, 2, model.crop_px, model.crop_px)).astype(np.float32)
    times_ms: dict[str, list[float]] = {name: [] for name in backends}
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    for _ in range(ROUNDS):
        for name, run in backends.items():
            for _ in range(CROPS):
                started = time.process_time()
                run(crop)
                times_ms[name].append(1000 * (time.process_time() - started))
    torch.set_num_threads(threads)
    crops = f"one crop of {model.crop_px} px, depth and ridge, one core"
    return {name: (median(values), "ms of CPU", crops) for name, values in times_ms.items()}
