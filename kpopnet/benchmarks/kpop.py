"""K-Pop sets, of your own and simulated: dances, each with a teacher and learners, read when they are asked for.

Their files: `kpopnet.benchmarks.kpop_format`.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from kpopnet.benchmarks.kpop_format import (
    LABELS,
    TEACHER,
    DepthClip,
    read_about,
    read_depth,
    read_depth_key,
    read_labels,
    read_manifest,
    read_performance,
    read_times,
)
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError


@dataclass
class KpopConfig:
    """A set of dances on disk.

    Attributes:
        path: its folder.
        dances: only the first so many, for a quick look.
        dance: one whose scores over time are drawn; by default the one in which a worse learner is farthest ahead of a better
            one, or else least behind.
        poses: folder for the estimators' poses; by default `poses` in the set's.
    """

    name: str = "kpop"
    path: str | None = None
    dances: int | None = None
    dance: str | None = None
    poses: str | None = None

    def __post_init__(self) -> None:
        if self.dances is not None and self.dances < 1:
            raise InputError(f"benchmark.dances={self.dances}: expected at least 1, or leave it away for all")


@dataclass
class KpopSimConfig(KpopConfig):
    """A folder that `python -m synth benchmark=kpop_sim` wrote; settings as of KpopConfig."""

    name: str = "kpop_sim"
    path: str | None = "data/kpop_sim"


@dataclass(frozen=True)
class Learner:
    """One recording of one learner; nothing is read before it is asked for, and a torn file is an InputError then."""

    name: str
    path: Path

    @cached_property
    def depth_key(self) -> str | None:
        """A digest of the depth recording, None where there is none."""
        return read_depth_key(self.path)

    @cached_property
    def about(self) -> dict:
        """What whoever wrote the file says of it."""
        return read_about(self.path)

    def times_s(self) -> np.ndarray:
        """(T,) float64: when the frames are."""
        return read_times(self.path)

    def joints(self) -> Performance | None:
        """The true joints, None where the file has none."""
        return read_performance(self.path)

    def depth(self) -> DepthClip:
        """The depth recording.

        Raises:
            InputError: there is none, or it is torn or odd.
        """
        return read_depth(self.path)


@dataclass(frozen=True)
class Dance:
    """One dance: learners are in the experts' order, the best first."""

    name: str
    folder: Path
    learners: tuple[Learner, ...]

    def teacher(self) -> Performance:
        """The teacher's motion.

        Raises:
            InputError: the file is missing, torn or odd.
        """
        path = self.folder / TEACHER
        performance = read_performance(path)
        if performance is None:
            raise InputError(f"{path}: no joints_m in it")
        return performance


class KpopSet:
    """A folder of dances, read dance by dance."""

    def __init__(self, folder: Path | str) -> None:
        """Lists the dances.

        Raises:
            InputError: no such folder, no dances in it, or an odd manifest.
        """
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise InputError(f"{self.folder}: no such folder; `python -m synth benchmark=kpop_sim` makes a set of dances")
        self.names = sorted(path.parent.name for path in self.folder.glob(f"*/{LABELS}"))
        if not self.names:
            raise InputError(
                f"{self.folder}: no dances in it; a dance is a folder with {TEACHER}, {LABELS} and a file for each learner "
                "(docs/kpop_format.md)"
            )
        self.manifest = read_manifest(self.folder)

    def __len__(self) -> int:
        return len(self.names)

    def dance(self, name: str) -> Dance:
        """One dance; its recordings are read later, when asked for.

        Raises:
            InputError: no such dance, labels that are empty or odd, or a learner without a file.
        """
        folder = self.folder / name
        if name not in self.names:
            near = ", ".join(self.names[:5])
            raise InputError(f"dance={name}: not among the {len(self.names)} of {self.folder}: {near}, ...")
        learners = []
        for learner in read_labels(folder / LABELS):
            path = folder / f"{learner}.h5"
            if not path.is_file():
                there = sorted(found.stem for found in folder.glob("*.h5") if found.name != TEACHER)
                raise InputError(f"{path}: missing, though {LABELS} ranks {learner}; there are {', '.join(there) or 'none'}")
            learners.append(Learner(learner, path))
        return Dance(name, folder, tuple(learners))


def open_set(config: KpopConfig) -> KpopSet:
    """The set of dances that a configuration names.

    Raises:
        InputError: none named, or none there.
    """
    if config.path is None:
        raise InputError(f"benchmark={config.name} needs benchmark.path=PATH, a folder of dances (docs/kpop_format.md)")
    return KpopSet(config.path)
