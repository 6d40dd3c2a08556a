"""Everything that a checkpoint knows, made comparable."""

from pathlib import Path

import torch

from kpopnet.checkpoint import load_state, read_meta


def contents(folder: Path) -> tuple[bytes, dict, dict]:
    """The averaged weights' file, the state for going on with its tensors as bytes, and the description."""
    return (folder / "model.safetensors").read_bytes(), flatten(load_state(folder)), read_meta(folder)


def flatten(value):
    if isinstance(value, dict):
        return {name: flatten(part) for name, part in value.items()}
    if isinstance(value, list):
        return [flatten(part) for part in value]
    return value.numpy().tobytes() if isinstance(value, torch.Tensor) else value
