"""The optimisers of a training, each for its part of the weights: Muon for filters and matrices, AdamW for the rest.

Muon (Jordan et al. 2024) makes the matrix of a momentum step orthogonal. torch.optim.Muon is for matrices only, and iterates in
bfloat16, which is slow on CPUs and ends the process on those that advertise AMX wrongly. Here a filter (O, I, k, k) is a matrix
(O, I k k), the iteration is in float32, and matrices of one shape are iterated together.
"""

from collections import defaultdict
from collections.abc import Iterable

import torch
from torch import Tensor, nn
from torch.optim import AdamW, Optimizer

OPTIMISERS = ("adamw", "muon")
WEIGHT_DECAY = 0.01  # of filters and matrices

COEFFICIENTS = (3.4445, -4.7750, 2.0315)
"""Of the quintic iteration X <- a X + b X X' X + c X X' X X' X (Jordan et al. 2024): steepest at 0, so singular values end up
between 0.5 and 1.5 after few iterations, which trains as well as exactly 1."""

ITERATIONS = 5
MOMENTUM = 0.95


def build_optimisers(network: nn.Module, name: str, lr: float) -> dict[str, Optimizer]:
    """The optimisers by name: of `OPTIMISERS`, one for filters and matrices, and adamw for biases and normalisation."""
    weights = list(network.parameters())
    matrices = [weight for weight in weights if weight.ndim > 1]
    vectors = {"params": [weight for weight in weights if weight.ndim <= 1], "weight_decay": 0.0}
    if name == "muon":
        return {"muon": Muon(matrices, lr, WEIGHT_DECAY), "adamw": AdamW([vectors], lr=lr, fused=True)}
    return {"adamw": AdamW([{"params": matrices, "weight_decay": WEIGHT_DECAY}, vectors], lr=lr, fused=True)}


def orthogonalised(matrices: Tensor) -> Tensor:
    """(N, R, C) matrices with singular values moved close to 1, their singular vectors kept."""
    a, b, c = COEFFICIENTS
    wide = matrices if matrices.shape[1] <= matrices.shape[2] else matrices.mT
    x = wide / wide.norm(dim=(1, 2), keepdim=True).clamp_min(1e-7)
    for _ in range(ITERATIONS):
        gram = x @ x.mT
        x = torch.baddbmm(x, torch.baddbmm(gram, gram, gram, beta=b, alpha=c), x, beta=a)
    return x if wide is matrices else x.mT


class Muon(torch.optim.Optimizer):
    """Takes weights of at least two dimensions, the first that of the outputs.

    A step is scaled by 0.2 sqrt(max(R, C)), so that its root mean square is that of AdamW's step (Liu et al. 2025): one
    learning rate and weight decay serve both.
    """

    def __init__(self, weights: Iterable[nn.Parameter], lr: float, weight_decay: float) -> None:
        super().__init__(weights, {"lr": lr, "weight_decay": weight_decay, "momentum": MOMENTUM})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:
        """Takes one step with the gradients at hand."""
        for group in self.param_groups:
            by_shape: dict[tuple[int, int], list[nn.Parameter]] = defaultdict(list)
            for weight in group["params"]:
                by_shape[len(weight), weight[0].numel()].append(weight)
            for (rows, columns), weights in by_shape.items():
                directions = torch.stack([self._direction(weight, group["momentum"]).flatten(1) for weight in weights])
                scale = 0.2 * max(rows, columns) ** 0.5
                for weight, step in zip(weights, orthogonalised(directions), strict=True):
                    weight.mul_(1 - group["lr"] * group["weight_decay"])
                    weight.add_(step.view(weight.shape), alpha=-group["lr"] * scale)

    def _direction(self, weight: nn.Parameter, momentum: float) -> Tensor:
        """The gradient's moving average, looked ahead by one step (Nesterov)."""
        state = self.state[weight]
        if not state:
            state["momentum"] = torch.zeros_like(weight.grad)
        state["momentum"].lerp_(weight.grad, 1 - momentum)
        return weight.grad.lerp(state["momentum"], momentum)
