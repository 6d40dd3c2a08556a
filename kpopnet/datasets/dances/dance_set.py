"""Sets of dances, recorded or simulated: each dance has a teacher and ranked learners, read on demand.

The file format is in `kpopnet.datasets.dances.format`.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.format import (
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
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_names


@dataclass
class KpopConfig:
    """Settings of a set of dances on disk.

    Attributes:
        name: of the benchmark.
        path: folder of the set.
        dances: number of dances to evaluate, the first ones of the set, for a quick test; all by default.
        dance: name of the dance whose scores over time are plotted; by default the dance in which the score of a worse
            learner is farthest above, or least below, that of the next better learner.
        poses: folder of the cached poses of the estimators; by default `poses` in the folder of the set.
    """

    name: str = "kpop"
    path: str | None = None
    dances: int | None = None
    dance: str | None = None
    poses: str | None = None

    def __post_init__(self) -> None:
        if self.dances is not None and self.dances < 1:
            raise InputError(f"benchmark.dances={self.dances}: expected at least 1, or omit it for all")


@dataclass(frozen=True)
class Learner:
    """One recording of one learner. Its contents are read on demand; a damaged file raises InputError then.

    Attributes:
        name: of the learner.
        path: of the file.
    """

    name: str
    path: Path

    @cached_property
    def depth_key(self) -> str | None:
        """A digest of the depth recording; None if the file has no depth."""
        return read_depth_key(self.path)

    @cached_property
    def about(self) -> dict:
        """The notes that the writer of the file stored in it."""
        return read_about(self.path)

    def times_s(self) -> np.ndarray:
        """(T,) float64 times of the frames in seconds."""
        return read_times(self.path)

    def joints(self) -> Performance | None:
        """The true joints; None if the file has none."""
        return read_performance(self.path)

    def depth(self) -> DepthClip:
        """Reads the depth recording.

        Raises:
            InputError: the file has no depth, or is damaged or invalid.
        """
        return read_depth(self.path)


@dataclass(frozen=True)
class Dance:
    """One dance.

    Attributes:
        name: of the dance.
        folder: of its files.
        learners: in the experts' order, the best first.
    """

    name: str
    folder: Path
    learners: tuple[Learner, ...]

    def teacher(self) -> Performance:
        """Reads the motion of the teacher.

        Raises:
            InputError: the file is missing, damaged or invalid.
        """
        path = self.folder / TEACHER
        performance = read_performance(path)
        if performance is None:
            raise InputError(f"{path}: no joints_m in it")
        return performance


class KpopSet:
    """A folder of dances, read one dance at a time."""

    def __init__(self, folder: Path | str) -> None:
        """Lists the dances.

        Raises:
            InputError: the folder does not exist or holds no dances, or its manifest is invalid.
        """
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise InputError(f"{self.folder}: no such folder; `python -m synth benchmark=kpop_sim` makes a set of dances")
        self.names = sorted(path.parent.name for path in self.folder.glob(f"*/{LABELS}"))
        check_names(str(self.folder), self.names)
        if not self.names:
            raise InputError(
                f"{self.folder}: no dances in it; a dance is a folder with {TEACHER}, {LABELS} and a file for each learner "
                "(docs/kpop_format.md)"
            )
        self.manifest = read_manifest(self.folder)

    def __len__(self) -> int:
        return len(self.names)

    def dance(self, name: str) -> Dance:
        """Reads the labels of one dance; its recordings are read on demand.

        Raises:
            InputError: the dance does not exist, its labels are empty or invalid, or the file of a learner is missing.
        """
        folder = self.folder / name
        if name not in self.names:
            first = ", ".join(self.names[:5])
            raise InputError(f"dance={name}: not among the {len(self.names)} of {self.folder}: {first}, ...")
        learners = []
        for learner in read_labels(folder / LABELS):
            path = folder / f"{learner}.h5"
            if not path.is_file():
                existing = sorted(file.stem for file in folder.glob("*.h5") if file.name != TEACHER)
                raise InputError(f"{path}: missing, though {LABELS} ranks {learner}; there are {', '.join(existing) or 'none'}")
            learners.append(Learner(learner, path))
        return Dance(name, folder, tuple(learners))


def open_set(config: KpopConfig) -> KpopSet:
    """Opens the set of dances in a configuration.

    Raises:
        InputError: no folder is configured, or it holds no dances.
    """
    if config.path is None:
        raise InputError(f"benchmark={config.name} needs benchmark.path=PATH, a folder of dances (docs/kpop_format.md)")
    return KpopSet(config.path)
