"""Trains the network that reads joints over time, and measures it beside the modes there are (docs/ledger.md).

    python tools/over_time_films.py data/over_time/train --split train --films 400
    python tools/over_time_films.py data/over_time/fresh --split benchmark --films 40
    python tools/over_time.py data/over_time/train --fresh data/over_time/fresh --out data/over_time/causal.safetensors
    python tools/over_time.py data/over_time/train --fresh data/over_time/fresh --out data/over_time/future.safetensors --future

The causal form, of mode realtime, takes what the network and the fit say of each image in that mode; the other what they say in
mode best. Each is printed beside the mean of both, with paired 95 % intervals over films. SIMULATED depth.
"""

import argparse
import logging
import time
from pathlib import Path

import numpy as np
import safetensors.numpy
import torch
from torch import Tensor, nn

from kpopnet.errors import InputError
from kpopnet.evaluation.intervals import Bootstrap, interval_of
from kpopnet.networks.over_time import BASES, FEATURES, Measured, OverTime, read
from kpopnet.runtime.atomic_write import write_whole
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.input_files import parsing
from kpopnet.skeleton import BONE_CHILDREN, BONE_PARENTS, MIRROR, NUM_JOINTS, Joint

log = logging.getLogger(__name__)

EPOCHS, PASSES, SEED = 40, 3, 0
"""How often all films are varied anew, and how often the pieces of an epoch are learned from."""

PIECE, BATCH_SIZE = 16, 32  # frames of a piece, and pieces a step
LASTING = 40.0
"""Weight of the mean error of directions over a piece: what lasts for half a second, no score of a dance averages out."""
HIDDEN, LR = 48, 5e-3
"""Width of both hidden layers, and the peak learning rate, whose cycle spans the epochs."""

AVERAGE_RATE = 0.02
"""Of the exponential average of the weights over the steps, which is the result."""

MODES = "realtime", "best"  # of the causal form, and of that which reads the frames that follow

ENDS = [Joint.RIGHT_HAND, Joint.LEFT_HAND, Joint.RIGHT_FOOT, Joint.LEFT_FOOT]
HANDS, CORE = ENDS[:2], [joint for joint in range(NUM_JOINTS) if joint not in ENDS]
FPS, REST_FRAMES, REST_M, FAST_M_S = 30.0, 10, 0.006, (1.5, 2.5)


def films_in(folder: Path, mode: str) -> list[dict[str, np.ndarray]]:
    """The films of a folder as `varied` takes them, as the network and the fit see them in mode realtime or best."""
    films = []
    for path in sorted(folder.glob("film_*.npz")):
        with parsing(path, "not a readable film", "delete it and make it again"), np.load(path) as file:
            film = {name: file[name] for name in ("true_m", "times_s", "hidden")}
            films.append(film | {name: file[f"{mode}_{name}"] for name in Measured._fields})
    if not films:
        raise InputError(f"{folder}: no film_*.npz; tools/over_time_films.py makes them")
    return films


# --- training --------------------------------------------------------------------------------------------------------------


def network_of(future: bool) -> nn.Sequential:
    """The network, which at first answers the mean of detection and fit."""
    ways = 2 if future else 1
    last = nn.Linear(HIDDEN, ways * BASES + 1)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(nn.Linear(ways * FEATURES, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, HIDDEN), nn.ReLU(), last)


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


def batches(rng: np.random.Generator, films: list[dict], future: bool) -> list[Tensor]:
    """(N, PIECE, ...) tensors of varied films: the results of `read`, true joints in metres, seconds since the frame before."""
    frames = max(len(film["true_m"]) for film in films) // PIECE * PIECE
    drawn = [varied(rng, film, frames) for film in films]
    measured = Measured(*(np.stack(part, axis=1) for part in zip(*(one[0] for one in drawn), strict=True)))
    true_m, times_s = (np.stack([one[k] for one in drawn], axis=1) for k in (1, 2))
    arrays = (*read(measured, times_s, future), true_m, np.diff(times_s, axis=0, prepend=times_s[:1] - 9))
    tensors = (torch.from_numpy(np.ascontiguousarray(one.swapaxes(0, 1), np.float32)) for one in arrays)
    return [one.unflatten(1, (-1, PIECE)).flatten(0, 1) for one in tensors]


def answer(network: nn.Module, points_m: Tensor, differences_m: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """(..., 15, 3) joints in metres and (..., 15) logits of the confidence, as `kpopnet.networks.over_time.OverTime`."""
    out = network(seen)
    moved_m = points_m + (out[..., :-1].mT[..., None] * differences_m).sum(-3)
    return moved_m[..., :-1, :] + moved_m[..., -1:, :], out[..., :-1, -1]


def loss_of(joints_m: Tensor, logits: Tensor, true_m: Tensor, steps_s: Tensor) -> Tensor:
    """Of (N, T, 15, 3) joints: centimetres, directions of bones, in each frame and in the mean over all T, centimetres from
    frame to frame, and the confidence.
    """
    error_m = (joints_m - true_m).norm(dim=-1)
    joint = nn.functional.smooth_l1_loss(100 * error_m, torch.zeros_like(error_m), beta=3.0)
    bones, true_bones = (
        nn.functional.normalize(one[..., BONE_CHILDREN, :] - one[..., BONE_PARENTS, :], dim=-1) for one in (joints_m, true_m)
    )
    turned = bones - true_bones
    near = (steps_s[:, 1:] < 0.12).float()[..., None]
    moved_m, true_moved_m = (one[:, 1:] - one[:, :-1] for one in (joints_m, true_m))
    speed = (100 * (moved_m - true_moved_m).norm(dim=-1) * near).mean()
    sure = nn.functional.binary_cross_entropy_with_logits(logits, (error_m < 0.1).float())
    directions = 3 * turned.norm(dim=-1).mean() + LASTING * turned.mean(dim=1).norm(dim=-1).mean()
    return joint + directions + speed + 0.3 * sure


def trained(films: list[dict[str, np.ndarray]], future: bool, epochs: int) -> dict[str, np.ndarray]:
    """The arrays of `kpopnet.networks.over_time.OverTime`; films as in `varied`, all of which each epoch varies anew."""
    torch.manual_seed(SEED)
    network, began = network_of(future), time.monotonic()
    average = {name: value.clone() for name, value in network.state_dict().items()}
    optimiser = torch.optim.AdamW(network.parameters(), lr=LR, weight_decay=0.01)
    for epoch in range(epochs):
        rng = np.random.default_rng([SEED, epoch])
        tensors = batches(rng, films, future)
        order = torch.from_numpy(np.concatenate([rng.permutation(len(tensors[0])) for _ in range(PASSES)]))
        optimiser.param_groups[0]["lr"] = LR * 0.5 * (1 + np.cos(np.pi * epoch / epochs))
        losses = []
        for chosen in order.split(BATCH_SIZE):
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


# --- figures ---------------------------------------------------------------------------------------------------------------


def figures(joints_m: np.ndarray, film: dict[str, np.ndarray]) -> dict[str, tuple[float, float]]:
    """Name to sum and count of (T, 15, 3) joints in metres: of squares for what is at rest, whose mean's root is reported.

    Degrees are of chords between unit vectors: for what is off by 30° one in a hundred too few.
    """
    true_m, times_s = film["true_m"], film["times_s"]
    error_m, steps_s = np.linalg.norm(joints_m - true_m, axis=-1), np.diff(times_s)
    near = steps_s < 1.5 / FPS
    speed_m_s = np.linalg.norm(np.diff(joints_m - true_m, axis=0), axis=-1) / steps_s[:, None]
    hand_m_s = np.gradient(true_m[:, HANDS], times_s, axis=0)
    fast = np.linalg.norm(hand_m_s, axis=-1)
    moving = (fast > FAST_M_S[0]) & (fast < FAST_M_S[1]) & (error_m[:, HANDS] < 0.25)
    behind_s = -((joints_m - true_m)[:, HANDS] * hand_m_s).sum(axis=-1) / np.maximum(fast, FAST_M_S[0]) ** 2
    bones, true_bones = (one[:, BONE_CHILDREN] - one[:, BONE_PARENTS] for one in (joints_m, true_m))
    lengths_m, true_lengths_m = (np.linalg.norm(one, axis=-1, keepdims=True) for one in (bones, true_bones))
    turned = bones / lengths_m - true_bones / true_lengths_m
    lasting = turned[: len(turned) // PIECE * PIECE].reshape(-1, PIECE, *turned.shape[1:]).mean(axis=1)
    at_rest, jitter_mm2 = rest(joints_m, film, near)

    def mean_of(values: np.ndarray) -> tuple[float, float]:
        return float(values.sum()), values.size

    return {
        "within 10 cm, %": mean_of(100.0 * (error_m < 0.1)),
        "error, cm": mean_of(100 * error_m),
        "hidden, cm": mean_of(100 * error_m[film["hidden"]]),
        "hands, cm": mean_of(100 * error_m[:, HANDS]),
        "velocity, cm/s": mean_of(100 * speed_m_s[near]),
        "core at rest, mm RMS": mean_of(jitter_mm2[:, CORE][at_rest[:, CORE]]),
        "hands and feet at rest, mm RMS": mean_of(jitter_mm2[:, ENDS][at_rest[:, ENDS]]),
        "hands at 2 m/s, ms behind": mean_of(1000 * behind_s[moving]),
        "bones, degrees": mean_of(np.degrees(np.linalg.norm(turned, axis=-1))),
        "bones in the mean over half a second, degrees": mean_of(np.degrees(np.linalg.norm(lasting, axis=-1))),
        "spread of bone lengths, cm": mean_of(100 * lengths_m[..., 0].std(axis=0)),
    }


def rest(joints_m: np.ndarray, film: dict[str, np.ndarray], near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 15) whether the true joint stays within REST_M of its mean for REST_FRAMES frames, and the error's variance, mm²."""
    starts = [
        start for start in range(0, len(joints_m) - REST_FRAMES, REST_FRAMES // 2) if near[start:][: REST_FRAMES - 1].all()
    ]
    if not starts:
        return np.zeros((0, NUM_JOINTS), bool), np.zeros((0, NUM_JOINTS))
    true_m, found_m = (np.stack([one[start : start + REST_FRAMES] for start in starts]) for one in (film["true_m"], joints_m))
    error_m, from_mean_m = found_m - true_m, true_m - true_m.mean(axis=1, keepdims=True)
    still = np.linalg.norm(from_mean_m, axis=-1).max(axis=1) < REST_M
    return still, 1e6 * ((error_m - error_m.mean(axis=1, keepdims=True)) ** 2).sum(axis=-1).mean(axis=1)


def report(by_name: dict[str, list[dict[str, tuple[float, float]]]], new: str, old: str) -> None:
    """Prints every figure of all, then the differences new - old, with intervals over films where enough of them count."""
    films = len(by_name[new])
    bootstrap = Bootstrap(np.arange(films), SEED)

    def values(name: str, key: str) -> np.ndarray:
        """Over all films, then over those of each resample; NaN where nothing counts."""
        sums = np.array([film[key] for film in by_name[name]], float)
        total, count = np.concatenate([sums.sum(axis=0, keepdims=True), bootstrap.sums(sums)]).T
        mean = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
        return np.sqrt(mean) if "RMS" in key else mean

    print(f"{films} films, SIMULATED; the difference is {new} - {old}")
    for key in by_name[new][0]:
        change = values(new, key) - values(old, key)
        each = ", ".join(f"{name} {values(name, key)[0]:.2f}" for name in by_name)
        counted = sum(one[key][1] > 0 and other[key][1] > 0 for one, other in zip(by_name[new], by_name[old], strict=True))
        found = interval_of(change[1:], counted)
        interval = " ({:+.2f} to {:+.2f})".format(*found) if found else ""
        print(f"{key}: {each}; difference {change[0]:+.2f}{interval}")


def measure(network: OverTime, films: list[dict[str, np.ndarray]]) -> None:
    """Prints the figures of a network beside the mean of detection and fit."""
    found: dict[str, list] = {"mean of both": [], "over time": []}
    for film in films:
        measured = Measured(*(film[name] for name in Measured._fields))
        mean_m = (measured.detected_m + measured.fitted_m) / 2
        joints_m, _ = network(*read(measured, film["times_s"], network.future))
        for name, one in zip(found, (mean_m, joints_m), strict=True):
            found[name].append(figures(one, film))
    report(found, "over time", "mean of both")


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("films", type=Path, help="folder of films to learn from")
    parser.add_argument("--fresh", type=Path, required=True, help="folder of films of other people, to measure on")
    parser.add_argument("--out", type=Path, required=True, help="file of the weights; one that exists is measured only")
    parser.add_argument("--future", action="store_true", help="the form that also reads the frames that follow")
    parser.add_argument("--epochs", type=int, default=EPOCHS, help="%(default)s")
    given = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    if given.fresh.resolve() == given.films.resolve():
        parser.error("--fresh: the films to learn from; give those of other people")
    fresh = {future: films_in(given.fresh, MODES[future]) for future in (False, True)}
    given.out.parent.mkdir(parents=True, exist_ok=True)
    if not given.out.exists():
        arrays = trained(films_in(given.films, MODES[given.future]), given.future, given.epochs)
        write_whole(given.out, safetensors.numpy.save(arrays))
    else:
        log.info("%s exists and is measured only", given.out)
    network = OverTime.load(given.out)
    if given.future and not network.future:
        raise InputError(f"{given.out}: is of the causal form, and is measured only; without --future, or give another --out")
    measure(network, fresh[network.future])


if __name__ == "__main__":
    main()
