"""Networks that estimate fifteen 3D joints from a depth crop of one person: `holistic` and `dense`.

crop (kpopnet.data.cube) -> encoder -> head -> joints in cube units, confidence

`network` builds them with torch, `checkpoint` stores them, `estimator` runs them. Here are their architecture and description:
meta.json of a checkpoint, the metadata of an ONNX file. This module, `estimator` and `backend` need no torch.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kpopnet.data.cube import INPUTS, check_crop_px
from kpopnet.errors import InputError, check_one_of
from kpopnet.runtime.input_files import check_fields, read_json, settings_from
from kpopnet.skeleton import NUM_JOINTS

KINDS = ("holistic", "dense")

STRIDES = (4, 8, 16)
"""Strides of the encoder's three outputs in crop pixels."""

MAX_WIDTH = 512
"""A checkpoint's description chooses widths, and the crop: they bound the weights to 0.3 GB, and a batch's maps to a few."""

PASSES = 2
"""Of the network over a person, at most; stored estimates are keyed by it, and by the weights."""

META, WEIGHTS, PERSON = "meta.json", "model.safetensors", "person.safetensors"
FORMAT = "kpopnet-checkpoint"
VERSION = 1

META_SCHEMA = {"step": int, "model": dict, "config": dict, "metrics": dict, "mean_pose_m": list[list[float]]}
CONFIG_PARTS = ("sensor", "extraction", "ridge", "training", "data")
"""Names and types in a description, and groups of settings in its config, where they are there."""

OF_THE_MACHINE = ("crops", "data", "device", "threads", "workers")
"""Settings that say where a training ran, and not what it computed."""


@dataclass
class ModelConfig:
    """The architecture of a network.

    Attributes:
        kind: holistic (flattened features and fully connected layers) or dense (integral heatmaps).
        input: depth, or depth_ridge for the ridge probability as a second channel.
        crop_px: side of the square crop in pixels, a multiple of 16, at most 256.
        half_size_m: half the edge of the cube around the person in metres.
        widths: number of the encoder's channels: stem, stride 4, stride 8, stride 16; at most 512.
    """

    kind: str = "dense"
    input: str = "depth"
    crop_px: int = 96
    half_size_m: float = 1.15
    widths: list[int] = field(default_factory=lambda: [16, 32, 64, 128])

    def __post_init__(self) -> None:
        for name, known in (("kind", KINDS), ("input", INPUTS)):
            check_one_of(f"model.{name}", getattr(self, name), known)
        check_crop_px("model.crop_px", self.crop_px)
        if not 0.5 <= self.half_size_m <= 5:
            raise InputError(f"model.half_size_m={self.half_size_m}: expected metres, 0.5 to 5")
        # Multiples of 8 fill vector registers.
        if len(self.widths) != 4 or any(not 8 <= width <= MAX_WIDTH or width % 8 for width in self.widths):
            raise InputError(
                f"model.widths={str(self.widths)[:60]}: expected four multiples of 8 up to {MAX_WIDTH}, e.g. [16,32,64,128]"
            )

    @property
    def name(self) -> str:
        """Short name, for folders and tables."""
        return f"{self.kind}-{self.input}"


def read_meta(folder: Path | str) -> dict:
    """The contents of a checkpoint's meta.json; raises InputError if it is missing, damaged, or of another version."""
    path = Path(folder) / META
    if not path.is_file():
        raise InputError(f"{folder}: no checkpoint there (no {META}); give a folder such as outputs/train/RUN/best")
    return check_description(str(path), read_json(path, non_finite=True), FORMAT)


def check_description(where: str, meta: Any, kind: str) -> dict:
    """A description, checked; raises InputError for another format or version, or values of other types than META_SCHEMA."""
    found = (meta.get("format"), meta.get("version")) if isinstance(meta, dict) else (None, None)
    if found != (kind, VERSION):
        raise InputError(f"{where}: expected a {kind} of version {VERSION}, found {found[0]!s:.40} of version {found[1]!s:.40}")
    check_fields(where, meta, META_SCHEMA, optional=["mean_pose_m"])
    settings_from(ModelConfig, meta["model"], f"{where}: model")
    check_fields(f"{where}: config", meta["config"], dict.fromkeys(CONFIG_PARTS, dict), optional=CONFIG_PARTS)
    pose_m = meta.get("mean_pose_m")
    if pose_m is not None and ([len(joint) for joint in pose_m] != [3] * NUM_JOINTS or not np.isfinite(pose_m).all()):
        raise InputError(f"{where}: mean_pose_m: expected {NUM_JOINTS} positions of three finite numbers")
    return meta


def portable(meta: dict) -> dict:
    """A description for others: without the folders, checkpoints and numbers of threads of the machine that trained.

    `data` still identifies the training sets: a hash and a number of samples for each.
    """
    config = {name: value for name, value in meta["config"].items() if name not in OF_THE_MACHINE}
    if "training" in config:
        config["training"] = {name: one for name, one in config["training"].items() if name not in ("start", "resume")}
    return meta | {"config": config}
