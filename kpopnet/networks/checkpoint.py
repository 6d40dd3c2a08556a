"""Checkpoints: self-describing folders that are written atomically, and run no code when loaded. `TorchBackend` runs one.

In the folder of a run:

    checkpoints/step_00002000/
        model.safetensors   the averaged weights, for inference
        state.pt            current weights and optimiser state, needed to resume besides the averaged weights
        meta.json           format, version, step, model, config, metrics, mean pose, git revision, packages
        person.safetensors  where tools/fit_person.py was run: whether a crop shows a person
    last, best              links to two checkpoints; the others are removed

From the first checkpoint on both links point to a whole one at each moment: a step that is saved again, by a run that was
resumed from `best`, goes to step_00002000_2. Where no links can be made, as on Windows, last and best are the checkpoints
themselves, and checkpoints/ is empty; a run that is killed while one replaces another leaves the one before in a hidden folder.

No random state is stored: everything random is a function of seed and step.
"""

import errno
import io
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from importlib.metadata import version
from itertools import chain, count
from pathlib import Path

import numpy as np
import safetensors.torch
import torch
from safetensors.torch import load_file
from torch import Tensor

from kpopnet.errors import InputError
from kpopnet.networks import FORMAT, META, PERSON, VERSION, WEIGHTS, ModelConfig, read_meta
from kpopnet.networks.network import PersonHead, PoseNetwork, build_network
from kpopnet.runtime.atomic_write import sync
from kpopnet.runtime.input_files import check_fields, read_with
from kpopnet.runtime.provenance import git_revision
from kpopnet.skeleton import JOINT_NAMES

STATE = "state.pt"

STATE_SCHEMA = {
    "step": int, "weights": dict, "optimiser": dict, "best_cm": float, "offset_sum_m": Tensor, "offset_count": int,
    "skipped": int,
}  # fmt: skip
"""Names and types in state.pt, where they are there."""


def save_checkpoint(run: Path, network: PoseNetwork, state: dict, meta: dict, *, best: bool) -> Path:
    """Writes a checkpoint of the averaged weights below the folder of a run, and moves the link `last` to it, which it returns.

    `state` holds tensors, numbers and containers of them (torch.load with weights_only reads only these), `meta` step, config,
    metrics and mean_pose_m, of JSON types. Where it is the best so far, the link `best` moves too.
    """
    name = f"step_{meta['step']:08d}"
    names = chain([name], (f"{name}_{again}" for again in count(2)))
    folder = next(folder for one in names if not (folder := run / "checkpoints" / one).exists())
    partial = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    # By way of memory: a full disk then raises OSError, and not what libraries make of it.
    weights = {name: value.cpu().contiguous() for name, value in network.state_dict().items()}
    (partial / WEIGHTS).write_bytes(safetensors.torch.save(weights))
    packed = io.BytesIO()
    torch.save(state, packed)
    (partial / STATE).write_bytes(packed.getbuffer())
    described = {
        "format": FORMAT,
        "version": VERSION,
        "model": asdict(network.config),
        **meta,
        "joint_names": JOINT_NAMES,
        "git": git_revision(),
        "packages": {name: version(name) for name in ("torch", "numpy", "safetensors")},
    }
    (partial / META).write_text(json.dumps(described, indent=2) + "\n")
    for file in partial.iterdir():
        sync(file)
    if not _can_link(run):
        if best:
            shutil.copytree(partial, copy := partial.with_name(f".best.{os.getpid()}"), dirs_exist_ok=True)
            _replace(run / "best", copy)
        _replace(run / "last", partial)
        for other in folder.parent.glob(".*"):  # of a run that was killed
            shutil.rmtree(other, ignore_errors=True)
        return run / "last"
    for link in ("best", "last"):
        if not (run / link).exists():  # so that the first checkpoint has both as soon as it stands
            _move_link(run / link, folder)
    sync(run)
    partial.rename(folder)
    sync(folder.parent)
    # A run killed in between resumes from `last`, reaches the best step again and moves the link then.
    for link in ("best", "last") if best else ("last",):
        _move_link(run / link, folder)
    sync(run)
    kept = {(run / link).resolve() for link in ("last", "best")}
    for other in (*folder.parent.glob("step_*"), *folder.parent.glob(".step_*")):
        if other.resolve() not in kept:
            _remove(other)
    return run / "last"


def resumable(run: Path) -> Path | None:
    """The checkpoint from which a run can be resumed; None if the folder holds no run."""
    return run / "last" if (run / "last" / META).is_file() else None


def refuse_copied_links(run: Path) -> None:
    """Raises InputError where a run has folders in the place of its links, as copies have that follow links."""
    for link in (run / "last", run / "best"):
        if any((run / "checkpoints").glob("step_*")) and link.is_dir() and not link.is_symlink():
            raise InputError(
                f"{link}: a folder where a run has a link to one of its checkpoints; copy runs with their links, as rsync -a "
                f"does, or make it again: rm -r {link}; ln -s checkpoints/STEP {link}"
            )


def _remove(folder: Path) -> None:
    """Removes a checkpoint that no link points to; if the process is killed, its remaining files are hidden ones."""
    if not folder.name.startswith("."):
        hidden = folder.with_name(f".{folder.name}.removed")
        shutil.rmtree(hidden, ignore_errors=True)
        folder = folder.rename(hidden)
    shutil.rmtree(folder, ignore_errors=True)


def _can_link(run: Path) -> bool:
    """Whether links can be made here and moved: on Windows few users may make one, and none replaces another."""
    link = run / f".link.{os.getpid()}"
    try:
        link.unlink(missing_ok=True)
        link.symlink_to("checkpoints")
        link.unlink()
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.EINVAL, errno.ENOTSUP):  # a full disk, for instance
            raise
        return False
    return os.name != "nt"


def _replace(folder: Path, new: Path) -> None:
    """Puts a folder in the place of another, which may be missing."""
    if folder.exists():
        old = new.with_name(f".{folder.name}.{os.getpid()}.removed")
        shutil.rmtree(old, ignore_errors=True)
        folder.rename(old)
        new.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    else:
        new.rename(folder)
    sync(folder.parent)


def _move_link(link: Path, folder: Path) -> None:
    """Creates or moves a relative link atomically."""
    new = link.with_name(f".{link.name}.{os.getpid()}")
    new.unlink(missing_ok=True)
    new.symlink_to(os.path.relpath(folder, link.parent))
    new.replace(link)


def load_network(folder: Path | str, device: str | torch.device = "cpu") -> tuple[PoseNetwork, dict]:
    """Loads a checkpoint's network for inference, and its meta.json; raises InputError as `read_meta` and `load_weights`."""
    meta = read_meta(folder)
    network = build_network(ModelConfig(**meta["model"]))
    load_weights(network, Path(folder) / WEIGHTS)
    if (Path(folder) / PERSON).is_file():
        network.person = PersonHead(network.config.widths[-1])
        load_weights(network.person, Path(folder) / PERSON)
    return network.to(device).eval(), meta


def load_weights(
    network: torch.nn.Module, path: Path, problem: str = f"missing, damaged, or not the weights that {META} describes"
) -> None:
    """Loads a file of weights into a network; float16, half the size on disk, becomes float32.

    Raises InputError if they are missing, damaged, or of another architecture.
    """
    weights = read_with(load_file, path, problem)
    expected = network.state_dict()
    for name in weights.keys() & expected.keys():
        if (weights[name].dtype, expected[name].dtype) == (torch.float16, torch.float32):
            weights[name] = weights[name].float()
        if weights[name].dtype != expected[name].dtype:
            raise InputError(f"{path}: {problem} ({name} is {weights[name].dtype})")
        if weights[name].ndim != expected[name].ndim:  # torch's functions end on more than 64 dimensions
            raise InputError(f"{path}: {problem} ({name} has {weights[name].ndim} dimensions)")
        if not bool(torch.isfinite(weights[name]).all()):
            raise InputError(f"{path}: damaged ({name} holds numbers that are not finite)")
    read_with(lambda _: network.load_state_dict(weights), path, problem)


def load_state(folder: Path | str) -> dict[str, int | float | Tensor | dict]:
    """Loads the state that `save_checkpoint` stored; raises InputError if it is missing or damaged."""
    path = Path(folder) / STATE
    problem = "missing, damaged or of another format; training cannot be resumed from it"
    state = read_with(lambda path: torch.load(path, map_location="cpu", weights_only=True), path, problem)
    return check_fields(str(path), state, STATE_SCHEMA, optional=STATE_SCHEMA)


@contextmanager
def on_one_thread() -> Iterator[None]:
    """Lets torch compute on one thread within."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


class TorchBackend:
    """A checkpoint, run by torch; a `kpopnet.networks.backend.Backend`."""

    def __init__(self, folder: Path | str, device: str = "cpu") -> None:
        """Raises InputError: no checkpoint in the folder, a damaged one, or no such device."""
        if device not in ("cpu", "cuda") or (device == "cuda" and not torch.cuda.is_available()):
            raise InputError(f"device={device}: expected cpu, or cuda on a machine with a GPU")
        self.network, self.meta = load_network(folder, device)
        self.device = torch.device(device)

    @torch.inference_mode()
    def __call__(self, crops: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """See `Backend`."""
        # For one crop torch uses many small matrix products instead of oneDNN, and each waits for the other threads: one thread
        # takes a third of the time of two.
        with on_one_thread() if len(crops) == 1 else nullcontext():
            prediction = self.network(torch.from_numpy(crops).to(self.device))
        person = prediction.person_logit
        joints, confidence = prediction.joints.cpu().numpy(), prediction.confidence.cpu().numpy()
        return joints, confidence, None if person is None else person.cpu().numpy()


def run_folder(resume: str | None, fresh: str) -> str:
    """The folder that a run writes to: that of the checkpoint it resumes, or `fresh`."""
    if resume is None:
        return fresh
    folder = Path(resume).resolve()  # follows a link such as RUN/last
    if folder.name in ("last", "best") and (folder.parent / "checkpoints").is_dir():  # of a run without links
        return str(folder.parent)
    return str(folder.parents[1] if folder.parent.name == "checkpoints" else fresh)
