"""Trains the network that reads joints over time (kpopnet.networks.over_time) on what an image network makes of films."""

import logging
import time
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from kpopnet.networks.over_time import BASES, CHILDREN, FEATURES, PARENTS, Measured, read
from kpopnet.skeleton import MIRROR, NUM_JOINTS

log = logging.getLogger(__name__)

AVERAGE_RATE = 0.02
"""Of the exponential average of the weights over the steps, which is the result."""


@dataclass
class OverTimeTraining:
    """How the network is trained.

    Attributes:
        epochs: times that all films are varied anew; the learning rate's cycle spans them.
        passes: times that the pieces of an epoch are learned from.
        piece: frames of a piece.
        batch_size: pieces a step.
        hidden: width of both hidden layers.
        lr: peak learning rate.
        future: whether the network also reads the frames that follow.
        seed: of the first weights and of all that is drawn.
    """

    epochs: int = 40
    passes: int = 3
    piece: int = 16
    batch_size: int = 32
    hidden: int = 48
    lr: float = 5e-3
    future: bool = False
    seed: int = 0


def network_of(config: OverTimeTraining) -> nn.Sequential:
    """The network, which at first answers the mean of detection and fit."""
    ways, width = (2 if config.future else 1), config.hidden
    last = nn.Linear(width, ways * BASES + 1)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(ways * FEATURES, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), last)


def varied(rng: np.random.Generator, film: dict[str, np.ndarray], frames: int) -> tuple[Measured, np.ndarray, np.ndarray]:
    """A film at another rate, with drop-outs, mirrored or not, turned a little, of another size: `frames` frames of what was
    measured, the true joints in metres and the times in seconds; a shorter film starts again.

    The film has the arrays of `Measured`, `true_m` (T, 15, 3) in metres and `times_s` (T,).
    """
    length, stride = len(film["true_m"]), int(rng.choice([1, 1, 1, 2]))
    keep = rng.random(length) >= rng.choice([0, 0, 0.03, 0.15])
    for _ in range(int(rng.integers(0, 3))):
        at = int(rng.integers(length))
        keep[at : at + int(rng.integers(2, 20))] = False
    rows = np.flatnonzero(keep)[::stride]
    rows = rows[np.arange(frames) % len(rows)]
    times_s = film["times_s"][rows] * rng.choice([1.0, rng.uniform(0.5, 1.3)])
    restarts = np.diff(times_s, prepend=-1) < 0
    times_s = times_s + 100.0 * np.cumsum(restarts)  # a new start: beyond FORGET_S
    order, sign = (MIRROR, np.array([-1, 1, 1])) if rng.random() < 0.5 else (np.arange(NUM_JOINTS), np.ones(3))
    angle, size = rng.uniform(-0.35, 0.35), rng.uniform(0.85, 1.1)
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]) * sign[:, None]
    centre = film["true_m"][rows[0]].mean(axis=0)

    def points(name: str) -> np.ndarray:
        return (film[name][rows][:, order] - centre) * size @ turn + centre * np.array([sign[0], 1, 1])

    chances = (film[name][rows][:, order] for name in ("detected", "fitted"))
    return Measured(points("detected_m"), points("fitted_m"), *chances), points("true_m"), times_s


def batches(rng: np.random.Generator, films: list[dict], config: OverTimeTraining) -> list[Tensor]:
    """(N, piece, ...) tensors of varied films: the results of `read`, true joints in metres, seconds since the frame before."""
    frames = max(len(film["true_m"]) for film in films) // config.piece * config.piece
    drawn = [varied(rng, film, frames) for film in films]
    measured = Measured(*(np.stack(part, axis=1) for part in zip(*(one[0] for one in drawn), strict=True)))
    true_m, times_s = (np.stack([one[k] for one in drawn], axis=1) for k in (1, 2))
    arrays = (*read(measured, times_s, config.future), true_m, np.diff(times_s, axis=0, prepend=times_s[:1] - 9))
    tensors = (torch.from_numpy(np.ascontiguousarray(one.swapaxes(0, 1), np.float32)) for one in arrays)
    return [one.unflatten(1, (-1, config.piece)).flatten(0, 1) for one in tensors]


def answer(network: nn.Module, points_m: Tensor, differences_m: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """(..., 15, 3) joints in metres and (..., 15) logits of the confidence, as `kpopnet.networks.over_time.OverTime`."""
    out = network(seen)
    moved_m = points_m + (out[..., :-1].mT[..., None] * differences_m).sum(-3)
    return moved_m[..., :-1, :] + moved_m[..., -1:, :], out[..., :-1, -1]


def loss_of(joints_m: Tensor, logits: Tensor, true_m: Tensor, steps_s: Tensor) -> Tensor:
    """Of (N, T, 15, 3) joints: centimetres, directions of bones, centimetres from frame to frame, and the confidence."""
    error_m = (joints_m - true_m).norm(dim=-1)
    joint = nn.functional.smooth_l1_loss(100 * error_m, torch.zeros_like(error_m), beta=3.0)
    bones, true_bones = (
        nn.functional.normalize(one[..., CHILDREN, :] - one[..., PARENTS, :], dim=-1) for one in (joints_m, true_m)
    )
    near = (steps_s[:, 1:] < 0.12).float()[..., None]
    moved_m, true_moved_m = (one[:, 1:] - one[:, :-1] for one in (joints_m, true_m))
    speed = (100 * (moved_m - true_moved_m).norm(dim=-1) * near).mean()
    sure = nn.functional.binary_cross_entropy_with_logits(logits, (error_m < 0.1).float())
    return joint + 3 * (bones - true_bones).norm(dim=-1).mean() + speed + 0.3 * sure


def train_over_time(config: OverTimeTraining, films: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The arrays of `kpopnet.networks.over_time.OverTime`; films as in `varied`."""
    torch.manual_seed(config.seed)
    network, began = network_of(config), time.monotonic()
    average = {name: value.clone() for name, value in network.state_dict().items()}
    optimiser = torch.optim.AdamW(network.parameters(), lr=config.lr, weight_decay=0.01)
    for epoch in range(config.epochs):
        rng = np.random.default_rng([config.seed, epoch])
        tensors = batches(rng, films, config)
        order = torch.from_numpy(np.concatenate([rng.permutation(len(tensors[0])) for _ in range(config.passes)]))
        optimiser.param_groups[0]["lr"] = config.lr * 0.5 * (1 + np.cos(np.pi * epoch / config.epochs))
        losses = []
        for chosen in order.split(config.batch_size):
            points_m, differences_m, seen, true_m, steps_s = (one[chosen] for one in tensors)
            loss = loss_of(*answer(network, points_m, differences_m, seen), true_m, steps_s)
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            losses.append(loss.item())
            for name, value in network.state_dict().items():
                average[name].lerp_(value, AVERAGE_RATE)
        log.info("epoch %d: loss %.4f, %d pieces, %.0f s", epoch, np.mean(losses), len(tensors[0]), time.monotonic() - began)
    return {name: value.numpy() for name, value in average.items()}
