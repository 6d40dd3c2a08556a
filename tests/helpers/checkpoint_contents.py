"""The contents of a checkpoint in a form that can be compared."""

from pathlib import Path

import torch

from kpopnet.networks.checkpoint import load_state, read_meta


def contents(folder: Path) -> tuple[bytes, dict, dict]:
    """The file of averaged weights, the training state with its tensors as bytes, and the description."""
    return (folder / "model.safetensors").read_bytes(), flatten(load_state(folder)), read_meta(folder)


def flatten(value):
    if isinstance(value, dict):
        return {name: flatten(part) for name, part in value.items()}
    if isinstance(value, list):
        return [flatten(part) for part in value]
    return value.numpy().tobytes() if isinstance(value, torch.Tensor) else value
