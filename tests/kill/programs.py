"""The programs that are killed, each with settings so small that a run takes seconds, most of them imports.

Each function imports what its program needs: a run of one should not wait for the libraries of all.
"""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from kpopnet.runtime.folder_lock import LOCK_FILE
from kpopnet.runtime.input_files import ArraySchema, read_npz

ROOT = Path(__file__).parents[2]
CHANGING = ("git", "packages", "files", "seconds", "fps", "made")
"""Parts of metrics.json that are about the run and not about its result."""

NOTHING = [sys.executable, "-c", ""]
"""Goes on with a run that is done."""

LEARNER = {"joints_m": ArraySchema("f", ("T", 15, 3))}


class Program(NamedTuple):
    """A program with small settings."""

    command: Callable[[Path], list[str]]  # that starts a run in a folder, or takes it up again
    result: Callable[[Path], Any]  # what of a finished run must not depend on kills


def files_in(folder: Path) -> dict[str, bytes]:
    """Every file by name with its bytes; a hidden one, which a killed process may leave, must be gone, but for the lock."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != LOCK_FILE)
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def synth(_: Path) -> Program:
    """The generator with 2 processes: 10 shards of frozen samples of two splits, which share no room, and their summaries."""
    from kpopnet.data.shards import ShardedSet

    settings = ["renderer=cpu", "motion=poses", "splits.train=32", "splits.validation=8", "splits.test=0", "shard_size=4"]
    settings += ["frozen=[train,validation]", "processes=2", "seed=5"]

    def result(run: Path) -> dict[str, Any]:
        rooms: list[set[bytes]] = []
        for split in ("train", "validation"):
            shards = ShardedSet(run / split)
            rooms.append({shards.room(index, shards[index].room)[0].tobytes() for index in range(len(shards))})
        return files_in(run) | {"rooms of both splits": len(rooms[0] & rooms[1])}

    return Program(lambda run: [sys.executable, "-m", "synth", f"out={run}", *settings], result)


def train(folder: Path) -> Program:
    """Training of a small network with a data worker: 12 steps with a checkpoint after every second one.

    A resumed run must go on from the last checkpoint that the log tells of, or a later one.
    """
    import factories
    from checkpoints import contents

    from kpopnet.networks.checkpoint import resumable

    for shard in (0, 1):
        factories.write_shard(folder / "train", shard, 6)
    factories.write_shard(folder / "validation", 0, 4)
    settings = [f"data.train={folder / 'train'}", f"data.validation={folder / 'validation'}", "model.crop_px=32"]
    settings += ["model.widths=[8,8,16,16]", "training.batch_size=4", "training.validate_every=2", "training.steps=12"]
    settings += ["training.validation_samples=4", "workers=1", "threads=1", "device=cpu"]

    def command(run: Path) -> list[str]:
        checkpoint, log = resumable(run), run.with_suffix(".log")
        step = json.loads((checkpoint / "meta.json").read_text())["step"] if checkpoint else 0
        told = re.findall(r"step (\d+) of 12: mean error", log.read_text()) if log.exists() else []
        if step < max(map(int, told), default=0):
            raise RuntimeError(f"the checkpoint of step {told[-1]} was lost: {checkpoint} is of step {step}")
        if checkpoint:
            if step == 12:  # killed after its last checkpoint
                return NOTHING
            return [sys.executable, "train.py", f"training.resume={checkpoint}"]
        return [sys.executable, "train.py", *settings, f"hydra.run.dir={run}"]

    def result(run: Path) -> dict[str, Any]:
        found = {}
        for link in ("last", "best"):
            weights, state, meta = contents(run / link)
            found |= {f"{link} weights": weights, f"{link} state": state}
            found |= {f"{link} {name}": meta[name] for name in ("step", "metrics", "mean_pose_m", "config", "data")}
            found[f"{link} config"]["training"].pop("resume")
        return found

    return Program(command, result)


def evaluate(folder: Path) -> Program:
    """The evaluation of an untrained network and the mean pose with 2 processes."""
    import shard_sets
    from checkpoints import save_untrained

    shard_sets.write_shard(folder / "set", [1, 1, 2, 2, 3, 3, 4, 4], empty=(1,))
    save_untrained(folder / "run")
    settings = [f"checkpoint={folder / 'run' / 'last'}", f"benchmark.path={folder / 'set'}", "processes=2"]

    def result(run: Path) -> dict[str, Any]:
        files = files_in(run)
        metrics = without_changing(json.loads(files["metrics.json"]))
        figures = {name: data for name, data in files.items() if name.endswith(".png")}
        return {"metrics": metrics, "files": sorted(files), **figures}

    def command(run: Path) -> list[str]:
        if (run / "metrics.json").exists():  # its last file: the report is done, and evaluate.py refuses to replace it
            return NOTHING
        return [sys.executable, "evaluate.py", *settings, f"hydra.run.dir={run}"]

    return Program(command, result)


def finder(folder: Path) -> Program:
    """Training of the finder of people: 6 steps with its files written after every second one."""
    import torch
    from room_image_files import write_room_images

    from kpopnet.training.finder import META, STATE, WEIGHTS

    settings = [f"data.{name}={write_room_images(folder / name)}" for name in ("train", "validation")]
    settings += ["threads=1", "training.batch_size=2", "training.steps=6", "training.validate_every=2"]

    def command(run: Path) -> list[str]:
        resume = str((run / STATE).exists()).lower()
        return [sys.executable, "train.py", "--config-name", "finder", f"out={run}", *settings, f"training.resume={resume}"]

    def result(run: Path) -> dict[str, Any]:
        state = torch.load(run / STATE, weights_only=True)
        described = json.loads((run / META).read_text())
        return {"weights": (run / WEIGHTS).read_bytes(), "described": described, "state": repr(state)}

    return Program(command, result)


def teacher(folder: Path) -> Program:
    """The dance teacher adds 5 dances and saves 5 tries; what it said to have kept is there, and all that is listed whole."""
    from kpopnet.teacher.library import Library
    from kpopnet.teacher.tries import Tries
    from synth.body.teacher import teacher_arrays
    from tests.kill.lessons import DANCE

    np.savez(folder / "body.npz", **teacher_arrays())

    def command(run: Path) -> list[str]:
        return [sys.executable, "-m", "tests.kill.lessons", str(run), str(folder / "body.npz"), "5"]

    def result(run: Path) -> dict[str, Any]:
        library, tries = Library(run, body=None), Tries(run / "tries")  # pyright: ignore[reportArgumentType]
        names = [one["session"] for one in tries.history(DANCE)]
        dances, kept = library.identities(), run.with_suffix(".log").read_text().split()
        learners = [read_npz(tries.path(DANCE, name, "npz"), LEARNER)["joints_m"].tobytes() for name in names]
        return {
            "lost": sorted(set(kept) - {*dances, *names}),
            "titles": sorted(library.dance(one).about.name for one in dances),
            "tries": [{**tries.result(DANCE, name), "session": ""} for name in names],
            "learners": sorted(set(learners)),
        }

    return Program(command, result)


def without_changing(value: Any) -> Any:
    """Nested dicts and lists without the entries named in CHANGING."""
    if isinstance(value, dict):
        return {name: without_changing(part) for name, part in value.items() if not name.startswith(CHANGING)}
    return [without_changing(part) for part in value] if isinstance(value, list) else value


PROGRAMS: dict[str, Callable[[Path], Program]] = {
    "synth": synth, "train": train, "evaluate": evaluate, "finder": finder, "teacher": teacher,
}  # fmt: skip
"""Each program by its name: made in a folder where its data may lie."""
