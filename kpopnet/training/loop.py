"""The training loop: data, step, weight averaging, validation, checkpoints, resuming.

Each step depends only on the seed and the step number: the batch (kpopnet.data.batches), the learning rate and the decay of
the average (kpopnet.training.descent) are pure functions of them. Therefore a run that was stopped and resumed equals an
uninterrupted run, bit for bit on a CPU with the same number of threads.
"""

import gc
import logging
import math
import sys
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
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
    Patches,
    ShuffledOrder,
    SmallCropsConfig,
    batch_loader,
)
from kpopnet.data.observation import ObservationSource
from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.networks import WEIGHTS, ModelConfig
from kpopnet.networks.checkpoint import (
    load_network,
    load_state,
    load_weights,
    read_meta,
    refuse_copied_links,
    resumable,
    save_checkpoint,
)
from kpopnet.networks.network import PoseNetwork, build_network
from kpopnet.ridge import RidgeConfig
from kpopnet.runtime.atomic_write import naming
from kpopnet.runtime.cpu import bounded_processes
from kpopnet.runtime.folder_lock import locked
from kpopnet.runtime.input_files import parsing
from kpopnet.training.descent import Descent
from kpopnet.training.distributed import Processes, join_processes, set_up_torch, try_bfloat16
from kpopnet.training.optimisers import OPTIMISERS
from kpopnet.training.validation import validate, validation_sheet

log = logging.getLogger(__name__)

LOG_EVERY = 20
"""Steps between scalars in TensorBoard."""

LINE_EVERY_S = 30.0
"""Seconds between lines of progress where standard error is not a terminal."""

MAX_STEPS, MAX_BATCH = 10**9, 2**16


@dataclass
class TrainingConfig:
    """How a network is trained.

    Attributes:
        steps: total number of steps; the learning rate cycle spans them.
        batch_size: crops per step, over all processes; `augment.views` of each observation.
        lr: peak learning rate of the cycle.
        optimiser: muon for the weights of convolutions and linear layers and AdamW for the rest, or adamw for all, whose lr
            should be 0.002.
        clip_norm: gradients with a larger norm are scaled down to it, so that a single odd batch does not throw the weights.
            Measured norms (median, 99th percentile, largest): 0.15, 0.25 and 0.38 in 2,400 steps of the dense network; 0.32,
            0.9 and 1.6 of the holistic one, 3.3 in its first 50 steps.
        bfloat16: whether a CPU computes the encoder in bfloat16, as GPUs always do: with AVX-512 BF16 a core trains on half as
            many crops more, with neither that nor AMX on fewer. It is tried first, as some processors claim what they cannot.
        augment: augmentation of training crops.
        small_crops: smaller crops for the first steps, for dense networks only.
        validate_every: steps between validations, each followed by a checkpoint; the last step always has one.
        validation_samples: number of evenly spaced samples of the validation set (all if it has fewer), kept in memory.
        start: a checkpoint whose weights a new run starts from, to fine-tune a network for other cameras or motions, or to go
            on with a wider one (model.widths).
        resume: a checkpoint from which to resume a run, e.g. outputs/train/RUN/last.
    """

    steps: int = 10000
    batch_size: int = 64
    lr: float = 5e-3
    optimiser: str = "muon"
    clip_norm: float = 0.5
    bfloat16: bool = False
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    small_crops: SmallCropsConfig = field(default_factory=SmallCropsConfig)
    validate_every: int = 500
    validation_samples: int = 2048
    start: str | None = None
    resume: str | None = None

    def __post_init__(self) -> None:
        most = {"steps": MAX_STEPS, "batch_size": MAX_BATCH, "validate_every": MAX_STEPS, "validation_samples": MAX_STEPS}
        for name, high in most.items():
            check_between(f"training.{name}", getattr(self, name), 1, high)
        if not (0 < self.lr < math.inf and self.clip_norm > 0):
            raise InputError(f"expected training.lr > 0 and training.clip_norm > 0, found {self.lr} and {self.clip_norm}")
        check_one_of("training.optimiser", self.optimiser, OPTIMISERS)
        if self.small_steps == self.steps:
            raise InputError(
                f"training.small_crops.share={self.small_crops.share}: all {self.steps} steps would take smaller crops, and "
                "the network would never see one of its own size; give a smaller share, or that size as model.crop_px"
            )
        if self.batch_size % self.augment.views:
            views = f"training.augment.views={self.augment.views}"
            raise InputError(f"training.batch_size={self.batch_size}: expected a multiple of {views}")

    @property
    def small_steps(self) -> int:
        """The number of steps that take smaller crops."""
        return int(self.small_crops.share * self.steps)


@dataclass
class RunConfig:
    """What is trained, how, and on which machine.

    Attributes:
        model: which network.
        training: how it is trained.
        ridge: of the ridge image, for model.input=depth_ridge.
        seed: of weights, sample order and augmentation.
        device: auto, cpu or cuda.
        workers: processes that prepare batches; 0 prepares them in this process.
        threads: of torch on the CPU; 0 takes the cores that the workers leave.
    """

    model: ModelConfig = field(default_factory=ModelConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    seed: int = 0
    device: str = "auto"
    workers: int = 1
    threads: int = 0

    def check_small_crops(self) -> None:
        """Raises InputError where the model, which `training.start` may give, cannot be trained on the smaller crops."""
        if self.training.small_crops.share and self.model.kind != "dense":
            raise InputError(f"training.small_crops: a {self.model.kind} network takes crops of one size; set its share to 0")
        if self.training.small_crops.share and self.training.small_crops.crop_px >= self.model.crop_px:
            side = f"training.small_crops.crop_px={self.training.small_crops.crop_px}"
            raise InputError(f"{side}: expected less than model.crop_px={self.model.crop_px}, or a share of 0")


def progress_bar(steps: int, done: int) -> tqdm:
    """The bar of a run's steps; rarer lines where standard error is not a terminal."""
    every_s = 0.2 if sys.stderr.isatty() else LINE_EVERY_S
    return tqdm(total=steps, initial=done, desc="training", unit="step", mininterval=every_s)


class Run(Descent):
    """The state of a training: a `Descent`, with lowest error and mean pose."""

    def __init__(self, config: TrainingConfig, model: ModelConfig, seed: int, processes: Processes) -> None:
        """Starts a run, from the weights of `config.start` if given, or resumes that of `config.resume`."""
        self.config = config
        self.processes = processes
        network = build_network(model, seed).to(processes.device)
        network.bfloat16 = config.bfloat16
        if config.start is not None and config.resume is None:
            load_initial_weights(network, config.start)
        super().__init__(network, config.optimiser, config.lr, config.steps, config.clip_norm)
        self.best_cm = math.inf
        self.offset_sum_m = torch.zeros(15, 3, dtype=torch.float64)
        self.offset_count = 0
        self.skipped = 0
        if config.resume is not None:
            self.load(Path(config.resume))
        self.data_parallel = processes.data_parallel(self.network)

    def close(self) -> None:
        """Releases the data-parallel wrapper, and with it gloo's threads.

        If they are alive when the interpreter ends, they abort the process in about one of ten runs (torch 2.13).
        """
        self.data_parallel = self.network
        gc.collect()

    def update(self, batch: Batch) -> dict[str, Tensor]:
        """Takes one optimiser step on one batch; returns scalars for TensorBoard.

        Raises InputError, before it changes a weight, if the loss or its gradient is not finite.
        """
        device = self.processes.device
        crop = batch.crop.crops(device) if isinstance(batch.crop, Patches) else batch.crop.to(device)
        target = batch.target.to(device)
        # Step
        self.network.train()
        prediction = self.data_parallel(crop)
        losses = self.network.loss(prediction, target)
        loss = sum(losses.values())
        norm, lr = self.descend(loss)

        # Statistics
        self.offset_sum_m += batch.offset_m.double().sum(0)
        self.offset_count += len(batch.offset_m)
        self.skipped += batch.skipped
        error = (prediction.joints.detach() - target).norm(dim=-1).mean() * self.network.config.half_size_m
        return {
            "loss": loss.detach(),
            **{f"loss_{name}": value.detach() for name, value in losses.items()},
            "error_cm": 100 * error,
            "gradient_norm": norm,
            "lr": torch.tensor(lr),
        }

    def save(self, folder: Path, metrics: dict[str, float], described: dict) -> Path:
        """Writes a checkpoint (kpopnet.networks.checkpoint) and returns its path.

        mean_pose_m is the (15, 3) mean offset of each joint from the person's centre in metres, over the samples of rank 0.
        """
        best = metrics["mean_error_cm"] < self.best_cm
        self.best_cm = min(self.best_cm, metrics["mean_error_cm"])
        state = self.state() | {
            "best_cm": self.best_cm,
            "offset_sum_m": self.offset_sum_m,
            "offset_count": self.offset_count,
            "skipped": self.skipped,
        }
        mean_pose_m = (self.offset_sum_m / max(1, self.offset_count)).tolist()
        meta = {"step": self.step, "metrics": metrics, "mean_pose_m": mean_pose_m, **described}
        return save_checkpoint(folder, self.average, state, meta, best=best)

    def load(self, folder: Path) -> None:
        """Loads the state of a checkpoint; raises InputError if it is damaged, of another model, or of a finished run."""
        load_weights(self.average, folder / WEIGHTS)
        state = load_state(folder)
        with parsing(folder, "its training state does not fit this model or version"):
            self.load_state(state)
            self.best_cm, self.skipped = state["best_cm"], state["skipped"]
            self.offset_sum_m, self.offset_count = state["offset_sum_m"].reshape(15, 3), state["offset_count"]
        if self.step >= self.config.steps:
            raise InputError(f"{folder}: finished already, {self.step} of {self.config.steps} steps are done")


def refuse_other_run(folder: Path, resume: str | None) -> None:
    """Refuses a folder that holds a run other than the one that is resumed: its checkpoints would be removed.

    And a copy of a run with copies of its links: it would resume from the same checkpoint for ever.
    """
    if resume is not None:
        read_meta(resume)
        refuse_copied_links(folder)
        refuse_copied_links(Path(resume).parent)
    found = resumable(folder)
    if found is not None and not (resume is not None and holds(folder, resume)):
        raise InputError(
            f"{folder}: holds a run; resume it (training.resume={found}), or give another folder (hydra.run.dir=...)"
        )


def holds(folder: Path, checkpoint: str) -> bool:
    """Whether a checkpoint is one of the run in a folder."""
    return folder.resolve() in Path(checkpoint).resolve().parents


def load_initial_weights(network: PoseNetwork, checkpoint: str) -> None:
    """Loads the weights of a checkpoint into a new network, which may be wider; raises InputError if it is of another model."""
    began_with, _ = load_network(checkpoint)
    found, expected = asdict(began_with.config), asdict(network.config)
    # The weights of a dense network fit crops of any size.
    free = ("crop_px",) if network.config.kind == "dense" else ()
    wider = all(new >= old for new, old in zip(expected["widths"], found["widths"], strict=True))
    free += ("widths",) if wider else ()
    other = [name for name in expected if name not in free and found[name] != expected[name]]
    if other:
        settings = " ".join(f"model.{name}={str(found[name]).replace(' ', '')}" for name in other)
        raise InputError(f"training.start={checkpoint} has another model; give it: {settings}")
    widen(network, began_with.state_dict())


@torch.no_grad()
def widen(network: nn.Module, weights: dict[str, Tensor]) -> None:
    """Loads the weights of a network with as many or fewer channels. Of further channels each has its initial weights, and is
    heard by further ones alone at first: the network says what the other one says.
    """
    for name, value in network.state_dict().items():
        narrow = weights[name]
        if narrow.ndim > 1:
            value[: len(narrow), narrow.shape[1] :] = 0
        value[tuple(slice(size) for size in narrow.shape)] = narrow


def train(
    config: RunConfig, source: ObservationSource, validation: ObservationSource, out: Path, data: dict | None = None
) -> Path:
    """Trains a network and writes checkpoints, which store the configuration, to the folder `out`; only rank 0 writes there.

    `data` identifies the data sets: a run is resumed only with those that it began with. Returns the folder of the last
    checkpoint. Raises InputError: a setting or a checkpoint does not fit; the folder holds another run, or another process
    writes there; a loss that is not finite.
    """
    training = config.training
    config.check_small_crops()
    if training.resume is not None and (begun_with := read_meta(training.resume).get("data")) != data:
        raise InputError(f"{training.resume}: was trained on other data ({begun_with}) than the given data ({data})")
    with join_processes(config.device) as processes, locked(out) if processes.rank == 0 else nullcontext(), naming(out):
        if processes.rank == 0:
            refuse_other_run(out, training.resume)
        workers = bounded_processes(config.workers, "workers")
        threads = set_up_torch(config.threads, workers)
        if training.bfloat16 and processes.device.type == "cpu":
            try_bfloat16()
        batches = training_batches(config, source, processes)
        with closing(Run(training, config.model, config.seed, processes)) as run:
            loader = batch_loader(batches, run.step, training.steps, workers, pin_memory=processes.device.type == "cuda")
            if processes.rank > 0:
                for batch in loader:
                    run.update(batch)
                return out / "last"
            model, parameters = config.model, sum(weight.numel() for weight in run.network.parameters())
            where = processes.describe(threads, training.bfloat16)
            log.info(
                f"seed {config.seed}, {workers} data worker(s) per process, on {where}\n"
                f"{len(source):,} training and {len(validation):,} validation samples; "
                f"{training.steps * training.batch_size / training.augment.views / len(source):.1f} epochs\n"
                f"{model.name}: {parameters:,} parameters, crops of {model.crop_px} px; "
                f"steps {run.step:,} to {training.steps:,} of {training.batch_size} samples, lr up to {training.lr:g}\n"
                f"into {out}; watch with: tensorboard --logdir {out}"
            )
            if training.resume is not None and not holds(out, training.resume):
                run.best_cm = math.inf  # the best checkpoint stayed in the other folder
            sets = {px: validation_batches(config, validation, px) for px in batches.sizes()}
            described = {"config": asdict(config), "data": data}
            _update_and_validate(run, loader, batches.crop_px, sets, out, described)
    log.info(f"checkpoints: {out / 'best'} (lowest validation error) and {out / 'last'}")
    return out / "last"


def training_batches(config: RunConfig, source: ObservationSource, processes: Processes) -> CropBatches:
    """This process's part of the batches of every step."""
    training = config.training
    observations = training.batch_size // training.augment.views
    if observations % processes.count:
        views = f", {training.augment.views} views of each observation" if training.augment.views > 1 else ""
        raise InputError(
            f"training.batch_size={training.batch_size}{views} cannot be divided evenly among {processes.count} processes"
        )
    order = ShuffledOrder(len(source), observations, config.seed, processes.rank, processes.count)
    small = training.small_steps, training.small_crops.crop_px
    patches = processes.device.type == "cuda" and config.model.input == "depth"
    return CropBatches(source, config.model, order, config.seed, training.augment, config.ridge, small, patches)


def validation_batches(config: RunConfig, validation: ObservationSource, crop_px: int) -> list[Batch]:
    """The validation crops, kept in memory: `validation_samples` evenly spaced samples of the set."""
    count = min(config.training.validation_samples, len(validation))
    order = EvenOrder(len(validation), config.training.batch_size, count)
    batches = CropBatches(validation, replace(config.model, crop_px=crop_px), order, config.seed, None, config.ridge)
    steps = math.ceil(count / config.training.batch_size)
    loader = batch_loader(batches, 0, steps, workers=0)
    return list(tqdm(loader, total=steps, desc="validation crops", disable=not sys.stderr.isatty(), leave=False))


def _update_and_validate(
    run: Run, loader: DataLoader, crop_px: Callable[[int], int], sets: dict[int, list[Batch]], out: Path, described: dict
) -> None:
    """The loop of rank 0: steps, scalars, validation on crops of the size trained with, images, checkpoints.

    `crop_px` is of a step's crops, `sets` are the validation crops by their sides. The time that is left is that of the last
    steps, longer or shorter as the crops of those to come have more or fewer pixels.
    """
    config, since_step, since_s = run.config, run.step, time.perf_counter()
    with SummaryWriter(out, purge_step=run.step + 1) as board, progress_bar(config.steps, run.step) as bar:
        for batch in loader:
            scalars = run.update(batch)
            bar.update()
            logs, validates = run.step % LOG_EVERY == 0, run.step % config.validate_every == 0 or run.step == config.steps
            if not (logs or validates):
                continue
            steps_per_s = (run.step - since_step) / (time.perf_counter() - since_s)

            if logs:
                for name, value in scalars.items():
                    board.add_scalar(f"train/{name}", float(value), run.step)
                board.add_scalar("train/samples_per_second", config.batch_size * steps_per_s, run.step)
                board.add_scalar("train/empty_silhouettes_skipped", run.skipped, run.step)
                bar.set_postfix(error=f"{float(scalars['error_cm']):.1f} cm", refresh=False)

            if validates:
                px = crop_px(run.step - 1)
                crops = sets[px]
                last = (run.step - 1) // config.validate_every * config.validate_every  # step of the validation before
                if px != crop_px(max(last - 1, 0)):
                    run.best_cm = math.inf  # errors in smaller crops are of another network: the best one is of the last size
                metrics, estimates = validate(run.average, crops, run.processes.device)
                for name, value in metrics.items():
                    board.add_scalar(f"validation/{name}", value, run.step)
                board.add_image("validation/predictions", validation_sheet(crops, estimates), run.step, dataformats="HWC")
                run.save(out, metrics, described)
                left_s = sum((crop_px(step) / px) ** 2 for step in range(run.step, config.steps)) / steps_per_s
                log.info(
                    f"step {run.step:,} of {config.steps:,}: mean error {metrics['mean_error_cm']:.2f} cm, "
                    f"{100 * metrics['within_10cm']:.1f} % within 10 cm (best {run.best_cm:.2f} cm); "
                    f"{config.batch_size * steps_per_s:.0f} samples/s, about {tqdm.format_interval(left_s)} left"
                )
            since_step, since_s = run.step, time.perf_counter()
    if run.skipped:
        of_many = " of this process" if run.processes.count > 1 else ""
        log.info(f"{run.skipped} observations{of_many} with an empty silhouette were replaced by the next one")
