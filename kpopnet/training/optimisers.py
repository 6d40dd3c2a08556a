"""The optimisers of a training, each for its part of the weights."""

from torch import nn
from torch.optim import AdamW, Optimizer

from kpopnet.training.muon import Muon

OPTIMISERS = ("adamw", "muon")

STATE = {AdamW: ("step", "exp_avg", "exp_avg_sq"), Muon: ("momentum",)}
"""What each keeps of a weight; all but `step` have the weight's shape."""


def build_optimisers(network: nn.Module, name: str, lr: float, weight_decay: float) -> dict[str, Optimizer]:
    """The optimisers by name: of `OPTIMISERS`, one for filters and matrices, and adamw for biases and normalisation.

    Only filters and matrices decay.
    """
    weights = list(network.parameters())
    matrices = [weight for weight in weights if weight.ndim > 1]
    vectors = {"params": [weight for weight in weights if weight.ndim <= 1], "weight_decay": 0.0}
    if name == "muon":
        return {"muon": Muon(matrices, lr, weight_decay), "adamw": AdamW([vectors], lr=lr, fused=True)}
    return {"adamw": AdamW([{"params": matrices, "weight_decay": weight_decay}, vectors], lr=lr, fused=True)}


def load_optimisers(optimisers: dict[str, Optimizer], saved: dict[str, dict]) -> None:
    """Loads states; their settings must be those of this run, their moments of the weights' shapes.

    Raises:
        ValueError: they are not.
    """
    if set(saved) != set(optimisers):
        raise ValueError(f"of optimisers {', '.join(map(str, saved))[:60]}, not {', '.join(optimisers)}")
    for name, optimiser in optimisers.items():
        settings = [
            {name: value for name, value in group.items() if name not in ("params", "lr")} for group in optimiser.param_groups
        ]
        optimiser.load_state_dict(saved[name])
        for group, expected in zip(optimiser.param_groups, settings, strict=True):
            if other := [name for name, value in expected.items() if group.get(name, value) != value]:
                raise ValueError(f"other settings of the optimiser: {', '.join(other)}")
            for weight in group["params"]:
                _check_moments(optimiser.state.get(weight, {}), weight, STATE[type(optimiser)])


def _check_moments(moments: dict, weight: nn.Parameter, names: tuple[str, ...]) -> None:
    if not set(names) <= set(moments):
        raise ValueError("moments are missing")
    if any(moments[name].shape != weight.shape for name in names if name != "step"):
        raise ValueError("moments of other shapes than the weights")
