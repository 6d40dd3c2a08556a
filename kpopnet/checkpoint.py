"""Checkpoints: folders that say what they are, appear whole or not at all, and hold nothing that could run code.

In the folder of a run:

    checkpoints/step_00002000/
        model.safetensors   the averaged weights, which is what one uses
        state.pt            raw weights and optimiser: what resuming needs besides
        meta.json           format, version, step, model, config, metrics, mean pose, git revision, packages
    last, best              links to two of them; the others are removed

There is no random state to keep: everything random is a function of seed and step.
"""

import json
import os
import pickle
import shutil
import subprocess
import zipfile
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import safetensors
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor

from kpopnet.errors import InputError
from kpopnet.networks import ModelConfig, PoseNetwork, build_network
from kpopnet.skeleton import JOINT_NAMES

FORMAT = "kpopnet-checkpoint"
VERSION = 1
WEIGHTS, STATE, META = "model.safetensors", "state.pt", "meta.json"


def save_checkpoint(run: Path, network: PoseNetwork, state: dict, meta: dict, *, best: bool) -> Path:
    """Writes a checkpoint below the run's folder and points `last`, and `best` if it is, to it.

    Args:
        run: the run's folder.
        network: the averaged weights.
        state: tensors, numbers and containers of them (it is read back with weights_only=True).
        meta: step, config, metrics and mean_pose_m, made of what JSON knows.
        best: the best so far.
    """
    folder = run / "checkpoints" / f"step_{meta['step']:08d}"
    building = folder.with_name(f".{folder.name}.{os.getpid()}")
    replaced = folder.with_name(f"{building.name}.replaced")
    for leftover in (building, replaced):
        shutil.rmtree(leftover, ignore_errors=True)
    building.mkdir(parents=True)
    save_file({name: value.cpu().contiguous() for name, value in network.state_dict().items()}, building / WEIGHTS)
    torch.save(state, building / STATE)
    described = {
        "format": FORMAT,
        "version": VERSION,
        "model": asdict(network.config),
        **meta,
        "joint_names": JOINT_NAMES,
        "git": git_revision(),
        "packages": {name: version(name) for name in ("torch", "numpy", "safetensors")},
    }
    (building / META).write_text(json.dumps(described, indent=2) + "\n")
    for file in building.iterdir():
        _sync(file)
    if folder.exists():  # the same step of an earlier attempt, which a link may point to
        folder.rename(replaced)
    building.rename(folder)
    _sync(folder.parent)
    # A run that dies in between goes on from `last`, comes by the best once more and points to it again.
    for link in ("best", "last") if best else ("last",):
        _point(run / link, folder)
    kept = {(run / link).resolve() for link in ("last", "best")}
    for other in (*folder.parent.glob("step_*"), *folder.parent.glob(".step_*")):
        if other.resolve() not in kept:
            shutil.rmtree(other, ignore_errors=True)
    return run / "last"


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _point(link: Path, folder: Path) -> None:
    """Makes or moves a relative link in one step."""
    new = link.with_name(f".{link.name}.{os.getpid()}")
    new.unlink(missing_ok=True)
    new.symlink_to(os.path.relpath(folder, link.parent))
    new.replace(link)


def git_revision() -> dict[str, str | bool] | None:
    """The revision of this code and whether it was changed since; None where it is not in a git repository."""
    root = Path(__file__).parent
    try:
        revision, changes = (
            subprocess.run(["git", *command], cwd=root, capture_output=True, text=True, check=True).stdout.strip()
            for command in (("rev-parse", "HEAD"), ("status", "--porcelain"))
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return {"revision": revision, "dirty": bool(changes)}


def read_meta(folder: Path | str) -> dict:
    """A checkpoint's description.

    Raises:
        InputError: nothing there, or not a checkpoint of this version.
    """
    path = Path(folder) / META
    if not path.is_file():
        raise InputError(f"{folder}: no checkpoint there (no {META}); give a folder such as outputs/train/RUN/best")
    try:
        meta = json.loads(path.read_text())
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error}); the checkpoint is damaged or foreign") from error
    found = (meta.get("format"), meta.get("version")) if isinstance(meta, dict) else (None, None)
    if found != (FORMAT, VERSION):
        raise InputError(f"{path}: expected a {FORMAT} of version {VERSION}, found {found[0]} of version {found[1]}")
    return meta


def load_network(folder: Path | str, device: str | torch.device = "cpu") -> tuple[PoseNetwork, dict]:
    """A checkpoint's network, ready to predict, and its description.

    Raises:
        InputError: nothing there, not a checkpoint of this version, or damaged.
    """
    meta = read_meta(folder)
    try:
        network = build_network(ModelConfig(**meta["model"]))
    except (TypeError, KeyError) as error:
        raise InputError(f"{folder}: its model is described in terms unknown here ({error})") from error
    load_weights(network, folder)
    return network.to(device).eval(), meta


def load_weights(network: PoseNetwork, folder: Path | str) -> None:
    """Fills a network with a checkpoint's averaged weights.

    Raises:
        InputError: missing, damaged, or of another architecture.
    """
    path = Path(folder) / WEIGHTS
    try:
        network.load_state_dict(load_file(path))
    except (OSError, safetensors.SafetensorError, RuntimeError) as error:
        first_line = str(error).splitlines()[0]
        raise InputError(f"{path}: missing, damaged, or not the weights that {META} describes: {first_line}") from error


def load_state(folder: Path | str) -> dict[str, int | float | Tensor | dict]:
    """What `save_checkpoint` was given as state.

    Raises:
        InputError: missing or damaged.
    """
    path = Path(folder) / STATE
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path}: missing, truncated or foreign; training cannot go on from there")
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, ValueError, pickle.UnpicklingError) as error:
        first_line = str(error).splitlines()[0]
        raise InputError(f"{path}: damaged ({first_line}); training cannot go on from there") from error


def run_folder(resume: str | None, fresh: str) -> str:
    """The folder a run writes to: that of the checkpoint it goes on from, or a fresh one."""
    if resume is None:
        return fresh
    folder = Path(resume).resolve()  # through a link such as RUN/last
    return str(folder.parents[1] if folder.parent.name == "checkpoints" else fresh)
