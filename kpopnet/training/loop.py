"""The training loop: data, step, weight averaging, validation, checkpoints, resuming.

Each step depends only on the seed and the step number: the batch (kpopnet.data.batches), the learning rate (`lr_at`) and
the decay of the average are pure functions of them. Therefore a run that was stopped and resumed equals an uninterrupted
run, bit for bit on a CPU with the same number of threads.
"""

import gc
import logging
import math
import sys
import time
from contextlib import closing, nullcontext
from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader
from torch.utils.tensorboard import SummaryWriter
from tqdm import tqdm

from kpopnet.data.batches import (
    AugmentConfig,
    Batch,
    CropBatches,
    EvenOrder,
    ShuffledOrder,
    SmallCropsConfig,
    batch_loader,
)
from kpopnet.data.observation import ObservationSource
from kpopnet.errors import InputError, check_between
from kpopnet.networks import ModelConfig
from kpopnet.networks.checkpoint import complete_links, load_state, load_weights, read_meta, resumable, save_checkpoint
from kpopnet.networks.network import PoseNetwork, build_network
from kpopnet.ridge import RidgeConfig
from kpopnet.runtime.atomic_write import naming
from kpopnet.runtime.cpu import bounded_processes
from kpopnet.runtime.folder_lock import locked
from kpopnet.training.distributed import Processes, join_processes, set_up_torch
from kpopnet.training.optimisers import OPTIMISERS, build_optimisers, load_optimisers
from kpopnet.training.validation import validate, validation_sheet

log = logging.getLogger(__name__)

FIRST_LINE_S = 10.0
"""Seconds of training before the first log line of progress, where standard error is not a terminal."""


MAX_STEPS, MAX_BATCH = 10**9, 2**16


@dataclass
class TrainingConfig:
    """How a network is trained.

    Attributes:
        steps: total number of steps; the learning rate cycle spans them.
        batch_size: samples per step, over all processes.
        lr: peak learning rate of the cycle.
        warmup: fraction of the steps in which the learning rate rises.
        optimiser: muon for the weights of convolutions and linear layers and AdamW for the rest (kpopnet.training.muon), or
            adamw for all, whose lr should be 0.002.
        weight_decay: weight decay, only for the weights of convolutions and linear layers.
        clip_norm: gradients with a larger norm are scaled down to it, so that a single odd batch does not throw the weights.
            Measured norms (median, 99th percentile, largest): 0.15, 0.25 and 0.38 in 2,400 steps of the dense network; 0.32,
            0.9 and 1.6 of the holistic one, 3.3 in its first 50 steps.
        average: decay per step of the exponential moving average of the weights, which is validated and stored.
        augment: augmentation of training crops.
        small_crops: smaller crops for the first steps, for dense networks only.
        log_every: steps between scalars in TensorBoard.
        validate_every: steps between validations, each followed by a checkpoint; the last step always has one.
        validation_samples: number of evenly spaced samples of the validation set (all if it has fewer), kept in memory.
        start: a checkpoint whose weights a new run starts from, to fine-tune a network for other cameras or motions.
        resume: a checkpoint from which to resume a run, e.g. outputs/train/RUN/last.
    """

    steps: int = 10000
    batch_size: int = 64
    lr: float = 5e-3
    warmup: float = 0.07
    optimiser: str = "muon"
    weight_decay: float = 0.01
    clip_norm: float = 0.5
    average: float = 0.999
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    small_crops: SmallCropsConfig = field(default_factory=SmallCropsConfig)
    log_every: int = 20
    validate_every: int = 500
    validation_samples: int = 2048
    start: str | None = None
    resume: str | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "batch_size", "log_every", "validate_every", "validation_samples"):
            if getattr(self, name) < 1:
                raise InputError(f"training.{name}={getattr(self, name)}: expected at least 1")
        check_between("training.steps", self.steps, 1, MAX_STEPS)
        check_between("training.batch_size", self.batch_size, 1, MAX_BATCH)
        if not (0 < self.lr < math.inf and self.clip_norm > 0 and 0 <= self.weight_decay < math.inf):
            raise InputError(
                f"expected training.lr > 0, training.clip_norm > 0 and training.weight_decay >= 0, found {self.lr}, "
                f"{self.clip_norm} and {self.weight_decay}"
            )
        if self.optimiser not in OPTIMISERS:
            raise InputError(f"training.optimiser={self.optimiser}: expected one of {', '.join(OPTIMISERS)}")
        if not (0 <= self.warmup < 1 and 0 <= self.average < 1):
            raise InputError(f"training.warmup={self.warmup}, training.average={self.average}: expected 0 <= x < 1")


def lr_at(step: int, config: TrainingConfig) -> float:
    """Learning rate of one cycle (Smith 2018): half a cosine from lr/25 up to lr, then one down to lr/10,000."""
    rising = config.warmup * config.steps
    if step < rising:
        low, fraction = config.lr / 25, step / rising
        return low + (config.lr - low) * (1 - math.cos(math.pi * fraction)) / 2
    low, fraction = config.lr / 1e4, (step - rising) / max(1, config.steps - rising)
    return low + (config.lr - low) * (1 + math.cos(math.pi * fraction)) / 2


def decay_at(step: int, config: TrainingConfig) -> float:
    """Decay of the weight average; smaller during the first steps, so that the initial weights vanish quickly."""
    return min(config.average, (1 + step) / (10 + step))


class Run:
    """The state of a training: weights, their average, optimiser, step, lowest error, mean pose."""

    def __init__(self, config: TrainingConfig, model: ModelConfig, seed: int, processes: Processes) -> None:
        """Starts a run, from the weights of `config.start` if given, or resumes that of `config.resume`."""
        self.config = config
        self.processes = processes
        self.network = build_network(model, seed).to(processes.device)
        if config.start is not None and config.resume is None:
            load_initial_weights(self.network, config.start)
        self.average = deepcopy(self.network).eval().requires_grad_(False)
        self.optimisers = build_optimisers(self.network, config.optimiser, config.lr, config.weight_decay)
        self.step = 0
        self.best_cm = math.inf
        self.offset_sum_m = torch.zeros(15, 3, dtype=torch.float64)
        self.offset_count = 0
        self.skipped = 0
        self.resumed_meta: dict | None = None
        if config.resume is not None:
            self.load(Path(config.resume))
        self.data_parallel = processes.data_parallel(self.network)

    def close(self) -> None:
        """Releases the data-parallel wrapper, and with it gloo's threads.

        If they are alive when the interpreter ends, they abort the process in about one of ten runs (torch 2.13).
        """
        self.data_parallel = self.network
        gc.collect()

    def describe(self) -> str:
        """Model and schedule, for the log."""
        config, model = self.config, self.network.config
        parameters = sum(weight.numel() for weight in self.network.parameters())
        return (
            f"{model.name}: {parameters:,} parameters, crops of {model.crop_px} px; "
            f"steps {self.step:,} to {config.steps:,} of {config.batch_size} samples, lr up to {config.lr:g}"
        )

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Takes one optimiser step on one batch; returns scalars for TensorBoard.

        Raises:
            InputError: the loss or its gradient is not finite; the weights were not changed.
        """
        crop, target = batch.crop.to(self.processes.device), batch.target.to(self.processes.device)
        lr = lr_at(self.step, self.config)

        # Gradient
        self.network.train()
        prediction = self.data_parallel(crop)
        losses = self.network.head.loss(prediction, target)
        loss = sum(losses.values())
        self.network.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip_norm)
        if not math.isfinite(float(loss.detach() + norm)):
            raise InputError(
                f"step {self.step}: loss {float(loss.detach()):g} with a gradient of norm {float(norm):g}; stopped "
                f"before the update; a training.lr below {self.config.lr:g} may help"
            )

        # Update
        for optimiser in self.optimisers.values():
            for group in optimiser.param_groups:
                group["lr"] = lr
            optimiser.step()
        self._update_average()

        # Statistics
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
        """(15, 3) mean offset of each joint from the person's centre in metres, over the training samples of rank 0."""
        return (self.offset_sum_m / max(1, self.offset_count)).tolist()

    def save(self, folder: Path, metrics: dict[str, float], described: dict) -> Path:
        """Writes a checkpoint (kpopnet.networks.checkpoint) and returns its path."""
        best = metrics["mean_error_cm"] < self.best_cm
        self.best_cm = min(self.best_cm, metrics["mean_error_cm"])
        state = {
            "step": self.step,
            "weights": self.network.state_dict(),
            "optimiser": {name: optimiser.state_dict() for name, optimiser in self.optimisers.items()},
            "best_cm": self.best_cm,
            "offset_sum_m": self.offset_sum_m,
            "offset_count": self.offset_count,
            "skipped": self.skipped,
        }
        meta = {"step": self.step, "metrics": metrics, "mean_pose_m": self.mean_pose_m(), **described}
        return save_checkpoint(folder, self.average, state, meta, best=best)

    def load(self, folder: Path) -> None:
        """Loads the state of a checkpoint.

        Raises:
            InputError: the checkpoint is missing, damaged, of another format or model, or of a finished run.
        """
        self.resumed_meta = read_meta(folder)
        load_weights(self.average, folder)
        state = load_state(folder)
        try:
            self.network.load_state_dict(state["weights"])
            load_optimisers(self.optimisers, state["optimiser"])
            self.step, self.best_cm = state["step"], state["best_cm"]
            self.offset_sum_m, self.offset_count = state["offset_sum_m"], state["offset_count"]
            self.skipped = state["skipped"]
            self.offset_sum_m.expand(15, 3)
        except (KeyError, RuntimeError, ValueError, TypeError, AttributeError, IndexError) as error:
            first_line = next(iter(str(error).splitlines()), type(error).__name__)
            raise InputError(f"{folder}: its training state does not fit this model or version ({first_line})") from error
        if self.step >= self.config.steps:
            raise InputError(f"{folder}: finished already, {self.step} of {self.config.steps} steps are done")


def refuse_other_run(folder: Path, resume: str | None) -> None:
    """Refuses a folder that holds a run, unless it is the one that is resumed: its checkpoints would be removed.

    Args:
        folder: the run's folder.
        resume: the checkpoint that is resumed.

    Raises:
        InputError: the folder holds another run, or `resume` is no checkpoint.
    """
    if resume is not None:
        read_meta(resume)
    found = resumable(folder)
    if found is None or (resume is not None and (folder / "checkpoints").resolve() in Path(resume).resolve().parents):
        return
    raise InputError(f"{folder}: holds a run; resume it (training.resume={found}), or give another folder (hydra.run.dir=...)")


def load_initial_weights(network: PoseNetwork, checkpoint: str) -> None:
    """Loads the weights of a checkpoint, a folder such as outputs/train/RUN/best, into a new network.

    Raises:
        InputError: no checkpoint in the folder, or one of another model.
    """
    found, expected = read_meta(checkpoint)["model"], asdict(network.config)
    # The weights of a dense network fit crops of any size.
    free = ("crop_px",) if network.config.kind == "dense" else ()
    other = [name for name in expected if name not in free and found.get(name, expected[name]) != expected[name]]
    if other:
        settings = " ".join(f"model.{name}={str(found[name]).replace(' ', '')}" for name in other)
        raise InputError(f"training.start={checkpoint} has another model; give it: {settings}")
    load_weights(network, checkpoint)


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
    ridge: RidgeConfig | None = None,
    described: dict | None = None,
    data: dict | None = None,
) -> Path:
    """Trains a network and writes checkpoints to `out`.

    Args:
        config: how the network is trained.
        model: architecture of the network.
        source: training observations.
        validation: validation observations.
        out: folder of the run. Only rank 0 writes to it.
        seed: of weights, sample order and augmentation.
        device: cpu, cuda, or auto.
        workers: processes that prepare batches; 0 prepares them in this process.
        threads: threads of torch, 0 for all available cores that the workers leave.
        ridge: of the ridge image, for model.input=depth_ridge; None for the defaults.
        described: the whole configuration, stored in the checkpoint's meta.json; an estimator takes `ridge` from it.
        data: identifies the data sets; a run is resumed only with the data that it began with.

    Returns:
        The folder of the last checkpoint.

    Raises:
        InputError: a setting or a checkpoint does not fit; the folder holds another run, or another process writes there; a
            loss that is not finite.
    """
    with join_processes(device) as processes, locked(out) if processes.rank == 0 else nullcontext(), naming(out):
        if processes.rank == 0:
            refuse_other_run(out, config.resume)
        workers = bounded_processes(workers, "workers")
        threads = set_up_torch(threads, workers)
        if config.batch_size % processes.count:
            raise InputError(
                f"training.batch_size={config.batch_size} cannot be divided evenly among {processes.count} processes"
            )
        if config.small_crops.share and model.kind != "dense":
            raise InputError(f"training.small_crops: a {model.kind} network takes crops of one size; set its share to 0")
        with closing(Run(config, model, seed, processes)) as run:
            if run.resumed_meta is not None and (begun_with := run.resumed_meta.get("data")) != data:
                raise InputError(f"{config.resume}: was trained on other data ({begun_with}) than the given data ({data})")
            order = ShuffledOrder(len(source), config.batch_size, seed, processes.rank, processes.count)
            small = round(config.small_crops.share * config.steps), config.small_crops.crop_px
            batches = CropBatches(source, model, order, seed, config.augment, ridge, small)
            loader = batch_loader(batches, run.step, config.steps, workers, pin_memory=processes.device.type == "cuda")
            if processes.rank > 0:
                for batch in loader:
                    run.update(batch)
                return out / "last"
            log.info(
                f"seed {seed}, {workers} data worker(s) per process, on {processes.describe(threads)}\n"
                f"{len(source):,} training and {len(validation):,} validation samples; "
                f"{config.steps * config.batch_size / len(source):.1f} epochs\n"
                f"{run.describe()}\ninto {out}; watch with: tensorboard --logdir {out}"
            )
            if config.resume is not None:
                complete_links(out, Path(config.resume))
            sets = {
                px: validation_batches(validation, replace(model, crop_px=px), config, seed, ridge) for px in batches.sizes()
            }
            return _train_and_validate(run, loader, batches, sets, out, {"config": described or {}, "data": data})


def validation_batches(
    validation: ObservationSource, model: ModelConfig, config: TrainingConfig, seed: int, ridge: RidgeConfig | None = None
) -> list[Batch]:
    """The validation crops, kept in memory: `validation_samples` evenly spaced samples of the set."""
    count = min(config.validation_samples, len(validation))
    batches = CropBatches(validation, model, EvenOrder(len(validation), config.batch_size, count), seed, None, ridge)
    steps = math.ceil(count / config.batch_size)
    loader = batch_loader(batches, 0, steps, workers=0)
    return list(tqdm(loader, total=steps, desc="validation crops", disable=not sys.stderr.isatty(), leave=False))


class Progress:
    """The speed and the remaining time of a run, and when to log them."""

    def __init__(self, step: int, config: TrainingConfig) -> None:
        """Starts the clock at the first step of this process's part of the run."""
        self.config = config
        self.first = step
        self.started_s = time.perf_counter()
        self.next_line_s = FIRST_LINE_S

    def is_due(self) -> bool:
        """Whether to log a line now: after FIRST_LINE_S, then each time the elapsed time has doubled."""
        elapsed_s = time.perf_counter() - self.started_s
        if elapsed_s < self.next_line_s:
            return False
        self.next_line_s = 2 * elapsed_s
        return True

    def samples_per_second(self, step: int) -> float:
        return (step - self.first) * self.config.batch_size / (time.perf_counter() - self.started_s)

    def describe(self, step: int) -> str:
        """Speed and remaining time, such as "480 samples/s, about 12 min left"."""
        elapsed_s = time.perf_counter() - self.started_s
        left_s = elapsed_s / (step - self.first) * (self.config.steps - step)
        if left_s < 100:
            left = f"{left_s:.0f} s"
        else:
            left = f"{left_s / 60:.0f} min" if left_s < 100 * 60 else f"{left_s / 3600:.1f} h"
        return f"{self.samples_per_second(step):.0f} samples/s, about {left} left"


def _train_and_validate(
    run: Run, loader: DataLoader, batches: CropBatches, sets: dict[int, list[Batch]], out: Path, described: dict
) -> Path:
    """The loop of rank 0: steps, scalars, validation on crops of the size trained with, images, checkpoints."""
    config, checkpoint = run.config, out / "last"
    progress = Progress(run.step, config)
    bar = tqdm(total=config.steps, initial=run.step, desc="training", unit="step", disable=not sys.stderr.isatty())
    with SummaryWriter(out, purge_step=run.step) as board, bar:
        for batch in loader:
            scalars = run.update(batch)
            bar.update()

            if run.step % config.log_every == 0:
                for name, value in scalars.items():
                    board.add_scalar(f"train/{name}", float(value), run.step)
                rate = progress.samples_per_second(run.step)
                board.add_scalar("train/samples_per_second", rate, run.step)
                board.add_scalar("train/empty_silhouettes_skipped", run.skipped, run.step)
                bar.set_postfix(error=f"{float(scalars['error_cm']):.1f} cm", rate=f"{rate:.0f}/s")

            if run.step % config.validate_every == 0 or run.step == config.steps:
                validation_set = sets[batches.crop_px(run.step - 1)]
                metrics, estimates = validate(run.average, validation_set, run.processes.device)
                for name, value in metrics.items():
                    board.add_scalar(f"validation/{name}", value, run.step)
                image = validation_sheet(validation_set, estimates)
                board.add_image("validation/predictions", image, run.step, dataformats="HWC")
                checkpoint = run.save(out, metrics, described)
                log.info(
                    f"step {run.step:,} of {config.steps:,}: mean error {metrics['mean_error_cm']:.2f} cm, "
                    f"{100 * metrics['within_10cm']:.1f} % within 10 cm (best {run.best_cm:.2f} cm); "
                    f"{progress.describe(run.step)}"
                )
            elif bar.disable and progress.is_due():
                log.info(
                    f"step {run.step:,} of {config.steps:,}: error {float(scalars['error_cm']):.1f} cm on the last "
                    f"training batch; {progress.describe(run.step)}"
                )
    if run.skipped:
        log.info(f"{run.skipped} observations with an empty silhouette were replaced by the next one")
    log.info(f"checkpoints: {out / 'best'} (lowest validation error) and {checkpoint}")
    return checkpoint
