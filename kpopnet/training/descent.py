"""A network in training: its weights, their average, its optimisers, and the steps that they take."""

import math
from copy import deepcopy

from torch import Tensor, nn

from kpopnet.errors import InputError
from kpopnet.training.optimisers import build_optimisers

WARMUP = 0.07
"""Fraction of the steps in which the learning rate rises."""

AVERAGE = 0.999
"""Decay per step of the exponential moving average of the weights, which is validated and stored."""


def lr_at(step: int, peak: float, steps: int) -> float:
    """Learning rate of one cycle (Smith 2018): half a cosine from peak/25 up to the peak, then one down to peak/10,000."""
    rising = WARMUP * steps
    if step < rising:
        low, fraction = peak / 25, step / rising
        return low + (peak - low) * (1 - math.cos(math.pi * fraction)) / 2
    low, fraction = peak / 1e4, (step - rising) / max(1, steps - rising)
    return low + (peak - low) * (1 + math.cos(math.pi * fraction)) / 2


class Descent:
    """A network that descends its loss, the average of its weights, its optimisers by name, and the number of steps taken."""

    def __init__(self, network: nn.Module, optimiser: str, lr: float, steps: int, clip_norm: float) -> None:
        self.network, self.average = network, deepcopy(network).eval().requires_grad_(False)
        self.optimisers = build_optimisers(network, optimiser, lr)
        self.step, self.steps, self.peak_lr, self.clip_norm = 0, steps, lr, clip_norm

    def descend(self, loss: Tensor) -> tuple[Tensor, float]:
        """Takes a step against the gradient of a loss; the gradient's norm before it was scaled down, and the learning rate.

        Raises InputError, before it changes a weight, if the loss or its gradient is not finite.
        """
        lr = lr_at(self.step, self.peak_lr, self.steps)
        self.network.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.clip_norm)
        if not math.isfinite(float(loss.detach() + norm)):
            raise InputError(
                f"step {self.step}: loss {float(loss.detach()):g} with a gradient of norm {float(norm):g} at a learning rate "
                f"of {lr:g}; stopped before the update; a smaller training.lr may help"
            )
        for optimiser in self.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = lr
            optimiser.step()
        self._update_average()
        self.step += 1
        return norm, lr

    def _update_average(self) -> None:
        """The decay is smaller during the first steps, so that the initial weights vanish quickly; counts are copied."""
        weight = 1 - min(AVERAGE, (1 + self.step) / (10 + self.step))
        for averaged, value in zip(self.average.state_dict().values(), self.network.state_dict().values(), strict=True):
            if averaged.is_floating_point():
                averaged.lerp_(value, weight)
            else:
                averaged.copy_(value)

    def state(self) -> dict:
        """What `load_state` needs to go on as if nothing had been, besides the average."""
        optimisers = {name: optimiser.state_dict() for name, optimiser in self.optimisers.items()}
        return {"step": self.step, "weights": self.network.state_dict(), "optimiser": optimisers}

    def load_state(self, state: dict) -> None:
        """Goes on from a `state`; raises whatever torch makes of another network's, or of damage."""
        self.network.load_state_dict(state["weights"])
        for name, optimiser in self.optimisers.items():
            optimiser.load_state_dict(state["optimiser"][name])
        self.step = int(state["step"])
