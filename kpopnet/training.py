"""The training loop: data, step, average, validation, checkpoint, resume.

What happens at a step depends on the seed and the step alone: the batch (kpopnet.crops), the learning rate (`lr_at`)
and the average's decay are pure functions of it. So a run that was stopped and resumed is the run that was not, bit for
bit on a CPU with an equal number of threads.
"""

import logging
import math
import sys
import time
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from kpopnet.checkpoint import load_state, load_weights, read_meta, save_checkpoint
from kpopnet.crops import AugmentConfig, Batch, CropBatches, EvenOrder, ShuffledOrder, batch_loader
from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig, PoseNetwork, build_network
from kpopnet.observation import ObservationSource
from kpopnet.processes import Processes, join_processes, set_up_torch
from kpopnet.validation import pictures, validate

log = logging.getLogger(__name__)


@dataclass
class TrainingConfig:
    """How a network is trained.

    Attributes:
        steps: the whole budget; the learning rate's cycle spans it.
        batch_size: samples a step, all processes together.
        lr: the cycle's peak.
        warmup: share of the steps in which the learning rate rises.
        weight_decay: of the convolutions' and linear layers' weights only (AdamW).
        clip_norm: gradients of a greater norm are scaled down to it.
        average: decay a step of the weights' exponential moving average, which is what is validated and kept.
        augment: see AugmentConfig.
        log_every: steps between scalars.
        validate_every: steps between validations, each followed by a checkpoint. The last step always has one.
        validation_samples: taken evenly from the validation set, or all if it has fewer; kept in memory.
        start: a checkpoint whose weights a fresh run begins with, to train a network on for other cameras or motions.
        resume: a checkpoint to continue from, e.g. outputs/train/RUN/last.
    """

    steps: int = 20000
    batch_size: int = 32
    lr: float = 2e-3
    warmup: float = 0.07
    weight_decay: float = 0.01
    clip_norm: float = 5.0
    average: float = 0.999
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    log_every: int = 20
    validate_every: int = 1000
    validation_samples: int = 2048
    start: str | None = None
    resume: str | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "batch_size", "log_every", "validate_every", "validation_samples"):
            if getattr(self, name) < 1:
                raise InputError(f"training.{name}={getattr(self, name)}: expected at least 1")
        if not (self.lr > 0 and self.clip_norm > 0 and self.weight_decay >= 0):
            raise InputError(
                f"expected training.lr > 0, training.clip_norm > 0 and training.weight_decay >= 0, found {self.lr}, "
                f"{self.clip_norm} and {self.weight_decay}"
            )
        if not (0 <= self.warmup < 1 and 0 <= self.average < 1):
            raise InputError(f"training.warmup={self.warmup}, training.average={self.average}: expected 0 <= x < 1")


def lr_at(step: int, config: TrainingConfig) -> float:
    """One cycle (Smith 2018): half a cosine from lr/25 up to lr, then one down to lr/10,000."""
    rising = config.warmup * config.steps
    if step < rising:
        low, share = config.lr / 25, step / rising
        return low + (config.lr - low) * (1 - math.cos(math.pi * share)) / 2
    low, share = config.lr / 1e4, (step - rising) / max(1, config.steps - rising)
    return low + (config.lr - low) * (1 + math.cos(math.pi * share)) / 2


def decay_at(step: int, config: TrainingConfig) -> float:
    """The average's decay, less in the beginning so that it soon forgets the fresh weights."""
    return min(config.average, (1 + step) / (10 + step))


class Run:
    """The state of a training: weights, their average, optimiser, step, best, mean pose."""

    def __init__(self, config: TrainingConfig, model: ModelConfig, seed: int, processes: Processes) -> None:
        """A fresh run, on the weights of `config.start` if there are any, or the one of `config.resume`."""
        self.config = config
        self.processes = processes
        self.network = build_network(model, seed).to(processes.device)
        if config.start is not None and config.resume is None:
            begin_with(self.network, config.start)
        self.average = deepcopy(self.network).eval().requires_grad_(False)
        self.optimiser = torch.optim.AdamW(weight_groups(self.network, config.weight_decay), lr=config.lr, fused=True)
        self.step = 0
        self.best_cm = math.inf
        self.offset_sum_m = torch.zeros(15, 3, dtype=torch.float64)
        self.offset_count = 0
        self.skipped = 0
        if config.resume is not None:
            self.load(Path(config.resume))
        self.callable = processes.spread(self.network)

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """One step on one batch. Returns scalars for the log.

        Raises:
            InputError: the loss or its gradient is not finite; nothing was updated.
        """
        crop, target = batch.crop.to(self.processes.device), batch.target.to(self.processes.device)
        lr = lr_at(self.step, self.config)

        # Gradient.
        self.network.train()
        prediction = self.callable(crop)
        losses = self.network.head.loss(prediction, target)
        loss = sum(losses.values())
        self.optimiser.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip_norm)
        if not math.isfinite(float(loss.detach() + norm)):
            raise InputError(
                f"step {self.step}: loss {float(loss.detach()):g} with a gradient of norm {float(norm):g}; stopped "
                f"before the update; a training.lr below {self.config.lr:g} may help"
            )

        # Update.
        for group in self.optimiser.param_groups:
            group["lr"] = lr
        self.optimiser.step()
        self._update_average()

        # Account.
        self.offset_sum_m += batch.offset_m.double().sum(0)
        self.offset_count += len(batch.offset_m)
        self.skipped += batch.skipped
        self.step += 1
        error = (prediction.joints.detach() - target).norm(dim=-1).mean() * self.network.config.half_size_m
        return {
            "loss": loss.detach(),
            **{f"loss_{name}": value.detach() for name, value in losses.items()},
            "error_cm": 100 * error,
            "gradient_norm": norm,
            "lr": torch.tensor(lr),
        }

    def _update_average(self) -> None:
        weight = 1 - decay_at(self.step, self.config)
        for averaged, value in zip(self.average.state_dict().values(), self.network.state_dict().values(), strict=True):
            if averaged.is_floating_point():
                averaged.lerp_(value, weight)
            else:
                averaged.copy_(value)

    def mean_pose_m(self) -> list[list[float]]:
        """(15, 3) the mean joint's offset from the person's centre, over the training samples that rank 0 saw."""
        return (self.offset_sum_m / max(1, self.offset_count)).tolist()

    def save(self, folder: Path, metrics: dict[str, float], described: dict) -> Path:
        """Writes a checkpoint (kpopnet.checkpoint) and returns its path."""
        best = metrics["mean_error_cm"] < self.best_cm
        self.best_cm = min(self.best_cm, metrics["mean_error_cm"])
        state = {
            "step": self.step,
            "weights": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "best_cm": self.best_cm,
            "offset_sum_m": self.offset_sum_m,
            "offset_count": self.offset_count,
            "skipped": self.skipped,
        }
        meta = {"step": self.step, "metrics": metrics, "mean_pose_m": self.mean_pose_m(), **described}
        return save_checkpoint(folder, self.average, state, meta, best=best)

    def load(self, folder: Path) -> None:
        """Takes up the state of a checkpoint.

        Raises:
            InputError: missing, foreign, damaged, or of another model or finished already.
        """
        meta = read_meta(folder)
        load_weights(self.average, folder)
        state = load_state(folder)
        try:
            self.network.load_state_dict(state["weights"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.step, self.best_cm = state["step"], state["best_cm"]
            self.offset_sum_m, self.offset_count = state["offset_sum_m"], state["offset_count"]
            self.skipped = state["skipped"]
        except (KeyError, RuntimeError, ValueError, TypeError) as error:
            raise InputError(f"{folder}: its training state does not fit this model or version ({error})") from error
        if self.step >= self.config.steps:
            raise InputError(f"{folder}: finished already, {meta['step']} of {self.config.steps} steps are done")


def begin_with(network: PoseNetwork, checkpoint: str) -> None:
    """Gives a fresh network the weights of a checkpoint, a folder such as outputs/train/RUN/best.

    Raises:
        InputError: no checkpoint there, or one of another model.
    """
    found, asked = read_meta(checkpoint)["model"], asdict(network.config)
    other = [name for name in asked if found.get(name, asked[name]) != asked[name]]
    if other:
        settings = " ".join(f"model.{name}={str(found[name]).replace(' ', '')}" for name in other)
        raise InputError(f"training.start={checkpoint} has another model; give it: {settings}")
    load_weights(network, checkpoint)


def weight_groups(network: nn.Module, weight_decay: float) -> list[dict]:
    """Weights of convolutions and linear layers, which decay, and all else (biases, normalisation), which does not."""
    weights = list(network.parameters())
    return [
        {"params": [weight for weight in weights if weight.ndim > 1], "weight_decay": weight_decay},
        {"params": [weight for weight in weights if weight.ndim <= 1], "weight_decay": 0.0},
    ]


def train(
    config: TrainingConfig,
    model: ModelConfig,
    source: ObservationSource,
    validation: ObservationSource,
    *,
    out: Path,
    seed: int = 0,
    device: str = "auto",
    workers: int = 1,
    threads: int = 0,
    described: dict | None = None,
    data: dict | None = None,
) -> Path:
    """Trains a network and leaves checkpoints in `out`.

    Args:
        config: how.
        model: what.
        source: training observations.
        validation: validation observations.
        out: the run's folder. Only rank 0 writes, and writes there.
        seed: of weights, order and augmentation.
        device: cpu, cuda, or auto.
        workers: processes that prepare batches; 0 does it in between.
        threads: of torch, 0 for all cores at hand.
        described: the whole configuration, for the checkpoint's meta.json.
        data: what tells one set of data from another; a run goes on only with the data it began with.

    Returns:
        The folder of the last checkpoint.

    Raises:
        InputError: a setting or a checkpoint does not fit; a loss that is not finite.
    """
    with join_processes(device) as processes:
        threads = set_up_torch(threads)
        if config.batch_size % processes.count:
            raise InputError(
                f"training.batch_size={config.batch_size} cannot be dealt out evenly to {processes.count} processes"
            )
        run = Run(config, model, seed, processes)
        if config.resume is not None and (begun_with := read_meta(config.resume).get("data")) != data:
            raise InputError(f"{config.resume}: was trained on other data ({begun_with}) than is there now ({data})")
        order = ShuffledOrder(len(source), config.batch_size, seed, processes.rank, processes.count)
        batches = CropBatches(source, model, order, seed, config.augment)
        loader = batch_loader(batches, run.step, config.steps, workers, pin_memory=processes.device.type == "cuda")
        if processes.rank > 0:
            for batch in loader:
                run.update(batch)
            return out / "last"
        log.info(
            f"{model.name}: {sum(weight.numel() for weight in run.network.parameters()):,} parameters, crops of "
            f"{model.crop_px} px, seed {seed}\n"
            f"on {processes.describe(threads)}, {workers} data worker(s) a process\n"
            f"{len(source):,} training and {len(validation):,} validation samples; steps {run.step:,} to "
            f"{config.steps:,} of {config.batch_size} ({config.steps * config.batch_size / len(source):.1f} epochs), "
            f"lr up to {config.lr:g}\n"
            f"into {out}; watch with: tensorboard --logdir {out}"
        )
        held_out = validation_batches(validation, model, config, seed)
        return _train_and_watch(run, loader, held_out, out, {"config": described or {}, "data": data})


def validation_batches(validation: ObservationSource, model: ModelConfig, config: TrainingConfig, seed: int) -> list[Batch]:
    """The validation crops, made once and kept: `validation_samples` of them, spread over the set."""
    count = min(config.validation_samples, len(validation))
    batches = CropBatches(validation, model, EvenOrder(len(validation), config.batch_size, count), seed, None)
    steps = math.ceil(count / config.batch_size)
    loader = batch_loader(batches, 0, steps, workers=0)
    return list(tqdm(loader, total=steps, desc="validation crops", disable=not sys.stderr.isatty(), leave=False))


def _train_and_watch(run: Run, loader: DataLoader, held_out: list[Batch], out: Path, described: dict) -> Path:
    """Rank 0's loop: steps, scalars, validation, pictures, checkpoints."""
    config, checkpoint = run.config, out / "last"
    started, first = time.perf_counter(), run.step
    bar = tqdm(total=config.steps, initial=first, desc="training", unit="step", disable=not sys.stderr.isatty())
    with SummaryWriter(out, purge_step=first) as board, bar:
        for batch in loader:
            scalars = run.update(batch)
            bar.update()

            if run.step % config.log_every == 0:
                for name, value in scalars.items():
                    board.add_scalar(f"train/{name}", float(value), run.step)
                rate = (run.step - first) * config.batch_size / (time.perf_counter() - started)
                board.add_scalar("train/samples_per_second", rate, run.step)
                board.add_scalar("train/empty_silhouettes_skipped", run.skipped, run.step)
                bar.set_postfix(error=f"{float(scalars['error_cm']):.1f} cm", rate=f"{rate:.0f}/s")

            if run.step % config.validate_every == 0 or run.step == config.steps:
                metrics, estimates = validate(run.average, held_out, run.processes.device)
                for name, value in metrics.items():
                    board.add_scalar(f"validation/{name}", value, run.step)
                board.add_image("validation/predictions", pictures(held_out, estimates), run.step, dataformats="HWC")
                checkpoint = run.save(out, metrics, described)
                log.info(
                    f"step {run.step:,} of {config.steps:,}: mean error {metrics['mean_error_cm']:.2f} cm, "
                    f"{100 * metrics['within_10cm']:.1f} % within 10 cm (best {run.best_cm:.2f} cm); "
                    f"{(run.step - first) * config.batch_size / (time.perf_counter() - started):.0f} samples/s"
                )
    if run.skipped:
        log.info(f"{run.skipped} observations with an empty silhouette were replaced by the next one")
    log.info(f"checkpoints: {out / 'best'} (lowest validation error) and {checkpoint}")
    return checkpoint
