"""Checkpoints of untrained networks, and the contents of any in a form that can be compared."""

from pathlib import Path

import numpy as np
import torch

from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_state, read_meta, save_checkpoint
from kpopnet.networks.network import PoseNetwork, build_network

SMALL = ModelConfig(crop_px=32, widths=[8, 8, 8, 8])
UPRIGHT_M = np.stack([np.zeros(15), np.linspace(-0.6, 0.6, 15), np.full(15, 0.1)], axis=-1)
"""The mean pose that these checkpoints state: all joints in a vertical line."""


def save_untrained(
    run: Path, model: ModelConfig = SMALL, network: PoseNetwork | None = None, state: dict | None = None, **described
) -> Path:
    """Saves a network, by default one with random weights, as the best and last one of a run; the folder of the checkpoint."""
    meta = {"step": 1, "config": {}, "metrics": {}, "mean_pose_m": UPRIGHT_M.tolist()} | described
    return save_checkpoint(run, network or build_network(model), state or {}, meta, best=True)


def contents(folder: Path) -> tuple[bytes, dict, dict]:
    """The file of averaged weights, the training state with its tensors as bytes, and the description."""
    return (folder / "model.safetensors").read_bytes(), flatten(load_state(folder)), read_meta(folder)


def flatten(value):
    if isinstance(value, dict):
        return {name: flatten(part) for name, part in value.items()}
    if isinstance(value, list):
        return [flatten(part) for part in value]
    return value.numpy().tobytes() if isinstance(value, torch.Tensor) else value
