"""Trains the finder's networks: the one that finds people on room images, the one that refines their masks on person masks.

Each step depends only on the seed and its number, so a run that was stopped and resumed equals an uninterrupted one, bit for
bit on a CPU with the same number of threads.
"""

import logging
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import safetensors.torch
import torch
from torch import Tensor, nn
from tqdm import tqdm

from kpopnet.camera import MM_PER_METRE
from kpopnet.data.batches import ShuffledOrder
from kpopnet.data.canvas import CANVAS, STRIDE
from kpopnet.data.made_sets import check_others
from kpopnet.data.person_masks import OTHER, OWN, THEIRS, read_person_masks
from kpopnet.data.room_images import MOST_PEOPLE, RoomImages
from kpopnet.errors import InputError, check_between, check_one_of
from kpopnet.finder.masks import REACH_M
from kpopnet.finder.network import (
    CellsNetwork,
    FinderNetwork,
    MaskNetwork,
    Target,
    cell_points_m,
    load_network,
    loss,
    mask_loss,
    observed,
    observed_crop,
)
from kpopnet.runtime.atomic_write import atomic_path, write_json, write_whole
from kpopnet.runtime.input_files import check_fields, expect, parsing, read_json, read_with
from kpopnet.skeleton import Joint
from kpopnet.training.descent import Descent
from kpopnet.training.distributed import device_kind, set_up_torch, try_bfloat16
from kpopnet.training.loop import progress_bar

log = logging.getLogger(__name__)

WEIGHTS, STATE, META = "finder.safetensors", "finder_state.pt", "finder.json"
CPU = torch.device("cpu")
CLIP_NORM = 1.0
VIEW_STREAM = 0x3166
ROLL_DEG, ZOOM = 12.0, (0.7, 1.7)
"""Standard deviation of the roll, and range of the zoom, of cameras that see a scene anew."""

AREA_CELLS = 150.0
"""A person of this many cells has weight 1 in each; others have the square root of the ratio, so that small people count."""

MOST_WEIGHT = 4.0

PERSON_CELLS = 400.0
"""Likewise of the cells of a crop."""


@dataclass
class FinderTraining:
    """How a network of the finder is trained.

    Attributes:
        part: finder, which finds people in room images, or masks, which says which pixels are theirs, from person masks.
        steps: number of steps; the learning rate's cycle spans them.
        batch_size: images a step.
        lr: peak learning rate.
        other_views: share of the images that each step shows rolled, zoomed and cut anew, of the finder; any image, of both
            networks, is mirrored or not.
        bfloat16: whether all but the last layer computes in bfloat16, which is twice as fast with AMX; on a CPU it is
            tried first, as some processors claim what they cannot.
        validate_every: steps between validations, each followed by a checkpoint.
        start: a file of weights to begin with, such as another run's finder.safetensors; None: random ones.
        resume: whether to go on with the run in the folder.
    """

    part: str = "finder"
    steps: int = 7000
    batch_size: int = 32
    lr: float = 3e-3
    other_views: float = 0.5
    bfloat16: bool = False
    validate_every: int = 500
    start: str | None = None
    resume: bool = False

    def __post_init__(self) -> None:
        for name in ("steps", "batch_size", "validate_every"):
            check_between(f"training.{name}", getattr(self, name), 1, 1e9)
        check_one_of("training.part", self.part, PARTS)
        check_between("training.other_views", self.other_views, 0, 1)
        if not 0 < self.lr < math.inf:
            raise InputError(f"training.lr={self.lr}: expected a positive number")


class SceneViews(NamedTuple):
    """How images of scenes are seen anew: mirrored, then by a camera that is rolled about its optical axis and zooms."""

    # (B, 2, 2) float32 matrix from pixels of the view to pixels of the image, about their principal points
    to_image: np.ndarray
    to_view: np.ndarray  # (B, 2, 2) float32 matrix from X and Y in the image's camera frame to those in the view's
    principal_px: np.ndarray  # (B, 2) float32 the views' principal points

    @classmethod
    def drawn(cls, rng: np.random.Generator, cameras: np.ndarray, share: float) -> "SceneViews":
        """Views of images of square pixels, (B, 6) fx, fy, cx, cy, width, height: half mirrored, a share rolled and zoomed.

        The middle of a view lies anywhere in the image, as long as the view does not reach beyond it or the image beyond the
        view; what a roll brings in from beyond the image is not measured.
        """
        count, principal_px, middle_px = len(cameras), cameras[:, 2:4], (cameras[:, 4:6] - 1) / 2
        other = rng.random(count) < share
        roll = np.where(other, np.radians(ROLL_DEG) * rng.normal(size=count), 0.0)
        zoom = np.where(other, np.exp(rng.uniform(*np.log(ZOOM), count)), 1.0)
        shift_px = rng.uniform(-1, 1, (count, 2)) * np.abs(1 - 1 / zoom)[:, None] * middle_px
        cos, sin = np.cos(roll), np.sin(roll)
        side = np.where(rng.random(count) < 0.5, -1.0, 1.0)
        to_view = np.array([[cos * side, -sin], [sin * side, cos]]).transpose(2, 0, 1)
        of_middle_px = np.einsum("nij,nj->ni", to_view, middle_px + shift_px - principal_px) * zoom[:, None]
        one = np.float32
        return cls(one(to_view.transpose(0, 2, 1) / zoom[:, None, None]), one(to_view), one(middle_px - of_middle_px))


class LoadedImages:
    """All room images of a folder, in the memory of a device: 61 kB each."""

    def __init__(self, folder: str, device: torch.device = CPU) -> None:
        images = RoomImages(folder)
        count, self.identity = len(images), images.identity
        depth_mm = np.empty((count, CANVAS[1], CANVAS[0]), np.uint16)
        labels = np.empty((count, CANVAS[1], CANVAS[0]), np.uint8)
        self.cameras = np.empty((count, 6), np.float32)
        torsos_m = np.empty((count, MOST_PEOPLE, 3), np.float32)
        start = 0
        for number in tqdm(range(len(images.paths)), desc=f"reading {folder}", disable=not sys.stderr.isatty()):
            arrays = images.file(number)
            rows = slice(start, start + len(arrays["depth_mm"]))
            depth_mm[rows], labels[rows] = arrays["depth_mm"], arrays["labels"]
            self.cameras[rows], torsos_m[rows] = arrays["cameras"], arrays["joints_m"][:, :, Joint.TORSO]
            start = rows.stop
        # torch selects rows of signed numbers alone.
        self._images = [torch.from_numpy(one).to(device) for one in (depth_mm.view(np.int16), labels, np.nan_to_num(torsos_m))]

    def __len__(self) -> int:
        return len(self.cameras)

    def drawn(self, rows: np.ndarray, rng: np.random.Generator, other_views: float) -> tuple[Tensor, Target]:
        """The input and the target of some images, in views of them, on the device."""
        return self.batch(rows, SceneViews.drawn(rng, self.cameras[rows], other_views))

    def batch(self, rows: np.ndarray, views: SceneViews | None = None) -> tuple[Tensor, Target]:
        """Likewise in views that are given, or as they are."""
        device = self._images[0].device
        depth_mm, labels, torsos_m = (one[torch.from_numpy(rows).to(device)] for one in self._images)
        depth_mm, cameras = depth_mm.int() & 0xFFFF, self.cameras[rows].copy()
        if views is not None:
            to_image, to_view, principal_px, old = (torch.from_numpy(one).to(device) for one in (*views, cameras.copy()))
            depth_mm, labels = _seen(torch.stack([depth_mm, labels.int()]), to_image, principal_px, old)
            torsos_m = torch.cat([torsos_m[..., :2] @ to_view.mT, torsos_m[..., 2:]], -1)
            cameras[:, :2] /= np.sqrt(np.abs(np.linalg.det(views.to_image)))[:, None]
            cameras[:, 2:4] = views.principal_px
        return self._target(depth_mm, labels[:, ::STRIDE, ::STRIDE], torch.from_numpy(cameras[:, :4]).to(device), torsos_m)

    def _target(self, depth_mm: Tensor, of_cells: Tensor, intrinsics: Tensor, torsos_m: Tensor) -> tuple[Tensor, Target]:
        depth_m, of_cells = depth_mm.float() / MM_PER_METRE, of_cells.long()
        image = observed(depth_m, intrinsics).contiguous(memory_format=torch.channels_last)
        points_m = cell_points_m(depth_m, intrinsics)
        one_hot = nn.functional.one_hot(of_cells, MOST_PEOPLE + 1)  # (B, h, w, 7)
        areas = one_hot.sum((1, 2)).float()
        weights = (AREA_CELLS / areas.clamp(min=1.0)).sqrt().clamp(max=MOST_WEIGHT)
        weights[:, 0] = 1.0
        rows = torch.arange(len(of_cells), device=of_cells.device)[:, None, None]
        padded_m = nn.functional.pad(torsos_m, (0, 0, 1, 0))
        measured = points_m[:, 2] > 0
        return image, Target(
            person=(of_cells > 0).float(),
            weight=weights[rows, of_cells] * measured,
            vote_m=padded_m[rows, of_cells].permute(0, 3, 1, 2) - points_m,
        )


class LoadedMasks:
    """All person masks of a folder, in the memory of a device: 27 kB each."""

    def __init__(self, folder: str, device: torch.device = CPU) -> None:
        *arrays, self.identity = read_person_masks(folder)
        arrays[0] = arrays[0].view(np.int16)  # torch selects rows of signed numbers alone
        self._arrays = [torch.from_numpy(one).to(device) for one in arrays]

    def __len__(self) -> int:
        return len(self._arrays[0])

    def drawn(self, rows: np.ndarray, rng: np.random.Generator, _other_views: float) -> tuple[Tensor, Target]:
        """The input and the target of some crops, half of them mirrored, on the device."""
        return self.batch(rows, rng.random(len(rows)) < 0.5)

    def batch(self, rows: np.ndarray, mirrored: np.ndarray | None = None) -> tuple[Tensor, Target]:
        """Likewise; (B,) bool which are mirrored, None: none."""
        depth_mm, labels, centres_m = (one[torch.from_numpy(rows).to(one.device)] for one in self._arrays)
        depth_m = (depth_mm.int() & 0xFFFF).float() / MM_PER_METRE
        if mirrored is not None:
            flips = torch.from_numpy(mirrored).to(labels.device)[:, None, None]
            depth_m, labels = (torch.where(flips, one.flip(2), one) for one in (depth_m, labels))
        image = observed_crop(depth_m, labels & (OWN | OTHER), centres_m).contiguous(memory_format=torch.channels_last)
        cells_m, theirs = depth_m[:, ::STRIDE, ::STRIDE], (labels[:, ::STRIDE, ::STRIDE] & THEIRS) > 0
        known = (cells_m > 0) & ((cells_m - centres_m[:, 2, None, None]).abs() < REACH_M)
        weights = (PERSON_CELLS / theirs.sum((1, 2)).clamp(min=20)).sqrt().clamp(max=MOST_WEIGHT)
        return image, Target(theirs.float(), known * weights[:, None, None])


def _seen(images: Tensor, to_image: Tensor, principal_px: Tensor, cameras: Tensor) -> Tensor:
    """(K, B, H, W) images as views show them: the nearest pixel, 0 beyond the image; `cameras` are the images' (B, 6)."""
    _, count, height, width = images.shape
    row, column = torch.meshgrid(*(torch.arange(size, device=images.device) for size in (height, width)), indexing="ij")
    from_middle = torch.stack([column.flatten(), row.flatten()]) - principal_px[:, :, None]  # (B, 2, H W)
    x, y = (to_image @ from_middle + cameras[:, 2:4, None]).round().long().unbind(1)
    inside = (x >= 0) & (y >= 0) & (x < cameras[:, 4, None]) & (y < cameras[:, 5, None])
    picked = images.flatten(2).gather(2, torch.where(inside, y * width + x, 0).expand(len(images), -1, -1))
    return torch.where(inside, picked, 0).view(-1, count, height, width)


def refuse_other_finder(folder: Path) -> None:
    """Raises InputError for a folder with a run or weights, which a new run would replace."""
    if (folder / STATE).exists():
        raise InputError(f"{folder}: holds a run; go on with it (training.resume=true), or give another folder (out=...)")
    if (folder / WEIGHTS).exists() and not (folder / META).exists():
        raise InputError(f"{folder}: holds {WEIGHTS} of no run; give another folder (out=...)")


class FinderRun(Descent):
    """The state of a training."""

    def __init__(self, config: FinderTraining, seed: int, folder: Path, device: torch.device = CPU) -> None:
        self.folder, self.config, self.part = folder, config, PARTS[config.part]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            network = self.part.network().to(memory_format=torch.channels_last)
        if config.start is not None and not config.resume:
            network.load_state_dict(load_network(config.start, type(network)).state_dict())
        network.bfloat16 = config.bfloat16
        super().__init__(network.to(device), "muon", config.lr, config.steps, CLIP_NORM)
        if config.resume:
            self.load()
        else:
            refuse_other_finder(folder)

    def update(self, image: Tensor, target: Target) -> dict[str, float]:
        """Takes one step; returns the terms of the loss."""
        self.network.train()
        terms = self.part.loss(self.network(image), target)
        self.descend(torch.stack(list(terms.values())).sum())
        return {name: float(term.detach()) for name, term in terms.items()}

    def check_same(self, described: dict) -> None:
        """Raises InputError where a run that is resumed was begun with other settings or images: it would not go on exactly."""
        path = self.folder / META
        begun = check_fields(str(path), read_json(path), {"config": dict})
        for of, found, given in (("training.", begun["config"], described["config"]), ("", begun, described)):
            for name, value in given.items():
                if found.get(name) != value:
                    raise InputError(
                        f"{self.folder}: was begun with {of}{name}={found.get(name)}, not {value}; give it the same again, or "
                        "begin anew in another folder (out=...)"
                    )

    def save(self, described: dict) -> None:
        """Writes description, weights and state, each whole or not at all; the state last: before it a killed run goes back."""
        weights = {name: value.contiguous().cpu() for name, value in self.average.state_dict().items()}
        write_json(self.folder / META, {"step": self.step, **described})
        write_whole(self.folder / WEIGHTS, safetensors.torch.save(weights))
        with atomic_path(self.folder / STATE) as part:
            torch.save(self.state() | {"average": weights}, part)

    def load(self) -> None:
        """Goes on from the state in the folder; raises InputError if it is missing or damaged."""
        path = self.folder / STATE
        state = read_with(
            lambda path: torch.load(path, weights_only=True, map_location="cpu"), path, "missing or damaged; cannot be resumed"
        )
        with parsing(path, f"its state does not fit training.part={self.config.part}, or this version"):
            self.load_state(state)
            self.average.load_state_dict(state["average"])


@torch.inference_mode()
def validate(network: FinderNetwork, images: LoadedImages, batch_size: int) -> dict[str, float]:
    """Share of person cells found and of found cells that are right, at probability 0.5; median error of votes, centimetres."""
    found = right = wanted = 0.0
    errors, terms = [], []
    for image, target in _batches(images, batch_size):
        seen = network(image)
        person, said = (target.person > 0) & (target.weight > 0), (seen.person_logit > 0) & (target.weight > 0)
        found, right, wanted = found + float(said.sum()), right + float((said & person).sum()), wanted + float(person.sum())
        errors.append((seen.vote_m - target.vote_m).norm(dim=1)[person].cpu().numpy())
        terms.append(float(sum(loss(seen, target).values())))
    return {
        "recall": right / max(wanted, 1),
        "precision": right / max(found, 1),
        "vote_error_cm": 100 * float(np.median(np.concatenate(errors))),
        "loss": float(np.mean(terms)),
    }


@torch.inference_mode()
def validate_masks(network: MaskNetwork, crops: LoadedMasks, batch_size: int) -> dict[str, float]:
    """Mean over people of the intersection of their cells, at probability 0.5, with the true ones over the union of both."""
    shares, terms = [], []
    for image, target in _batches(crops, batch_size):
        logit, known = network(image), target.weight > 0
        said, person = (logit > 0) & known, (target.person > 0) & known
        shares.append(((said & person).sum((1, 2)) / (said | person).sum((1, 2)).clamp(min=1)).cpu().numpy())
        terms.append(float(sum(mask_loss(logit, target).values())))
    return {"intersection_over_union": float(np.concatenate(shares).mean()), "loss": float(np.mean(terms))}


def _batches(images: LoadedImages | LoadedMasks, batch_size: int) -> Iterator[tuple[Tensor, Target]]:
    for start in range(0, len(images), batch_size):
        yield images.batch(np.arange(start, min(start + batch_size, len(images))))


class Part(NamedTuple):
    """What differs between the trainings of the finder's networks."""

    network: type[CellsNetwork]
    images: type[LoadedImages] | type[LoadedMasks]
    loss: Callable[..., dict[str, Tensor]]
    validate: Callable[..., dict[str, float]]
    said: str  # of the metrics, for the log


PARTS = {
    "finder": Part(
        FinderNetwork, LoadedImages, loss, validate,
        "of the people's cells {recall:.1%} found, of those found {precision:.1%} right, votes {vote_error_cm:.1f} cm off, "
        "loss {loss:.4f}",
    ),
    "masks": Part(MaskNetwork, LoadedMasks, mask_loss, validate_masks, "IoU {intersection_over_union:.2%}, loss {loss:.4f}"),
}  # fmt: skip
"""By the name in `FinderTraining.part`."""


def train_finder(
    config: FinderTraining, seed: int, data: dict[str, str], out: Path, threads: int, device: str = "auto"
) -> None:
    """Trains a network of the finder on what is in the folders `train` and `validation` of `data`; writes its weights to `out`.

    Raises InputError for nothing there to train on, another run in the folder, no such device, or a loss that is not finite.
    """
    on = torch.device(device_kind(device))
    set_up_torch(threads)
    if config.bfloat16 and on.type == "cpu":
        try_bfloat16()
    out.mkdir(parents=True, exist_ok=True)
    run = FinderRun(config, seed, out, on)
    images, validation = (run.part.images(data[name], on) for name in ("train", "validation"))
    for name, one in (("train", images), ("validation", validation)):
        expect(len(one) > 0, data[name], "at least one image in its files")
    check_others(images.identity, validation.identity, data["validation"])
    order, settings = ShuffledOrder(len(images), config.batch_size, seed), asdict(config)
    del settings["resume"]
    described = {"config": settings, "seed": seed}
    described |= {"images": {"hash": images.identity.hash, "count": len(images)}, "validation": validation.identity.hash}
    if config.resume:
        run.check_same(described)
    epochs = config.steps * config.batch_size / len(images)
    log.info(f"{len(images):,} training and {len(validation):,} validation images, {epochs:.1f} epochs")
    with progress_bar(config.steps, run.step) as bar:
        while run.step < config.steps:
            rows = np.array([row for row, _ in order(run.step)])
            rng = np.random.default_rng([seed, VIEW_STREAM, run.step])
            terms = run.update(*images.drawn(rows, rng, config.other_views))
            bar.update()
            bar.set_postfix({name: f"{value:.3f}" for name, value in terms.items()}, refresh=False)
            if run.step % config.validate_every == 0 or run.step == config.steps:
                metrics = run.part.validate(run.average, validation, config.batch_size)
                run.save({"metrics": metrics, **described})
                log.info(f"step {run.step:,} of {config.steps:,}: {run.part.said.format(**metrics)}")
