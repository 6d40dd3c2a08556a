"""Small networks as ONNX files."""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import load_network, save_checkpoint
from kpopnet.networks.network import PoseNetwork, build_network
from kpopnet.networks.onnx.export import export_network


def small(kind: str = "dense") -> ModelConfig:
    return ModelConfig(kind, "depth_ridge" if kind == "dense" else "depth", crop_px=32, widths=[8, 8, 16, 16])


def save(run: Path, kind: str = "dense") -> Path:
    """A checkpoint of a network with random weights."""
    config = {"ridge": {"epsilon_r": 0.5}, "data": {"train": "/home/me/data/train"}}
    meta = {"step": 5, "config": config, "metrics": {}, "mean_pose_m": np.zeros((15, 3)).tolist()}
    return save_checkpoint(run, build_network(small(kind), 1), {}, meta, best=True)


class Exported(NamedTuple):
    """An exported network: its file, the largest difference to torch, and what was exported."""

    file: Path
    difference: float
    network: PoseNetwork


@cache
def export(run: Path, kind: str = "dense") -> Exported:
    """Exports a small network into the folder of its run, which takes seconds."""
    network, meta = load_network(save(run, kind))
    return Exported(run / "pose.onnx", export_network(network, meta, run / "pose.onnx"), network)
