"""The description of a trained network: what meta.json of a checkpoint and the metadata of an ONNX file hold.

Reading one needs no torch.
"""

import math
from pathlib import Path
from typing import Any

from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig
from kpopnet.runtime.input_files import check_fields, read_json, settings_from
from kpopnet.skeleton import NUM_JOINTS

META = "meta.json"
FORMAT = "kpopnet-checkpoint"
VERSION = 1

META_SCHEMA = {"step": int, "model": dict, "config": dict, "metrics": dict, "mean_pose_m": list[list[float]]}
CONFIG_PARTS = ("sensor", "extraction", "ridge", "training", "data")
"""Names and types in a description, and groups of settings in its config, where they are there."""

OF_THE_MACHINE = ("data", "device", "threads", "workers")
"""Settings that say where a training ran, and not what it computed."""


def read_meta(folder: Path | str) -> dict:
    """The contents of a checkpoint's meta.json.

    Raises:
        InputError: no checkpoint in the folder, one of another version, or values of other types than META_SCHEMA.
    """
    path = Path(folder) / META
    if not path.is_file():
        raise InputError(f"{folder}: no checkpoint there (no {META}); give a folder such as outputs/train/RUN/best")
    return check_description(str(path), read_json(path, non_finite=True), FORMAT)


def check_description(where: str, meta: Any, kind: str) -> dict:
    """Checks a description of the given format, for `where` in messages.

    Raises:
        InputError: another format or version, or values of other types than META_SCHEMA.
    """
    found = (meta.get("format"), meta.get("version")) if isinstance(meta, dict) else (None, None)
    if found != (kind, VERSION):
        raise InputError(f"{where}: expected a {kind} of version {VERSION}, found {found[0]!s:.40} of version {found[1]!s:.40}")
    check_fields(where, meta, META_SCHEMA, optional=["mean_pose_m"])
    settings_from(ModelConfig, meta["model"], f"{where}: model")
    check_fields(f"{where}: config", meta["config"], dict.fromkeys(CONFIG_PARTS, dict), optional=CONFIG_PARTS)
    pose_m = meta.get("mean_pose_m")
    if pose_m is not None and (len(pose_m) != NUM_JOINTS or any(len(joint) != 3 or not _all_finite(joint) for joint in pose_m)):
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


def _all_finite(values: list[float]) -> bool:
    return all(math.isfinite(value) for value in values)
